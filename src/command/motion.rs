//! Motions that are under way, and how they end.

use takt_rt::{Answer, MotionState, RequestId, RequestTarget, Snapshot};

use super::error::{MotionError, Refused, Stopped};
use crate::telemetry::Machine;

/// Bits of the number of a motion for its group: there are fewer than 255 groups, and no run makes 2⁵⁶ requests.
const TARGET_BITS: u32 = 8;

/// Identifies a motion, or a change of the mode, for [`Handle::wait`](crate::Handle::wait).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bitcode::Encode, bitcode::Decode)]
pub struct MotionId {
    pub(crate) request: RequestId,
    /// Which stops discard it.
    pub(crate) target: RequestTarget,
}

impl MotionId {
    /// The request that began it.
    pub const fn request(self) -> RequestId {
        self.request
    }

    /// The axes that it was asked for.
    pub const fn target(self) -> RequestTarget {
        self.target
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
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
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

/// How far a trajectory is.
#[derive(Clone, Copy, Debug, PartialEq, bitcode::Encode, bitcode::Decode)]
#[non_exhaustive]
pub struct TrajectoryProgress {
    /// The time on the path, in seconds: that of the point that is passed now.
    pub path_s: f64,
    /// The time of its last point.
    pub of_s: f64,
    /// Seconds of the path in a second: 1 as it was written, 0 while it is paused.
    pub rate: f64,
}

/// Returns the result of a motion, by a state; `None` while it is under way. `newest_stop` is the newest stop that the real-time thread has taken
/// of those that concern the request.
pub fn result_in(
    state: &Snapshot,
    request: RequestId,
    newest_stop: RequestId,
    machine: &Machine,
) -> Option<Result<(), MotionError>> {
    let result = match (state.motions.of(request), state.answers.of(request)) {
        (Some(MotionState::InProgress), _) => return None,
        (Some(MotionState::Finished), _) => Ok(()),
        (Some(MotionState::Stopped(reason)), _) => Err(Stopped::new(reason, machine).into()),
        (Some(MotionState::Replaced { .. }), _) => Err(MotionError::Replaced),
        (None, Answer::Rejected(refusal)) => Err(Refused::new(refusal, machine).into()),
        (None, Answer::Granted) => Err(MotionError::Forgotten),
        (None, Answer::None) if state.answers.have_forgotten(request) => Err(MotionError::Forgotten),
        (None, Answer::None) if is_discarded(state, request, newest_stop) => Err(MotionError::Overtaken),
        (None, Answer::None) => return None,
    };
    Some(result)
}

/// Returns `true` if a stop has discarded a request that has no answer in this state. `newest_stop` is the newest one that the real-time
/// thread has taken of those that concern the request.
pub(crate) fn is_discarded(state: &Snapshot, request: RequestId, newest_stop: RequestId) -> bool {
    // Every request that was taken before the stop has its answer in the first state that has that of the stop.
    let has_stopped =
        state.answers.of(newest_stop) != Answer::None || state.answers.have_forgotten(newest_stop);
    request < newest_stop && has_stopped
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
