//! Following a target that moves: given anew in every cycle, with velocity and acceleration.
//!
//! Seen from the target, the axis has to come to rest at the origin, within limits that are shifted by the target's
//! velocity and acceleration. That is a problem like any other, and one without blocked intervals.

use super::error::PlanError;
use super::problem::{Limits, Problem, State};
use super::profile::Profile;
use super::synchronisation::{PlanOptions, Return, Synchronisation, synchronised};
use super::travel;

/// The share of the acceleration limits that a target may use; the rest is for catching up with it.
const ACCELERATION_SHARE: f64 = 0.95;

/// Relative to the velocity limits, being bound beyond them by this much is rounding.
const ROUNDING: f64 = 1e-12;

/// A velocity limit is come back to without going below it.
const SETTLED: PlanOptions = PlanOptions {
    synchronisation: Synchronisation::Time,
    minimum_duration_s: 0.0,
    cycle_s: None,
    return_to_limits: Return::Settled,
};

/// The share of the velocity limits that a target may use.
const VELOCITY_SHARE: f64 = 1.0 - 1e-9;

impl Problem {
    /// The state to command one cycle from now, on the way to a target that moves on as it does now.
    ///
    /// `target` is where the target is now, how fast and with what acceleration it moves; what it asks for beyond the
    /// limits is cut off at them. Called in every cycle with its last answer as the start, it follows any target that
    /// keeps the limits, with an error that stems from the change of the target's acceleration within a cycle only.
    /// The position limits are kept whenever a stop from the start keeps them, and from one cycle to the next the position
    /// changes by no more than the velocity limit allows.
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
        let target = self.feasible_target(cycle_s);
        let met = self.relative_step(&target, cycle_s)?;
        if self.keeps_step(&met, cycle_s) && self.can_go_on(&met)? {
            return Ok(met);
        }
        // The target is bound for a limit, and following it as closely as possible would be, too.
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

    /// The first cycle of the fastest way to meet the target and move with it, as seen from the target.
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

    /// Whether the position changes in the cycle by no more than the velocity limits allow.
    ///
    /// Seen from a target that accelerates, a velocity may swing and be back within the cycle; on the axis it must not.
    fn keeps_step(&self, next: &State, cycle_s: f64) -> bool {
        let Self { start, limits, .. } = self;
        let step = next.position - start.position;
        let rounding = ROUNDING * cycle_s * (limits.velocity_max - limits.velocity_min)
            + 4.0 * f64::EPSILON * start.position.abs();
        step <= cycle_s * limits.velocity_max.max(start.velocity) + rounding
            && step >= cycle_s * limits.velocity_min.min(start.velocity) - rounding
    }

    /// Whether the axis can keep its limits from this state on.
    fn can_go_on(&self, next: &State) -> Result<bool, PlanError> {
        let Self { start, limits, .. } = self;
        let bound_for = |state: &State| {
            let coming = 0.5 * state.acceleration * state.acceleration.abs() / limits.jerk_max;
            let highest = state.velocity + coming.max(0.0);
            let lowest = state.velocity + coming.min(0.0);
            (highest - limits.velocity_max).max(limits.velocity_min - lowest)
        };
        // From a start beyond a limit it is enough to come nearer.
        let rounding = ROUNDING * (limits.velocity_max - limits.velocity_min);
        if bound_for(next) > bound_for(start).max(rounding) {
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

    /// Whether the state is within the position limits, or at least no further out than the start.
    fn within_travel(&self, state: &State) -> bool {
        let Self { start, limits, .. } = self;
        state.position <= limits.position_max.max(start.position)
            && state.position >= limits.position_min.min(start.position)
    }

    /// The target, as far as the limits let the axis be there and move with it.
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
        // At a velocity limit, or beyond it after the cycle, the acceleration is none the axis could follow.
        let within = (slowest..=fastest).contains(&(velocity + acceleration * cycle_s));
        let follows = within && velocity == target.velocity && !limits.is_second_order();
        State { position, velocity, acceleration: if follows { acceleration } else { 0.0 } }
    }
}
