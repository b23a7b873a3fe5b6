//! The engine of procedures: bring-up, shutdown and commissioning of drives, without input and output.
//!
//! A procedure is sequential async code that reads like the manual's own list: read the identity, compare, write the
//! limits. It never blocks. The caller passes the time and received messages in, and sends the messages that come out,
//! in real or virtual time. There is no executor: [`Procedure::poll`] polls the code whenever the caller likes.
//!
//! ```text
//! parallel ── many procedures at once, on several buses
//!    │
//! running ── one procedure: its code, its events, its outcome
//!    │
//! session ── what its code awaits: time, messages, an interruption
//!    │
//! client ── one protocol with one drive: frames, or bytes
//!    ├── canopen_client, canopen_session ── SDO, NMT, EMCY, heartbeat
//!    └── modbus_session ── registers of a slave on a Modbus line
//! ```
//!
//! A waiting procedure is abandoned by dropping its code: [`ProcedureSession::unless_over`], or the whole [`Procedure`].
//! A family with a protocol of its own has its session in its folder. The engine knows no family of drives, and no failure of its users: they say what a failed transfer means.

mod access;
mod canopen_client;
mod canopen_session;
mod client;
mod event;
mod modbus_session;
mod parallel;
mod running;
mod sdo_quirks;
mod session;

pub use access::Access;
pub use canopen_client::CanopenClient;
pub use canopen_session::{CanopenSession, POLL_NS};
pub use client::Client;
pub use event::{AxisReading, ProcedureEvent};
pub use modbus_session::{ModbusClient, ModbusSession};
pub use parallel::Parallel;
pub use running::{Procedure, ProcedureError};
pub use sdo_quirks::SdoQuirks;
pub use session::ProcedureSession;
