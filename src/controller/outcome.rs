//! How a run goes and how it ends.

use takt_rt::refusal::Refusal;
use takt_rt::stop::{Phase, StopReason};

use crate::drive::BringUpError;

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The program was done, or its time was over.
    Finished,
    /// Somebody interrupted it; the axes were stopped in control unless it was asked otherwise.
    Interrupted,
    /// The group stopped by itself.
    Stopped(StopReason),
    /// The drives could not be brought up.
    BringUpFailed(BringUpError),
    /// A drive is in a fault that a reset does not clear.
    FaultPersists {
        /// The axis.
        axis: usize,
        /// Object 603F or the code of the emergency message.
        code: u16,
    },
    /// A drive does not report.
    NotHeard {
        /// The axis.
        axis: usize,
    },
    /// A move of the program was refused; counted from 1.
    MoveRefused {
        /// The move.
        number: u64,
        /// Why, if that is still known.
        refusal: Option<Refusal>,
    },
    /// A function that the caller gave to the run panicked, and the axes were stopped in control.
    CallbackPanicked {
        /// What the panic said.
        message: String,
    },
    /// The real-time thread ended by itself, which only a defect of takt can bring about.
    ThreadDied,
    /// The group did not get where it was told to in time.
    Stuck {
        /// What it was doing.
        phase: Phase,
    },
}

/// Who asks a run to end before its program does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Interrupt {
    /// Decelerate, hold, disable, leave.
    Controlled,
    /// Take the power now and leave without farewell.
    Immediate,
}

/// What the run is doing, for a progress bar.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// In a few words.
    pub what: String,
    /// 0 to 1 where that is known.
    pub fraction: Option<f64>,
}
