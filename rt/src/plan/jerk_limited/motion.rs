//! The problem without units. Time is counted in `amax/J`, so the jerk limit and the upper acceleration limit are one.
//!
//! The same motion in radians, degrees or encoder counts then has the same numbers, and all tolerances are relative.

use super::super::problem::{Limits, State};

/// A problem without units: from a start within the limits, over a distance, to a target. The jerk limit is one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) distance: f64,
    pub(super) v0: f64,
    pub(super) a0: f64,
    pub(super) vf: f64,
    pub(super) af: f64,
    pub(super) vmax: f64,
    pub(super) vmin: f64,
    /// Largest acceleration.
    pub(super) up: f64,
    /// Largest deceleration, positive.
    pub(super) down: f64,
}

/// The sizes of the units of time, acceleration, velocity and distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) time_s: f64,
    pub(super) acceleration: f64,
    pub(super) velocity: f64,
    pub(super) distance: f64,
}

impl Scale {
    pub(super) fn of(limits: &Limits) -> Self {
        let acceleration = limits.acceleration_max;
        let time_s = acceleration / limits.jerk_max;
        let velocity = acceleration * time_s;
        Self { time_s, acceleration, velocity, distance: velocity * time_s }
    }

    /// The problem from this state over this distance. The position of the state is not read.
    pub(super) fn motion(&self, start: &State, distance: f64, target: &State, limits: &Limits) -> Motion {
        let (per_velocity, per_acceleration) = (1.0 / self.velocity, 1.0 / self.acceleration);
        Motion {
            distance: distance / self.distance,
            v0: start.velocity * per_velocity,
            a0: start.acceleration * per_acceleration,
            vf: target.velocity * per_velocity,
            af: target.acceleration * per_acceleration,
            vmax: limits.velocity_max * per_velocity,
            vmin: limits.velocity_min * per_velocity,
            up: 1.0,
            down: -limits.acceleration_min * per_acceleration,
        }
    }
}

impl Motion {
    /// The mirror image: positive and negative direction are exchanged, and every jerk changes its sign.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            distance: -self.distance,
            v0: -self.v0,
            a0: -self.a0,
            vf: -self.vf,
            af: -self.af,
            vmax: -self.vmin,
            vmin: -self.vmax,
            up: self.down,
            down: self.up,
        }
    }

    /// The motion backwards in time: velocities and jerks change their signs, accelerations do not.
    pub(super) fn reversed(&self) -> Self {
        Self {
            distance: -self.distance,
            v0: -self.vf,
            a0: self.af,
            vf: -self.v0,
            af: self.a0,
            vmax: -self.vmin,
            vmin: -self.vmax,
            up: self.up,
            down: self.down,
        }
    }

    /// The velocity that the axis reaches if it takes its start acceleration to zero at once.
    pub(super) fn velocity_behind_start(&self) -> f64 {
        self.v0 + 0.5 * self.a0 * self.a0.abs()
    }

    /// The velocity from which the axis reaches the target by building up the target acceleration at once.
    pub(super) fn velocity_before_target(&self) -> f64 {
        self.vf - 0.5 * self.af * self.af.abs()
    }

    /// The velocity at which the first phase of positive jerk has zero acceleration, or would have it if it were longer.
    pub(super) fn start_root(&self) -> f64 {
        self.v0 - 0.5 * self.a0 * self.a0
    }

    /// The velocity at which the last phase of positive jerk has zero acceleration, or would have it if it were longer.
    pub(super) fn target_root(&self) -> f64 {
        self.vf - 0.5 * self.af * self.af
    }

    /// The distance beside the motion between the two roots: of the last phase behind its root, less that of the first phase
    /// before its root.
    pub(super) fn arcs_distance(&self) -> f64 {
        let before = self.a0 * (self.start_root() + self.a0 * self.a0 / 6.0);
        let behind = self.af * (self.target_root() + self.af * self.af / 6.0);
        behind - before
    }
}

/// `x²` where `x` is positive, else 0.
pub(super) fn square_positive(x: f64) -> f64 {
    if x > 0.0 { x * x } else { 0.0 }
}

/// The fastest change of the velocity from zero to zero acceleration: jerk up (U), hold, jerk down (D).
#[derive(Clone, Copy, Debug)]
pub(super) struct VelocityStep {
    /// The acceleration that is reached; also the duration of each of the two phases of jerk.
    pub(super) peak: f64,
    /// How long the acceleration is held.
    pub(super) hold: f64,
}

impl VelocityStep {
    /// The change by `step`, with accelerations up to `limit`.
    #[inline]
    pub(super) fn over(step: f64, limit: f64) -> Self {
        if step > limit * limit {
            Self { peak: limit, hold: step / limit - limit }
        } else {
            Self { peak: libm::sqrt(step.max(0.0)), hold: 0.0 }
        }
    }

    #[inline]
    pub(super) fn duration(&self) -> f64 {
        2.0 * self.peak + self.hold
    }
}

/// Seven phases of constant jerk: the profile of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct SevenPhases {
    pub(super) durations: [f64; 7],
    pub(super) jerks: [f64; 7],
}

impl SevenPhases {
    /// The same with positive and negative direction exchanged.
    pub(super) fn mirrored(mut self) -> Self {
        self.jerks = self.jerks.map(|jerk| -jerk);
        self
    }

    /// The same backwards in time.
    pub(super) fn reversed(mut self) -> Self {
        self.durations.reverse();
        self.jerks.reverse();
        self.mirrored()
    }
}
