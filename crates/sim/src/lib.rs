//! Simulated drives on simulated buses. They replace the hardware in the default configuration, in tests, and in
//! `takt sim`. The simulation is independent: it does not depend on the controller.
//!
//! ```text
//!                port ── SimulatedBus: a bus as the real-time thread sees it (BusPort)
//!                 │
//!     medium               drive ── Drive: the interface between a simulated drive and its bus
//!     arbitration           │
//!     who sends, when       │
//!     mailbox              cia402 ── any CiA 402 drive, made from its electronic data sheet
//!                          bit_fields ── any drive of bit fields, made from its description
//!                          erob_can, yz_aim ── drives of their own, by their manuals and field experience
//!     frames                │
//!     waiting               ├── object_dictionary, sdo_server, pdo_engine, network, errors ── CANopen (CiA 301)
//!                         erob_modbus ── a drive on a serial line, with its line
//!                           │
//!                         commanded_module, profile_motions ── an eRob that commands move, as both protocols of its maker do
//!                           │
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
//! use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
//! use takt_sim::cia402::{Cia402AxisParameters, Cia402Drive, Cia402Parameters};
//! use takt_sim::homing_switches::ReferenceSwitches;
//! use takt_sim::plant::{Encoder, FrictionShape, JointParameters};
//! use takt_sim::{SimulatedBus, WireBitRates};
//! use takt_wire::canopen::eds;
//! use takt_wire::quirks::Quirks;
//!
//! let axis = Cia402AxisParameters {
//!     joint: JointParameters {
//!         inertia: 0.01,
//!         viscous_friction: 0.1,
//!         coulomb_friction: 0.1,
//!         friction_shape: FrictionShape::Constant,
//!         brake_torque: 10.0,
//!     },
//!     encoder: Encoder { counts_per_unit: 524_288.0 / std::f64::consts::TAU, zero_counts: 0.0 },
//!     counts_per_turn: 524_288.0,
//!     initial_position: 0.0,
//!     rated_torque: 1.0,
//!     peak_torque: 3.0,
//!     highest_velocity: 10.0,
//!     switches: ReferenceSwitches::default(),
//!     end_stops: None,
//! };
//! let sheet = eds::load("../../configs/eds/erob-canopen.eds".as_ref()).unwrap().dictionary;
//! let drive = Cia402Drive::new(Cia402Parameters {
//!     sheet,
//!     node: 1,
//!     quirks: Quirks::default(),
//!     axes: vec![axis],
//!     power_up_ns: 100_000_000,
//!     feedback_delay_ns: 20_000,
//!     seed: 0,
//! })
//! .unwrap();
//! let rates = WireBitRates { nominal: 1_000_000, data: None };
//! let mut bus = SimulatedBus::with_drives(rates, 1_000_000_000, vec![Box::new(drive)]);
//! bus.send(0, &[]); // the supply is switched on
//! let mut batch = ReceiveBatch::new();
//! let mut now_ns = 0;
//! while batch.is_empty() {
//!     now_ns += 1_000_000;
//!     bus.receive(now_ns, &mut batch);
//! }
//! assert_eq!(batch[0].frame, Frame::of(Id::canopen(0x700, 1), [0])); // boot-up
//! ```

pub mod bit_fields;
pub mod cia402;
pub mod commanded_module;
mod defect;
mod drive;
pub mod erob_can;
pub mod erob_modbus;
mod errors;
mod feedback_defects;
#[cfg(target_os = "linux")]
pub mod hollow_lines;
pub mod homing_switches;
#[cfg(target_os = "linux")]
pub mod line_faults;
#[cfg(target_os = "linux")]
pub mod live;
#[cfg(target_os = "linux")]
pub mod live_serial_device;
mod loops;
pub mod lss;
pub mod mailbox;
pub mod medium;
mod motion;
mod network;
pub mod object_dictionary;
mod pdo_engine;
pub mod plant;
mod port;
pub mod profile_motions;
#[cfg(target_os = "linux")]
pub mod pseudo_terminal;
pub mod random;
pub mod sdo_reply;
mod sdo_server;
#[cfg(target_os = "linux")]
pub mod serial_device;
#[cfg(target_os = "linux")]
pub mod serial_host;
pub mod serial_line;
mod servo;
mod silent_drive;
#[cfg(target_os = "linux")]
pub mod slcan_adapter;
pub mod yz_aim;

pub use defect::{Defect, Disobedience, Unsupported};
pub use drive::{Drive, DriveFault, NodeState, Observation};
#[cfg(target_os = "linux")]
pub use live::{LiveDrives, LivePort};
pub use mailbox::{Mailbox, QueueOrder};
pub use medium::WireBitRates;
pub use plant::Gravity;
pub use port::{InjectDefectError, SimulatedBus, UnknownNode};
pub use serial_line::{DevicesOnLine, LineDisturbance, SimulatedLineDevices};
pub use silent_drive::SilentDrive;
