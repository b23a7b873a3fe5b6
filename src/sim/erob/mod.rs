//! The eRob joint module with CANopen firmware, as the eRunner manual 1.7 and its EDS describe it and as real units
//! behave: object dictionary, SDO, NMT, PDO, emergency messages, the CiA 402 machine, six modes of operation, and the
//! joint.
//!
//! ```text
//! objects ── dictionary ──┬── sdo            requests of the master
//!                         ├── process_data   RPDO, TPDO, SYNC
//!                         ├── network        NMT, heartbeat, guarding
//!                         ├── errors         emergency messages, error history
//!                         ├── defects        what is wrong, and how the feedback shows it
//!                         ├── device         CiA 402: controlword → state → statusword
//!                         └── motion → servo → plant    set-points → loops → torque → joint
//! ```
//!
//! Choices where neither manual nor traces say anything:
//! - A CSP target latched at SYNC k is reached at SYNC k + 1: the drive interpolates over the period (1006, else
//!   60C2), locks its loop to SYNC, and feeds the difference of the last two targets forward, for two periods
//!   at most. When SYNC stays away it holds the last target.
//! - A write that the present state forbids (mapping of a PDO that exists, 6060 while enabled) is aborted with
//!   0x0800_0022. A mode that 6502 does not name is accepted by 6060 but 6061 does not follow.
//! - After 2242 = 1 a battery fault still wants its rising edge of bit 7.
//! - Power is cut at once by electrical and encoder faults; the others decelerate by 605E first, whose default ramp
//!   6085 = 200 counts/s² takes minutes: program 6085.
//! - The following-error window 6065 is off (all ones) until it is written.
//! - The brake works without delay. The controlword's transition 5 (disable operation) is immediate.
//! - 6093, 6080, 607C, 2380 to 2382, 3B60 and the homing and interpolation objects can be written and read, and do
//!   nothing.

mod defects;
mod device;
mod dictionary;
mod errors;
mod joint;
mod motion;
mod network;
mod objects;
mod process_data;
mod sdo;

pub use dictionary::AbortCode;
pub use joint::ErobJoint;
pub use objects::{Access, DataType, OBJECTS, Object};

use crate::config::{Axis, Control, Simulation, Travel};
use takt_rt::Nanoseconds;

use super::plant::{Encoder, JointParameters};

/// One eRob module as it is built and set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErobParameters {
    /// Node number, 1 to 127.
    pub node: u8,
    /// The mechanics.
    pub joint: JointParameters,
    /// The encoder at the output.
    pub encoder: Encoder,
    /// Counts of one turn, for what the multi-turn counter loses.
    pub counts_per_turn: f64,
    /// Position at the first power-up: rad (m).
    pub initial_position: f64,
    /// What the drive calls rated torque: N·m (N). Object 6076 shows it in thousandths.
    pub rated_torque: f64,
    /// Peak torque: N·m (N).
    pub peak_torque: f64,
    /// The highest speed the drive allows in any mode: rad/s (m/s).
    pub highest_velocity: f64,
    /// From power-up or "reset node" to the boot-up message.
    pub power_up_ns: Nanoseconds,
    /// From the arrival of SYNC until the feedback is ready to be sent.
    pub feedback_delay_ns: Nanoseconds,
    /// Whether a battery keeps the multi-turn count; without one the position after power-up is single-turn.
    pub has_battery: bool,
    /// Whether mode 7 is followed by 6061, as one capture of the manual shows (Fig 5-38) although 6502 lacks it.
    pub has_interpolated_position: bool,
    /// Whether SDO uploads come in segments, which CiA 301 permits for any object.
    pub is_upload_segmented: bool,
    /// Seed of what differs from unit to unit: SDO latencies, whether the warning bit is set.
    pub seed: u64,
}

impl ErobParameters {
    /// The module that stands in for a configured axis.
    pub fn of(axis: &Axis, simulation: &Simulation) -> Self {
        let travel_per_turn = match axis.travel {
            Travel::Rotary => std::f64::consts::TAU,
            Travel::Linear { lead_m } => lead_m,
        };
        let direction = if axis.reversed { -1.0 } else { 1.0 };
        let joint = &axis.simulated;
        Self {
            node: axis.node,
            joint: JointParameters {
                inertia: joint.inertia,
                viscous_friction: joint.viscous_friction,
                coulomb_friction: joint.coulomb_friction,
                brake_torque: 2.0 * joint.peak_torque,
            },
            encoder: Encoder {
                counts_per_unit: direction * axis.counts_per_turn * axis.gear_ratio / travel_per_turn,
                zero_counts: axis.zero_counts.into(),
            },
            counts_per_turn: axis.counts_per_turn,
            initial_position: joint.initial_position,
            rated_torque: joint.rated_torque,
            peak_torque: joint.peak_torque,
            highest_velocity: 1.5 * axis.limits.velocity,
            power_up_ns: joint.power_up_ns,
            feedback_delay_ns: axis.feedback_delay_ns,
            has_battery: true,
            has_interpolated_position: axis.control == Control::Interpolated,
            is_upload_segmented: false,
            seed: simulation.seed,
        }
    }
}
