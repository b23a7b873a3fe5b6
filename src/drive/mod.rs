//! What differs from one family of drives to the next: process data, bring-up, parameters.
//!
//! A family writes its procedures down as lists of steps (`erob_canopen`, `yz_aim`, `step_list`, `step`); one machine
//! carries them out for every family (`axis_run`), for all axes at once ([`BringUp`], [`Leave`]); what was learnt is in [`AxisFacts`], what
//! went wrong in [`BringUpError`]. Which objects travel in which PDO is in [`ProcessData`]: as it is written to the drive,
//! or as the drive reports it (`reported_mapping`).

mod axis_run;
mod bring_up;
pub mod erob_canopen;
mod facts;
mod failure;
mod process_data;
mod reported_mapping;
mod step;
mod step_list;
pub mod yz_aim;

pub use bring_up::{BringUp, BringUpTiming, Leave, NotConfigured, Progress, Stage};
pub use facts::{AxisFacts, DeviceIdentity, DeviceTexts};
pub use failure::{Answered, AxisFailure, BringUpError, Cause, Content};
pub use process_data::{PdoPlan, ProcessData};
pub use reported_mapping::MappingProblem;
pub use step::{Access, Check, mode_words};
