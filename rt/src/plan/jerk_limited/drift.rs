//! Motions that only rounding denies.
//!
//! On the direct motion to its target, or where a lens is but one motion, an axis has nothing left to choose: the three
//! numbers of its state must lie on one line. Planned anew in every cycle it drifts off that line, by the rounding of
//! each cycle, and where it passes the target at speed, the next motion that meets it exactly has to go round again.
//! So a state from which the target would be met but for that drift counts as on the line.
//!
//! How far it may have drifted depends on where it came from, not on how little is left of its way: the measure is the
//! distance to brake from the largest velocity.

use super::ROUNDING;
use super::motion::{Motion, Swing, square_positive};
use super::step1::{Edges, LensEnd, Ways};

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

impl Edges {
    /// The edges and the ways as they would be but for drift, if that is why the fastest way takes this long.
    pub(super) fn but_for_drift(&self, fastest: f64) -> Option<(Self, Ways)> {
        let drift = Drift::of(self);
        let [one, other] = self.in_lens(&drift);
        let direct = self
            .nearly_direct(&drift)
            .map(|edges| Some((edges?.over(edges?.direct_distance), edges?.direct_duration)));
        let candidates = [one, other].into_iter().chain(direct).flatten();
        candidates.into_iter().find_map(|(edges, duration)| {
            let error = (edges.motion.distance - self.motion.distance).abs();
            // At rest, an error of the distance costs its third root in time: that is no detour.
            let is_detour = |duration: f64| {
                let lost = fastest - duration;
                lost * lost * lost > DETOUR * (error + f64::EPSILON * drift.distance)
            };
            if error > drift.distance || !is_detour(duration) {
                return None;
            }
            // The motion is found when its distance is judged such that the edges meet it there and not only later.
            [LensEnd::BesideOther, LensEnd::BesideNext]
                .into_iter()
                .flat_map(|lens_end| [false, true].map(|is_above| edges.ways_seen(is_above, lens_end)))
                .find(|ways| ways.first().is_some_and(|way| way.duration < 0.5 * (duration + fastest)))
                .map(|ways| (edges, ways))
        })
    }

    /// The same edges over another distance.
    fn over(mut self, distance: f64) -> Self {
        self.motion.distance = distance;
        self
    }

    /// The edges over the distance of the direct motion, with and without drift of the velocities, if it may be that.
    fn nearly_direct(&self, drift: &Drift) -> [Option<Self>; 2] {
        let Motion { v0, a0, vf, af, distance, .. } = self.motion;
        // A gap that closes takes no more time away than this, at no more than this speed.
        let speed = v0.abs() + vf.abs() + a0 * a0 + af * af;
        let reach = drift.distance + 2.0 * libm::sqrt(drift.velocity) * speed;
        if (self.direct_distance - distance).abs() > reach {
            return [None; 2];
        }
        [(self.gap > 0.0).then(|| self.closed(drift)), Some(*self)]
    }

    /// The edges when the velocities at both ends are nearer by as much of their drift as the direct motion is too far.
    fn closed(&self, drift: &Drift) -> Self {
        let Motion { a0, vf, af, distance, up, .. } = self.motion;
        let beside = square_positive(a0) + square_positive(af);
        let speed = 0.5 * (self.motion.start_root() + vf + 0.5 * af * af);
        let duration =
            Swing::over(self.gap + beside, up).duration() - (self.direct_distance - distance) / speed;
        let step = if duration > 2.0 * up { up * (duration - up) } else { 0.25 * square_positive(duration) };
        let least = (self.gap - drift.velocity).max(0.0);
        let mut closed = Self::across((step - beside).max(least).min(self.gap), self.motion, self.mirrored);
        (closed.rounding, closed.lens_rounding) = (self.rounding, self.lens_rounding);
        closed
    }

    /// The edges over the distances of both ends of the lens, and their durations, if there would be a lens but for
    /// drift.
    fn in_lens(&self, drift: &Drift) -> [Option<(Self, f64)>; 2] {
        let mut edges = *self;
        edges.lens_rounding = drift.velocity;
        let Some(lens) = edges.lens() else { return [None; 2] };
        let (fastest, slowest) = lens.ends();
        let duration = |least: f64| lens.upper.dip(least).duration;
        let ends = [(fastest, lens.motion.af), (slowest, lens.least)];
        ends.map(|(distance, least)| Some((edges.over(-distance), duration(least))))
    }
}

/// A jerk of one and of minus one in turns, from rest to rest, covers this part of its duration's third power.
const DETOUR: f64 = 32.0;
