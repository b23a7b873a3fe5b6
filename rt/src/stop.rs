//! How the group stops, and the one reason for it.

use crate::fault::{Fault, Rule};
use crate::phase::Phase;
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

/// What two stops of one group make together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MergedStop {
    /// The reason and the category of both.
    pub(crate) reason: StopReason,
    /// True if the second one is the reason.
    pub(crate) is_new_reason: bool,
    /// True if the second one asks for a harder category than the first one.
    pub(crate) is_harder: bool,
}

impl StopReason {
    /// Merges a stop with the present one of its group. The cause of the higher rank is the reason, the first one of the same rank, and
    /// the harder category counts.
    pub(crate) fn merged(present: Option<Self>, begun: Self) -> MergedStop {
        let is_new_reason = present.is_none_or(|present| present.cause.rank() < begun.cause.rank());
        let is_harder = present.is_none_or(|present| begun.category < present.category);
        let category = present.map_or(begun.category, |present| present.category.min(begun.category));
        let reason = present.filter(|_| !is_new_reason).unwrap_or(begun);
        MergedStop { reason: Self { category, ..reason }, is_new_reason, is_harder }
    }

    /// The axis concerned; `None` when it was not one axis.
    pub const fn axis(&self) -> Option<u8> {
        self.origin.axis()
    }

    /// The rule that is broken, or [`Rule::Requested`].
    pub const fn rule(&self) -> Rule {
        self.cause.rule()
    }

    /// Returns `true` if the stop was asked for: then nothing has to be reset.
    pub const fn is_requested(&self) -> bool {
        matches!(self.cause, StopCause::Requested)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cia402::DriveState;

    const REQUESTED: StopCause = StopCause::Requested;
    const FAULT: StopCause = StopCause::Fault(Fault::BusOff);
    const UNRELEASED: StopCause =
        StopCause::Fault(Fault::DriveEnabled { state: DriveState::OperationEnabled });
    const CATEGORIES: [StopCategory; 3] = [StopCategory::Zero, StopCategory::One, StopCategory::Two];

    fn stop(cause: StopCause, category: StopCategory, slot: u64) -> StopReason {
        StopReason { category, cause, origin: Origin::Group, slot, phase: Phase::Moving }
    }

    #[test]
    fn a_stop_without_another_one_is_the_reason() {
        for cause in [REQUESTED, FAULT, UNRELEASED] {
            for category in CATEGORIES {
                let begun = stop(cause, category, 2);
                let expected = MergedStop { reason: begun, is_new_reason: true, is_harder: true };
                assert_eq!(StopReason::merged(None, begun), expected);
            }
        }
    }

    #[test]
    fn of_two_stops_the_table_says_which_one_is_the_reason() {
        // The present cause, the second one, and whether that becomes the reason.
        let table = [
            (REQUESTED, REQUESTED, false),
            (REQUESTED, FAULT, true),
            (REQUESTED, UNRELEASED, true),
            (FAULT, REQUESTED, false),
            (FAULT, FAULT, false),
            (FAULT, UNRELEASED, true),
            (UNRELEASED, REQUESTED, false),
            (UNRELEASED, FAULT, false),
            (UNRELEASED, UNRELEASED, false),
        ];
        for (first, second, is_new_reason) in table {
            for first_category in CATEGORIES {
                for second_category in CATEGORIES {
                    let (present, begun) = (stop(first, first_category, 1), stop(second, second_category, 2));
                    let merged = StopReason::merged(Some(present), begun);
                    let reason = if is_new_reason { begun } else { present };
                    let category = first_category.min(second_category);
                    let expected = MergedStop {
                        reason: StopReason { category, ..reason },
                        is_new_reason,
                        is_harder: second_category < first_category,
                    };
                    assert_eq!(merged, expected, "{present:?}, {begun:?}");
                }
            }
        }
    }
}
