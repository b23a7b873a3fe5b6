//! The text of a file with its problems: where its lines begin, and the line of a problem as people are shown it.

use std::fmt;
use std::ops::Range;

use crate::printable::letter_start;

/// The most bytes of a file that are shown around a problem. A longer excerpt takes long to render, and is not
/// readable.
const SHOWN_AT_MOST: usize = 2000;
/// What is shown on both sides of a problem in a line that is too long.
const SIDE: usize = 60;

/// Where each line of a text begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineStarts(Vec<usize>);

impl LineStarts {
    /// Finds the lines of a text.
    pub fn of(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        Self(std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect())
    }

    /// Where a line begins, counted from 0.
    pub fn start_of(&self, line: usize) -> usize {
        self.0.get(line).copied().unwrap_or(0)
    }

    /// The line in which a byte is, counted from 1.
    pub fn line_of(&self, at: usize) -> usize {
        self.0.partition_point(|start| *start <= at)
    }
}

/// The text of a file, to be shown beside its problems.
#[derive(Debug, PartialEq, Eq)]
pub struct SourceText {
    name: String,
    text: String,
    lines: LineStarts,
}

/// The part of a line around a problem.
struct Part<'a> {
    text: &'a str,
    /// The first byte of it in the whole text.
    start: usize,
}

impl SourceText {
    /// The text of the file that messages call `name`.
    pub fn new(name: impl Into<String>, text: String) -> Self {
        let lines = LineStarts::of(&text);
        Self { name: name.into(), text, lines }
    }

    /// Returns the name of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The line and the column of a byte, the column in characters; both are counted from 1.
    pub fn position(&self, at: usize) -> (usize, usize) {
        let at = at.min(self.text.len());
        let line = self.lines.line_of(at);
        let start = self.lines.start_of(line.saturating_sub(1));
        (line, self.text.get(start..at).map_or(0, |before| before.chars().count()) + 1)
    }

    /// A problem with its line, for people: what is wrong, where, and what to do about it.
    pub fn write_problem(
        &self,
        to: &mut impl fmt::Write,
        problem: &impl fmt::Display,
        place: Option<(Range<usize>, &str)>,
        help: &str,
    ) -> fmt::Result {
        write!(to, "\n{problem}")?;
        if let Some((span, label)) = place {
            let (line, column) = self.position(span.start);
            let part = self.part_around(&span);
            let number = line.to_string();
            let margin = " ".repeat(number.len());
            let before = part.text.get(..span.start.saturating_sub(part.start)).unwrap_or_default();
            let marked = part.text.get(before.len()..).unwrap_or_default();
            let length = letter_start(marked, span.len());
            let marked = marked.get(..length).unwrap_or_default().chars().count().max(1);
            // A tab stays a tab, so that the mark is below its place.
            let before: String =
                before.chars().map(|letter| if letter == '\t' { '\t' } else { ' ' }).collect();
            write!(to, "\n {margin}--> {}:{line}:{column}", self.name)?;
            write!(to, "\n {number} | {}", part.text)?;
            write!(to, "\n {margin} | {before}{} {label}", "^".repeat(marked))?;
        }
        if !help.is_empty() {
            write!(to, "\n  help: {help}")?;
        }
        writeln!(to)
    }

    /// The line of the beginning of a span; of a very long line the part around the span.
    fn part_around(&self, span: &Range<usize>) -> Part<'_> {
        let text = &self.text;
        let at = span.start.min(text.len());
        let line = self.lines.line_of(at).saturating_sub(1);
        let line_start = self.lines.start_of(line);
        let line_end =
            text.get(at..).and_then(|rest| rest.find(['\r', '\n'])).map_or(text.len(), |end| at + end);
        let is_long = line_end - line_start > SHOWN_AT_MOST;
        let (mut start, mut end) = (line_start, line_end);
        if is_long {
            start = letter_start(text, at.saturating_sub(SIDE).max(line_start));
            let span_end = at + span.len().min(SHOWN_AT_MOST);
            end = letter_start(text, (span_end + SIDE).min(line_end).max(at));
        }
        Part { text: text.get(start..end).unwrap_or_default(), start }
    }
}

#[cfg(feature = "miette")]
mod with_miette {
    use miette::{MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

    use super::{SHOWN_AT_MOST, SourceText};

    impl SourceCode for SourceText {
        fn read_span<'a>(
            &'a self,
            span: &SourceSpan,
            context_lines_before: usize,
            context_lines_after: usize,
        ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
            let contents = self.text.read_span(span, context_lines_before, context_lines_after)?;
            let name = self.name.clone();
            let (data, at, line, column, lines) = if contents.data().len() <= SHOWN_AT_MOST {
                let column = contents.column();
                (contents.data(), *contents.span(), contents.line(), column, contents.line_count())
            } else {
                let part = self.part_around(&(span.offset()..span.offset() + span.len()));
                let (line, column) = self.position(part.start);
                (part.text.as_bytes(), (part.start, part.text.len()).into(), line - 1, column - 1, 1)
            };
            Ok(Box::new(MietteSpanContents::new_named(name, data, at, line, column, lines)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str, span: Range<usize>) -> String {
        let mut shown = String::new();
        let source = SourceText::new("arm.toml", text.to_owned());
        source.write_problem(&mut shown, &"it is wrong", Some((span, "this")), "mend it").unwrap();
        shown
    }

    #[test]
    fn a_problem_is_shown_with_its_place_and_its_line_and_a_mark_below_it() {
        let expected = "
it is wrong
  --> arm.toml:2:6
 2 | \tbö = 77
   | \t     ^^ this
  help: mend it
";
        assert_eq!(shown("a = 1\r\n\tbö = 77\r\nc = 3\n", 14..16), expected.replace(":2:6", ":2:7"));
    }

    #[test]
    fn the_end_of_a_text_and_spans_of_several_lines_have_a_mark_too() {
        assert!(shown("a = 1\n", 6..6).ends_with(":2:1\n 2 | \n   | ^ this\n  help: mend it\n"));
        assert!(shown("ab\ncd\n", 1..5).contains("\n 1 | ab\n   |  ^ this\n"));
        assert!(shown("", 5..9).contains("--> arm.toml:1:1"));
    }

    #[test]
    fn of_a_very_long_line_the_part_around_the_problem_is_shown() {
        let text = format!("x = \"{}\u{1F9BE}wrong{}\"", "a".repeat(5_000), "b".repeat(5_000));
        let at = text.find("wrong").unwrap();
        let shown = shown(&text, at..at + 5);
        assert!(shown.len() < 400 && shown.contains("wrong") && shown.contains("^^^^^ this"), "{shown}");
        assert!(shown.contains(":1:5007"), "{shown}");
    }
}
