//! Random numbers: SplitMix64, small and the same on every machine.

/// The generator.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn integer(&mut self, low: i32, high: i32) -> f64 {
        self.uniform(f64::from(low), f64::from(high) + 1.0).floor()
    }

    pub fn gaussian(&mut self, deviation: f64) -> f64 {
        let (radius, angle) = (self.uniform(1e-300, 1.0), self.uniform(0.0, core::f64::consts::TAU));
        deviation * (-2.0 * radius.ln()).sqrt() * angle.cos()
    }

    /// Gaussian with this probability, otherwise exactly zero.
    pub fn sometimes(&mut self, probability: f64) -> f64 {
        if self.uniform(0.0, 1.0) < probability { self.gaussian(0.8) } else { 0.0 }
    }

    pub fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    pub fn one_of<const N: usize>(&mut self, values: [f64; N]) -> f64 {
        values[(self.next() % N as u64) as usize]
    }
}
