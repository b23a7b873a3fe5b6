//! How wide the terminal is, and sentences that fit it.

use std::env;
use std::io::{IsTerminal, stdout};

/// The columns of the terminal that the result is printed to, or those of the variable `COLUMNS`; `None` where there is no
/// terminal, so that lines stay whole for other programs.
pub fn columns() -> Option<u16> {
    let asked = env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    let of_terminal = || {
        let (width, _) = terminal_size::terminal_size_of(stdout())?;
        Some(width.0)
    };
    asked.or_else(|| stdout().is_terminal().then(of_terminal).flatten()).filter(|columns| *columns > 0)
}

/// A paragraph that is broken between words to fit the terminal. Lines after the first begin with so many spaces.
pub fn paragraph(text: &str, indentation: usize) -> String {
    match columns() {
        None => text.to_owned(),
        Some(columns) => broken(text, indentation, columns.into()),
    }
}

/// The same for so many columns.
pub fn broken(text: &str, indentation: usize, columns: usize) -> String {
    let indentation = " ".repeat(indentation);
    let options = textwrap::Options::new(columns).subsequent_indent(&indentation).break_words(false);
    // A number stays with its unit.
    textwrap::fill(&text.replace(" µs", "\u{a0}µs"), options).replace('\u{a0}', " ")
}

#[cfg(test)]
mod tests {
    use super::broken;

    #[test]
    fn a_paragraph_is_broken_between_words_and_indented_from_its_second_line_on() {
        assert_eq!(
            broken("  reserve  SYNC may leave late", 11, 20),
            "  reserve  SYNC may\n           leave\n           late"
        );
    }
}
