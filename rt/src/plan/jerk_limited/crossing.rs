//! Up, cruise, down: the motions whose acceleration crosses zero at their largest velocity.
//!
//! With the largest velocity `v` as parameter, both sides of the peak are [`Swing`]s of `v − start root` and
//! `v − target root`. Without a cruise, the distance as a function of `v` follows the duration with the slope
//! `H = v + A·B/2` (the Hamiltonian of the optimal control problem: `A` and `B` are the accelerations reached
//! on the way up and down). `H` grows with `v`, so the distance has at most one minimum.

use super::super::choice::smaller;
use super::motion::{Motion, Shape, Swing};
use super::roots::{Point, excess, rising_root};

/// The motions of one peak. The parameter is how far the peak is above `base`, the smallest that is possible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) base: f64,
    /// The step of the first swing for a peak at `base`; given by the caller, who knows it without cancellation.
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

/// One motion of the family, without cruise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub(super) velocity: f64,
    pub(super) distance: f64,
    /// The size of the terms of the distance, to which its rounding error is relative.
    size: f64,
    pub(super) duration: f64,
    /// Distance gained for a longer duration.
    pub(super) hamiltonian: f64,
    slope: f64,
    first: Swing,
    second: Swing,
}

impl Crossing {
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

    #[inline]
    pub(super) fn peak(&self, above: f64) -> Peak {
        let (first_step, second_step) = (above + self.first_step, above + self.second_step);
        let first = Swing::over(first_step, self.first_limit);
        let second = Swing::over(second_step, self.second_limit);
        let velocity = self.base + above;
        let (s1, s2) = (first.duration(), second.duration());
        let hamiltonian = velocity + 0.5 * first.peak * second.peak;
        let (up, down) = ((velocity - 0.5 * first_step) * s1, (velocity - 0.5 * second_step) * s2);
        Peak {
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

    /// The phases with the peak this far above the base and a cruise there.
    pub(super) fn shape(&self, above: f64, cruise: f64) -> Shape {
        let Peak { first, second, .. } = self.peak(above);
        Shape {
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

    /// Calls `found` with peak, cruise and duration of every motion over this distance that goes to an edge of what
    /// is possible in its time. `base_distance` is that of the motion that peaks at the base, and `base_is_above` says
    /// whether it counts as too far.
    pub(super) fn solve(
        &self,
        distance: f64,
        base_distance: f64,
        base_is_above: bool,
        mut found: impl FnMut(f64, f64, f64),
    ) {
        let (mut low, mut low_distance) = (0.0, base_distance);
        if base_is_above {
            // Only with a dip in between the distance can be met, twice then.
            if self.peak(0.0).hamiltonian >= 0.0 {
                return;
            }
            low = self.lowest();
            low_distance = self.peak(low).distance;
            if low_distance >= distance {
                return;
            }
            let above = rising_root(low, 0.0, self.falling_by(base_distance - distance), |above| {
                let peak = self.peak(above);
                Point { value: excess(peak.distance, peak.size, distance), slope: peak.slope }
            });
            found(above, 0.0, self.peak(above).duration);
        }
        let top = self.peak(self.room);
        if distance >= top.distance {
            let cruise = (distance - top.distance) / self.vmax;
            found(self.room, cruise, top.duration + cruise);
        } else {
            let above = rising_root(low, self.room, low + self.rising_by(distance - low_distance), |above| {
                let peak = self.peak(above);
                Point { value: excess(peak.distance, peak.size, distance), slope: peak.slope }
            });
            found(above, 0.0, self.peak(above).duration);
        }
    }

    /// About how far above the base, or above the lowest peak, the distance is larger by this. From more on Newton's method
    /// comes down to the root.
    fn rising_by(&self, distance: f64) -> f64 {
        // The slope of the distance is at least `above·(1/limit + 1/limit)`, as the accelerations keep their limits.
        let held = libm::sqrt(
            2.0 * distance * self.first_limit * self.second_limit / (self.first_limit + self.second_limit),
        );
        if self.base > 0.0 {
            smaller(held, self.in_arc(0.5 * distance / self.base))
        } else {
            held - 2.0 * self.base
        }
    }

    /// About how far above the base, which is negative, the distance is smaller by this. From less on Newton's method comes
    /// up to the root.
    fn falling_by(&self, distance: f64) -> f64 {
        self.in_arc(-0.25 * distance / self.base)
    }

    /// How far above the base an arc takes this much longer.
    fn in_arc(&self, time: f64) -> f64 {
        time * (time + 2.0 * libm::sqrt(smaller(self.first_step, self.second_step)))
    }

    /// Where the distance is smallest, given that it falls at the base.
    fn lowest(&self) -> f64 {
        rising_root(0.0, self.room, 0.5 * self.room, |above| {
            let peak = self.peak(above);
            let growth = peak.hamiltonian - peak.velocity;
            let value = peak.hamiltonian;
            let (a, b) = (peak.first, peak.second);
            let share = if a.hold > 0.0 { 0.0 } else { 0.5 / (a.peak * a.peak) }
                + if b.hold > 0.0 { 0.0 } else { 0.5 / (b.peak * b.peak) };
            Point { value, slope: 1.0 + growth * share }
        })
    }

    /// The peak of the motion over this distance in this time; it cruises there for the rest of the time.
    ///
    /// Every velocity along the way grows with the peak, and so does the distance, as long as there is time to
    /// cruise.
    pub(super) fn lasting(&self, distance: f64, duration: f64) -> Shape {
        let above = rising_root(0.0, self.room, 0.0, |above| {
            let peak = self.peak(above);
            let cruise = duration - peak.duration;
            if cruise < 0.0 {
                return Point { value: 1.0, slope: 0.0 };
            }
            let cruised = peak.velocity * cruise;
            Point {
                value: excess(peak.distance + cruised, peak.size + cruised.abs(), distance),
                slope: cruise + 0.5 * (peak.first.peak + peak.second.peak),
            }
        });
        let cruise = (duration - self.peak(above).duration).max(0.0);
        self.shape(above, cruise)
    }
}
