//! How long the frames that a port saw have occupied the wire.

use crate::frame::Frame;
use crate::time::{NANOSECONDS_PER_SECOND, Nanoseconds};
use crate::wire::UnstuffedLength;

/// The bits that have passed the wire, without stuff bits.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WireTime {
    /// Bits at the nominal bit rate.
    nominal_bits: u64,
    /// Bits at the bit rate of the data phase.
    data_bits: u64,
    bit_rate: u32,
    data_bit_rate: Option<u32>,
}

impl WireTime {
    /// Of a bus with these bit rates in bit/s.
    pub(super) fn new(bit_rate: u32, data_bit_rate: Option<u32>) -> Self {
        Self { bit_rate, data_bit_rate, ..Self::default() }
    }

    /// Counts a frame.
    pub(super) fn add(&mut self, frame: &Frame) {
        let UnstuffedLength { nominal_bits, data_bits } = UnstuffedLength::of(frame);
        self.nominal_bits += u64::from(nominal_bits);
        self.data_bits += u64::from(data_bits);
    }

    /// The time of all frames. The bits become a time here, so that no frame costs a division.
    pub(super) fn busy_ns(&self) -> Nanoseconds {
        let data_bit_rate = self.data_bit_rate.unwrap_or(self.bit_rate);
        bits_ns(self.nominal_bits, self.bit_rate).saturating_add(bits_ns(self.data_bits, data_bit_rate))
    }
}

/// How long these bits take at this bit rate, in whole nanoseconds.
fn bits_ns(bits: u64, bit_rate: u32) -> Nanoseconds {
    let bit_rate = u64::from(bit_rate.max(1));
    // Whole seconds apart from the rest: the product of all bits and 10⁹ overflows after five hours of a full bus.
    let seconds_ns = (bits / bit_rate).saturating_mul(NANOSECONDS_PER_SECOND);
    seconds_ns.saturating_add(bits % bit_rate * NANOSECONDS_PER_SECOND / bit_rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_that_the_wire_was_occupied_is_right_after_years_of_a_full_bus() {
        const YEAR_S: u64 = 365 * 24 * 3_600;
        assert_eq!(
            bits_ns(10 * YEAR_S * 1_000_000 + 3, 1_000_000),
            10 * YEAR_S * NANOSECONDS_PER_SECOND + 3_000
        );
        assert_eq!(bits_ns(u64::MAX, 1), u64::MAX);
        assert_eq!(bits_ns(5, 0), 5 * NANOSECONDS_PER_SECOND);
    }
}
