//! Waiting for cycles. The real-time thread does nothing for those who wait: it wakes no one and sees no one. They sleep until
//! the next state is expected, and look. In virtual time, whoever waits runs the cycles.
//!
//! A cycle shows its state when its set-points have been sent, after about six tenths of the slot. A sleep that ends then does not
//! disturb the next SYNC; see [`sleep_alignment`](crate::sleep_alignment).

use std::time::Duration;

use takt_rt::{AxisSnapshot, Clock, Nanoseconds, Phase, Snapshot};

use super::{ENABLE_TIMEOUT, Handle, OwnProcess};
use crate::command::{Backend, WaitError};
use crate::controller::supervisor::AfterBringUp;
use crate::monotonic_clock::MonotonicClock;

/// How much later than the last one the next state is looked for, beyond the period. It covers the usual jitter of a cycle.
const MARGIN_NS: Nanoseconds = 20_000;
/// Time from one look to the next while a state is overdue, and before the first one.
const OVERDUE_NS: Nanoseconds = 100_000;
/// The shortest time from one look to the next of a wait for anything else than the next cycle.
const LOOK_NS: Nanoseconds = 1_000_000;

/// When a wait is to end.
pub(super) struct Deadline(Nanoseconds);

impl Handle {
    /// Waits until the drives are as they are to be before the first command.
    pub(super) fn wait_until_brought_up(&self, after_bring_up: AfterBringUp) -> Result<(), WaitError> {
        match after_bring_up {
            AfterBringUp::Enable => self.wait_for(Phase::Holding, ENABLE_TIMEOUT),
            AfterBringUp::StayDisabled => self.wait_until(ENABLE_TIMEOUT, |state| {
                // A drive of bit fields may have had power since it was switched on, until its first command stops it.
                let is_ready = |axis: &AxisSnapshot| {
                    let state = axis.drive_state;
                    axis.is_heard && !state.is_faulted() && !state.has_torque()
                };
                let are_disabled = state.groups().iter().all(|group| group.phase == Phase::Disabled);
                (are_disabled && state.axes().iter().all(is_ready)).then_some(())
            }),
        }
    }
}

impl OwnProcess {
    pub(super) fn deadline_after(&self, at_most: Duration) -> Deadline {
        let at_most_ns = Nanoseconds::try_from(at_most.as_nanos()).unwrap_or(Nanoseconds::MAX);
        Deadline(self.now_ns().saturating_add(at_most_ns))
    }

    /// See [`Handle::cycle_after`].
    pub(super) fn wait_for_cycle(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        let deadline = self.deadline_after(at_most);
        loop {
            let has_ended = self.has_ended();
            let (newest, shown_ns) = self.observer.look(|state| (state.slot, state.at_ns));
            if newest > slot {
                return Ok(self.observer.snapshot());
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.sleep_until_cycle(shown_ns, self.machine.cycle_ns, &deadline)?;
        }
    }

    /// See [`Handle::wait_until`].
    pub(super) fn wait_until<T>(
        &self,
        at_most: Duration,
        mut find: impl FnMut(&Snapshot) -> Option<T>,
    ) -> Result<T, WaitError> {
        let deadline = self.deadline_after(at_most);
        let mut state = Snapshot::default();
        loop {
            // This is read before the state, so that the state includes the last cycle before the end.
            let has_ended = self.has_ended();
            self.observer.read(&mut state);
            if let Some(found) = find(&state) {
                return Ok(found);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.sleep_until_look(state.at_ns, &deadline)?;
        }
    }

    /// Sleeps until a later state than that of this time is expected, at least a millisecond later.
    pub(super) fn sleep_until_look(
        &self,
        shown_ns: Nanoseconds,
        deadline: &Deadline,
    ) -> Result<(), WaitError> {
        let period_ns = self.machine.cycle_ns.max(1);
        self.sleep_until_cycle(shown_ns, LOOK_NS.div_ceil(period_ns) * period_ns, deadline)
    }

    /// Sleeps until the state is expected that comes so long after the one of this time.
    fn sleep_until_cycle(
        &self,
        shown_ns: Nanoseconds,
        later_ns: Nanoseconds,
        deadline: &Deadline,
    ) -> Result<(), WaitError> {
        let now_ns = self.now_ns();
        if now_ns >= deadline.0 {
            return Err(WaitError::NotInTime);
        }
        if let Some(pace) = self.virtual_pace() {
            pace.step(1, &self.life);
            return Ok(());
        }
        let expected_ns = shown_ns.saturating_add(later_ns).saturating_add(MARGIN_NS);
        let look_ns = expected_ns.max(now_ns.saturating_add(OVERDUE_NS));
        MonotonicClock::default().wait_until(look_ns.min(deadline.0));
        Ok(())
    }
}
