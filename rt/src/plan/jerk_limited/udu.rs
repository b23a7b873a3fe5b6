//! UDU: the motions without a velocity peak. Jerk up, down, up; the velocity rises all the way; see the figure of the
//! [module](super).
//!
//! The acceleration rises to its first peak `A`, falls to its least value `s ≥ 0`, and rises to that of the target. The parameter
//! is `s`. In the formulas of [`Uddu`](super::uddu::Uddu) the second velocity step has become `−s`. The distance
//! changes with the duration by `H = v + s² − A·s/2`, where `v` is the target root. So the distance has at most four extrema, at
//! the roots of two quadratic equations.

use super::motion::{Motion, SevenPhases, VelocityStep};
use super::roots::{Point, excess, rising_root};

/// All UDU motions of a problem. The parameter is the least acceleration between the two phases of positive jerk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Udu {
    /// Target root minus start root.
    step: f64,
    root: f64,
    limit: f64,
    distance_beside: f64,
    a0: f64,
    af: f64,
}

/// One UDU motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct UduMotion {
    pub(super) distance: f64,
    /// The size of the terms of the distance. The rounding error of the distance is relative to it.
    size: f64,
    pub(super) duration: f64,
    /// The change of the distance with the parameter.
    pub(super) slope: f64,
    /// The change of the duration with the parameter.
    duration_slope: f64,
    first: VelocityStep,
}

impl Udu {
    /// The UDU motions of this problem. `step` is the target root less the start root, not negative.
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

    /// The motion with this least acceleration.
    pub(super) fn at(&self, least: f64) -> UduMotion {
        let step = self.step + least * least;
        let first = VelocityStep::over(step, self.limit);
        let velocity = self.root + least * least;
        let duration_slope = if first.peak > 0.0 { 2.0 * (least / first.peak - 1.0) } else { -2.0 };
        let hamiltonian = velocity - 0.5 * first.peak * least;
        let (up, down) = ((velocity - 0.5 * step) * first.duration(), (velocity + self.root) * least);
        UduMotion {
            distance: up - down + self.distance_beside,
            size: up.abs() + down.abs() + self.distance_beside.abs(),
            duration: first.duration() - self.a0 + self.af - 2.0 * least,
            slope: hamiltonian * duration_slope,
            duration_slope,
            first,
        }
    }

    /// The phases of the motion with this least acceleration.
    pub(super) fn phases(&self, least: f64) -> SevenPhases {
        let UduMotion { first, .. } = self.at(least);
        SevenPhases {
            durations: [first.peak - self.a0, first.hold, first.peak - least, 0.0, 0.0, 0.0, self.af - least],
            jerks: [1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0],
        }
    }

    /// Calls `found` for every motion over this distance with a parameter between `least` and the target acceleration, with its
    /// parameter and its duration.
    ///
    /// `ends_are_above` says whether the distances at these two parameters count as too long. The caller decides that, so that
    /// neighbouring families agree.
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
            let high = (*node, if last { ends_are_above[1] } else { self.at(*node).distance > distance });
            if low.1 != high.1 {
                let (below, above) = if low.1 { (high.0, low.0) } else { (low.0, high.0) };
                let root = rising_root(below, above, 0.5 * (below + above), |least| {
                    let motion = self.at(least);
                    Point { value: excess(motion.distance, motion.size, distance), slope: motion.slope }
                });
                found(root, self.at(root).duration);
            }
            low = high;
        }
    }

    /// The parameters at the extrema of the distance, in ascending order; not a number for those that do not exist.
    fn extrema(&self) -> [f64; 4] {
        let none = [f64::NAN; 4];
        // v + s² − A·s/2 is positive where v is above limit²/16.
        if self.root > self.limit * self.limit * (1.0 / 16.0) {
            return none;
        }
        let roots = |a: f64, b: f64, c: f64| {
            let q = -0.5 * (b + libm::copysign(libm::sqrt(b * b - 4.0 * a * c), b));
            [q / a, c / q]
        };
        // Where the acceleration is held at its limit, A = limit: s² − limit/2·s + v = 0.
        let held = roots(1.0, -0.5 * self.limit, self.root)
            .map(|least| if self.at(least).first.hold > 0.0 { least } else { f64::NAN });
        // Where it is not held, A² = step + s². Squared, with y = s²: 3/4·y² + (2v − step/4)·y + v² = 0.
        let free = roots(0.75, 2.0 * self.root - 0.25 * self.step, self.root * self.root)
            .map(libm::sqrt)
            .map(|least| if self.at(least).first.hold > 0.0 { f64::NAN } else { least });
        let mut extrema = [held[0], held[1], free[0], free[1]];
        extrema.sort_unstable_by(f64::total_cmp);
        extrema
    }

    /// The parameter of the motion of this duration, between `least` and the target acceleration.
    pub(super) fn lasting(&self, least: f64, duration: f64) -> f64 {
        rising_root(self.af, least, 0.5 * (least + self.af), |least| {
            let motion = self.at(least);
            Point {
                value: excess(motion.duration, self.a0.abs() + self.af + least, duration),
                slope: motion.duration_slope,
            }
        })
    }
}
