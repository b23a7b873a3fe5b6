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

use super::ROUNDING;
use super::motion::{Motion, SevenPhases, VelocityStep, square_positive};

/// How far a state may have drifted over many cycles of sampling and planning.
struct Drift {
    distance: f64,
    velocity: f64,
}

impl Drift {
    /// The drift in this motion, whose distance has this rounding error besides.
    fn of(motion: &Motion, rounding: f64) -> Self {
        let Motion { a0, af, vmax, vmin, up, down, .. } = *motion;
        let speed = vmax.max(-vmin);
        let braking_distance = speed * VelocityStep::over(speed, up.min(down)).duration();
        Self {
            distance: rounding + ROUNDING * braking_distance,
            velocity: ROUNDING * (vmax - vmin + a0 * a0 + af * af),
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
struct TwoSteps<'a> {
    motion: &'a Motion,
    mirrored: bool,
    /// 1 or −1.
    sign: f64,
}

impl TwoSteps<'_> {
    /// The two-step motion that is nearest to the wanted distance, its error of the distance, and its duration.
    fn nearest(&self, drift: &Drift) -> Option<(TwoStep, f64, f64)> {
        let Motion { a0, vf, af, up, distance, .. } = *self.motion;
        let (first, last) = (self.motion.start_root(), vf + 0.5 * af * af);
        let outer = a0.max(af);
        // Both accelerations must be below the peak. Until the limit is reached, the velocity step is the square of the peak.
        let (least, most, limit) = if self.sign > 0.0 {
            (square_positive(outer), f64::INFINITY, up)
        } else {
            (0.0, -outer * outer.abs(), f64::INFINITY)
        };
        let step = last - first;
        let (low, high) = ((step - drift.velocity).max(least), (step + drift.velocity).min(most));
        if low > high {
            return None;
        }
        let speed = 0.5 * (first + last);
        let beside = first * a0 + a0 * a0 * a0 / 6.0 + last * af - af * af * af / 6.0;
        let times = |step: f64| self.sign * VelocityStep::over(step, limit).duration();
        let exact = times(step.clamp(low, high));
        let miss = |times: f64| speed * times - beside - distance;
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
        let two_step = TwoStep { mirrored: self.mirrored, peak, hold: times - 2.0 * peak };
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
    let mirrored = motion.mirrored();
    let seen = [(motion, false), (&mirrored, true)];
    let motions = seen.into_iter().flat_map(|(motion, mirrored)| {
        [1.0, -1.0].map(|sign| TwoSteps { motion, mirrored, sign }.nearest(&drift))
    });
    let explained = motions.flatten().filter(|(_, error, duration)| {
        // At rest, an error of the distance costs its third root in time. That is no detour.
        let lost = fastest - duration;
        *error <= drift.distance && lost * lost * lost > DETOUR * (error + f64::EPSILON * drift.distance)
    });
    explained
        .map(|(two_step, _, duration)| (two_step, duration))
        .min_by(|one, other| one.1.total_cmp(&other.1))
}

/// The third power of the duration of a motion from rest to rest with full jerk (UDDU without plateaus), divided by its
/// distance.
const DETOUR: f64 = 32.0;
