//! Tracking: following a moving target that comes with a velocity and an acceleration in every cycle.
//!
//! In the frame of the target, the axis must come to rest at the origin. The limits there are shifted by the velocity and the
//! acceleration of the target. That is an ordinary planning problem, without blocked intervals.

use super::error::PlanError;
use super::options::{PlanOptions, Return, Synchronisation};
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::synchronisation::synchronised;
use super::travel;

/// The share of the acceleration limits that a target may use. The axis needs the rest to catch up with the target.
const ACCELERATION_SHARE: f64 = 0.95;

/// A velocity that will exceed its limits by this much, relative to their width, exceeds them by rounding only.
const ROUNDING: f64 = 1e-12;

/// The timing of a tracked motion: a velocity beyond its limit comes back to the limit without falling below it.
const SETTLED: PlanOptions = PlanOptions {
    synchronisation: Synchronisation::Time,
    minimum_duration_s: 0.0,
    cycle_s: None,
    return_to_limits: Return::Settled,
};

/// The share of the velocity limits that a target may use.
const VELOCITY_SHARE: f64 = 1.0 - 1e-9;

impl Problem {
    /// The state to command one cycle (`cycle_s`, in s, positive and finite) from now, on the way to a moving target.
    ///
    /// `target` is the present position, velocity and acceleration of the target; the acceleration is taken as constant. A
    /// target beyond the limits is cut off at them.
    ///
    /// Call this in every cycle, with the last result as the start. Then the axis follows any target that keeps the limits.
    /// The remaining error comes only from the change of the target's acceleration within one cycle. The position limits are
    /// kept whenever a stop from the start keeps them. From one cycle to the next the position changes by no more than the
    /// velocity limit allows.
    ///
    /// # Errors
    /// [`PlanError::InvalidTiming`] for a cycle that is not positive and finite; otherwise as [`synchronised`], with axis 0.
    pub fn track(&self, cycle_s: f64) -> Result<State, PlanError> {
        if !(cycle_s > 0.0 && cycle_s.is_finite()) {
            return Err(PlanError::InvalidTiming);
        }
        self.validate().or_else(|error| match error {
            // `feasible_target` cuts the target off at the limits.
            PlanError::TargetBeyondLimit { .. } => Ok(()),
            other => Err(other),
        })?;
        let target = self.feasible_target(cycle_s);
        let met = self.relative_step(&target, cycle_s)?;
        if self.keeps_step(&met, cycle_s) && self.can_go_on(&met)? {
            return Ok(met);
        }
        // The target moves towards a limit, and so would an axis that follows it as closely as possible.
        let mut profile = Profile::hold(0.0);
        let waypoint = State { acceleration: 0.0, ..target.after(cycle_s) };
        let absolute = Self { target: self.within_limits(&waypoint), ..*self };
        let planned = synchronised(&[absolute], core::slice::from_mut(&mut profile), SETTLED);
        let next = profile.sample(cycle_s);
        if planned.is_ok() && self.can_go_on(&next)? {
            return Ok(next);
        }
        travel::stop_within(self.start, &self.limits, &mut profile)?;
        Ok(profile.sample(cycle_s))
    }

    /// The first cycle of the fastest motion to the target, planned in the frame of the target.
    fn relative_step(&self, now: &State, cycle_s: f64) -> Result<State, PlanError> {
        let Self { start, limits, .. } = self;
        let then = now.after(cycle_s);
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
        let mut profile = Profile::hold(0.0);
        synchronised(&[seen], core::slice::from_mut(&mut profile), SETTLED)?;
        let relative = profile.sample(cycle_s);
        Ok(State {
            position: then.position + relative.position,
            velocity: then.velocity + relative.velocity,
            acceleration: then.acceleration + relative.acceleration,
        })
    }

    /// Returns `true` if the position changes in the cycle by no more than the velocity limits allow.
    ///
    /// In the frame of an accelerating target the velocity may rise and fall again within the cycle. On the axis it must
    /// not exceed its limit meanwhile.
    fn keeps_step(&self, next: &State, cycle_s: f64) -> bool {
        let Self { start, limits, .. } = self;
        let step = next.position - start.position;
        let rounding = ROUNDING * cycle_s * (limits.velocity_max - limits.velocity_min)
            + 4.0 * f64::EPSILON * start.position.abs();
        step <= cycle_s * limits.velocity_max.max(start.velocity) + rounding
            && step >= cycle_s * limits.velocity_min.min(start.velocity) - rounding
    }

    /// Returns `true` if the axis can still keep its limits after this state.
    fn can_go_on(&self, next: &State) -> Result<bool, PlanError> {
        let Self { start, limits, .. } = self;
        let excess_ahead = |state: &State| {
            let coming = 0.5 * state.acceleration * state.acceleration.abs() / limits.jerk_max;
            let highest = state.velocity + coming.max(0.0);
            let lowest = state.velocity + coming.min(0.0);
            (highest - limits.velocity_max).max(limits.velocity_min - lowest)
        };
        // For a start beyond a limit it is enough to come nearer to the limit.
        let rounding = ROUNDING * (limits.velocity_max - limits.velocity_min);
        if excess_ahead(next) > excess_ahead(start).max(rounding) {
            return Ok(false);
        }
        let mut profile = Profile::hold(0.0);
        travel::stop_within(*next, limits, &mut profile)?;
        Ok(travel::limit_left(&Self { start: *next, ..*self }, &profile).is_none()
            && self.within_travel(next))
    }

    /// The state with its velocity cut off at the limits.
    fn within_limits(&self, state: &State) -> State {
        let Limits { velocity_max, velocity_min, .. } = self.limits;
        State { velocity: state.velocity.clamp(velocity_min, velocity_max), ..*state }
    }

    /// Returns `true` if the state is within the position limits, or not further out than the start.
    fn within_travel(&self, state: &State) -> bool {
        let Self { start, limits, .. } = self;
        state.position <= limits.position_max.max(start.position)
            && state.position >= limits.position_min.min(start.position)
    }

    /// The target, cut off where the limits do not let the axis be there or move with it.
    fn feasible_target(&self, cycle_s: f64) -> State {
        let Self { target, limits, .. } = self;
        let position = target.position.clamp(limits.position_min, limits.position_max);
        if position != target.position {
            return State::rest(position);
        }
        let (fastest, slowest) = (VELOCITY_SHARE * limits.velocity_max, VELOCITY_SHARE * limits.velocity_min);
        let velocity = target.velocity.clamp(slowest, fastest);
        let acceleration = target.acceleration.clamp(
            ACCELERATION_SHARE * limits.acceleration_min,
            ACCELERATION_SHARE * limits.acceleration_max,
        );
        // The axis cannot follow an acceleration that leads beyond a velocity limit within the cycle.
        let within = (slowest..=fastest).contains(&(velocity + acceleration * cycle_s));
        let follows = within && velocity == target.velocity && !limits.is_second_order();
        State { position, velocity, acceleration: if follows { acceleration } else { 0.0 } }
    }
}
