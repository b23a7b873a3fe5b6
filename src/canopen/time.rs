//! The TIME message (CiA 301, 7.2.6): the time of day, in milliseconds since midnight and days since 1984-01-01.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use takt_rt::frame::{Frame, Id};
use takt_rt::time::Nanoseconds;

use super::function_code;

/// 1984-01-01 in days of Unix time.
const FIRST_DAY: u64 = 5_113;
const DAY_MS: u64 = 86_400_000;
/// The field has 28 bits.
const MILLISECONDS_MASK: u32 = 0x0FFF_FFFF;

/// A time of day (TIME_OF_DAY of CiA 301, 7.1.6.5) in UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeOfDay {
    /// Days since 1984-01-01.
    pub days: u16,
    /// Milliseconds since midnight; less than 86 400 000 (more in a leap second), at most 28 bits.
    pub milliseconds: u32,
}

impl TimeOfDay {
    /// A system time; `None` before 1984 and after 2163.
    pub fn from_system_time(time: SystemTime) -> Option<Self> {
        let since_1970_ms = u64::try_from(time.duration_since(UNIX_EPOCH).ok()?.as_millis()).ok()?;
        let days = u16::try_from((since_1970_ms / DAY_MS).checked_sub(FIRST_DAY)?).ok()?;
        Some(Self { days, milliseconds: (since_1970_ms % DAY_MS) as u32 })
    }

    /// As a system time.
    pub fn system_time(self) -> SystemTime {
        let days = FIRST_DAY + u64::from(self.days);
        UNIX_EPOCH + Duration::from_millis(days * DAY_MS + u64::from(self.milliseconds))
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
        Frame::of(Id::canopen(function_code::TIME, 0), self.encode())
    }

    /// Reads a message on the pre-defined identifier; `None` when a frame is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        if frame.id() != Id::canopen(function_code::TIME, 0) {
            return None;
        }
        Some(Self::from_bytes(frame.payload().try_into().ok()?))
    }
}

/// Produces TIME messages at a steady period. The time itself is handed in, since the cycle's clock is not that of the
/// day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeProducer {
    period_ns: Nanoseconds,
    due_at_ns: Nanoseconds,
}

impl TimeProducer {
    /// Sends at once and then every `period_ns`, which is at least 1 ms.
    pub const fn new(period_ns: Nanoseconds) -> Self {
        let period_ns = if period_ns < 1_000_000 { 1_000_000 } else { period_ns };
        Self { period_ns, due_at_ns: 0 }
    }

    /// The message, when it is due. After a pause one is sent, not all that were missed.
    pub fn poll(&mut self, now_ns: Nanoseconds, time: impl FnOnce() -> Option<TimeOfDay>) -> Option<Frame> {
        if now_ns < self.due_at_ns {
            return None;
        }
        let missed = (now_ns - self.due_at_ns) / self.period_ns;
        self.due_at_ns = match self.due_at_ns {
            0 => now_ns.saturating_add(self.period_ns),
            due => due.saturating_add((missed + 1).saturating_mul(self.period_ns)),
        };
        Some(time()?.frame())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_epoch_is_the_first_of_january_1984() {
        let epoch = UNIX_EPOCH + Duration::from_secs(441_763_200);
        let first = TimeOfDay { days: 0, milliseconds: 0 };
        assert_eq!(TimeOfDay::from_system_time(epoch), Some(first));
        assert_eq!(first.system_time(), epoch);
        assert_eq!(TimeOfDay::from_system_time(epoch - Duration::from_millis(1)), None);
        // 2026-11-21 12:00:00.5 UTC
        let later = UNIX_EPOCH + Duration::from_millis(1_795_262_400_500);
        let expected = TimeOfDay { days: 15_665, milliseconds: 43_200_500 };
        assert_eq!(TimeOfDay::from_system_time(later), Some(expected));
    }

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
    fn messages_come_on_a_grid_and_missed_ones_are_not_made_up_for() {
        let mut producer = TimeProducer::new(1_000_000_000);
        let mut is_due =
            |now_ns| producer.poll(now_ns, || Some(TimeOfDay { days: 1, milliseconds: 2 })).is_some();
        assert!(is_due(500));
        assert!(!is_due(1_000_000_000));
        assert!(is_due(1_000_000_600));
        assert!(is_due(5_000_000_700), "after a pause");
        assert!(!is_due(5_900_000_000), "once");
        assert!(is_due(6_000_000_500));
    }
}
