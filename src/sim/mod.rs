//! Simulated drives on simulated buses. They replace the hardware in the default configuration, in tests, and in
//! `takt sim`. The simulation is independent: it does not depend on the controller.
//!
//! ```text
//!                port ── SimulatedBus: a bus as the real-time thread sees it (BusPort)
//!                 │
//!     medium               drive ── Drive: the interface between a simulated drive and its bus
//!     arbitration           │
//!     who sends, when       │
//!     mailbox  wire        cia402 ── any CiA 402 drive, made from its electronic data sheet
//!                          erob, erob_can, yz_aim ── drives of their own, by their manuals and field experience
//!     frames   bits,        │
//!     waiting  stuffing     ├── object_dictionary, sdo_server, pdo_engine, network, errors ── CANopen (CiA 301)
//!                           │     canopen_node ── these together, for the drives with CiA 402
//!                         motion ── ramps, profiles, interpolation; servo ── position, velocity and torque loops
//!                           │
//!                         plant ── inertia, friction, brake, end stops, encoder; homing switches
//! ```
//!
//! Everything is passive, without threads and clocks. The caller passes the time in, so the same code runs in virtual
//! time (hours in seconds, the same result in every run) and in wall-clock time. It allocates no memory after
//! construction.
//!
//! ```
//! use takt::sim::{WireBitRates, SimulatedBus};
//! use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
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
//! let rates = WireBitRates { nominal: 1_000_000, data: None };
//! let mut bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive)]);
//!
//! let mut batch = ReceiveBatch::new();
//! bus.send(0, &[]); // the supply is switched on
//! bus.receive(2_000_000, &mut batch); // two milliseconds later
//! assert_eq!(batch[0].frame, Frame::of(Id::canopen(0x700, 5), [0])); // boot-up
//! ```

mod canopen_node;
pub mod cia402;
mod defect;
mod drive;
pub mod erob;
pub mod erob_can;
mod errors;
mod feedback_defects;
pub mod homing_switches;
mod live;
mod loops;
pub mod lss;
mod mailbox;
mod medium;
mod motion;
mod network;
mod object_dictionary;
mod pdo_engine;
pub mod plant;
mod port;
pub(crate) mod random;
mod sdo_reply;
mod sdo_server;
mod servo;
mod wire_length;
pub mod yz_aim;

pub use defect::{Defect, Unsupported};
pub use drive::{Drive, DriveFault, NodeState, Observation};
pub use live::LiveDrives;
pub use mailbox::{Mailbox, QueueOrder};
pub use medium::{FrameOnWire, Medium, WireBitRates};
pub use object_dictionary::table::ObjectRow;
pub use plant::Gravity;
pub use port::{InjectDefectError, SimulatedBus, UnknownNode};
pub use sdo_reply::AbortCode;
pub use wire_length::{INTERMISSION_BITS, WireLength, bits_ns};
