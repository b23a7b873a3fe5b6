//! The journal: what the real-time thread has taken from the host, cycle by cycle, so that a run can be replayed.

use std::sync::{Arc, Mutex, PoisonError};

use takt_rt::{AxisTarget, CallbackReturn, Frame, MAX_AXES, OffCycleReport, RequestEnvelope, StreamPoint};

use super::ring::{Consumer, Producer, ring};
use super::trajectories::NumberedTrajectory;

/// Entries that wait for their reader. A cycle takes a few at most; a flood of points is eight for each group.
const ENTRIES: usize = 1024;

/// Something that the real-time thread has taken from the host.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
#[expect(clippy::large_enum_variant, reason = "the real-time thread puts nothing on the heap")]
pub enum HostInput {
    /// A request.
    Request(RequestEnvelope),
    /// A report of a drive that is spoken to outside of the cycle.
    OffCycleReport {
        /// Its axis.
        axis: u8,
        /// What it says.
        report: OffCycleReport,
    },
    /// A point of the stream of a group.
    Point {
        /// The group.
        group: u8,
        /// The point, with the axes of the group.
        point: StreamPoint,
    },
    /// Whether there was a callback that was asked for.
    CallbackTaken {
        /// True if there was.
        is_there: bool,
    },
    /// A call of a callback.
    Called {
        /// What became of it.
        returned: CallbackReturn,
        /// What it wants of the axes.
        targets: [Option<AxisTarget>; MAX_AXES],
    },
    /// A frame that was to be sent.
    ServiceFrame {
        /// Its bus.
        bus: u8,
        /// The frame.
        frame: Frame,
    },
}

/// An input with the cycle that took it, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
pub struct JournalEntry {
    /// The cycle.
    pub cycle: u64,
    /// The input.
    pub input: HostInput,
}

/// The two ends.
pub(super) fn journal() -> (JournalWriter, JournalReader) {
    let (entry_in, entry_out) = ring(ENTRIES);
    (
        JournalWriter { cycle: 0, entries: entry_in },
        JournalReader { entries: entry_out, given: Arc::default() },
    )
}

/// The end of the real-time thread. A full journal drops and counts.
pub(super) struct JournalWriter {
    cycle: u64,
    entries: Producer<JournalEntry>,
}

impl JournalWriter {
    /// Notes an input of this cycle.
    pub(super) fn note(&mut self, input: HostInput) {
        self.entries.push(JournalEntry { cycle: self.cycle, input });
    }

    /// The cycle is over.
    pub(super) fn end_cycle(&mut self) {
        self.cycle += 1;
    }
}

/// The end of whoever keeps the journal.
pub struct JournalReader {
    entries: Consumer<JournalEntry>,
    given: Arc<Mutex<Vec<NumberedTrajectory>>>,
}

impl JournalReader {
    /// The oldest entry.
    pub fn take(&mut self) -> Option<JournalEntry> {
        self.entries.pop()
    }

    /// The trajectories that have been given since the last call. Call it before [`Self::take`]: a request names a trajectory that has
    /// been given before.
    pub fn take_trajectories(&self) -> Vec<NumberedTrajectory> {
        std::mem::take(&mut *self.given.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Entries that found no room.
    pub fn dropped(&self) -> u64 {
        self.entries.dropped()
    }

    /// Where the giver notes trajectories.
    pub(super) fn trajectories(&self) -> Arc<Mutex<Vec<NumberedTrajectory>>> {
        Arc::clone(&self.given)
    }
}
