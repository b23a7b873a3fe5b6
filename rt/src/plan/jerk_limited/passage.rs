//! The motions that pass on to a target acceleration without a peak of the velocity in between.
//!
//! Jerk up, down, up; the acceleration falls from its first peak `A` to `s ≥ 0` and ends in the target
//! acceleration. In the formulas of a [`Crossing`](super::crossing::Crossing) its second swing has become
//! `−s`. The distance follows the duration with the slope `H = v + s² − A·s/2`, `v` being the target root: it has
//! at most four extrema, at the roots of two quadratic equations.

use super::motion::{Motion, Shape, Swing};
use super::roots::{Point, excess, rising_root};

/// The motions of one passage. The parameter is the smallest acceleration between the two arcs of positive jerk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// Target root minus start root.
    step: f64,
    root: f64,
    limit: f64,
    distance_beside: f64,
    a0: f64,
    af: f64,
}

/// One motion of the family.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dip {
    pub(super) distance: f64,
    /// The size of the terms of the distance, to which its rounding error is relative.
    size: f64,
    pub(super) duration: f64,
    pub(super) slope: f64,
    duration_slope: f64,
    first: Swing,
}

impl Passage {
    /// `step` is the difference between target root and start root, not negative.
    pub(super) fn new(motion: &Motion, step: f64) -> Self {
        Self {
            step,
            root: motion.target_root(),
            limit: motion.up,
            distance_beside: motion.arcs_distance(),
            a0: motion.a0,
            af: motion.af,
        }
    }

    pub(super) fn dip(&self, least: f64) -> Dip {
        let step = self.step + least * least;
        let first = Swing::over(step, self.limit);
        let velocity = self.root + least * least;
        let duration_slope = if first.peak > 0.0 { 2.0 * (least / first.peak - 1.0) } else { -2.0 };
        let hamiltonian = velocity - 0.5 * first.peak * least;
        let (up, down) = ((velocity - 0.5 * step) * first.duration(), (velocity + self.root) * least);
        Dip {
            distance: up - down + self.distance_beside,
            size: up.abs() + down.abs() + self.distance_beside.abs(),
            duration: first.duration() - self.a0 + self.af - 2.0 * least,
            slope: hamiltonian * duration_slope,
            duration_slope,
            first,
        }
    }

    pub(super) fn shape(&self, least: f64) -> Shape {
        let Dip { first, .. } = self.dip(least);
        Shape {
            durations: [first.peak - self.a0, first.hold, first.peak - least, 0.0, 0.0, 0.0, self.af - least],
            jerks: [1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0],
        }
    }

    /// Calls `found` with the parameter and the duration of every motion over this distance whose parameter is
    /// between `least` and the target acceleration.
    ///
    /// `ends_are_above` says whether the distances at these two are more than the one wanted: the caller judges
    /// them, so that neighbouring families agree.
    pub(super) fn solve(
        &self,
        distance: f64,
        least: f64,
        ends_are_above: [bool; 2],
        mut found: impl FnMut(f64, f64),
    ) {
        let mut nodes = [f64::NAN; 6];
        nodes[0] = least;
        let extrema = self.extrema();
        let mut count = 1;
        for extremum in extrema {
            if extremum > least
                && extremum < self.af
                && let Some(node) = nodes.get_mut(count)
            {
                *node = extremum;
                count += 1;
            }
        }
        nodes[count.min(5)] = self.af;
        let mut low = (least, ends_are_above[0]);
        for node in nodes.iter().skip(1).take(count) {
            let last = *node == self.af;
            let high = (*node, if last { ends_are_above[1] } else { self.dip(*node).distance > distance });
            if low.1 != high.1 {
                let (below, above) = if low.1 { (high.0, low.0) } else { (low.0, high.0) };
                let dip = rising_root(below, above, 0.5 * (below + above), |least| {
                    let dip = self.dip(least);
                    Point { value: excess(dip.distance, dip.size, distance), slope: dip.slope }
                });
                found(dip, self.dip(dip).duration);
            }
            low = high;
        }
    }

    /// The parameters where the distance has an extremum, in ascending order, not a number where there is none.
    fn extrema(&self) -> [f64; 4] {
        let none = [f64::NAN; 4];
        // v + s² − A·s/2 is positive when v is above limit²/16.
        if self.root > self.limit * self.limit * (1.0 / 16.0) {
            return none;
        }
        let roots = |a: f64, b: f64, c: f64| {
            let q = -0.5 * (b + libm::copysign(libm::sqrt(b * b - 4.0 * a * c), b));
            [q / a, c / q]
        };
        // A = limit: s² − limit/2·s + v = 0
        let held = roots(1.0, -0.5 * self.limit, self.root)
            .map(|least| if self.dip(least).first.hold > 0.0 { least } else { f64::NAN });
        // A² = step + s²; squared, with y = s²: 3/4·y² + (2v − step/4)·y + v² = 0
        let free = roots(0.75, 2.0 * self.root - 0.25 * self.step, self.root * self.root)
            .map(libm::sqrt)
            .map(|least| if self.dip(least).first.hold > 0.0 { f64::NAN } else { least });
        let mut extrema = [held[0], held[1], free[0], free[1]];
        extrema.sort_unstable_by(f64::total_cmp);
        extrema
    }

    /// The parameter of the motion of this duration.
    pub(super) fn lasting(&self, least: f64, duration: f64) -> f64 {
        rising_root(self.af, least, 0.5 * (least + self.af), |least| {
            let dip = self.dip(least);
            Point {
                value: excess(dip.duration, self.a0.abs() + self.af + least, duration),
                slope: dip.duration_slope,
            }
        })
    }
}
