//! The time of day that the controller tells its drives: the TIME message of CiA 301 (7.2.6).

use crate::frame::{Frame, Id};
use crate::function_code;
use crate::time::Nanoseconds;

const MILLISECOND_NS: u64 = 1_000_000;
const DAY_MS: u64 = 86_400_000;
/// The field has 28 bits.
const MILLISECONDS_MASK: u32 = 0x0FFF_FFFF;

/// The identifier of TIME in the pre-defined connection set.
pub const TIME_ID: Id = Id::canopen(function_code::TIME, 0);

/// A time of day (TIME_OF_DAY of CiA 301, 7.1.6.5) in UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct TimeOfDay {
    /// Days since 1984-01-01.
    pub days: u16,
    /// Milliseconds since midnight; less than 86 400 000 (more in a leap second), at most 28 bits.
    pub milliseconds: u32,
}

impl TimeOfDay {
    /// So many milliseconds after the beginning of 1984-01-01; `None` after 2163, which the days cannot count.
    pub fn after_epoch(milliseconds: u64) -> Option<Self> {
        let days = u16::try_from(milliseconds / DAY_MS).ok()?;
        Some(Self { days, milliseconds: (milliseconds % DAY_MS) as u32 })
    }

    /// Milliseconds since the beginning of 1984-01-01.
    pub fn since_epoch_ms(self) -> u64 {
        u64::from(self.days) * DAY_MS + u64::from(self.milliseconds)
    }

    /// The six bytes on the wire.
    pub fn encode(self) -> [u8; 6] {
        let [a, b, c, d] = (self.milliseconds & MILLISECONDS_MASK).to_le_bytes();
        let [low, high] = self.days.to_le_bytes();
        [a, b, c, d, low, high]
    }

    /// From six bytes. The four bits above the milliseconds are reserved and not looked at.
    pub fn from_bytes([a, b, c, d, low, high]: [u8; 6]) -> Self {
        Self {
            days: u16::from_le_bytes([low, high]),
            milliseconds: u32::from_le_bytes([a, b, c, d]) & MILLISECONDS_MASK,
        }
    }

    /// The message on the pre-defined identifier 0x100.
    pub fn frame(self) -> Frame {
        Frame::of(TIME_ID, self.encode())
    }

    /// Reads a message on the pre-defined identifier; `None` when a frame is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.id() != TIME_ID {
            return None;
        }
        Some(Self::from_bytes(frame.payload().try_into().ok()?))
    }
}

/// Sends TIME every so many cycles, once it knows the time of day: the clock of the cycle does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(crate) struct TimeProducer {
    cycles: u32,
    /// Cycles until the next message.
    due: u32,
    /// The time of day at zero of the cycle's clock, in nanoseconds after the beginning of 1984-01-01.
    at_zero_ns: Option<u64>,
    /// The message of this cycle.
    message: Option<Frame>,
}

impl TimeProducer {
    pub fn new(cycles: u32) -> Self {
        Self { cycles: cycles.max(1), due: 0, at_zero_ns: None, message: None }
    }

    pub fn set(&mut self, at_zero_ns: u64) {
        self.at_zero_ns = Some(at_zero_ns);
    }

    /// Lets so many cycles pass. What was missed is not made up for.
    pub fn pass(&mut self, cycles: u64, now_ns: Nanoseconds) {
        self.due = self.due.saturating_sub(u32::try_from(cycles).unwrap_or(u32::MAX));
        let time = self.at_zero_ns.filter(|_| self.due == 0).and_then(|at_zero_ns| {
            TimeOfDay::after_epoch(at_zero_ns.saturating_add(now_ns) / MILLISECOND_NS)
        });
        self.message = time.map(TimeOfDay::frame);
        if time.is_some() {
            self.due = self.cycles;
        }
    }

    /// The message, in the cycles in which it is due.
    pub fn message(&self) -> Option<Frame> {
        self.message
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::format;

    #[test]
    fn a_message_is_milliseconds_and_days_low_byte_first() {
        let time = TimeOfDay { days: 0x1234, milliseconds: 0x0123_4567 };
        assert_eq!(format!("{:?}", time.frame()), "100#674523013412");
        assert_eq!(TimeOfDay::decode(&time.frame()), Some(time));
        assert_eq!(TimeOfDay::decode(&Frame::of(Id::canopen(0x100, 0), [0; 5])), None);
        assert_eq!(TimeOfDay::decode(&Frame::of(Id::canopen(0x100, 1), [0; 6])), None);
        let reserved = Frame::of(Id::canopen(0x100, 0), [0x67, 0x45, 0x23, 0xF1, 0x34, 0x12]);
        assert_eq!(TimeOfDay::decode(&reserved), Some(time));
    }

    #[test]
    fn days_begin_at_midnight_and_end_with_the_field() {
        let last = TimeOfDay { days: u16::MAX, milliseconds: 86_399_999 };
        assert_eq!(TimeOfDay::after_epoch(last.since_epoch_ms()), Some(last));
        assert_eq!(TimeOfDay::after_epoch(last.since_epoch_ms() + 1), None);
        assert_eq!(TimeOfDay::after_epoch(86_400_000), Some(TimeOfDay { days: 1, milliseconds: 0 }));
    }

    #[test]
    fn nothing_is_told_before_the_time_is_known_and_then_every_so_many_cycles() {
        let mut producer = TimeProducer::new(3);
        producer.pass(1, 0);
        assert_eq!(producer.message(), None);
        producer.set(86_400_000_000_000);
        let told: std::vec::Vec<_> = (1..=7)
            .map(|cycle| {
                producer.pass(1, cycle * 1_500_000);
                producer.message().and_then(|frame| TimeOfDay::decode(&frame)).map(|time| time.milliseconds)
            })
            .collect();
        assert_eq!(told, [Some(1), None, None, Some(6), None, None, Some(10)]);
        producer.pass(8, 20_000_000);
        assert!(producer.message().is_some());
        producer.pass(1, 21_000_000);
        assert_eq!(producer.message(), None, "one after a pause");
    }
}
