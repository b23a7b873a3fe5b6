//! Motions that only rounding denies.
//!
//! With an acceleration that goes straight to one value, stays there if it is the limit, and goes straight on to that of the
//! target, an axis has nothing left to choose: the three numbers of its state must lie on a surface. Such [`Turn`]s
//! are the last two phases of every motion. Planned anew in every cycle, the state drifts off that surface by the
//! rounding of each cycle, and where it passes the target at speed, the next motion that meets it exactly has to go
//! round again. So a state from which the target would be met but for that drift counts as on the surface.
//!
//! How far it may have drifted depends on where it came from, not on how little is left of its way: the measure is the
//! distance to brake from the largest velocity. What the velocities have drifted weighs the more the smaller the
//! acceleration at the turn, for that grows with their root. So where the turn that meets the velocity does not meet the
//! position as nearly, it is the next one that does, as far as the drift of the velocities explains it.

use super::ROUNDING;
use super::motion::{Motion, Shape, Swing, square_positive};
use super::step1::Edges;

/// How far many cycles of sampling and planning may have led a state astray.
struct Drift {
    distance: f64,
    velocity: f64,
}

impl Drift {
    fn of(edges: &Edges) -> Self {
        let Motion { a0, af, vmax, vmin, up, down, .. } = edges.motion;
        let speed = vmax.max(-vmin);
        let braking_distance = speed * Swing::over(speed, up.min(down)).duration();
        Self {
            distance: edges.rounding + ROUNDING * braking_distance,
            velocity: ROUNDING * (vmax - vmin + a0 * a0 + af * af),
        }
    }
}

/// Up to an acceleration, which is held if it is the limit, and down from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// Down and up instead: everything else is as seen in the mirror.
    mirrored: bool,
    /// The acceleration at the turn. It is negative where a deceleration becomes less and then more again.
    peak: f64,
    hold: f64,
}

/// All turns of one motion whose peak is of one sign. The sum of the times of both arcs, seen from where they have, or would
/// have, no acceleration, is proportional to the distance.
struct Turns<'a> {
    motion: &'a Motion,
    mirrored: bool,
    /// 1 or −1.
    sign: f64,
}

impl Turns<'_> {
    /// The turn that comes nearest to the wanted distance, how far it is off, and how long it takes.
    fn nearest(&self, drift: &Drift) -> Option<(Turn, f64, f64)> {
        let Motion { a0, vf, af, up, distance, .. } = *self.motion;
        let (first, last) = (self.motion.start_root(), vf + 0.5 * af * af);
        let outer = a0.max(af);
        // Both accelerations must be below the peak, whose square the step of the velocity is until the limit is reached.
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
        let arcs = |step: f64| self.sign * Swing::over(step, limit).duration();
        let exact = arcs(step.clamp(low, high));
        let miss = |arcs: f64| speed * arcs - beside - distance;
        // No more than need be, for what is put into the velocities here is drift in the next cycle.
        let tolerated = 0.5 * drift.distance;
        let beyond = miss(exact) - miss(exact).clamp(-tolerated, tolerated);
        let arcs = if beyond == 0.0 {
            exact
        } else {
            let (one, other) = (arcs(low), arcs(high));
            (exact - beyond / speed).min(one.max(other)).max(one.min(other))
        };
        let peak = (0.5 * arcs).min(limit);
        let turn = Turn { mirrored: self.mirrored, peak, hold: arcs - 2.0 * peak };
        Some((turn, miss(arcs).abs(), arcs - a0 - af))
    }
}

impl Turn {
    /// The phases of the turn, from start to target of the motion.
    pub(super) fn shape(&self, motion: &Motion) -> Shape {
        let seen = if self.mirrored { motion.mirrored() } else { *motion };
        let shape = Shape {
            durations: [self.peak - seen.a0, self.hold, self.peak - seen.af, 0.0, 0.0, 0.0, 0.0],
            jerks: [1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0],
        };
        if self.mirrored { shape.mirrored() } else { shape }
    }
}

impl Edges {
    /// The turn that would be the fastest motion but for drift, and how long it takes, if the fastest one is a detour in place of
    /// it.
    pub(super) fn but_for_drift(&self, fastest: f64) -> Option<(Turn, f64)> {
        let drift = Drift::of(self);
        let mirrored = self.motion.mirrored();
        let seen = [(&self.motion, false), (&mirrored, true)];
        let turns = seen.into_iter().flat_map(|(motion, mirrored)| {
            [1.0, -1.0].map(|sign| Turns { motion, mirrored, sign }.nearest(&drift))
        });
        let explained = turns.flatten().filter(|(_, error, duration)| {
            // At rest, an error of the distance costs its third root in time: that is no detour.
            let lost = fastest - duration;
            *error <= drift.distance && lost * lost * lost > DETOUR * (error + f64::EPSILON * drift.distance)
        });
        explained.map(|(turn, _, duration)| (turn, duration)).min_by(|one, other| one.1.total_cmp(&other.1))
    }
}

/// A jerk of one and of minus one in turns, from rest to rest, covers this part of its duration's third power.
const DETOUR: f64 = 32.0;
