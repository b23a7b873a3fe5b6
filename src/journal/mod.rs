//! The journal of a run: everything that the real-time thread was told from outside, so that the same engine can be run again and does
//! the same, bit for bit.
//!
//! The cycle is a function of what its [`Clock`](takt_rt::Clock), its [`BusPort`](takt_rt::BusPort)s and its
//! [`HostInterface`](takt_rt::HostInterface) answer. The journal has these answers:
//!
//! | answers of | noted by | replayed by |
//! | --- | --- | --- |
//! | the clock | [`JournaledClock`] | [`ReplayClock`] |
//! | the ports: frames, and what is out of the ordinary | [`TracedPort`](crate::link::trace::TracedPort) | [`ReplayPort`] |
//! | the host: requests, points, callbacks, service frames, trajectories | the channels ([`channels::journal`](crate::channels::journal)) | [`ReplayHost`] |
//!
//! What a port and the host answer is found again by its time and by its cycle, so that a replay under another configuration, whose
//! engine asks for other things, gets what was there.

mod clock;
mod format;
mod host;
mod port;
mod rerun;
mod run_journal;

pub use clock::{ClockAnswer, ClockJournal, JournaledClock, ReplayClock, clock_journal};
pub use format::{BlockDefect, Checkpoint, Journal, JournaledTrajectory};
pub use host::ReplayHost;
pub use port::{PortEntry, PortState, ReceivedFrame, ReplayPort};
pub use rerun::{Rerun, RerunParts};
pub use run_journal::RunJournal;

use std::collections::VecDeque;

/// The first entry of a queue, if it is wanted.
pub fn pop_front_if<T>(queue: &mut VecDeque<T>, is_wanted: impl FnOnce(&T) -> bool) -> Option<T> {
    queue.front().is_some_and(is_wanted).then(|| queue.pop_front()).flatten()
}
