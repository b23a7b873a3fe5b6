//! UDDU: the motions with a velocity peak. The acceleration is zero at the peak; see the figure of the [module](super).
//!
//! The parameter is the velocity `v` of the peak. Both sides of the peak are [`VelocityStep`]s, of `v − start root` and of
//! `v − target root`. Without a cruise, the distance is a function of `v`, and so is the duration. The distance changes with
//! the duration by `H = v + A·B/2`, where `A` and `B` are the largest accelerations on the way up and down. (`H` is the
//! Hamiltonian of the optimal control problem.) `H` grows with `v`, so the distance has at most one minimum.

use super::super::choice::{larger, smaller};
use super::motion::{Motion, SevenPhases, VelocityStep};
use super::roots::{Point, excess, rising_root};

/// All UDDU motions of a problem. The parameter is how far the peak is above `base`, the lowest possible peak.
#[derive(Clone, Copy, Debug)]
pub(super) struct Uddu {
    /// The velocity of the lowest possible peak.
    pub(super) base: f64,
    /// The velocity steps on both sides for a peak at `base`. The caller knows them without cancellation.
    first_step: f64,
    second_step: f64,
    first_limit: f64,
    second_limit: f64,
    distance_beside: f64,
    duration_beside: f64,
    /// How far the peak can be above `base`.
    room: f64,
    vmax: f64,
    a0: f64,
    af: f64,
}

/// The UDDU motion of one peak, without a cruise.
#[derive(Clone, Copy, Debug)]
pub(super) struct UdduMotion {
    /// The velocity of the peak.
    pub(super) velocity: f64,
    pub(super) distance: f64,
    /// The size of the terms of the distance. The rounding error of the distance is relative to it.
    size: f64,
    pub(super) duration: f64,
    /// The change of the distance with the duration.
    pub(super) hamiltonian: f64,
    /// The change of the distance with the velocity of the peak.
    slope: f64,
    first: VelocityStep,
    second: VelocityStep,
}

impl Uddu {
    pub(super) fn new(motion: &Motion, base: f64, first_step: f64, second_step: f64) -> Self {
        Self {
            base,
            first_step,
            second_step,
            first_limit: motion.up,
            second_limit: motion.down,
            distance_beside: motion.arcs_distance(),
            duration_beside: motion.af - motion.a0,
            room: (motion.vmax - base).max(0.0),
            vmax: motion.vmax,
            a0: motion.a0,
            af: motion.af,
        }
    }

    /// The motion with its peak this far above the base.
    #[inline]
    pub(super) fn at(&self, above: f64) -> UdduMotion {
        let (first_step, second_step) = (above + self.first_step, above + self.second_step);
        let first = VelocityStep::over(first_step, self.first_limit);
        let second = VelocityStep::over(second_step, self.second_limit);
        let velocity = self.base + above;
        let (s1, s2) = (first.duration(), second.duration());
        let hamiltonian = velocity + 0.5 * first.peak * second.peak;
        let (up, down) = ((velocity - 0.5 * first_step) * s1, (velocity - 0.5 * second_step) * s2);
        UdduMotion {
            velocity,
            distance: up + down + self.distance_beside,
            size: up.abs() + down.abs() + self.distance_beside.abs(),
            duration: s1 + s2 + self.duration_beside,
            hamiltonian,
            slope: hamiltonian * (first.peak + second.peak) / (first.peak * second.peak),
            first,
            second,
        }
    }

    /// The phases of the motion with its peak this far above the base, and a cruise of this duration at the peak.
    pub(super) fn phases(&self, above: f64, cruise: f64) -> SevenPhases {
        let UdduMotion { first, second, .. } = self.at(above);
        SevenPhases {
            durations: [
                first.peak - self.a0,
                first.hold,
                first.peak,
                cruise,
                second.peak,
                second.hold,
                second.peak + self.af,
            ],
            jerks: [1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0],
        }
    }

    /// Calls `found` for every motion over this distance that is on an edge, with its parameter, the duration of its cruise and
    /// its own duration.
    ///
    /// `base_distance` is the distance of the motion with the lowest peak. `base_is_above` says whether that distance counts
    /// as too long.
    pub(super) fn solve(
        &self,
        distance: f64,
        base_distance: f64,
        base_is_above: bool,
        mut found: impl FnMut(f64, f64, f64),
    ) {
        let (mut low, mut low_distance) = (0.0, base_distance);
        if base_is_above {
            // The distance is met only if it has a minimum in between, and then it is met twice.
            if self.base >= 0.0 || !self.may_fall_by(base_distance - distance) {
                return;
            }
            low = self.lowest();
            low_distance = self.at(low).distance;
            if low_distance >= distance {
                return;
            }
            let above = rising_root(low, 0.0, self.falling_by(base_distance - distance), |above| {
                let motion = self.at(above);
                Point { value: excess(motion.distance, motion.size, distance), slope: motion.slope }
            });
            found(above, 0.0, self.at(above).duration);
        }
        let top = self.at(self.room);
        if distance >= top.distance {
            let cruise = (distance - top.distance) / self.vmax;
            found(self.room, cruise, top.duration + cruise);
        } else {
            let above = rising_root(low, self.room, low + self.rising_by(distance - low_distance), |above| {
                let motion = self.at(above);
                Point { value: excess(motion.distance, motion.size, distance), slope: motion.slope }
            });
            found(above, 0.0, self.at(above).duration);
        }
    }

    /// A first guess of how far above the base, or above the minimum of the distance, the distance is larger by this much. The
    /// guess is too large, so Newton's method approaches the root from above.
    fn rising_by(&self, distance: f64) -> f64 {
        // The slope of the distance is at least `above·(1/limit + 1/limit)`, because the accelerations keep their limits.
        let held = libm::sqrt(
            2.0 * distance * self.first_limit * self.second_limit / (self.first_limit + self.second_limit),
        );
        if self.base > 0.0 {
            smaller(held, self.higher_by(0.5 * distance / self.base))
        } else {
            held - 2.0 * self.base
        }
    }

    /// A first guess of how far above the base, which is negative, the distance is smaller by this much. The guess is too small,
    /// so Newton's method approaches the root from below.
    fn falling_by(&self, distance: f64) -> f64 {
        self.higher_by(-0.25 * distance / self.base)
    }

    /// How far above the base a phase of full jerk takes this much longer.
    fn higher_by(&self, time: f64) -> f64 {
        time * (time + 2.0 * libm::sqrt(smaller(self.first_step, self.second_step)))
    }

    /// Returns `true` if the distance may become shorter by this much, as far as can be known without the parameter of the shortest one.
    ///
    /// The distance changes with the duration by `H`, which is lowest at the base. `H` grows faster than the parameter, so it is
    /// not negative where the parameter is `−H` of the base.
    fn may_fall_by(&self, distance: f64) -> bool {
        let base = self.at(0.0);
        let end = self.at(larger(0.0, -base.hamiltonian));
        base.hamiltonian < 0.0 && base.hamiltonian * (base.duration - end.duration) > distance
    }

    /// The parameter of the shortest distance, where the distance falls at the base.
    fn lowest(&self) -> f64 {
        rising_root(0.0, self.room, 0.5 * self.room, |above| {
            let motion = self.at(above);
            let growth = motion.hamiltonian - motion.velocity;
            let value = motion.hamiltonian;
            let (a, b) = (motion.first, motion.second);
            let share = if a.hold > 0.0 { 0.0 } else { 0.5 / (a.peak * a.peak) }
                + if b.hold > 0.0 { 0.0 } else { 0.5 / (b.peak * b.peak) };
            Point { value, slope: 1.0 + growth * share }
        })
    }

    /// The phases of the motion over this distance in this duration. It cruises at its peak for the rest of the duration.
    ///
    /// Every velocity on the way grows with the peak, and so does the distance, as long as there is time to cruise.
    pub(super) fn lasting(&self, distance: f64, duration: f64) -> SevenPhases {
        let above = rising_root(0.0, self.room, 0.0, |above| {
            let motion = self.at(above);
            let cruise = duration - motion.duration;
            if cruise < 0.0 {
                return Point { value: 1.0, slope: 0.0 };
            }
            let cruised = motion.velocity * cruise;
            Point {
                value: excess(motion.distance + cruised, motion.size + cruised.abs(), distance),
                slope: cruise + 0.5 * (motion.first.peak + motion.second.peak),
            }
        });
        let cruise = (duration - self.at(above).duration).max(0.0);
        self.phases(above, cruise)
    }
}
