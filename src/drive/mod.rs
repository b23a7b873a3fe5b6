//! What differs from one family of drives to the next: process data, bring-up, parameters.

mod process_data;

pub use process_data::{PdoPlan, ProcessData};
