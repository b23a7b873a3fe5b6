//! What differs between drive families: process data, bring-up, parameters.
//!
//! A family describes its procedures as lists of steps (`erob_canopen`, `yz_aim`, `step_list`, `step`). One engine runs
//! them for every family (`axis_run`), for all axes in parallel ([`BringUp`], [`Shutdown`]). [`AxisFacts`] has what the
//! drive has reported, [`BringUpError`] what failed. [`ProcessData`] says which objects each PDO carries: as written to
//! the drive, or as the drive reports it (`reported_mapping`).

mod axis_run;
mod bring_up;
pub mod erob_canopen;
mod facts;
mod failure;
pub(crate) mod mapped_objects;
mod process_data;
mod reported_mapping;
pub(crate) mod step;
mod step_list;
pub mod yz_aim;

pub use bring_up::{BringUp, BringUpProgress, BringUpTiming, NotConfigured, Shutdown, Stage, overwritten};
pub use facts::{AxisFacts, DeviceIdentity, DeviceTexts};
pub use failure::{AxisFailure, BringUpError, Content, FailureCause, ProbeResult};
pub use process_data::{PdoPlan, ProcessData, Reply};
pub use reported_mapping::MappingProblem;
pub use step::ProcedureStep;
pub use step::{Access, Check};
