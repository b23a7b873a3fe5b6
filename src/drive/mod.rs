//! What differs between drive families: process data, bring-up, parameters.
//!
//! Bring-up and shutdown of a family are plain async functions over an [`AxisSession`](axis_session::AxisSession), which
//! read like the manual's own list ([`erob_canopen`], [`yz_aim`]; `family` chooses). What every CiA 402 drive has in
//! common is in functions that any family may call: `identity`, `configuration_file`, `pdo_mapping`, `heartbeat`,
//! `actual_position`. [`BringUp`] and [`Shutdown`] run them for all axes in parallel, with the engine of
//! [`procedure`](crate::procedure).
//!
//! [`AxisFacts`] has what the drive has reported, [`BringUpError`] what failed. [`ProcessData`] says which objects each PDO
//! carries: as written to the drive, or as the drive reports it (`reported_mapping`).

mod actual_position;
mod axis_session;
mod axis_units;
mod bring_up;
mod check;
mod configuration_file;
pub mod erob_canopen;
mod error_words;
mod facts;
mod failure;
mod family;
mod heartbeat;
mod identifiers;
mod identity;
mod network_state;
mod pdo_mapping;
mod process_data;
mod reported_mapping;
pub mod yz_aim;

pub use crate::procedure::Access;
pub use bring_up::{BringUp, BringUpProgress, BringUpTiming, NotConfigured, Shutdown, Stage, overwritten};
pub use check::Check;
pub use error_words::{error_cure, error_words};
pub use facts::{AxisFacts, DeviceIdentity, DeviceTexts};
pub use failure::{AxisFailure, BringUpError, Content, FailureCause, ProbeResult};
pub use identifiers::{OtherProtocol, identifiers, other_protocol};
pub use process_data::{PdoPlan, ProcessData};
pub use reported_mapping::MappingProblem;
