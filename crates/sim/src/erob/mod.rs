//! A simulated eRob joint module with CANopen firmware, by the eRunner manual 1.7, its EDS and field experience: object
//! dictionary, SDO, NMT, PDO, emergency messages, the CiA 402 state machine, six modes of operation, and the joint.
//!
//! ```text
//! objects ── object_dictionary ── canopen_node ──┬── sdo_server   SDO: expedited, segmented
//!                                     │          ├── pdo_engine   RPDO, TPDO, SYNC
//!                                     │          ├── network      NMT, heartbeat, guarding, SYNC producer
//!                                     │          └── errors       emergency messages, error history
//!                                   joint ──┬── device            CiA 402: controlword → state → statusword
//!                                           └── motion → servo → plant    set-points → loops → torque → joint
//! ```
//!
//! Choices where neither the manual nor traces give an answer:
//! - A CSP target latched at SYNC k is reached at SYNC k + 1. The drive interpolates over the period (1006, otherwise
//!   60C2), locks its loop to SYNC, and feeds the difference of the last two targets forward for at most two periods.
//!   Without SYNC it holds the last target.
//! - A write that the current state forbids (mapping of a valid PDO, 6060 while enabled) is aborted with 0x0800_0022.
//!   6060 accepts a mode that 6502 does not name, but 6061 does not follow.
//! - After 2242 = 1 a battery fault still needs a rising edge of controlword bit 7.
//! - Electrical and encoder faults cut the power at once. Other faults decelerate by 605E first; the default ramp 6085
//!   = 200 counts/s² takes minutes, so 6085 should be written.
//! - The following error window 6065 is off (all ones) until it is written.
//! - The brake works without delay. The controlword's transition 5 (disable operation) is immediate.
//! - 6093, 6080, 607C, 2380 to 2382, 3B60 and the homing and interpolation objects can be read and written, without
//!   effect.

mod device;
mod joint;
mod motion;
mod objects;

pub use joint::ErobJoint;
pub use objects::OBJECTS;

use takt_rt::Nanoseconds;

use super::plant::{Encoder, JointParameters};

/// The parameters of one eRob module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobParameters {
    /// Node ID, 1 to 127.
    pub node: u8,
    /// The mechanics.
    pub joint: JointParameters,
    /// The encoder at the output.
    pub encoder: Encoder,
    /// Counts per turn, for the loss of the turn count.
    pub counts_per_turn: f64,
    /// Position at the first power-up: rad (m).
    pub initial_position: f64,
    /// Rated torque: N·m (N). Object 6076 reports it in thousandths.
    pub rated_torque: f64,
    /// Peak torque: N·m (N).
    pub peak_torque: f64,
    /// The drive's velocity limit in every mode: rad/s (m/s).
    pub highest_velocity: f64,
    /// From power-up or "reset node" to the boot-up message.
    pub power_up_ns: Nanoseconds,
    /// From the arrival of SYNC until the feedback is ready to send.
    pub feedback_delay_ns: Nanoseconds,
    /// True if a battery keeps the turn count; without it the position after power-up is within one turn.
    pub has_battery: bool,
    /// True if 6061 follows mode 7, as one capture of the manual shows (Fig 5-38) although 6502 does not have it.
    pub has_interpolated_position: bool,
    /// True if SDO uploads are segmented, which CiA 301 permits for any object.
    pub is_upload_segmented: bool,
    /// Seed of the differences between units: SDO latencies, the warning bit.
    pub seed: u64,
}
