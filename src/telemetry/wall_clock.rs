//! Converts the monotonic clock of a run to the time of day of files and reports.

use std::time::{SystemTime, UNIX_EPOCH};

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds};

const DAYS_PER_400_YEARS: u64 = 146_097;

/// The time of day at zero of the monotonic clock. It is read once, so recorded times stay monotonic when the system's clock
/// is set during a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallClock {
    unix_at_zero_ns: u64,
}

impl WallClock {
    /// The wall clock of a run whose monotonic clock shows `now_ns` at this moment.
    pub fn starting_now(now_ns: Nanoseconds) -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { unix_at_zero_ns: (unix.as_nanos() as u64).saturating_sub(now_ns) }
    }

    /// A wall clock for virtual time: `unix_at_zero_ns` (since 1970-01-01 UTC) at zero.
    pub const fn fixed(unix_at_zero_ns: u64) -> Self {
        Self { unix_at_zero_ns }
    }

    /// Nanoseconds since 1970-01-01 UTC at an instant of the monotonic clock.
    pub const fn unix_ns(self, at_ns: Nanoseconds) -> u64 {
        self.unix_at_zero_ns.saturating_add(at_ns)
    }

    /// An instant of the monotonic clock as `20250131T235959Z`, for file names.
    pub(crate) fn file_stamp(self, at_ns: Nanoseconds) -> String {
        let ([year, month, day], [hour, minute, second]) = self.date_and_time(at_ns);
        format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
    }

    /// An instant of the monotonic clock as `2025-01-31 23:59:59.123 UTC`, for people.
    pub fn moment(self, at_ns: Nanoseconds) -> String {
        let ([year, month, day], [hour, minute, second]) = self.date_and_time(at_ns);
        let milliseconds = self.unix_ns(at_ns) % NANOSECONDS_PER_SECOND / 1_000_000;
        format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}.{milliseconds:03} UTC")
    }

    fn date_and_time(self, at_ns: Nanoseconds) -> ([u64; 3], [u64; 3]) {
        let seconds = self.unix_ns(at_ns) / NANOSECONDS_PER_SECOND;
        (civil_date(seconds / 86_400).into(), [seconds / 3600 % 24, seconds / 60 % 60, seconds % 60])
    }
}

/// The Gregorian date so many days after 1970-01-01. Years are counted from March, so that the leap day is the last
/// day of a year; 400 of them always have the same number of days.
fn civil_date(days_since_1970: u64) -> (u64, u64, u64) {
    // 719 468 days lie between 0000-03-01 and 1970-01-01.
    let days = days_since_1970 + 719_468;
    let (era, day_of_era) = (days / DAYS_PER_400_YEARS, days % DAYS_PER_400_YEARS);
    // Without the leap days of 4, 100 (none) and 400 years, every year has 365 days.
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / (DAYS_PER_400_YEARS - 1)) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // From March on, five months have 153 days.
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (era * 400 + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_of_four_centuries_follows_the_one_before() {
        let is_leap =
            |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
        let (mut year, mut month, mut day) = (1970, 1, 1);
        for days in 0..DAYS_PER_400_YEARS {
            assert_eq!(civil_date(days), (year, month, day));
            let length = match month {
                2 => 28 + u64::from(is_leap(year)),
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            day += 1;
            if day > length {
                (month, day) = (month + 1, 1);
            }
            if month > 12 {
                (year, month) = (year + 1, 1);
            }
        }
        assert_eq!(year, 2370);
    }

    #[test]
    fn a_file_stamp_is_utc_to_the_second() {
        let clock = WallClock::fixed(1_700_000_000 * NANOSECONDS_PER_SECOND);
        assert_eq!(clock.file_stamp(0), "20231114T221320Z");
        assert_eq!(clock.moment(123_999_999), "2023-11-14 22:13:20.123 UTC");
        assert_eq!(clock.file_stamp(39 * NANOSECONDS_PER_SECOND + 999_999_999), "20231114T221359Z");
    }

    #[test]
    fn a_clock_started_now_shows_the_time_of_day() {
        let now = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        let before = now();
        let clock = WallClock::starting_now(5_000);
        assert!((before..=now()).contains(&clock.unix_ns(5_000)));
    }
}
