//! Waiting for cycles. The real-time thread does nothing for those who wait: it wakes no one and sees no one. They sleep until
//! the next state is expected, and look. In virtual time, whoever waits runs the cycles.
//!
//! A cycle shows its state when its set-points have been sent, after about six tenths of the slot. A sleep that ends then does not
//! disturb the next SYNC; see [`sleep_alignment`](crate::sleep_alignment).

use std::time::Duration;

use takt_rt::{AxisSnapshot, Clock, Nanoseconds, Phase, Snapshot};

use super::{ENABLE_TIMEOUT, Handle};
use crate::command::WaitError;
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
    /// The present time on the clock of the controller: `CLOCK_MONOTONIC`; of a [`VirtualController`](super::VirtualController), its own.
    /// The times of states and events, and the stamps of streams, are on it.
    pub fn now_ns(&self) -> Nanoseconds {
        self.0.pace.now_ns()
    }

    pub(super) fn deadline_after(&self, at_most: Duration) -> Deadline {
        let at_most_ns = Nanoseconds::try_from(at_most.as_nanos()).unwrap_or(Nanoseconds::MAX);
        Deadline(self.now_ns().saturating_add(at_most_ns))
    }

    /// Lets so many cycles pass, and returns the state after them. In real time it waits for them; in virtual time it runs them, as fast
    /// as this machine can.
    ///
    /// # Errors
    /// [`WaitError::Ended`] if the controller has ended before them.
    pub fn advance(&self, cycles: u64) -> Result<Snapshot, WaitError> {
        if self.has_ended() {
            return Err(WaitError::Ended);
        }
        match self.virtual_pace() {
            Some(pace) => {
                // Each cycle by itself: the owner can end the run between two of them.
                for _ in 0..cycles {
                    if self.0.life.is_ending() || pace.step(1, &self.0.life) == 0 {
                        return Err(WaitError::Ended);
                    }
                }
                Ok(self.state())
            }
            None if cycles == 0 => Ok(self.state()),
            None => self.cycle_after(self.state().slot.saturating_add(cycles - 1), Duration::MAX),
        }
    }

    /// Waits for the next cycle to be complete, and returns the state after it.
    ///
    /// The thread wakes 20 µs after the time at which the state is expected, plus the wake-up latency that the operating system gives it.
    /// An ordinary thread on Linux has 50 µs of timer slack beside. To miss no cycle, use [`Handle::cycle_after`].
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn next_cycle(&self, at_most: Duration) -> Result<Snapshot, WaitError> {
        self.cycle_after(self.state().slot, at_most)
    }

    /// Waits for a state that is newer than that of `slot`, and returns it. If there is one already, it does not wait. The newest state
    /// is returned: if its slot is not the next one, the caller was too slow, or the loop has missed slots.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn cycle_after(&self, slot: u64, at_most: Duration) -> Result<Snapshot, WaitError> {
        let deadline = self.deadline_after(at_most);
        loop {
            let has_ended = self.has_ended();
            let state = self.state();
            if state.slot > slot {
                return Ok(state);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.sleep_until_cycle(&state, self.period_ns(), &deadline)?;
        }
    }

    /// Waits until every group is in a phase.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_for(&self, phase: Phase, at_most: Duration) -> Result<(), WaitError> {
        let is_there = |state: &Snapshot| state.groups().iter().all(|group| group.phase == phase);
        self.wait_until(at_most, |state| is_there(state).then_some(()))
    }

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

    /// Waits until `find` finds something in a state. It looks at one state of each cycle, or of each millisecond if the period is
    /// shorter.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_until<T>(
        &self,
        at_most: Duration,
        mut find: impl FnMut(&Snapshot) -> Option<T>,
    ) -> Result<T, WaitError> {
        let deadline = self.deadline_after(at_most);
        let mut state = Snapshot::default();
        loop {
            // This is read before the state, so that the state includes the last cycle before the end.
            let has_ended = self.has_ended();
            self.0.observer.read(&mut state);
            if let Some(found) = find(&state) {
                return Ok(found);
            }
            if has_ended {
                return Err(WaitError::Ended);
            }
            self.sleep_until_look(&state, &deadline)?;
        }
    }

    /// Sleeps until a later state is expected, at least a millisecond later.
    pub(super) fn sleep_until_look(&self, state: &Snapshot, deadline: &Deadline) -> Result<(), WaitError> {
        let period_ns = self.period_ns().max(1);
        self.sleep_until_cycle(state, LOOK_NS.div_ceil(period_ns) * period_ns, deadline)
    }

    /// Sleeps until the state is expected that comes so long after this one.
    fn sleep_until_cycle(
        &self,
        state: &Snapshot,
        later_ns: Nanoseconds,
        deadline: &Deadline,
    ) -> Result<(), WaitError> {
        let now_ns = self.now_ns();
        if now_ns >= deadline.0 {
            return Err(WaitError::NotInTime);
        }
        if let Some(pace) = self.virtual_pace() {
            pace.step(1, &self.0.life);
            return Ok(());
        }
        let expected_ns = state.at_ns.saturating_add(later_ns).saturating_add(MARGIN_NS);
        let look_ns = expected_ns.max(now_ns.saturating_add(OVERDUE_NS));
        MonotonicClock::default().wait_until(look_ns.min(deadline.0));
        Ok(())
    }

    /// The period of the cycle.
    pub fn period_ns(&self) -> Nanoseconds {
        self.machine().cycle_ns
    }
}
