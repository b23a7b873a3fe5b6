//! Random problems from a fixed seed, with the distribution of Ruckig's own benchmark.

pub mod rsruckig;

use takt_rt::plan::{Limits, PlanOptions, Problem, Profile, State, synchronised};

/// The highest derivative that is limited.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Acceleration.
    Second,
    /// Jerk.
    Third,
}

/// SplitMix64: small, and the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn gaussian(&mut self, deviation: f64) -> f64 {
        let (radius, angle) = (self.uniform(1e-300, 1.0), self.uniform(0.0, core::f64::consts::TAU));
        deviation * (-2.0 * radius.ln()).sqrt() * angle.cos()
    }

    /// Gaussian with this probability, otherwise exactly zero.
    fn sometimes(&mut self, probability: f64) -> f64 {
        if self.uniform(0.0, 1.0) < probability { self.gaussian(0.8) } else { 0.0 }
    }
}

/// One problem for each axis.
pub fn problems(seed: u64, axes: usize, order: Order) -> Vec<Problem> {
    let mut random = Random(seed);
    (0..axes).map(|_| problem(&mut random, order)).collect()
}

/// Problems from the state at this part of the duration of each motion to the same target, as when a controller plans again.
pub fn planned_anew(seed: u64, axes: usize, part: f64) -> Vec<Problem> {
    let mut set = problems(seed, axes, Order::Third);
    let mut profiles = vec![Profile::hold(0.0); axes];
    let duration_s = synchronised(&set, &mut profiles, PlanOptions::default()).unwrap_or_default();
    for (problem, profile) in set.iter_mut().zip(&profiles) {
        problem.start = profile.sample(part * duration_s);
    }
    set
}

fn problem(random: &mut Random, order: Order) -> Problem {
    loop {
        let (p0, pf) = (random.gaussian(4.0), random.gaussian(4.0));
        let (v0, mut a0, vf, mut af) =
            (random.sometimes(0.9), random.sometimes(0.8), random.sometimes(0.7), random.sometimes(0.6));
        let mut limit = |admitted: f64| random.uniform(0.1, 12.0) + f64::abs(admitted);
        let (velocity, acceleration, mut jerk) = (limit(vf), limit(af), limit(0.0));
        if order == Order::Second {
            (a0, af, jerk) = (0.0, 0.0, f64::INFINITY);
        }
        let bound =
            |velocity: f64, acceleration: f64| velocity + acceleration * acceleration.abs() / (2.0 * jerk);
        let inside = |value: f64, limit: f64| value.abs() <= limit;
        let start_inside =
            inside(v0, velocity) && inside(a0, acceleration) && inside(bound(v0, a0), velocity);
        if start_inside && inside(bound(vf, -af), velocity) {
            return Problem {
                start: State { position: p0, velocity: v0, acceleration: a0 },
                target: State { position: pf, velocity: vf, acceleration: af },
                limits: Limits::symmetric(velocity, acceleration, jerk),
            };
        }
    }
}
