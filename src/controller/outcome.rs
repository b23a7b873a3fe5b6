//! How a run goes and how it ends.

use takt_rt::{Phase, RequestError, StopReason};

use crate::drive::BringUpError;
use crate::telemetry::{Machine, words};

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
        refusal: Option<RequestError>,
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

impl Outcome {
    /// It in words, with the names of the axes.
    pub fn words(&self, machine: &Machine) -> String {
        let name = |axis: usize| u8::try_from(axis).map_or("?".to_owned(), |axis| machine.axis_name(axis));
        match self {
            Self::Finished => "the run is over".to_owned(),
            Self::Interrupted => "the run was interrupted".to_owned(),
            Self::Stopped(stop) => words::stop(stop, machine),
            Self::BringUpFailed(error) => error.to_string(),
            Self::FaultPersists { axis, code } => {
                let axis = name(*axis);
                format!("{axis}: the drive is in a fault ({code:#06x}) that a fault reset does not clear")
            }
            Self::NotHeard { axis } => format!(
                "{}: the drive is operational but sends no feedback; is another master changing its PDOs?",
                name(*axis)
            ),
            Self::MoveRefused { number, refusal } => {
                let why = refusal.map(|refusal| words::rejection(&refusal, machine));
                let why = why.unwrap_or_else(|| "why is no longer known".to_owned());
                format!("move {number} of the program could not be begun: {why}")
            }
            Self::CallbackPanicked { message } => {
                format!("a defect of takt (please report it) ended the run in a controlled stop: {message}")
            }
            Self::Stuck { phase } => {
                format!("the group did not get any further while it was {}", words::phase(*phase))
            }
            Self::ThreadDied => {
                "the real-time thread ended by itself; this is a defect of takt, please report it".to_owned()
            }
        }
    }
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
