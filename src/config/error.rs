//! What is wrong with a configuration: every problem, its place, and what to do about it.

use std::fmt;
use std::ops::Range;

use takt_wire::canopen::dcf::DcfError;
use takt_wire::canopen::eds::Findings;
use takt_wire::printable::{letter_start, printable};
use takt_wire::source_text::{LineStarts, SourceText};
use thiserror::Error;

use super::problem_kind::ProblemKind;

/// The most problems that are shown of one configuration; the rest are counted. Whoever gets more of them has given another
/// file, or will see the rest after the first are mended.
const SHOWN_AT_MOST: usize = 20;

/// The most bytes of a file that are underlined.
const LONGEST_SPAN: usize = 200;

/// A configuration that cannot be used, with its first twenty problems in the order of the file. `Debug` shows each of them at its
/// line: that is what `main` prints of an error that `?` hands it. With the feature `miette` it is a diagnostic of that crate.
pub struct ConfigError(Box<Inner>);

struct Inner {
    name: String,
    /// The text of the file; `None` where the configuration was made in code or could not be read.
    source: Option<SourceText>,
    lines: LineStarts,
    problems: Vec<Problem>,
    omitted: usize,
}

impl ConfigError {
    /// A file, or another text, that is wrong.
    pub(super) fn of_text(name: &str, text: &str, problems: Vec<Problem>) -> Self {
        let name = printable(name);
        let source = Some(SourceText::new(name.as_str(), printable(text)));
        let shorten = |problem: &mut Problem| {
            if let Location::Text { span, .. } = &mut problem.location {
                let end = span.end.min(span.start.saturating_add(LONGEST_SPAN));
                span.end = letter_start(text, end).max(span.start);
            }
        };
        let mut error = Self::new(name, source, LineStarts::of(text), problems);
        error.0.problems.iter_mut().for_each(shorten);
        error
    }

    /// A file that cannot be read.
    pub(in crate::config) fn unreadable(name: &str, reason: String) -> Self {
        let kind = ProblemKind::Unreadable { reason };
        let problems = vec![Problem { kind, location: Location::Nowhere }];
        Self::new(printable(name), None, LineStarts::of(""), problems)
    }

    /// A configuration, by its own name, with fields that are wrong.
    pub(super) fn of_fields(name: &str, problems: Vec<Problem>) -> Self {
        let name = format!("the configuration {:?}", printable(name));
        Self::new(name, None, LineStarts::of(""), problems)
    }

    fn new(name: String, source: Option<SourceText>, lines: LineStarts, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.span().map(|span| (span.start, span.end)));
        // The defaults of axes are read once for each axis, with the same problems.
        let mut shown: Vec<Problem> = Vec::with_capacity(SHOWN_AT_MOST);
        let mut omitted = 0;
        for problem in problems {
            let at = problem.span();
            let mut of_place = shown.iter().rev().take_while(|earlier| at.is_none() || earlier.span() == at);
            if of_place.any(|earlier| *earlier == problem) {
                continue;
            }
            if shown.len() < SHOWN_AT_MOST { shown.push(problem) } else { omitted += 1 }
        }
        Self(Box::new(Inner { name, source, lines, problems: shown, omitted }))
    }

    /// The text of a file.
    pub(crate) fn text_of(source_name: &str, bytes: Vec<u8>) -> Result<String, Self> {
        String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            // The character that replaces the byte is longer than the byte.
            let span = at..at + char::REPLACEMENT_CHARACTER.len_utf8();
            let location = Location::Text { span, first_line: None };
            let problem = Problem { kind: ProblemKind::NotText, location };
            Self::of_text(source_name, &String::from_utf8_lossy(error.as_bytes()), vec![problem])
        })
    }

    /// The first twenty problems in the order of the file; never empty.
    pub fn problems(&self) -> &[Problem] {
        &self.0.problems
    }

    /// The text of the file, if there is one.
    #[cfg(feature = "miette")]
    pub(super) fn source(&self) -> Option<&SourceText> {
        self.0.source.as_ref()
    }

    /// Returns the number of problems besides [`ConfigError::problems`].
    pub fn omitted(&self) -> usize {
        self.0.omitted
    }

    /// The name of the file, or of the configuration that was made in code.
    pub fn source_name(&self) -> &str {
        &self.0.name
    }

    /// The line of a problem, counted from 1; `None` where the configuration is no text.
    pub fn line(&self, problem: &Problem) -> Option<usize> {
        Some(self.0.lines.line_of(problem.span()?.start))
    }
}

impl fmt::Display for ConfigError {
    /// One line. The problems of fields are part of it, since they have no lines that a report could show.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cannot be used", self.source_name())?;
        match (self.problems().len() + self.omitted(), self.omitted()) {
            (1, _) => {}
            (count, 0) => write!(f, ": {count} problems")?,
            (count, _) => write!(f, ": {count} problems, of which the first {SHOWN_AT_MOST} follow")?,
        }
        let fields =
            self.problems().iter().filter(|problem| matches!(problem.location, Location::Field { .. }));
        for problem in fields {
            write!(f, "; {problem} ({})", problem.kind.help())?;
        }
        Ok(())
    }
}

impl fmt::Debug for ConfigError {
    /// The problems at their lines.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{self}")?;
        for problem in self.problems() {
            let help = problem.kind.help();
            match (&self.0.source, problem.span()) {
                (Some(source), Some(span)) => {
                    source.write_problem(f, problem, Some((span, &problem.label())), &help)?;
                }
                // Problems of fields are part of the sentence.
                (_, None) if matches!(problem.location, Location::Field { .. }) => continue,
                _ => write!(f, "\n{problem}\n  help: {help}\n")?,
            }
            if let Some(findings) = problem.findings() {
                findings.write_problems(f)?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for ConfigError {}

/// One problem.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{location}{kind}")]
pub struct Problem {
    /// The problem.
    pub kind: ProblemKind,
    /// The place.
    pub location: Location,
}

/// The place of a problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// The file could not even be read.
    Nowhere,
    /// In the text of a file.
    Text {
        /// The bytes that are wrong.
        span: Range<usize>,
        /// The line that this one contradicts, counted from 1.
        first_line: Option<usize>,
    },
    /// In a field of a configuration that was made or changed in code.
    Field {
        /// The element of a list that has the field, as in `axes[2] "elbow"`; empty for a field of no list.
        of: String,
    },
}

impl fmt::Display for Location {
    /// What goes before the words of a problem. A line of a file is shown beside them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Field { of } if !of.is_empty() => write!(f, "{of}: "),
            _ => Ok(()),
        }
    }
}

impl Problem {
    /// The bytes of the file that are wrong, the first 200 of them; `None` where there is no file, or it could not be read.
    pub fn span(&self) -> Option<Range<usize>> {
        match &self.location {
            Location::Text { span, .. } => Some(span.clone()),
            Location::Nowhere | Location::Field { .. } => None,
        }
    }

    /// The problems of a file that the configuration names.
    pub(super) fn findings(&self) -> Option<&Findings> {
        match &self.kind {
            ProblemKind::Dcf { reason: DcfError::File(findings) } => Some(findings),
            _ => None,
        }
    }

    /// What is written beside the place in the file.
    pub(super) fn label(&self) -> String {
        match &self.location {
            Location::Text { first_line: Some(line), .. } => {
                format!("{}; first in line {line}", self.kind.label())
            }
            _ => self.kind.label().to_owned(),
        }
    }
}
