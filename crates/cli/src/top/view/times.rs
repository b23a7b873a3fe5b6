//! Times for people.

use takt_rt::Nanoseconds;

/// A length of time with two or three digits: `850 ns`, `12 µs`, `1.5 ms`, `3.2 s`, `12 min`.
pub fn duration(ns: Nanoseconds) -> String {
    let shown = |number: f64, unit: &str| {
        let digits = usize::from(number < 9.95);
        let text = format!("{number:.digits$}");
        format!("{} {unit}", text.strip_suffix(".0").unwrap_or(&text))
    };
    let number = ns as f64;
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => shown(number / 1e3, "µs"),
        1_000_000..1_000_000_000 => shown(number / 1e6, "ms"),
        1_000_000_000..120_000_000_000 => shown(number / 1e9, "s"),
        _ => format!("{:.0} min", number / 6e10),
    }
}

/// How long ago something was; what was just now is no longer ago than that.
pub fn age(ns: Nanoseconds) -> String {
    if ns < 100_000_000 { "now".to_owned() } else { duration(ns / 100_000_000 * 100_000_000) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_two_or_three_digits_and_their_unit() {
        let times = [0, 850, 1_000, 12_400, 1_530_000, 999_000_000, 3_210_000_000, 119_000_000_000];
        let words = ["0 ns", "850 ns", "1 µs", "12 µs", "1.5 ms", "999 ms", "3.2 s", "119 s"];
        assert_eq!(times.map(duration), words);
        assert_eq!(duration(720_000_000_000), "12 min");
        assert_eq!((age(99_000_000), age(250_000_000)), ("now".to_owned(), "200 ms".to_owned()));
    }
}
