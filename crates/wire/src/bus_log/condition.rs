//! Problems of a log: those that end its reading, and those that are counted.

use std::io;

/// Why a file cannot be read as a log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is empty.
    #[error("the file is empty: nothing was logged")]
    Empty,
    /// It is none of the logs that are known.
    #[error(
        "this is no log of a bus; line {line}: {problem}. A log of candump (-l, or what it prints), pcapng, a CSV table with the \
         columns id and data (or that of python-can), ASC, TRC, and recordings of takt are read"
    )]
    Unknown {
        /// The first line that is of no log.
        line: usize,
        /// Why.
        problem: String,
    },
    /// It is a capture of the older format.
    #[error("this is a capture in the older format pcap; convert it: editcap -F pcapng CAPTURE NEW.pcapng")]
    OldCapture,
    /// A block of a pcapng file is impossible.
    #[error("block {block} of the capture is damaged")]
    Damaged {
        /// The block, counted from 1.
        block: usize,
    },
}

/// What a log was like.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogCondition {
    /// Messages of CAN controllers about errors; they are no frames.
    pub error_frames: u64,
    /// Packets of other networks in a capture.
    pub foreign: u64,
    /// Lines (blocks of a capture) that were passed over.
    pub malformed: u64,
    /// The first of them, counted from 1, and why.
    pub first_malformed: Option<(usize, String)>,
    /// How often a time is before that of the frame before.
    pub steps_back: u64,
    /// The first such frame, counted from 1.
    pub first_step_back: Option<u64>,
    /// True if the end of the last block is missing.
    pub is_cut_off: bool,
}

impl LogCondition {
    pub(super) fn count_malformed(&mut self, at: usize, problem: String) {
        self.malformed += 1;
        self.first_malformed.get_or_insert((at, problem));
    }
}
