//! The progress of a run, and its outcome.

use std::time::Duration;

use takt_rt::{Phase, RequestError, StopReason};

use crate::family::bring_up::BringUpError;
use crate::link::Process;
use crate::telemetry::{Machine, words};

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outcome {
    /// The program has finished, or its time has passed.
    Finished,
    /// It was interrupted. The axes were stopped in control, unless an immediate stop was asked for.
    Interrupted,
    /// Another process took the buses over; the axes were stopped in control for it.
    TakenOver {
        /// The process.
        process: Process,
    },
    /// The group stopped for a fault.
    Stopped(StopReason),
    /// The drives could not be brought up.
    BringUpFailed(BringUpError),
    /// A fault reset does not clear the fault of a drive.
    FaultPersists {
        /// The axis.
        axis: usize,
        /// Object 603F or the code of the emergency message.
        code: u16,
    },
    /// A drive does not send feedback.
    NotHeard {
        /// The axis.
        axis: usize,
    },
    /// A move of the program was refused; counted from 1.
    MoveRefused {
        /// The move.
        number: u64,
        /// The reason, if it is still known.
        refusal: Option<RequestError>,
    },
    /// The program is done, but a joint is farther off its target than its `target_tolerance`.
    OffTarget {
        /// The axis.
        axis: usize,
        /// How far beyond its target it is: rad (m).
        distance: f64,
        /// How far it may be: rad (m).
        tolerance: f64,
    },
    /// The program is done, but the drive of a joint has not reported where the joint is.
    PositionNotReported {
        /// The axis.
        axis: usize,
        /// The slot of its last report.
        since_slot: u64,
    },
    /// A motion of another client has replaced a move of the program; counted from 1.
    MoveReplaced {
        /// The move.
        number: u64,
    },
    /// A function that the caller gave to the run panicked, and the axes were stopped in control.
    CallbackPanicked {
        /// The message of the panic.
        message: String,
    },
    /// The real-time thread has panicked. That is a defect of takt.
    ThreadDied {
        /// What was done to stop the drives of each bus, in words.
        told: Vec<String>,
    },
    /// The real-time loop has stood still, because a callback has not returned, and was given up.
    Stalled {
        /// For how long there was no cycle.
        after: Duration,
        /// What was done to stop the drives of each bus, in words.
        told: Vec<String>,
    },
    /// The group did not reach the next phase in time.
    Stuck {
        /// The phase in which it remained.
        phase: Phase,
    },
}

impl Outcome {
    /// The outcome as a sentence, with the names of the axes.
    pub fn words(&self, machine: &Machine) -> String {
        let name = |axis: usize| u8::try_from(axis).map_or("?".to_owned(), |axis| machine.axis_name(axis));
        match self {
            Self::Finished => "the run has finished".to_owned(),
            Self::Interrupted => "the run was interrupted".to_owned(),
            Self::TakenOver { process } => {
                format!("{process} has taken the buses over; the axes were stopped in control for it")
            }
            Self::Stopped(stop) => words::stop(stop, machine).to_string(),
            Self::BringUpFailed(error) => error.to_string(),
            Self::FaultPersists { axis, code } => {
                let number = u8::try_from(*axis).unwrap_or(u8::MAX);
                format!(
                    "{}: the drive is in a fault, {}, that a fault reset does not clear; try: {}",
                    name(*axis),
                    machine.drive_error(number, *code),
                    machine.drive_cure(number, *code)
                )
            }
            Self::NotHeard { axis } => format!(
                "{}: the drive has been brought up but sends no feedback; does another master change its NMT state or its PDOs?",
                name(*axis)
            ),
            Self::MoveRefused { number, refusal } => {
                let why = refusal.map(|refusal| words::rejection(&refusal, machine).to_string());
                let why = why.unwrap_or_else(|| "the reason is no longer known".to_owned());
                format!("move {number} of the program was refused: {why}")
            }
            Self::MoveReplaced { number } => {
                format!("another client has moved the group during move {number} of the program")
            }
            Self::OffTarget { axis, distance, tolerance } => {
                format!(
                    "{}: the program is done, but the joint is {:.6} rad (m) off its target, and target_tolerance is {:.6}; \
                     in CSV and CST, look at the gains of the loop, and at the friction that is fed forward",
                    name(*axis),
                    distance.abs(),
                    tolerance
                )
            }
            Self::PositionNotReported { axis, since_slot } => {
                format!(
                    "{}: the program is done, but the drive has not reported since slot {since_slot}, so it is not known where \
                     the joint is",
                    name(*axis)
                )
            }
            Self::CallbackPanicked { message } => {
                format!("a callback panicked, and the run ended in a controlled stop: {message}")
            }
            Self::Stuck { phase } => {
                format!("the group remained {} for too long", words::phase(*phase))
            }
            Self::ThreadDied { told } => {
                let told = told.join("; ");
                format!(
                    "the real-time thread has panicked, which is a defect of takt, please report it: {told}"
                )
            }
            Self::Stalled { after, told } => format!(
                "the real-time loop has stood still for {:.1} s, as where a callback does not return, and was given up: {}",
                after.as_secs_f64(),
                told.join("; ")
            ),
        }
    }
}

/// How a run is asked to end before its program has finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Interrupt {
    /// Decelerate, hold, disable, shut down.
    Controlled,
    /// Remove the power now, and end without a shut-down of the drives.
    Immediate,
}

/// The progress of a run, for a progress bar.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// The present step in a few words.
    pub what: String,
    /// 0 to 1, if it is known.
    pub fraction: Option<f64>,
    /// True if the run is on its way to its end.
    pub is_ending: bool,
}
