//! The text of a file as `miette` shows it: the lines around a problem, and of very long lines the part around it.

use miette::{MietteError, MietteSpanContents, NamedSource, SourceCode, SourceSpan, SpanContents};

use super::error::LineStarts;
use crate::printable::letter_start;

/// The most bytes of a file that are shown around a problem. A longer excerpt takes long to render, and is not
/// readable.
const SHOWN_AT_MOST: usize = 2000;
/// What is shown on both sides of a problem in a line that is too long.
const SIDE: usize = 60;

/// The text of a file, to be shown beside its problems.
#[derive(Debug)]
pub struct SourceView {
    source: NamedSource<String>,
    lines: LineStarts,
}

impl SourceView {
    pub fn new(name: &str, text: String) -> Self {
        let lines = LineStarts::of(&text);
        Self { source: NamedSource::new(name, text), lines }
    }

    /// The part of the line around a span.
    fn part_around(&self, span: &SourceSpan) -> MietteSpanContents<'_> {
        let text = self.source.inner();
        let at = span.offset().min(text.len());
        let line = self.lines.line_of(at) - 1;
        let line_start = self.lines.start_of(line);
        let line_end = text.get(at..).and_then(|rest| rest.find('\n')).map_or(text.len(), |end| at + end);
        let start = letter_start(text, at.saturating_sub(SIDE).max(line_start));
        let span_end = at + span.len().min(SHOWN_AT_MOST);
        let end = letter_start(text, (span_end + SIDE).min(line_end).max(at));
        let part = text.get(start..end).unwrap_or_default();
        let column = text.get(line_start..start).map_or(0, |before| before.chars().count());
        let name = self.source.name().to_owned();
        MietteSpanContents::new_named(name, part.as_bytes(), (start, part.len()).into(), line, column, 1)
    }
}

impl SourceCode for SourceView {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let contents = self.source.read_span(span, context_lines_before, context_lines_after)?;
        if contents.data().len() <= SHOWN_AT_MOST {
            Ok(contents)
        } else {
            Ok(Box::new(self.part_around(span)))
        }
    }
}
