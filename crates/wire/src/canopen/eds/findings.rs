//! Collects the problems of a file with their positions, and shows them at their lines.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use super::problem::{EdsProblem, EdsProblemKind, Severity};
use crate::source_text::{LineStarts, SourceText};

/// The largest number of problems that are shown with their lines; [`Findings::problems`] has all.
const MAX_SHOWN: usize = 100;

/// The problems of a file, in its order. With the feature `miette` it is a diagnostic of that crate.
#[derive(Clone)]
pub struct Findings(Arc<Inner>);

struct Inner {
    source: SourceText,
    problems: Vec<EdsProblem>,
}

/// A position in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourcePosition {
    /// The line, counted from 1.
    pub line: usize,
    /// The column, counted in characters from 1.
    pub column: usize,
}

impl Findings {
    pub(super) fn new(source_name: &str, text: String, mut problems: Vec<EdsProblem>) -> Self {
        problems.sort_by_key(|problem| (problem.span.start, problem.span.end));
        Self(Arc::new(Inner { source: SourceText::new(source_name, text), problems }))
    }

    pub(super) fn unreadable(source_name: &str, reason: String) -> Self {
        let kind = EdsProblemKind::Unreadable { reason };
        Self::new(source_name, String::new(), vec![EdsProblem { kind, span: 0..0, first_line: None }])
    }

    /// Every problem in the order of the file.
    pub fn problems(&self) -> &[EdsProblem] {
        &self.0.problems
    }

    /// The name of the file.
    pub fn source_name(&self) -> &str {
        self.0.source.name()
    }

    /// Returns `true` if the file has errors, so that it cannot be used.
    pub fn has_errors(&self) -> bool {
        self.problems().iter().any(|problem| problem.kind.severity() == Severity::Error)
    }

    /// What it is like, with the first error and its line, in one sentence.
    pub fn first_error(&self) -> String {
        match self.problems().iter().find(|problem| problem.kind.severity() == Severity::Error) {
            Some(problem) if problem.label().is_some() => {
                format!("{self}: line {}: {problem}", self.position(problem).line)
            }
            Some(problem) => format!("{}: {problem}", self.source_name()),
            None => self.to_string(),
        }
    }

    /// Returns `true` if there are no problems.
    pub fn is_empty(&self) -> bool {
        self.problems().is_empty()
    }

    /// The position of a problem.
    pub fn position(&self, problem: &EdsProblem) -> SourcePosition {
        let (line, column) = self.0.source.position(problem.span.start);
        SourcePosition { line, column }
    }

    /// The problems that are shown; if there are too many, errors come before warnings.
    pub(super) fn shown(&self) -> impl Iterator<Item = &EdsProblem> {
        let is_many = self.problems().len() > MAX_SHOWN;
        let is_error = |problem: &&EdsProblem| problem.kind.severity() == Severity::Error;
        let first = self.problems().iter().filter(move |problem| !is_many || is_error(problem));
        let then = self.problems().iter().filter(move |problem| is_many && !is_error(problem));
        first.chain(then).take(MAX_SHOWN)
    }

    /// Writes them for people, each with its line.
    pub fn write_problems(&self, to: &mut impl fmt::Write) -> fmt::Result {
        for problem in self.shown() {
            let label = problem.label();
            let place = label.as_deref().map(|label| (problem.span.clone(), label));
            self.0.source.write_problem(to, problem, place, &problem.kind.help())?;
        }
        Ok(())
    }

    #[cfg(feature = "miette")]
    pub(super) fn source(&self) -> &SourceText {
        &self.0.source
    }

    /// The line of a problem, without blanks at its ends.
    pub fn source_line(&self, problem: &EdsProblem) -> &str {
        let text = self.0.source.text();
        let start = problem.span.start.min(text.len());
        let from = text.get(..start).and_then(|before| before.rfind('\n')).map_or(0, |at| at + 1);
        text.get(from..).and_then(|rest| rest.lines().next()).unwrap_or("").trim()
    }
}

impl fmt::Debug for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Findings").field(&self.source_name()).field(&self.problems()).finish()
    }
}

impl PartialEq for Findings {
    fn eq(&self, other: &Self) -> bool {
        self.source_name() == other.source_name()
            && self.0.source.text() == other.0.source.text()
            && self.problems() == other.problems()
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of =
            |severity| self.problems().iter().filter(|problem| problem.kind.severity() == severity).count();
        let counted = |count: usize, what: &str| match count {
            1 => format!("1 {what}"),
            _ => format!("{count} {what}s"),
        };
        let (errors, warnings) = (of(Severity::Error), of(Severity::Warning));
        let name = self.source_name();
        match (errors, warnings) {
            (0, 0) => write!(f, "{name} is valid")?,
            (0, _) => write!(f, "{name} is usable: {}", counted(warnings, "warning"))?,
            (_, 0) => write!(f, "{name} cannot be used: {}", counted(errors, "error"))?,
            _ => write!(
                f,
                "{name} cannot be used: {}, {}",
                counted(errors, "error"),
                counted(warnings, "warning")
            )?,
        }
        if self.problems().len() > MAX_SHOWN {
            write!(f, "; the first {MAX_SHOWN} are shown")?;
        }
        Ok(())
    }
}

impl std::error::Error for Findings {}

/// Collects problems while a file is read.
#[derive(Debug)]
pub(super) struct Reporter {
    lines: LineStarts,
    problems: Vec<EdsProblem>,
}

impl Reporter {
    pub fn new(text: &str) -> Self {
        Self { lines: LineStarts::of(text), problems: vec![] }
    }

    pub fn report(&mut self, kind: EdsProblemKind, span: Range<usize>) {
        self.problems.push(EdsProblem { kind, span, first_line: None });
    }

    /// Reports a problem that contradicts or repeats something at `first`.
    pub fn report_against(&mut self, kind: EdsProblemKind, span: Range<usize>, first: usize) {
        let first_line = Some(self.line_of(first));
        self.problems.push(EdsProblem { kind, span, first_line });
    }

    /// The line of a byte, counted from 1.
    pub fn line_of(&self, at: usize) -> usize {
        self.lines.line_of(at)
    }

    pub fn into_problems(self) -> Vec<EdsProblem> {
        self.problems
    }
}
