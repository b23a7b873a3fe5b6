//! Following a target that moves: given anew in every cycle, with velocity and acceleration.
//!
//! Seen from the target, the axis has to come to rest at the origin, within limits that are shifted by the target's
//! velocity and acceleration. That is a problem like any other, and one without blocked intervals.

use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::synchronisation::{Return, Timing, synchronised};
use super::travel;

/// The share of the acceleration limits that a target may use; the rest is for catching up with it.
const ACCELERATION_SHARE: f64 = 0.95;

/// The share of the velocity limits that a target may use.
const VELOCITY_SHARE: f64 = 1.0 - 1e-9;

impl Problem {
    /// The state to command one cycle from now, on the way to a target that moves on as it does now.
    ///
    /// `target` is where the target is now, how fast and with what acceleration it moves; what it asks for beyond the
    /// limits is cut off at them. Called in every cycle with its last answer as the start, it follows any target that
    /// keeps the limits, with an error that stems from the change of the target's acceleration within a cycle only.
    /// The position limits are kept whenever a stop from the start keeps them.
    ///
    /// # Errors
    /// As [`synchronised`], with axis 0.
    pub fn track(&self, cycle_s: f64) -> Result<State, PlanError> {
        if !(cycle_s > 0.0 && cycle_s.is_finite()) {
            return Err(PlanError::InvalidTiming);
        }
        self.validate().or_else(|error| match error {
            // The target is cut off at the limits.
            PlanError::TargetBeyondLimit { .. } => Ok(()),
            other => Err(other),
        })?;
        let now = self.feasible_target();
        let then = moved(&now, cycle_s);
        let Self { start, limits, .. } = self;
        let seen = Self {
            start: State {
                position: start.position - now.position,
                velocity: start.velocity - now.velocity,
                acceleration: start.acceleration - now.acceleration,
            },
            target: State::rest(0.0),
            limits: Limits::asymmetric(
                limits.velocity_max - now.velocity.max(then.velocity),
                limits.velocity_min - now.velocity.min(then.velocity),
                limits.acceleration_max - now.acceleration,
                limits.acceleration_min - now.acceleration,
                limits.jerk_max,
            ),
        };
        let mut profile = [Profile::hold(0.0)];
        let timing = Timing { return_to_limits: Return::Settled, ..Timing::default() };
        synchronised(&[seen], &mut profile, timing)?;
        let [mut profile] = profile;
        let relative = profile.sample(cycle_s);
        let next = State {
            position: then.position + relative.position,
            velocity: then.velocity + relative.velocity,
            acceleration: then.acceleration + relative.acceleration,
        };
        // Whoever can stop behind the next cycle can do so before it, too.
        travel::stop_within(next, limits, &mut profile)?;
        if travel::limit_left(&Self { start: next, ..*self }, &profile).is_none() && self.within_travel(&next)
        {
            return Ok(next);
        }
        travel::stop_within(*start, limits, &mut profile)?;
        Ok(profile.sample(cycle_s))
    }

    /// Whether the state is within the position limits, or at least no further out than the start.
    fn within_travel(&self, state: &State) -> bool {
        let Self { start, limits, .. } = self;
        state.position <= limits.position_max.max(start.position)
            && state.position >= limits.position_min.min(start.position)
    }

    /// The target, as far as the limits let the axis be there and move with it.
    fn feasible_target(&self) -> State {
        let Self { target, limits, .. } = self;
        let position = target.position.clamp(limits.position_min, limits.position_max);
        if position != target.position {
            return State::rest(position);
        }
        let (max, min) = (VELOCITY_SHARE * limits.velocity_max, VELOCITY_SHARE * limits.velocity_min);
        let velocity = target.velocity.clamp(min, max);
        let acceleration =
            if velocity == target.velocity && !limits.is_second_order() { target.acceleration } else { 0.0 };
        let (max, min) =
            (ACCELERATION_SHARE * limits.acceleration_max, ACCELERATION_SHARE * limits.acceleration_min);
        State { position, velocity, acceleration: acceleration.clamp(min, max) }
    }
}

/// Where a target with constant acceleration is after this time.
fn moved(target: &State, time_s: f64) -> State {
    let State { position, velocity, acceleration } = *target;
    State {
        position: position + time_s * (velocity + 0.5 * acceleration * time_s),
        velocity: velocity + acceleration * time_s,
        acceleration,
    }
}
