//! What differs between drive families: process data, bring-up, parameters.
//!
//! A family describes its procedures as lists of steps (`erob_canopen`, `yz_aim`, `step_list`, `step`). One engine runs
//! them for every family (`axis_run`), for all axes in parallel ([`BringUp`], [`Shutdown`]). [`AxisFacts`] has what the
//! drive has reported, [`BringUpError`] what failed. [`ProcessData`] says which objects each PDO carries: as written to
//! the drive, or as the drive reports it (`reported_mapping`).

mod axis_run;
mod bring_up;
pub mod erob_canopen;
mod error_words;
mod facts;
mod failure;
mod identifiers;
mod process_data;
mod reported_mapping;
mod step;
mod step_list;
pub mod yz_aim;

pub use bring_up::{BringUp, BringUpProgress, BringUpTiming, NotConfigured, Shutdown, Stage, overwritten};
pub use error_words::{error_cure, error_words};
pub use facts::{AxisFacts, DeviceIdentity, DeviceTexts};
pub use failure::{AxisFailure, BringUpError, Content, FailureCause, ProbeResult};
pub use identifiers::{OtherProtocol, identifiers, other_protocol};
pub use process_data::{PdoPlan, ProcessData};
pub use reported_mapping::MappingProblem;
pub use step::{Access, Check};
