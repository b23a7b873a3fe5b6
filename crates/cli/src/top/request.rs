//! What the view asks of the controller.

use std::time::Duration;

use takt_rt::{Nanoseconds, RequestTarget, StopCategory};

/// One request. The shell sends it, and tells the model what became of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// To stop. It needs no lease.
    Stop {
        /// Whose axes.
        target: RequestTarget,
        /// How.
        category: StopCategory,
    },
    /// To take the lease if nobody has it, or to renew it.
    TakeLease,
    /// The same, said by nobody: it is not told when it has succeeded.
    RenewLease,
    /// To take the lease from whoever has it.
    TakeOver,
    /// To give the lease back.
    Release,
    /// To enable axes.
    Enable(RequestTarget),
    /// To bring axes to rest and disable them.
    Disable(RequestTarget),
    /// To clear the latched faults of axes.
    ClearFaults(RequestTarget),
    /// To begin to follow velocities.
    BeginStream(RequestTarget),
    /// To follow these velocities, of each axis of the target, from a time on.
    Velocities {
        /// Whose axes.
        target: RequestTarget,
        /// From when on.
        at_ns: Nanoseconds,
        /// rad/s (m/s)
        velocities: Vec<f64>,
    },
    /// To move an axis in profile velocity, for this time.
    ProfileVelocity {
        /// When it was asked for.
        at_ns: Nanoseconds,
        /// The axis.
        axis: usize,
        /// rad/s (m/s)
        velocity: f64,
        /// For how long.
        valid_for: Duration,
    },
    /// To end the view. The axes go on.
    Quit,
}

impl Request {
    /// Since when it waits, of one that is worth nothing when it comes late.
    pub const fn perishes_since(&self) -> Option<Nanoseconds> {
        match self {
            Self::Velocities { at_ns, .. } | Self::ProfileVelocity { at_ns, .. } => Some(*at_ns),
            _ => None,
        }
    }

    /// What was done when it has succeeded, in words; nothing of one that goes without saying.
    pub fn done(&self) -> Option<&'static str> {
        Some(match self {
            Self::Stop { category: StopCategory::Zero, .. } => "stop of category 0 asked for",
            Self::Stop { category: StopCategory::One, .. } => "stop of category 1 asked for",
            Self::Stop { category: StopCategory::Two, .. } => "stop of category 2 asked for",
            Self::TakeLease => "the lease is taken: this view commands",
            Self::TakeOver => "the lease is taken over: this view commands",
            Self::Release => "the lease is given back",
            Self::Enable(_) => "enabling",
            Self::Disable(_) => "coming to rest and disabling",
            Self::ClearFaults(_) => "the faults are cleared",
            Self::RenewLease
            | Self::BeginStream(_)
            | Self::Velocities { .. }
            | Self::ProfileVelocity { .. }
            | Self::Quit => return None,
        })
    }

    /// What it is, as the subject of a sentence about its failure.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Stop { .. } => "the stop",
            Self::TakeLease | Self::RenewLease | Self::TakeOver => "the lease",
            Self::Release => "giving the lease back",
            Self::Enable(_) => "enabling",
            Self::Disable(_) => "disabling",
            Self::ClearFaults(_) => "clearing the faults",
            Self::BeginStream(_) | Self::Velocities { .. } | Self::ProfileVelocity { .. } => "the jog",
            Self::Quit => "the end",
        }
    }
}
