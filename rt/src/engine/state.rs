//! What the group is doing, with what only that needs.
//!
//! ```text
//! phase      leaves when …                                                           for
//! ─────────  ──────────────────────────────────────────────────────────────────────  ─────────────────────
//! Passive    Request::Activate                                                       Disabled
//! Disabled   Request::Enable                                                         Enabling
//!            Request::BringUp (and no enabling before Request::ConfirmBringUp)       Passive
//!            Request::ChangeMode                                                     Disabled, changing mode
//! Enabling   every drive shows operation enabled                                     Holding
//!            a stop, Request::Disable                                                Disabling
//! Holding    Request::Move, Request::SetProfileTarget, Request::Execute              Moving
//!            Request::Stream, Request::RunCallback                                   Streaming
//!            Request::ChangeMode                                                     Holding, changing mode
//!            Request::Disable, a stop of category 1 or 0                             Stopping, Disabling
//! Moving     the targets are reached                                                 Holding
//!            Request::Disable, a stop                                                Stopping, Disabling (0)
//! Streaming  Request::Disable, a stop                                                Stopping, Disabling (0)
//!            Request::Move takes the place of a callback, or the callback is over    Moving
//! Stopping   the joints are at rest                                                  Holding (2), Disabling (1)
//!            it gets harder (category 0)                                             Disabling
//! Disabling  every drive has confirmed that it has no torque, or is not waited for   Disabled
//!            any longer: then a latched fault says so
//! ```
//!
//! A number in brackets is a stop category of IEC 60204-1. While a group changes its mode it is shown in the phase that it has come
//! from and goes back to. It does nothing else then but stop and be disabled.

use super::execution::Execution;
use super::in_loop::InLoop;
use crate::cia402::Goal;
use crate::phase::Phase;
use crate::source::CallbackId;

/// What the group is doing.
// With a byte of its own that tells the states apart: it is looked at many times in each cycle, and otherwise the compiler
// packs it into the payloads.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
#[repr(u8)]
pub(super) enum GroupState<const AXES: usize> {
    Passive,
    Disabled,
    Enabling,
    Holding,
    /// Drives are told another mode of operation and have not shown it yet.
    ChangingMode(AtRest),
    Moving {
        /// True if the end of the motion has been reported; a velocity or a torque goes on after that.
        is_reported: bool,
    },
    /// On a trajectory of the host.
    Executing(Execution<AXES>),
    Streaming(Stream),
    /// Led by a callback of the host.
    InLoop(InLoop),
    Stopping,
    Disabling(PowerRemoval),
}

/// The phase in which a group changes its mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum AtRest {
    /// Without power.
    Disabled,
    /// Enabled, every joint at rest.
    Holding,
}

/// How far a stream has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum Stream {
    /// It was asked for, and the host has yet to be told.
    Requested,
    /// No point has come yet: the set-points stay.
    Awaited,
    /// The axes follow the points.
    Following,
    /// The points have run out: the axes come to rest.
    Dry,
}

/// How the power is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) enum PowerRemoval {
    /// By the way of CiA 402: ready to switch on.
    Shutdown,
    /// At once: disable voltage.
    DisableVoltage,
}

impl<const AXES: usize> GroupState<AXES> {
    /// The phase that observers see.
    pub(super) const fn phase(&self) -> Phase {
        match self {
            Self::Passive => Phase::Passive,
            Self::Disabled | Self::ChangingMode(AtRest::Disabled) => Phase::Disabled,
            Self::Enabling => Phase::Enabling,
            Self::Holding | Self::ChangingMode(AtRest::Holding) => Phase::Holding,
            Self::Moving { .. } | Self::Executing(_) => Phase::Moving,
            Self::Streaming(_) | Self::InLoop(_) => Phase::Streaming,
            Self::Stopping => Phase::Stopping,
            Self::Disabling(_) => Phase::Disabling,
        }
    }

    /// Where the drives are led.
    pub(super) const fn goal(&self) -> Goal {
        match self {
            Self::Passive
            | Self::Disabled
            | Self::ChangingMode(AtRest::Disabled)
            | Self::Disabling(PowerRemoval::Shutdown) => Goal::Disabled,
            Self::Disabling(PowerRemoval::DisableVoltage) => Goal::NoVoltage,
            Self::Enabling
            | Self::Holding
            | Self::ChangingMode(AtRest::Holding)
            | Self::Moving { .. }
            | Self::Executing(_)
            | Self::Streaming(_)
            | Self::InLoop(_)
            | Self::Stopping => Goal::Enabled,
        }
    }

    /// The callback that is still needed.
    pub(super) const fn callback(&self) -> Option<CallbackId> {
        match self {
            Self::InLoop(in_loop) => Some(in_loop.callback()),
            _ => None,
        }
    }

    /// Returns `true` if a drive may have torque.
    pub(super) const fn has_power(&self) -> bool {
        !matches!(self, Self::Passive | Self::Disabled | Self::ChangingMode(AtRest::Disabled))
    }
}
