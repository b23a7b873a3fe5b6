//! Motions that are under way, and how they end.

use std::time::Duration;

use takt_rt::{Answer, MotionState, RequestId, RequestTarget, Snapshot};

use super::Handle;
use super::error::{MotionError, Refused, Stopped, WaitError};

/// Bits of the number of a motion for its group: there are fewer than 255 groups, and no run makes 2⁵⁶ requests.
const TARGET_BITS: u32 = 8;

/// Identifies a motion, or a change of the mode, for [`Handle::wait`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MotionId {
    pub(super) request: RequestId,
    /// Which stops discard it.
    pub(super) target: RequestTarget,
}

impl MotionId {
    /// The request that began it.
    pub const fn request(self) -> RequestId {
        self.request
    }

    /// It as one number, for programs in other languages.
    pub fn to_number(self) -> u64 {
        let target = match self.target {
            RequestTarget::All => 0,
            RequestTarget::Group(group) => u64::from(group) + 1,
        };
        self.request.0 << TARGET_BITS | target
    }

    /// The motion of [`MotionId::to_number`].
    pub fn from_number(number: u64) -> Self {
        let target = match number & ((1 << TARGET_BITS) - 1) {
            0 => RequestTarget::All,
            group => RequestTarget::Group((group - 1) as u8),
        };
        Self { request: RequestId(number >> TARGET_BITS), target }
    }
}

/// Parameters of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveOptions {
    /// Fraction of the velocity limits, above 0 up to 1.
    pub velocity_scale: f64,
    /// Fraction of the acceleration and jerk limits, above 0 up to 1.
    pub acceleration_scale: f64,
    /// The shortest duration of the move, in seconds.
    pub minimum_duration_s: f64,
}

impl Default for MoveOptions {
    fn default() -> Self {
        Self { velocity_scale: 1.0, acceleration_scale: 1.0, minimum_duration_s: 0.0 }
    }
}

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
        self.result_in(&self.state(), motion).or_else(|| has_ended.then_some(Err(MotionError::Ended)))
    }

    /// How a motion has ended, by a state.
    fn result_in(
        &self,
        state: &Snapshot,
        MotionId { request, target }: MotionId,
    ) -> Option<Result<(), MotionError>> {
        let machine = self.machine();
        let result = match (state.motions.of(request), state.answers.of(request)) {
            (Some(MotionState::InProgress), _) => return None,
            (Some(MotionState::Finished), _) => Ok(()),
            (Some(MotionState::Stopped(reason)), _) => Err(Stopped::new(reason, machine).into()),
            (Some(MotionState::Replaced { .. }), _) => Err(MotionError::Replaced),
            (None, Answer::Rejected(refusal)) => Err(Refused::new(refusal, machine).into()),
            (None, Answer::Granted) => Err(MotionError::Forgotten),
            (None, Answer::None) if state.answers.have_forgotten(request) => Err(MotionError::Forgotten),
            (None, Answer::None) if self.is_discarded(target, request, state) => Err(MotionError::Overtaken),
            (None, Answer::None) => return None,
        };
        Some(result)
    }

    /// The fault that has stopped a group and has not been reset: the first, of several groups.
    pub fn fault(&self) -> Option<Stopped> {
        self.fault_of(&self.state(), |_| true)
    }

    /// The fault that has stopped one of these groups.
    pub(super) fn fault_of(&self, state: &Snapshot, is_meant: impl Fn(usize) -> bool) -> Option<Stopped> {
        let groups = state.groups().iter().enumerate().filter(|(group, _)| is_meant(*group));
        let faults = groups.filter_map(|(_, group)| group.stop).filter(|stop| !stop.is_requested());
        faults.min_by_key(|stop| stop.slot).map(|stop| Stopped::new(stop, self.machine()))
    }

    /// Whether a stop has discarded a request that has no answer in this state.
    pub(super) fn is_discarded(&self, target: RequestTarget, request: RequestId, state: &Snapshot) -> bool {
        let stop = self.0.clients.newest_stop(target);
        // Every request that was taken before the stop has its answer in the first state that has that of the stop.
        let has_stopped = state.answers.of(stop) != Answer::None || state.answers.have_forgotten(stop);
        request < stop && has_stopped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_comes_back_from_its_number() {
        for target in [RequestTarget::All, RequestTarget::Group(0), RequestTarget::Group(7)] {
            for request in [1, 77, (1 << 56) - 1] {
                let motion = MotionId { request: RequestId(request), target };
                assert_eq!(MotionId::from_number(motion.to_number()), motion);
            }
        }
    }
}
