//! Motions that are under way, and how they end.

use std::time::Duration;

use takt_rt::{RequestId, RequestTarget, Snapshot};

use super::Handle;
use crate::command::{MotionError, MotionId, RunningController, Stopped, WaitError, motion};

impl Handle {
    /// Waits until a motion has reached its targets: until the axes are at rest there, or a velocity or torque is reached. The
    /// result is that of this motion, independent of what the group did before and after it. It comes with the cycle in which the
    /// motion ends, however it ends: done, replaced, stopped or refused.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn wait(&self, motion: MotionId, at_most: Duration) -> Result<(), MotionError> {
        match self.wait_until(at_most, |state| self.result_in(state, motion)) {
            Ok(result) => result,
            Err(WaitError::NotInTime) => Err(MotionError::NotInTime),
            Err(WaitError::Ended) => Err(MotionError::Ended),
        }
    }

    /// How a motion has ended; `None` while it is under way. Does not wait.
    pub fn result_of(&self, motion: MotionId) -> Option<Result<(), MotionError>> {
        let has_ended = self.has_ended();
        let result = self.0.observer.look(|state| self.result_in(state, motion));
        result.or_else(|| has_ended.then_some(Err(MotionError::Ended)))
    }

    /// How a motion has ended, by a state.
    fn result_in(
        &self,
        state: &Snapshot,
        MotionId { request, target }: MotionId,
    ) -> Option<Result<(), MotionError>> {
        motion::result_in(state, request, self.0.clients.newest_stop(target), self.machine())
    }

    /// The fault that has stopped a group and has not been reset: the first, of several groups.
    pub fn fault(&self) -> Option<Stopped> {
        self.fault_in(RequestTarget::All)
    }

    /// Returns `true` if a stop has discarded a request that has no answer in this state.
    pub(super) fn is_discarded(&self, target: RequestTarget, request: RequestId, state: &Snapshot) -> bool {
        motion::is_discarded(state, request, self.0.clients.newest_stop(target))
    }
}
