//! How evenly this machine paces the loop: `takt jitter`, and the self-test of `takt doctor`.
//!
//! What is measured is the loop itself ([`takt_rt::Cycle`]) in its own thread, with its own clock, spin guard and
//! set-up, around an engine whose only axis stays passive: nothing is commanded. With a bus, SYNC leaves in every
//! slot, and the bus is read as in a run.

mod measurement;
mod render;
mod report;

pub use measurement::{JitterError, JitterOptions, Measurement, Pacing, measure};
pub use report::{JitterReport, PassReport};
