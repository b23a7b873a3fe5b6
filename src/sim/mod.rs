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
//!                          erob, erob_can, yz_aim ── drives of their own, by their manuals and field experience
//!     frames                │
//!     waiting               ├── object_dictionary, sdo_server, pdo_engine, network, errors ── CANopen (CiA 301)
//!                           │     canopen_node ── these together, for the drives with CiA 402
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
//! use takt::Config;
//! use takt::rt::{BusPort, Frame, Id, ReceiveBatch};
//! use takt::sim::SimulatedBus;
//!
//! let config = Config::load("configs/first.toml".as_ref())?;
//! let mut bus = SimulatedBus::new(&config, 0);
//! bus.send(0, &[]); // the supply is switched on
//! let mut batch = ReceiveBatch::new();
//! let mut now_ns = 0;
//! while batch.is_empty() {
//!     now_ns += 1_000_000;
//!     bus.receive(now_ns, &mut batch);
//! }
//! assert_eq!(batch[0].frame, Frame::of(Id::canopen(0x700, 1), [0])); // boot-up
//! # Ok::<(), takt::ConfigError>(())
//! ```

pub(crate) mod bit_fields;
mod canopen_node;
pub mod cia402;
#[cfg_attr(
    not(feature = "internals"),
    allow(unnameable_types, reason = "its parameters are those of an axis, which nobody outside makes")
)]
pub(crate) mod commanded_module;
mod defect;
mod drive;
pub(crate) mod erob;
#[cfg_attr(
    not(feature = "internals"),
    allow(unnameable_types, reason = "its parameters are those of an axis, which nobody outside makes")
)]
pub(crate) mod erob_can;
pub(crate) mod erob_modbus;
mod errors;
mod feedback_defects;
#[cfg(feature = "cli")]
pub(crate) mod hollow_lines;
pub mod homing_switches;
#[cfg(feature = "cli")]
#[cfg_attr(not(feature = "internals"), allow(unnameable_types, reason = "only the port of a link names it"))]
pub(crate) mod line_faults;
#[cfg(feature = "cli")]
#[cfg_attr(not(feature = "internals"), allow(unnameable_types, reason = "only the port of a link names it"))]
pub(crate) mod live;
mod loops;
#[cfg(feature = "cli")]
pub(crate) mod lss;
pub(crate) mod mailbox;
pub(crate) mod medium;
mod motion;
mod network;
pub(crate) mod object_dictionary;
mod pdo_engine;
pub mod plant;
mod port;
mod profile_motions;
#[cfg(target_os = "linux")]
pub(crate) mod pseudo_terminal;
pub(crate) mod random;
mod sdo_reply;
mod sdo_server;
#[cfg(feature = "cli")]
pub(crate) mod serial_device;
#[cfg(target_os = "linux")]
pub(crate) mod serial_host;
pub(crate) mod serial_line;
mod servo;
mod silent_drive;
#[cfg(feature = "cli")]
pub(crate) mod slcan_adapter;
pub(crate) mod yz_aim;

pub use defect::{Defect, Disobedience, Unsupported};
pub use drive::{Drive, DriveFault, NodeState, Observation};
#[cfg(feature = "cli")]
pub(crate) use live::{LiveDrives, LivePort};
pub use mailbox::{Mailbox, QueueOrder};
pub use medium::WireBitRates;
pub use plant::Gravity;
pub use port::{InjectDefectError, SimulatedBus, UnknownNode};
pub use serial_line::{DevicesOnLine, LineDisturbance, SimulatedLineDevices};
pub(crate) use silent_drive::SilentDrive;
