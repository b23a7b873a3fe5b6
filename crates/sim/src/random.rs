//! Reproducible pseudo-random numbers (SplitMix64; G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number
//! generators", OOPSLA 2014).

/// A reproducible sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random(u64);

impl Random {
    /// The sequence of one drive under one seed.
    pub fn new(seed: u64, node: u8) -> Self {
        let mut random = Self(seed ^ u64::from(node) << 56);
        random.next_u64();
        random
    }

    /// A sequence for something that draws no number from it.
    pub const fn placeholder() -> Self {
        Self(0)
    }

    /// The next number.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// A number in a range without its end; the start for an empty range.
    pub fn within(&mut self, range: std::ops::Range<u64>) -> u64 {
        let width = range.end.saturating_sub(range.start).max(1);
        range.start + self.next_u64() % width
    }
}
