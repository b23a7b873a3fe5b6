//! Two-step motions that only rounding makes impossible.
//!
//! A two-step motion takes the acceleration straight to one value, holds it there if that is the limit, and takes it straight to
//! that of the target (UD: the first three phases of ACC0 or NONE). It leaves the axis no choice: its start must lie on a
//! surface in the space of position, velocity and acceleration. The last phases of every motion are such a motion.
//!
//! An axis that is planned again in every cycle drifts off that surface by the rounding of each cycle. Where it passes its
//! target at speed, the next exact motion to the target is a long detour. So a state from which the target would be met
//! without the drift counts as on the surface.
//!
//! How far a state may have drifted depends on where it came from, not on the rest of its way. The measure is the distance to
//! brake from the largest velocity. The drift of the velocities matters more for a smaller peak of the acceleration, which
//! grows with their root. So if the two-step motion that meets the velocity misses the position, the next one that meets
//! the position is taken, as far as the drift of the velocities explains the difference.

use super::super::choice::{larger, smaller};
use super::ROUNDING;
use super::motion::{Motion, SevenPhases, VelocityStep, square_positive};

/// How far a state may have drifted over many cycles of sampling and planning.
struct Drift {
    distance: f64,
    velocity: f64,
    /// The most by which the drift of the velocities changes the times of both steps.
    times: f64,
}

impl Drift {
    /// The drift in this motion, whose distance has this rounding error besides.
    fn of(motion: &Motion, rounding: f64) -> Self {
        let Motion { a0, af, vmax, vmin, up, down, .. } = *motion;
        let speed = vmax.max(-vmin);
        let limit = smaller(up, down);
        let braking_distance = speed * VelocityStep::over(speed, limit).duration();
        let velocity = ROUNDING * (vmax - vmin + a0 * a0 + af * af);
        Self {
            distance: rounding + ROUNDING * braking_distance,
            velocity,
            // The times grow with the velocity step ever more slowly, so they grow most from zero on.
            times: VelocityStep::over(2.0 * velocity, limit).duration(),
        }
    }
}

/// A two-step motion: up to an acceleration, which is held if it is the limit, and down from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoStep {
    /// True if this is the mirror image: down, hold, up. Then all other fields are mirrored too.
    mirrored: bool,
    /// The acceleration between both steps. It is negative where a deceleration becomes less and then more again.
    peak: f64,
    hold: f64,
}

/// All two-step motions of one problem whose peak has one sign.
///
/// Each step is a phase of full jerk. Count its time from where its acceleration is zero, or would be zero if the step were
/// longer. The sum of both times is proportional to the distance.
struct TwoSteps {
    mirrored: bool,
    /// 1 or −1.
    sign: f64,
    /// The velocities between which both steps lead, counted where the acceleration is zero.
    first: f64,
    last: f64,
    /// The smallest and the largest velocity step to which the real one may have drifted.
    low: f64,
    high: f64,
}

impl TwoSteps {
    /// The two-step motions of this motion or its mirror image; `None` if their peak cannot have this sign.
    #[inline]
    fn of(motion: &Motion, mirrored: bool, sign: f64, drift: &Drift) -> Option<Self> {
        let Motion { a0, af, v0, vf, .. } = *motion;
        let (side, outer) = if mirrored { (-1.0, -smaller(a0, af)) } else { (1.0, larger(a0, af)) };
        let (first, last) = (side * v0 - 0.5 * a0 * a0, side * vf + 0.5 * af * af);
        let step = last - first;
        // Both accelerations must be below the peak. Until the limit is reached, the velocity step is the square of the peak.
        let (least, most) =
            if sign > 0.0 { (square_positive(outer), f64::INFINITY) } else { (0.0, -outer * outer.abs()) };
        let (low, high) = (larger(step - drift.velocity, least), smaller(step + drift.velocity, most));
        (low <= high).then_some(Self { mirrored, sign, first, last, low, high })
    }

    /// The two-step motion that explains `fastest` as a detour, and its duration.
    #[inline(never)]
    fn explaining(&self, motion: &Motion, drift: &Drift, fastest: f64) -> Option<(TwoStep, f64)> {
        let (two_step, error, duration) = self.nearest(motion, drift)?;
        // At rest, an error of the distance costs its third root in time. That is no detour.
        let lost = fastest - duration;
        let is_detour = lost * lost * lost > DETOUR * (error + f64::EPSILON * drift.distance);
        (error <= drift.distance && is_detour).then_some((two_step, duration))
    }

    /// The two-step motion that is nearest to the wanted distance, its error of the distance, and its duration; `None` if it
    /// is further away than any drift.
    fn nearest(&self, motion: &Motion, drift: &Drift) -> Option<(TwoStep, f64, f64)> {
        let Self { mirrored, sign, first, last, low, high } = *self;
        let Motion { a0, af, up, distance, .. } = if mirrored { motion.mirrored() } else { *motion };
        let limit = if sign > 0.0 { up } else { f64::INFINITY };
        let speed = 0.5 * (first + last);
        let beside = first * a0 + a0 * a0 * a0 / 6.0 + last * af - af * af * af / 6.0;
        let times = |step: f64| sign * VelocityStep::over(step, limit).duration();
        let exact = times((last - first).clamp(low, high));
        let miss = |times: f64| speed * times - beside - distance;
        // Nearly every motion misses by far more than its drift.
        if miss(exact).abs() > 2.0 * (drift.distance + speed.abs() * drift.times) {
            return None;
        }
        // The velocities are changed no more than needed, because that change is drift in the next cycle.
        let tolerated = 0.5 * drift.distance;
        let beyond = miss(exact) - miss(exact).clamp(-tolerated, tolerated);
        let times = if beyond == 0.0 {
            exact
        } else {
            let (one, other) = (times(low), times(high));
            (exact - beyond / speed).min(one.max(other)).max(one.min(other))
        };
        let peak = (0.5 * times).min(limit);
        let two_step = TwoStep { mirrored, peak, hold: times - 2.0 * peak };
        Some((two_step, miss(times).abs(), times - a0 - af))
    }
}

impl TwoStep {
    /// The phases from start to target of the motion.
    pub(super) fn phases(&self, motion: &Motion) -> SevenPhases {
        let seen = if self.mirrored { motion.mirrored() } else { *motion };
        let phases = SevenPhases {
            durations: [self.peak - seen.a0, self.hold, self.peak - seen.af, 0.0, 0.0, 0.0, 0.0],
            jerks: [1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0],
        };
        if self.mirrored { phases.mirrored() } else { phases }
    }
}

/// The two-step motion that would be the fastest one without drift, and its duration; `None` if `fastest`, the duration of
/// the fastest exact motion, is no detour in place of it. `rounding` is the rounding error of the distance.
pub(super) fn but_for_drift(motion: &Motion, rounding: f64, fastest: f64) -> Option<(TwoStep, f64)> {
    let drift = Drift::of(motion, rounding);
    let explained = |mirrored: bool, sign: f64| {
        TwoSteps::of(motion, mirrored, sign, &drift)?.explaining(motion, &drift, fastest)
    };
    let seen = earlier(explained(false, 1.0), explained(false, -1.0));
    earlier(seen, earlier(explained(true, 1.0), explained(true, -1.0)))
}

/// The motion with the shorter duration.
#[inline]
fn earlier(one: Option<(TwoStep, f64)>, other: Option<(TwoStep, f64)>) -> Option<(TwoStep, f64)> {
    match (one, other) {
        (Some(a), Some(b)) if b.1 < a.1 => other,
        _ => one.or(other),
    }
}

/// The third power of the duration of a motion from rest to rest with full jerk (UDDU without plateaus), divided by its
/// distance.
const DETOUR: f64 = 32.0;
