//! Simulated drives on simulated buses: what stands in for the hardware in the default configuration, in tests, and
//! behind `takt sim`. A product of its own: nothing in here knows the controller.
//!
//! ```text
//!                port ── SimulatedBus: a bus as the real-time thread sees it (BusPort)
//!                 │
//!       ┌─────────┴──────────┐
//!     medium               drive ── Drive: what every simulated drive is to its bus
//!     who sends, when       │
//!       │                  erob ── the eRob joint: dictionary, SDO, NMT, PDO, CiA 402, modes, loops
//!     mailbox  wire        yz_aim ── the YZ-AIM servo: the same, its own controlword, homing, alarms
//!     frames   bits,        │
//!     waiting  stuffing   servo ── position, velocity and torque loops
//!                           │
//!                         plant ── inertia, friction, brake, end stops, encoder; homing switches
//! ```
//!
//! Everything is passive: there are no threads and no clocks. Time is a number that is handed in, so the same code
//! runs in virtual time (hours in seconds, the same bytes in every run) and on a wall clock, and takes no heap memory
//! once it is built.
//!
//! ```
//! use takt::sim::{BitRates, SimulatedBus};
//! use takt_rt::{Frame, Id};
//! use takt_rt::{BusPort, ReceiveBatch};
//!
//! # fn parameters() -> takt::sim::erob::ErobParameters {
//! #     use takt::sim::erob::ErobParameters;
//! #     use takt::sim::plant::{Encoder, JointParameters};
//! #     ErobParameters {
//! #         node: 5,
//! #         joint: JointParameters { inertia: 0.3, viscous_friction: 1.0, coulomb_friction: 3.0, brake_torque: 60.0 },
//! #         encoder: Encoder { counts_per_unit: 83_443.0, zero_counts: 0.0 },
//! #         counts_per_turn: 524_288.0, initial_position: 0.0, rated_torque: 31.0, peak_torque: 60.0,
//! #         highest_velocity: 3.0, power_up_ns: 1_000_000, feedback_delay_ns: 20_000, has_battery: true,
//! #         has_interpolated_position: false, is_upload_segmented: false, seed: 1,
//! #     }
//! # }
//! let drive = takt::sim::erob::ErobJoint::new(parameters());
//! let rates = BitRates { nominal: 1_000_000, data: None };
//! let mut bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive)]);
//!
//! let mut batch = ReceiveBatch::new();
//! bus.send(0, &[]); // the supply comes on
//! bus.receive(2_000_000, &mut batch); // two milliseconds later
//! assert_eq!(batch[0].frame, Frame::of(Id::canopen(0x700, 5), [0])); // boot-up
//! ```

mod defect;
mod drive;
pub mod erob;
pub mod homing_switches;
mod live;
pub mod lss;
mod mailbox;
mod medium;
pub mod plant;
mod port;
pub(crate) mod random;
mod servo;
pub mod yz_aim;

pub use defect::{Defect, Unsupported};
pub use drive::{Drive, DriveFault, NmtState, Observation};
pub use live::LiveDrives;
pub use mailbox::{Mailbox, Order};
pub use medium::{BitRates, Medium, Transmission};
pub use port::{AfflictError, SimulatedBus, UnknownNode};
pub use takt_rt::{INTERMISSION_BITS, WireLength, bits_ns};
