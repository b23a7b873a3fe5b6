//! How serious an event is, for those who filter a log.

use takt_rt::{EventKind, TimingLevel};

/// How serious an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Of use to those who look for the cause of something.
    Debug,
    /// Part of an ordinary run.
    Info,
    /// Out of the ordinary; the motion goes on.
    Warning,
    /// A group has stopped for a fault.
    Error,
}

impl Severity {
    /// The severity of an event.
    pub fn of(kind: &EventKind) -> Self {
        match kind {
            EventKind::Stop(stop) if stop.is_requested() => Self::Info,
            EventKind::Stop(_) => Self::Error,
            EventKind::DriveState { state, .. } if state.is_faulted() => Self::Warning,
            EventKind::DriveState { .. } | EventKind::Stream { .. } | EventKind::MotionFinished { .. } => {
                Self::Debug
            }
            EventKind::Emergency { code: 0, .. }
            | EventKind::Timing { level: TimingLevel::Normal }
            | EventKind::PhaseChanged { .. }
            | EventKind::Mode { .. } => Self::Info,
            EventKind::Emergency { .. }
            | EventKind::Timing { .. }
            | EventKind::MissedSlots { .. }
            | EventKind::Rejected(_) => Self::Warning,
        }
    }
}
