//! Times in logs: seconds with a fraction, or a date and a time of day.

use takt_rt::{NANOSECONDS_PER_SECOND, Nanoseconds};

/// Reads `1700000000.000123`: seconds, with up to nine digits of a fraction.
pub fn seconds(text: &str) -> Option<Nanoseconds> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    whole_number(whole)?.checked_mul(NANOSECONDS_PER_SECOND)?.checked_add(nanoseconds(fraction)?)
}

/// Returns `true` if a time of a log can be a time of day: one after 1990. Others count from another moment, or from the line before.
pub const fn is_time_of_day(at_ns: Nanoseconds) -> bool {
    at_ns >= 631_152_000 * NANOSECONDS_PER_SECOND
}

/// Reads `2026.11.23 10:20:30.123` or `2026-11-23 10:20:30.123456` as UTC.
pub fn moment(date: &str, time: &str) -> Option<Nanoseconds> {
    let mut parts = date.split(['.', '-']).map(whole_number);
    let (year, month, day) = (parts.next()??, parts.next()??, parts.next()??);
    let (clock, fraction) = time.split_once('.').unwrap_or((time, ""));
    let mut clock = clock.split(':').map(whole_number);
    let (hour, minute, second) = (clock.next()??, clock.next()??, clock.next()??);
    let is_date = (1970..=2500).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    if !is_date || hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    let seconds = (days_since_1970(year, month, day) * 24 + hour) * 3600 + minute * 60 + second;
    seconds.checked_mul(NANOSECONDS_PER_SECOND)?.checked_add(nanoseconds(fraction)?)
}

/// Years are counted from March, so that the leap day is the last day of a year.
const fn days_since_1970(year: u64, month: u64, day: u64) -> u64 {
    let year = if month <= 2 { year - 1 } else { year };
    let month_from_march = (month + 9) % 12;
    let day_of_year = (153 * month_from_march + 2) / 5 + day - 1;
    // 719 468 days lie between 0000-03-01 and 1970-01-01; February of 1970 is one of them.
    year * 365 + year / 4 - year / 100 + year / 400 + day_of_year - 719_468
}

fn whole_number(text: &str) -> Option<u64> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|_| is_number)
}

/// The digits behind the point of a second. Those beyond the ninth are cut off.
fn nanoseconds(fraction: &str) -> Option<Nanoseconds> {
    if !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let digits = fraction.get(..9).unwrap_or(fraction);
    let number: u64 = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    Some(number * 10_u64.pow(9 - digits.len() as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_have_any_number_of_decimals() {
        assert_eq!(seconds("1700000000.000123"), Some(1_700_000_000_000_123_000));
        assert_eq!(seconds("5"), Some(5_000_000_000));
        assert_eq!(seconds("0.1234567899"), Some(123_456_789));
        for wrong in ["", "-1", "1e3", "+1", "1.2.3", ".", "99999999999999999999", "1.+5"] {
            assert_eq!(seconds(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_date_and_a_time_of_day_are_utc() {
        assert_eq!(moment("1970.01.01", "00:00:00.5"), Some(500_000_000));
        assert_eq!(moment("2026-11-21", "12:00:00.500"), Some(1_795_262_400_500_000_000));
        assert_eq!(moment("2024.02.29", "23:59:59"), Some(1_709_251_199_000_000_000));
        for (date, time) in [("2024.13.01", "00:00:00"), ("2024.01", "00:00:00"), ("2024.01.01", "24:00:00")]
        {
            assert_eq!(moment(date, time), None);
        }
        assert_eq!(moment("1969-12-31", "00:00:00"), None);
    }
}
