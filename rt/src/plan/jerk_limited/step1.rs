//! Step 1: the fastest motion and the blocked intervals.
//!
//! For a given duration, the motions within the limits form a convex set. So the distances that can be covered in that duration
//! form an interval. Its two ends, as functions of the duration, are the *edges* of what is possible:
//!
//! ```text
//!  distance                      . upper edge: jerk first up (UDU, then UDDU)
//!     |                      . '
//!     |          __      .'
//!     |         /  ` - '         The upper edge can fall for a while: a blocked interval
//!  D -+- - - - x - - x- - - x- - begins and ends where an edge crosses the wanted distance D.
//!     |       /
//!     |     direct motion
//!     |       ` .
//!     |           ' - .          lower edge: jerk first down (the mirror image, backwards in time)
//!     +------------------------------> duration
//! ```
//!
//! Both edges start at the direct motion: the fastest change from the start state to the velocity and acceleration of the
//! target, whatever its distance is. Every motion of minimum time is where an edge meets the wanted distance, and so is every
//! end of a blocked interval. These motions are the *candidates*.
//!
//! Each edge is a chain of families with one parameter. The distance is monotone between points known in closed form, so every
//! root is in a bracket and none can be missed. The upper edge ends above every distance and the lower edge ends below. So the
//! number of roots is odd, and there is a first one.
//!
//! If both accelerations have the same sign, there are further motions, which never lose that sign. Their durations and
//! distances form a closed region of its own, with an upper and a lower edge that meet at both ends.

use super::ROUNDING;
use super::drift::{self, TwoStep};
use super::motion::{Motion, SevenPhases, VelocityStep, square_positive};
use super::uddu::Uddu;
use super::udu::Udu;
use arrayvec::ArrayVec;

/// The most candidates: two on each of the two UDDU edges, five on each of the four UDU edges, and a two-step motion twice.
const CANDIDATES_MAX: usize = 26;

/// A difference of two velocities up to this, relative to their sizes, is rounding.
const GAP_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// An error of the distance up to this, relative to the distance, is left in it to keep the duration free of rounding.
const DISTANCE_ERROR: f64 = 1e-7;

/// A motion on an edge over the wanted distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) duration: f64,
    family: Family,
}

#[derive(Clone, Copy, Debug)]
enum Family {
    /// UDDU on the upper edge, or its mirror image on the lower edge: how far the peak is above the base, and the duration of the
    /// cruise.
    Uddu { lower: bool, above: f64, cruise: f64 },
    /// UDU, without a velocity peak: the least acceleration.
    Udu { lower: bool, least: f64 },
    /// UDU whose acceleration keeps its sign: the least acceleration.
    SameSign { lower: bool, least: f64 },
    /// A two-step motion, which is impossible only by drift.
    TwoStep(TwoStep),
}

/// All candidates, the fastest first.
pub(super) type Candidates = ArrayVec<Candidate, CANDIDATES_MAX>;

/// The edges of what is possible.
///
/// The problem is mirrored where needed, so that the velocity behind the start is not above the velocity before the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges {
    pub(super) motion: Motion,
    pub(super) mirrored: bool,
    /// The rounding error of the distance.
    pub(super) rounding: f64,
    /// The rounding error of the velocities where they decide whether there are motions of the same sign.
    pub(super) same_sign_rounding: f64,
    pub(super) upper: Uddu,
    /// The mirror image of the lower edge.
    pub(super) lower: Uddu,
    pub(super) direct_distance: f64,
    pub(super) direct_duration: f64,
    /// Distance and duration of the UDDU motion with the lowest peak, which is the velocity before the target.
    pub(super) upper_base: (f64, f64),
    /// Distance and duration of the DUUD motion with the highest valley, which is the velocity behind the start.
    pub(super) lower_base: (f64, f64),
}

impl Edges {
    #[inline]
    pub(super) fn of(original: &Motion) -> Self {
        let mirrored = original.velocity_before_target() < original.velocity_behind_start();
        let motion = if mirrored { original.mirrored() } else { *original };
        let Motion { v0, a0, vf, af, vmax, vmin, .. } = motion;
        // The square root of the gap goes into times and distances, so a rounding error must not open it.
        let gap_rounding = GAP_ROUNDING * (vmax - vmin + a0 * a0 + af * af);
        let gap = motion.velocity_before_target() - motion.velocity_behind_start();
        let gap = if gap > gap_rounding { gap } else { 0.0 };
        let (behind_start, before_target) = (motion.velocity_behind_start(), motion.velocity_before_target());
        let upper = Uddu::new(&motion, before_target, gap + square_positive(a0), square_positive(-af));
        let lower =
            Uddu::new(&motion.mirrored(), -behind_start, square_positive(-a0), gap + square_positive(af));
        let step = VelocityStep::over(gap + square_positive(a0) + square_positive(af), motion.up);
        let (first, last) = (motion.start_root(), motion.vf + 0.5 * af * af);
        let beside = first * a0 + a0 * a0 * a0 / 6.0 + last * af - af * af * af / 6.0;
        let direct_distance = 0.5 * (first + last) * step.duration() - beside;
        let direct_duration = step.duration() - a0 - af;
        let base = |family: &Uddu| {
            let motion = family.at(0.0);
            (motion.distance, motion.duration)
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
            same_sign_rounding: ROUNDING * (v0.abs() + vf.abs() + a0 * a0 + af * af),
            upper,
            lower,
            direct_distance,
            direct_duration,
        }
    }

    /// Sets the rounding error of the distance. Where the distance differs from a special one by no more, the special one is
    /// taken: the distance of the direct motion, and those at both ends of the same-sign region.
    ///
    /// Near the direct motion, an error costs its square root in time, so less of it is accepted there. At the ends of the
    /// same-sign region, it decides whether that region has a motion at all.
    pub(super) fn round(&mut self, position_rounding: f64) {
        let Motion { v0, a0, vf, af, .. } = self.motion;
        let size = (v0.abs() + vf.abs() + a0 * a0 + af * af) * (self.direct_duration + a0.abs() + af.abs());
        self.rounding = position_rounding + ROUNDING * size;
        self.snap(self.direct_distance, self.rounding.min(DISTANCE_ERROR * self.motion.distance.abs()));
        if let Some(same_sign) = self.same_sign() {
            let (fastest, slowest) = same_sign.ends();
            self.snap(-fastest, self.rounding);
            self.snap(-slowest, self.rounding);
        }
    }

    fn snap(&mut self, to: f64, tolerance: f64) {
        if (self.motion.distance - to).abs() <= tolerance {
            self.motion.distance = to;
        }
    }

    /// Finds every motion on an edge over the wanted distance, the fastest first. `candidates` are empty before.
    pub(super) fn find(&self, candidates: &mut Candidates) {
        let direct_is_above = self.direct_distance > self.motion.distance;
        self.same_sign_candidates(candidates);
        self.upper_candidates(direct_is_above, candidates);
        self.lower_candidates(direct_is_above, candidates);
        candidates.sort_unstable_by(|one, other| one.duration.total_cmp(&other.duration));
        let fastest = candidates.first().map_or(f64::INFINITY, |candidate| candidate.duration);
        if let Some((two_step, duration)) = drift::but_for_drift(&self.motion, self.rounding, fastest) {
            // It is the fastest motion. All durations between it and the detour are blocked.
            let candidate = Candidate { duration, family: Family::TwoStep(two_step) };
            for _ in 0..2 {
                if !candidates.is_full() {
                    candidates.insert(0, candidate);
                }
            }
        }
    }

    fn upper_candidates(&self, direct_is_above: bool, candidates: &mut Candidates) {
        let distance = self.motion.distance;
        let base = self.upper_base.0;
        let mut base_is_above = direct_is_above;
        if self.motion.af > 0.0 {
            base_is_above = base > distance;
            let ends_are_above = [base_is_above, direct_is_above];
            self.upper_udu().solve(distance, 0.0, ends_are_above, |least, duration| {
                add(candidates, Candidate { duration, family: Family::Udu { lower: false, least } });
            });
        }
        self.upper.solve(distance, base, base_is_above, |above, cruise, duration| {
            add(candidates, Candidate { duration, family: Family::Uddu { lower: false, above, cruise } });
        });
    }

    fn lower_candidates(&self, direct_is_above: bool, candidates: &mut Candidates) {
        // Distances change their sign in the mirror image, and backwards in time.
        let distance = -self.motion.distance;
        let base = -self.lower_base.0;
        let mut base_is_above = !direct_is_above;
        if self.motion.a0 > 0.0 {
            base_is_above = base >= distance;
            let ends_are_above = [base_is_above, !direct_is_above];
            self.lower_udu().solve(distance, 0.0, ends_are_above, |least, duration| {
                add(candidates, Candidate { duration, family: Family::Udu { lower: true, least } });
            });
        }
        self.lower.solve(distance, base, base_is_above, |above, cruise, duration| {
            add(candidates, Candidate { duration, family: Family::Uddu { lower: true, above, cruise } });
        });
    }

    pub(super) fn upper_udu(&self) -> Udu {
        Udu::new(&self.motion, self.motion.target_root() - self.motion.start_root())
    }

    pub(super) fn lower_udu(&self) -> Udu {
        let reversed = self.motion.reversed();
        Udu::new(&reversed, reversed.target_root() - reversed.start_root())
    }

    fn same_sign_candidates(&self, candidates: &mut Candidates) {
        let Some(same_sign) = self.same_sign() else { return };
        let distance = same_sign.motion.distance;
        let (fastest, slowest) = same_sign.ends();
        // An end that covers exactly the distance counts as being on the other side than the other end. So it is found as a
        // motion, and both edges have an odd number of motions.
        let ends_are_above = |distance: f64, [slowest, fastest]: [f64; 2]| {
            let fastest_is_above = if fastest == distance { slowest < distance } else { fastest > distance };
            let slowest_is_above = if slowest == distance { !fastest_is_above } else { slowest > distance };
            [slowest_is_above, fastest_is_above]
        };
        let ends = ends_are_above(distance, [slowest, fastest]);
        same_sign.upper.solve(distance, same_sign.least, ends, |least, duration| {
            add(candidates, Candidate { duration, family: Family::SameSign { lower: false, least } });
        });
        let ends = ends_are_above(-distance, [-slowest, -fastest]);
        same_sign.lower.solve(-distance, same_sign.least, ends, |least, duration| {
            add(candidates, Candidate { duration, family: Family::SameSign { lower: true, least } });
        });
    }

    /// The motions that keep the sign of their acceleration, if there are any.
    pub(super) fn same_sign(&self) -> Option<SameSign> {
        if self.motion.a0 < 0.0 && self.motion.af < 0.0 {
            SameSign::of(&self.motion.mirrored(), self.same_sign_rounding)
        } else {
            None
        }
    }

    /// The phases of a candidate.
    pub(super) fn phases(&self, candidate: &Candidate) -> SevenPhases {
        let phases = match candidate.family {
            Family::Uddu { lower: false, above, cruise } => self.upper.phases(above, cruise),
            Family::Uddu { lower: true, above, cruise } => self.lower.phases(above, cruise).mirrored(),
            Family::Udu { lower: false, least } => self.upper_udu().phases(least),
            Family::Udu { lower: true, least } => self.lower_udu().phases(least).reversed(),
            Family::TwoStep(two_step) => two_step.phases(&self.motion),
            Family::SameSign { lower, least } => {
                let same_sign = SameSign::at(&self.motion.mirrored());
                let phases = if lower {
                    same_sign.lower.phases(least).reversed()
                } else {
                    same_sign.upper.phases(least)
                };
                phases.mirrored()
            }
        };
        self.outside(phases)
    }

    /// The phases of the original problem, from those of the edges, which may be mirrored.
    pub(super) fn outside(&self, phases: SevenPhases) -> SevenPhases {
        if self.mirrored { phases.mirrored() } else { phases }
    }
}

fn add(candidates: &mut Candidates, candidate: Candidate) {
    if candidate.duration.is_finite() && !candidates.is_full() {
        candidates.push(candidate);
    }
}

/// The motions with positive acceleration from start to target.
#[derive(Clone, Copy, Debug)]
pub(super) struct SameSign {
    pub(super) motion: Motion,
    pub(super) upper: Udu,
    /// The lower edge, backwards in time.
    pub(super) lower: Udu,
    /// The least acceleration of the slowest motion, where both edges meet again.
    pub(super) least: f64,
}

impl SameSign {
    fn of(motion: &Motion, rounding: f64) -> Option<Self> {
        let Motion { v0, a0, vf, af, .. } = motion;
        // The velocity grows by this much at least: that is one phase of full jerk from start to target acceleration.
        // Often it grows by exactly that, and rounding must not make that motion impossible.
        let exists = vf - v0 >= 0.5 * (af * af - a0 * a0).abs() - rounding;
        exists.then(|| Self::at(motion))
    }

    fn at(motion: &Motion) -> Self {
        let Motion { v0, a0, vf, af, .. } = motion;
        let reversed = motion.reversed();
        Self {
            motion: *motion,
            upper: Udu::new(motion, (motion.target_root() - motion.start_root()).max(0.0)),
            lower: Udu::new(&reversed, (reversed.target_root() - reversed.start_root()).max(0.0)),
            least: libm::sqrt((0.5 * (a0 * a0 + af * af) - (vf - v0)).max(0.0)).min(a0.min(*af)),
        }
    }

    /// The distances at the fastest and at the slowest end.
    pub(super) fn ends(&self) -> (f64, f64) {
        (self.upper.at(self.motion.af).distance, self.upper.at(self.least).distance)
    }
}
