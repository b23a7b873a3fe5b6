//! Text that somebody else has chosen (the contents and names of files, arguments), made safe to show on a terminal.

use std::fmt;
use std::path::Path;

/// The same text without what would move a terminal's cursor, colour what follows, or turn its direction. Every
/// character that is replaced is as long as what stands in its place, so that places in the text stay what they are.
pub fn printable(text: &str) -> String {
    let mut letters = text.chars().peekable();
    let mut shown = String::with_capacity(text.len());
    while let Some(letter) = letters.next() {
        let is_line_end = letter == '\r' && letters.peek() == Some(&'\n');
        shown.push(if is_line_end { letter } else { replacement(letter) });
    }
    shown
}

/// A path, made safe in the same way.
pub fn printable_path(path: &Path) -> String {
    printable(&path.display().to_string())
}

/// A number of a message, with the decimals of its format. One of 1e9 and above has an exponent, and a zero has no sign.
#[derive(Clone, Copy, Debug)]
pub struct Shown(pub f64);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = *self;
        let text = match f.precision() {
            _ if value.abs() >= 1e9 => format!("{value:e}"),
            Some(decimals) => format!("{value:.decimals$}"),
            None => value.to_string(),
        };
        let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
        f.write_str(if is_zero { text.trim_start_matches('-') } else { &text })
    }
}

/// The beginning of a text that may be of any length, for a message.
pub fn excerpt(text: &str) -> String {
    const LETTERS: usize = 80;
    let mut shown = printable(text.get(..letter_start(text, 4 * LETTERS)).unwrap_or_default());
    if let Some((end, _)) = shown.char_indices().nth(LETTERS) {
        shown.truncate(end);
        shown.push('…');
    }
    shown
}

/// The last beginning of a letter at or before a byte; the end of a text that is shorter.
pub fn letter_start(text: &str, at: usize) -> usize {
    let is_start = |at: &usize| text.is_char_boundary(*at);
    (0..=at.min(text.len())).rev().find(is_start).unwrap_or(0)
}

const fn replacement(letter: char) -> char {
    match letter {
        '\n' | '\t' => letter,
        '\0'..='\u{1F}' | '\u{7F}' => '?',
        '\u{80}'..='\u{9F}' => '¿',
        '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}' => {
            char::REPLACEMENT_CHARACTER
        }
        _ => letter,
    }
}

#[cfg(test)]
mod tests {
    use super::{Shown, excerpt, printable};
    use proptest::prelude::*;

    #[test]
    fn what_a_terminal_would_obey_is_replaced_and_everything_else_stays() {
        assert_eq!(printable("\u{1B}[2J\u{9B}1m\u{202E}\rä\0"), "?[2J¿1m\u{FFFD}?ä?");
        let plain = "k = \"µs\"\t# \u{2026}\r\nnext 日本\n";
        assert_eq!(printable(plain), plain);
    }

    #[test]
    fn no_number_has_hundreds_of_digits_and_no_zero_a_sign() {
        let shown = [1e308, -1e308, 1e9, 999_999_999.0, -0.000_001, -0.0, -0.01, f64::INFINITY, f64::NAN];
        let shown = shown.map(|value| format!("{:.4} {}", Shown(value), Shown(value)));
        let expected = [
            "1e308 1e308",
            "-1e308 -1e308",
            "1e9 1e9",
            "999999999.0000 999999999",
            "0.0000 -0.000001",
            "0.0000 0",
            "-0.0100 -0.01",
            "inf inf",
            "NaN NaN",
        ];
        assert_eq!(shown, expected);
    }

    #[test]
    fn a_long_text_is_cut_and_a_short_one_is_whole() {
        assert_eq!(excerpt("left\u{1B}"), "left?");
        assert_eq!(excerpt(&"ä".repeat(80)), "ä".repeat(80));
        assert_eq!(excerpt(&"日".repeat(1_000_000)), format!("{}…", "日".repeat(80)));
    }

    proptest! {
        #[test]
        fn every_character_keeps_its_place(text in any::<String>()) {
            let places = |text: &str| text.char_indices().map(|(at, _)| at).collect::<Vec<_>>();
            prop_assert_eq!(places(&printable(&text)), places(&text));
        }
    }
}
