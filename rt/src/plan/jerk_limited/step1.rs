//! Step 1: the fastest motion, and the durations that are blocked (`otg.md` section 2, 2 and 3).
//!
//! For a given duration, the motions within the limits form a convex set, so the distances that can be covered
//! in it are an interval. Its two ends, followed over the duration, are the *edges* of what is possible: upwards
//! first (jerk +, −, +) and downwards first (−, +, −). Both start at the direct change from the start state to
//! the target's velocity and acceleration, the fastest that does not care for the distance. A motion of
//! minimum time, and every end of a blocked interval, is where an edge meets the wanted distance.
//!
//! Each edge is a chain of families with one parameter whose distance is monotone between points known in
//! closed form, so roots are bracketed and none can be missed: the upper edge ends above every distance and
//! the lower edge below, so the number of roots is odd and there is a first one.
//!
//! Accelerations of one sign at both ends allow, besides, motions that never lose that sign, in a closed lens
//! of durations and distances of its own.

use super::ROUNDING;
use super::crossing::Crossing;
use super::drift::Turn;
use super::motion::{Motion, Shape, Swing, square_positive};
use super::passage::Passage;
use arrayvec::ArrayVec;

/// The most roots: two on each edge of the crossings, five on each of four passages, and a turn twice.
const WAYS_MAX: usize = 26;

/// Relative to the sizes of velocities, differences up to this are rounding.
const GAP_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Relative to the distance, the error that is left in it to keep the duration free of rounding.
const DISTANCE_ERROR: f64 = 1e-7;

/// A motion on an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub(super) duration: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// On the upper edge (or, mirrored, the lower): how far the peak is above the base, and the cruise there.
    Crossing { lower: bool, above: f64, cruise: f64 },
    /// Without a peak: the smallest acceleration in between.
    Passage { lower: bool, least: f64 },
    /// In the lens.
    Lens { lower: bool, least: f64 },
    /// The only one left to the target, but for drift.
    Turn(Turn),
}

/// All motions on an edge over the wanted distance, the fastest first.
pub(super) type Ways = ArrayVec<Way, WAYS_MAX>;

/// The edges of what is possible.
///
/// Seen in the mirror where needed, so that the velocity behind the start is not above the one before the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    pub(super) motion: Motion,
    pub(super) mirrored: bool,
    /// How wrong the distance may be.
    pub(super) rounding: f64,
    /// How wrong the velocities may be where they decide whether there is a lens.
    pub(super) lens_rounding: f64,
    pub(super) upper: Crossing,
    /// In the mirror.
    pub(super) lower: Crossing,
    pub(super) direct_distance: f64,
    pub(super) direct_duration: f64,
    /// Distance and duration of the crossings that only just have a peak at the velocity before the target, and
    /// a valley at the velocity behind the start.
    pub(super) upper_base: (f64, f64),
    pub(super) lower_base: (f64, f64),
}

impl Edges {
    pub(super) fn of(original: &Motion) -> Self {
        let mirrored = original.velocity_before_target() < original.velocity_behind_start();
        let motion = if mirrored { original.mirrored() } else { *original };
        let Motion { v0, a0, vf, af, vmax, vmin, .. } = motion;
        // The root of the gap goes into times and distances, so a rounding error must not open it.
        let gap_rounding = GAP_ROUNDING * (vmax - vmin + a0 * a0 + af * af);
        let gap = motion.velocity_before_target() - motion.velocity_behind_start();
        let gap = if gap > gap_rounding { gap } else { 0.0 };
        let (behind_start, before_target) = (motion.velocity_behind_start(), motion.velocity_before_target());
        let upper = Crossing::new(&motion, before_target, gap + square_positive(a0), square_positive(-af));
        let lower =
            Crossing::new(&motion.mirrored(), -behind_start, square_positive(-a0), gap + square_positive(af));
        let swing = Swing::over(gap + square_positive(a0) + square_positive(af), motion.up);
        let (first, last) = (motion.start_root(), motion.vf + 0.5 * af * af);
        let beside = first * a0 + a0 * a0 * a0 / 6.0 + last * af - af * af * af / 6.0;
        let direct_distance = 0.5 * (first + last) * swing.duration() - beside;
        let direct_duration = swing.duration() - a0 - af;
        let base = |crossing: &Crossing| {
            let peak = crossing.peak(0.0);
            (peak.distance, peak.duration)
        };
        Self {
            upper_base: if af > 0.0 { base(&upper) } else { (direct_distance, direct_duration) },
            lower_base: if a0 > 0.0 {
                let (distance, duration) = base(&lower);
                (-distance, duration)
            } else {
                (direct_distance, direct_duration)
            },
            motion,
            mirrored,
            rounding: 0.0,
            lens_rounding: ROUNDING * (v0.abs() + vf.abs() + a0 * a0 + af * af),
            upper,
            lower,
            direct_distance,
            direct_duration,
        }
    }

    /// Says what rounding error the distance may have, and takes the distance for one that is special where they
    /// differ by no more.
    ///
    /// Beside the direct motion an error costs its root in time, and less of it is accepted. At the ends of the lens
    /// it decides whether there is a motion in the lens at all.
    pub(super) fn round(&mut self, position_rounding: f64) {
        let Motion { v0, a0, vf, af, .. } = self.motion;
        let size = (v0.abs() + vf.abs() + a0 * a0 + af * af) * (self.direct_duration + a0.abs() + af.abs());
        self.rounding = position_rounding + ROUNDING * size;
        self.snap(self.direct_distance, self.rounding.min(DISTANCE_ERROR * self.motion.distance.abs()));
        if let Some(lens) = self.lens() {
            let (fastest, slowest) = lens.ends();
            self.snap(-fastest, self.rounding);
            self.snap(-slowest, self.rounding);
        }
    }

    fn snap(&mut self, to: f64, tolerance: f64) {
        if (self.motion.distance - to).abs() <= tolerance {
            self.motion.distance = to;
        }
    }

    /// Every motion on an edge over the wanted distance, the fastest first.
    pub(super) fn ways(&self) -> Ways {
        let mut ways = Ways::new();
        let direct_is_above = self.direct_distance > self.motion.distance;
        self.lens_ways(&mut ways);
        self.upper_ways(direct_is_above, &mut ways);
        self.lower_ways(direct_is_above, &mut ways);
        ways.sort_unstable_by(|one, other| one.duration.total_cmp(&other.duration));
        let fastest = ways.first().map_or(f64::INFINITY, |way| way.duration);
        if let Some((turn, duration)) = self.but_for_drift(fastest) {
            // It is possible, and nothing between it and the detour.
            let way = Way { duration, kind: Kind::Turn(turn) };
            for _ in 0..2 {
                if !ways.is_full() {
                    ways.insert(0, way);
                }
            }
        }
        ways
    }

    fn upper_ways(&self, direct_is_above: bool, ways: &mut Ways) {
        let distance = self.motion.distance;
        let base = self.upper_base.0;
        let mut base_is_above = direct_is_above;
        if self.motion.af > 0.0 {
            base_is_above = base > distance;
            let ends_are_above = [base_is_above, direct_is_above];
            self.upper_passage().solve(distance, 0.0, ends_are_above, |least, duration| {
                add(ways, Way { duration, kind: Kind::Passage { lower: false, least } });
            });
        }
        self.upper.solve(distance, base, base_is_above, |above, cruise, duration| {
            add(ways, Way { duration, kind: Kind::Crossing { lower: false, above, cruise } });
        });
    }

    fn lower_ways(&self, direct_is_above: bool, ways: &mut Ways) {
        // In the mirror, and backwards in time, distances have the other sign.
        let distance = -self.motion.distance;
        let base = -self.lower_base.0;
        let mut base_is_above = !direct_is_above;
        if self.motion.a0 > 0.0 {
            base_is_above = base >= distance;
            let ends_are_above = [base_is_above, !direct_is_above];
            self.lower_passage().solve(distance, 0.0, ends_are_above, |least, duration| {
                add(ways, Way { duration, kind: Kind::Passage { lower: true, least } });
            });
        }
        self.lower.solve(distance, base, base_is_above, |above, cruise, duration| {
            add(ways, Way { duration, kind: Kind::Crossing { lower: true, above, cruise } });
        });
    }

    pub(super) fn upper_passage(&self) -> Passage {
        Passage::new(&self.motion, self.motion.target_root() - self.motion.start_root())
    }

    pub(super) fn lower_passage(&self) -> Passage {
        let reversed = self.motion.reversed();
        Passage::new(&reversed, reversed.target_root() - reversed.start_root())
    }

    fn lens_ways(&self, ways: &mut Ways) {
        let Some(lens) = self.lens() else { return };
        let distance = lens.motion.distance;
        let (fastest, slowest) = lens.ends();
        // An end that covers just the distance counts as on the other side than the other end, so that it is found as a
        // motion, and both edges have an odd number of them.
        let ends_are_above = |distance: f64, [slowest, fastest]: [f64; 2]| {
            let fastest_is_above = if fastest == distance { slowest < distance } else { fastest > distance };
            let slowest_is_above = if slowest == distance { !fastest_is_above } else { slowest > distance };
            [slowest_is_above, fastest_is_above]
        };
        let ends = ends_are_above(distance, [slowest, fastest]);
        lens.upper.solve(distance, lens.least, ends, |least, duration| {
            add(ways, Way { duration, kind: Kind::Lens { lower: false, least } });
        });
        let ends = ends_are_above(-distance, [-slowest, -fastest]);
        lens.lower.solve(-distance, lens.least, ends, |least, duration| {
            add(ways, Way { duration, kind: Kind::Lens { lower: true, least } });
        });
    }

    /// The lens, if there is one.
    pub(super) fn lens(&self) -> Option<Lens> {
        if self.motion.a0 < 0.0 && self.motion.af < 0.0 {
            Lens::of(&self.motion.mirrored(), self.lens_rounding)
        } else {
            None
        }
    }

    /// The phases of a way.
    pub(super) fn shape(&self, way: &Way) -> Shape {
        let shape = match way.kind {
            Kind::Crossing { lower: false, above, cruise } => self.upper.shape(above, cruise),
            Kind::Crossing { lower: true, above, cruise } => self.lower.shape(above, cruise).mirrored(),
            Kind::Passage { lower: false, least } => self.upper_passage().shape(least),
            Kind::Passage { lower: true, least } => self.lower_passage().shape(least).reversed(),
            Kind::Turn(turn) => turn.shape(&self.motion),
            Kind::Lens { lower, least } => {
                let lens = Lens::at(&self.motion.mirrored());
                let shape = if lower { lens.lower.shape(least).reversed() } else { lens.upper.shape(least) };
                shape.mirrored()
            }
        };
        self.outside(shape)
    }

    /// Out of the mirror, if the edges are seen in one.
    pub(super) fn outside(&self, shape: Shape) -> Shape {
        if self.mirrored { shape.mirrored() } else { shape }
    }
}

fn add(ways: &mut Ways, way: Way) {
    if way.duration.is_finite() && !ways.is_full() {
        ways.push(way);
    }
}

/// The motions with positive acceleration all the way, between positive accelerations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    pub(super) motion: Motion,
    pub(super) upper: Passage,
    /// Backwards in time.
    pub(super) lower: Passage,
    /// The smallest acceleration on the way, at the end of the lens where both edges meet again.
    pub(super) least: f64,
}

impl Lens {
    fn of(motion: &Motion, rounding: f64) -> Option<Self> {
        let Motion { v0, a0, vf, af, .. } = motion;
        // Directly up from the one acceleration to the other, the velocity already grows by this much.
        // Often it does so just: then one arc leads from start to target, and rounding must not deny it.
        let exists = vf - v0 >= 0.5 * (af * af - a0 * a0).abs() - rounding;
        exists.then(|| Self::at(motion))
    }

    fn at(motion: &Motion) -> Self {
        let Motion { v0, a0, vf, af, .. } = motion;
        let reversed = motion.reversed();
        Self {
            motion: *motion,
            upper: Passage::new(motion, (motion.target_root() - motion.start_root()).max(0.0)),
            lower: Passage::new(&reversed, (reversed.target_root() - reversed.start_root()).max(0.0)),
            least: libm::sqrt((0.5 * (a0 * a0 + af * af) - (vf - v0)).max(0.0)).min(a0.min(*af)),
        }
    }

    /// The distances at the fastest and at the slowest end.
    pub(super) fn ends(&self) -> (f64, f64) {
        (self.upper.dip(self.motion.af).distance, self.upper.dip(self.least).distance)
    }
}
