//! How the group stops, and the one reason for it.

use crate::fault::Fault;
use crate::phase::Phase;
use crate::rule::Rule;
use crate::stop_category::StopCategory;

/// The category of the stop for each rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StopCategories([StopCategory; Rule::ALL.len()]);

impl Default for StopCategories {
    fn default() -> Self {
        Self(Rule::ALL.map(Rule::default_category))
    }
}

impl StopCategories {
    /// The category of a rule.
    pub fn of(&self, rule: Rule) -> StopCategory {
        self.0.get(rule as usize).copied().unwrap_or(StopCategory::One)
    }

    /// Sets the category of a rule.
    pub fn set(&mut self, rule: Rule, category: StopCategory) {
        if let Some(present) = self.0.get_mut(rule as usize) {
            *present = category;
        }
    }
}

/// What a stop concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum Origin {
    /// The group as a whole: what was asked of it, or how it is paced.
    #[default]
    Group,
    /// The axis with this number.
    Axis(u8),
    /// The bus with this number.
    Bus(u8),
}

impl Origin {
    /// The axis, if it is one.
    pub const fn axis(self) -> Option<u8> {
        match self {
            Self::Axis(axis) => Some(axis),
            Self::Group | Self::Bus(_) => None,
        }
    }

    /// The bus, if it is one.
    pub const fn bus(self) -> Option<u8> {
        match self {
            Self::Bus(bus) => Some(bus),
            Self::Group | Self::Axis(_) => None,
        }
    }
}

/// Why the group stops.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum StopCause {
    /// Somebody asked for it. A fault that comes up before that stop is over takes its place.
    Requested,
    /// Something went wrong. It must be reset before anything moves again.
    Fault(Fault),
}

impl StopCause {
    /// The rule that is broken, or [`Rule::Requested`].
    pub const fn rule(&self) -> Rule {
        match self {
            Self::Requested => Rule::Requested,
            Self::Fault(fault) => fault.rule(),
        }
    }

    /// The fault, unless the stop was asked for.
    pub const fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Requested => None,
            Self::Fault(fault) => Some(fault),
        }
    }

    /// Of two causes the one of a higher rank is the reason of a stop, and the first one of those of the same rank: a fault goes before
    /// what was asked for, and a drive that has torque when it should have none before whatever made it stop.
    pub(crate) const fn rank(&self) -> CauseRank {
        match self {
            Self::Requested => CauseRank::Requested,
            Self::Fault(Fault::NotDisabled { .. } | Fault::DriveEnabled { .. }) => CauseRank::Unreleased,
            Self::Fault(_) => CauseRank::Fault,
        }
    }

    /// As [`Fault::numbers`].
    pub fn numbers(&self) -> (f64, f64) {
        self.fault().map_or((0.0, 0.0), Fault::numbers)
    }

    /// As [`Fault::from_numbers`].
    pub fn from_numbers(rule: Rule, seen: f64, allowed: f64) -> Option<Self> {
        match rule {
            Rule::Requested => Some(Self::Requested),
            _ => Fault::from_numbers(rule, seen, allowed).map(Self::Fault),
        }
    }
}

/// How much a cause weighs, see [`StopCause::rank`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum CauseRank {
    Requested,
    Fault,
    Unreleased,
}

/// The one reason of a stop: the first fault, or that it was asked for where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct StopReason {
    /// The category of the stop that it led to.
    pub category: StopCategory,
    /// What was seen, and what was allowed.
    pub cause: StopCause,
    /// What it concerns.
    pub origin: Origin,
    /// The slot in which it was seen.
    pub slot: u64,
    /// What the group was doing then.
    pub phase: Phase,
}

impl StopReason {
    /// The axis concerned; `None` when it was not one axis.
    pub const fn axis(&self) -> Option<u8> {
        self.origin.axis()
    }

    /// The rule that is broken, or [`Rule::Requested`].
    pub const fn rule(&self) -> Rule {
        self.cause.rule()
    }

    /// Whether the stop was asked for: then nothing has to be reset.
    pub const fn is_requested(&self) -> bool {
        matches!(self.cause, StopCause::Requested)
    }
}
