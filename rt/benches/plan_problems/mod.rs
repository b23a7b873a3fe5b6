//! Random problems from a fixed seed, in the distribution of Ruckig's own benchmark.

use takt_rt::plan::{Limits, Problem, State};

/// Which derivative is limited.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Acceleration.
    Second,
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

fn problem(random: &mut Random, order: Order) -> Problem {
    let _ = order;
    loop {
        let (p0, pf) = (random.gaussian(4.0), random.gaussian(4.0));
        let (v0, vf) = (random.sometimes(0.9), random.sometimes(0.7));
        let velocity = random.uniform(0.1, 12.0) + f64::abs(vf);
        let acceleration = random.uniform(0.1, 12.0);
        if f64::abs(v0) <= velocity {
            return Problem {
                start: State { position: p0, velocity: v0, acceleration: 0.0 },
                target: State { position: pf, velocity: vf, acceleration: 0.0 },
                limits: Limits::symmetric(velocity, acceleration, f64::INFINITY),
            };
        }
    }
}
