//! A callback that leads a group, and what came of its calls.

use crate::bit_set::BitSet;
use crate::fault::Fault;
use crate::source::{CallbackId, CallbackOutcome, CallbackReturn, CallbackRun};

/// A callback that leads the group.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct InLoop {
    pub(super) run: CallbackRun,
    /// The slot of the last call; `None` before the first one.
    pub(super) called_in: Option<u64>,
    /// What came of the call in this cycle.
    pub(super) returned: CallbackReturn,
    /// Calls in a row that have taken too long.
    pub(super) overruns: u32,
    /// The axes that rest because nothing is commanded of them, by their numbers.
    pub(super) resting: BitSet,
}

impl InLoop {
    pub(super) fn new(run: CallbackRun) -> Self {
        let returned = CallbackReturn { outcome: CallbackOutcome::Missing, spent_ns: 0 };
        Self { run, called_in: None, returned, overruns: 0, resting: BitSet::default() }
    }

    /// The callback that is still needed.
    pub(super) const fn callback(&self) -> CallbackId {
        self.run.callback
    }

    pub(super) fn returns(&mut self, slot: u64, returned: CallbackReturn) {
        let is_overrun = returned.spent_ns > self.run.budget_ns;
        self.overruns = if is_overrun { self.overruns.saturating_add(1) } else { 0 };
        (self.called_in, self.returned) = (Some(slot), returned);
    }

    /// What keeps the commands of the last call from being carried out.
    pub(super) fn fault(&self) -> Option<Fault> {
        let CallbackReturn { outcome, spent_ns } = self.returned;
        match outcome {
            CallbackOutcome::Missing => Some(Fault::StaleCommand { age_cycles: 1 }),
            CallbackOutcome::Panicked => Some(Fault::CallbackPanicked),
            CallbackOutcome::Commanded if self.overruns > self.run.overruns_allowed => {
                Some(Fault::CallbackOverrun { spent_ns, budget_ns: self.run.budget_ns })
            }
            CallbackOutcome::Commanded | CallbackOutcome::Finished => None,
        }
    }
}
