//! What differs between drive families: process data, bring-up, parameters.
//!
//! Bring-up and shutdown of a [family](crate::family) are plain async functions over an [`AxisSession`], which read like the
//! manual's own list. What CiA 402 drives have in common is in functions that any family may call: [`identity`],
//! [`configuration_file`], [`pdo_mapping`], [`heartbeat`], [`actual_position`]. `BringUp` and `Shutdown` run them for all
//! axes in parallel, with the engine of procedures.
//!
//! [`AxisFacts`] has what the drive has reported, [`BringUpError`] what failed. [`ProcessData`] says which objects each PDO
//! carries: as written to the drive, or as the drive reports it (`reported_mapping`).

pub mod actual_position;
mod axis_session;
pub(crate) mod axis_units;
mod check;
pub mod configuration_file;
mod facts;
mod failure;
pub mod heartbeat;
mod identifiers;
pub mod identity;
pub(crate) mod mapped_objects;
mod network_state;
pub mod pdo_mapping;
pub(crate) mod planner;
mod process_data;
mod reported_mapping;
mod shared_commands;
#[doc(hidden)]
pub mod stages;
mod timing;

pub use crate::procedure::Access;
pub use axis_session::{AxisSession, StepResult};
pub use axis_units::SiUnit;
pub use check::Check;
pub use facts::{AxisFacts, DeviceIdentity, DeviceTexts};
pub use failure::{AxisFailure, BringUpError, Content, FailureCause, ProbeResult};
pub use network_state::RESTART_STEP;
pub use process_data::{PdoPlan, ProcessData, Reply, first_pdo};
pub use reported_mapping::MappingProblem;
pub(crate) use stages::{BringUp, Shutdown, overwritten, refused_values};
pub use takt_wire::canopen::pdo_reader::PdoReadError;
pub use timing::BringUpTiming;
