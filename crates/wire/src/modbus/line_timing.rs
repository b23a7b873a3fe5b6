//! How long bytes take on a serial line, and the silence between frames (Modbus over Serial Line 1.02, 2.5.1.1).

use takt_rt::Nanoseconds;

/// The silence between two frames at rates above 19200 bit/s.
const FAST_SILENCE_NS: Nanoseconds = 1_750_000;
/// The highest rate at which the silence is 3.5 characters.
const SLOW_BIT_RATE: u32 = 19_200;

/// The timing of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineTiming {
    /// bit/s
    bit_rate: u32,
    /// The bits of a character, with start, parity and stop bits.
    character_bits: u8,
}

impl LineTiming {
    /// A line with eight data bits, no parity and one stop bit; at least 1 bit/s.
    pub const fn new(bit_rate: u32) -> Self {
        Self { bit_rate: if bit_rate == 0 { 1 } else { bit_rate }, character_bits: 10 }
    }

    /// The same line with other characters: the number of their bits, with start, parity and stop bits.
    pub const fn with_character_bits(self, character_bits: u8) -> Self {
        Self { character_bits, ..self }
    }

    /// bit/s
    pub const fn bit_rate(self) -> u32 {
        self.bit_rate
    }

    /// How long so many characters take.
    pub const fn duration_ns(self, characters: usize) -> Nanoseconds {
        let bits = (characters as u64).saturating_mul(self.character_bits as u64);
        bits.saturating_mul(1_000_000_000).div_ceil(self.bit_rate as u64)
    }

    /// The silence that divides two frames: 3.5 characters, or 1.75 ms above 19200 bit/s.
    pub const fn silence_ns(self) -> Nanoseconds {
        if self.bit_rate > SLOW_BIT_RATE { FAST_SILENCE_NS } else { self.duration_ns(7).div_ceil(2) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_silence_is_three_and_a_half_characters_and_fixed_above_19200() {
        assert_eq!(LineTiming::new(9_600).silence_ns(), 3_645_834);
        assert_eq!(LineTiming::new(19_200).silence_ns(), 1_822_917);
        assert_eq!(LineTiming::new(19_200).with_character_bits(11).silence_ns(), 2_005_209);
        for fast in [38_400, 115_200, 1_000_000] {
            assert_eq!(LineTiming::new(fast).silence_ns(), 1_750_000);
        }
    }

    #[test]
    fn a_write_of_two_registers_takes_1_82_ms_at_115200() {
        let line = LineTiming::new(115_200);
        assert_eq!((line.duration_ns(13 + 8), line.duration_ns(0)), (1_822_917, 0));
    }
}
