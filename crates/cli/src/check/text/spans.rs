//! Names, numbers and times in short.

use takt::schedule::text::microseconds;

/// The elements that follow each other and are alike.
pub fn alike<T>(elements: &[T], are_alike: impl Fn(&T, &T) -> bool) -> Vec<&[T]> {
    elements.chunk_by(are_alike).collect()
}

/// `a`, or `a, b`, or `a … z`; each name once where it is repeated.
pub fn span<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut different: Vec<&str> = names.collect();
    different.dedup();
    match different[..] {
        [first, _, .., last] if different.len() > 2 => format!("{first} … {last}"),
        _ => different.join(", "),
    }
}

/// The same with how many there are, where not all of them are named.
pub fn counted_span<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let count = names.len();
    let span = span(names);
    if count > 2 { format!("{span} ({count})") } else { span }
}

/// A number with five significant digits, without zeros at its end.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (4 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A length of time in the unit that suits it.
pub fn time(ns: u64) -> String {
    if ns >= 1_000_000_000 && ns.is_multiple_of(100_000_000) {
        format!("{} s", ns as f64 / 1e9)
    } else if ns >= 1_000_000 && ns.is_multiple_of(100_000) {
        format!("{} ms", ns as f64 / 1e6)
    } else {
        format!("{} µs", microseconds(ns))
    }
}
