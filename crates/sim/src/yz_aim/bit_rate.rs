//! The procedure that changes the bit rate: four writes in a fixed order (manual 5.13).

/// The objects of the procedure, by their index.
const MODBUS_ENABLE: u16 = 0x2600;
const FLUX_WEAKENING_ANGLE: u16 = 0x2604;
const ACCELERATION: u16 = 0x6083;

/// The progress of the procedure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BitRateChange {
    /// Not begun.
    #[default]
    None,
    /// 2600h = 1.
    Begun,
    /// 6083h = the code of this rate (bit/s).
    Chosen(u32),
    /// 2604h = 129.
    Confirmed(u32),
}

impl BitRateChange {
    /// Takes a write. The last write of the procedure returns the new bit rate (bit/s), which takes effect at the next
    /// power-up.
    pub fn written(&mut self, index: u16, value: i64) -> Option<u32> {
        let (next, rate) = match (*self, index, value) {
            (_, MODBUS_ENABLE, 1) => (Self::Begun, None),
            (Self::Begun | Self::Chosen(_), ACCELERATION, 800..=803) => {
                (Self::Chosen(125_000 << (value - 800)), None)
            }
            (Self::Chosen(rate), FLUX_WEAKENING_ANGLE, 129) => (Self::Confirmed(rate), None),
            (Self::Confirmed(rate), MODBUS_ENABLE, 506) => (Self::None, Some(rate)),
            (_, MODBUS_ENABLE | ACCELERATION | FLUX_WEAKENING_ANGLE, _) => (Self::None, None),
            (unchanged, _, _) => (unchanged, None),
        };
        *self = next;
        rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(writes: &[(u16, i64)]) -> Option<u32> {
        let mut change = BitRateChange::default();
        writes.iter().fold(None, |_, (index, value)| change.written(*index, *value))
    }

    #[test]
    fn only_the_four_writes_in_the_right_order_change_the_bit_rate() {
        let write = |code| {
            [(MODBUS_ENABLE, 1), (ACCELERATION, code), (FLUX_WEAKENING_ANGLE, 129), (MODBUS_ENABLE, 506)]
        };
        let rates = [800, 801, 802, 803].map(|code| after(&write(code)));
        assert_eq!(rates, [125_000, 250_000, 500_000, 1_000_000].map(Some));
        assert_eq!(after(&write(804)), None);
        assert_eq!(after(&write(802)[1..]), None);
        let [begin, choose, confirm, end] = write(802);
        assert_eq!(after(&[begin, confirm, choose, end]), None);
        assert_eq!(after(&[begin, choose, confirm, (ACCELERATION, 20_000), end]), None);
    }
}
