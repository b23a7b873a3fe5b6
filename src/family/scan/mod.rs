//! What is on a bus or on a serial line, without a configuration. Devices are asked what changes nothing in them, and heard.
//!
//! ```text
//! bus ── a CAN bus: protocols of vendors and CANopen, listening all the while; conclusion ── what follows from what was heard
//! line ── a serial line: Modbus slaves, one address after the other
//!   │
//! canopen ── what a CANopen node tells of itself
//! own_protocol ── how drives with a protocol of their own are asked: the family says it
//! reading ── which frames only read, and may be sent beside a running controller
//!   │
//! session ── frames in and out of the procedure; heard ── what devices send by themselves
//!   │
//! device ── what was found;  starting ── a configuration to start with
//! ```
//!
//! A family tells how its drives are recognised: [`Family::recognises`](super::Family::recognises),
//! [`Family::own_protocols`](super::Family::own_protocols), [`Family::recognises_on_line`](super::Family::recognises_on_line), and which keys
//! drive them: [`Family::starting_keys`](super::Family::starting_keys).

mod bus;
mod canopen;
mod conclusion;
mod device;
mod heard;
mod line;
mod own_protocol;
mod reading;
mod session;
mod starting;

use takt_rt::BusState;

pub use bus::{BusScan, scan_bus};
pub use canopen::{NodeIdentity, Recognised};
pub use device::{Answered, FoundDevice};
pub use line::{LineScan, scan_line};
pub use own_protocol::{Likeness, OwnProtocol, Reading};
pub use reading::reply_to_reading;
pub use session::{ScanClient, ScanSession};
pub use starting::{PlaceOfScan, StartingKeys, can_drive, starting_configuration};

/// What a scan has found.
#[derive(Clone, Debug, Default)]
pub struct Scanned {
    /// The devices, in the order of their node IDs.
    pub devices: Vec<FoundDevice>,
    /// What is odd on the bus as a whole: sentences for people.
    pub remarks: Vec<String>,
    /// True if it was interrupted before everything was asked.
    pub is_interrupted: bool,
    /// The state of the bus at the end.
    pub bus_state: BusState,
}
