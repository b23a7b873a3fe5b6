//! What the handles of a controller need for callbacks.

use takt_rt::{Nanoseconds, SlotPlan};

use crate::channels::CallbackGiver;

/// The callbacks of the handles of a controller.
pub(super) struct Callbacks {
    pub giver: CallbackGiver,
    /// The longest budget.
    pub longest_ns: Nanoseconds,
}

impl Callbacks {
    /// The budgets end with the time in which the set-points of a cycle must be ready.
    pub fn new(giver: CallbackGiver, plan: &SlotPlan) -> Self {
        Self { giver, longest_ns: plan.latest_set_points_ns.saturating_sub(plan.command_phase_ns) }
    }
}
