//! What is wrong with a configuration: every problem with its place in the file and what to do about it.

use std::fmt;
use std::ops::Range;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use thiserror::Error;

use crate::canopen::dcf::DcfError;

use super::problem_kind::ProblemKind;
use crate::printable::printable;

/// A configuration that cannot be used, with all of its problems in the order of the file. `miette` shows each of
/// them with its line.
#[derive(Debug)]
pub struct ConfigError(Box<Inner>);

#[derive(Debug)]
struct Inner {
    source: NamedSource<String>,
    text: String,
    problems: Vec<Problem>,
}

impl ConfigError {
    pub(super) fn new(source_name: &str, text: &str, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.span.as_ref().map(|span| (span.start, span.end)));
        let mut seen: Vec<Problem> = Vec::with_capacity(problems.len());
        for problem in problems {
            if !seen.contains(&problem) {
                seen.push(problem);
            }
        }
        let source = NamedSource::new(source_name, printable(text));
        Self(Box::new(Inner { source, text: text.to_owned(), problems: seen }))
    }

    /// The text of a file.
    pub(crate) fn text_of(source_name: &str, bytes: Vec<u8>) -> Result<String, Self> {
        String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            // What stands in the place of the byte is as long as that many bytes.
            let span = at..at + char::REPLACEMENT_CHARACTER.len_utf8();
            let problem = Problem { kind: ProblemKind::NotText, span: Some(span), first_line: None };
            Self::new(source_name, &String::from_utf8_lossy(error.as_bytes()), vec![problem])
        })
    }

    /// The problems in the order of the file; never empty.
    pub fn problems(&self) -> &[Problem] {
        &self.0.problems
    }

    /// The name of the file (or whatever the text came from).
    pub fn source_name(&self) -> &str {
        self.0.source.name()
    }

    /// The line of a problem, counted from 1; `None` where the file could not even be read.
    pub fn line(&self, problem: &Problem) -> Option<usize> {
        Some(line_of(&self.0.text, problem.span.as_ref()?.start))
    }
}

/// The line in which a byte stands, counted from 1.
pub(super) fn line_of(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problems() {
            [_] => write!(f, "{} cannot be used", self.source_name()),
            problems => write!(f, "{} cannot be used: {} problems", self.source_name(), problems.len()),
        }
    }
}

impl std::error::Error for ConfigError {}

impl Diagnostic for ConfigError {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.0.source)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        fn diagnostic(problem: &Problem) -> &dyn Diagnostic {
            problem
        }
        Some(Box::new(self.problems().iter().map(diagnostic)))
    }
}

/// One problem.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{kind}")]
pub struct Problem {
    /// What is wrong.
    pub kind: ProblemKind,
    /// The bytes of the file that are wrong; `None` where the file could not even be read.
    pub span: Option<Range<usize>>,
    /// The line that this one contradicts, counted from 1.
    pub first_line: Option<usize>,
}

impl Diagnostic for Problem {
    /// What is wrong with a file that the configuration names, at its lines.
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let ProblemKind::Dcf { reason: DcfError::File(findings) } = &self.kind else { return None };
        let findings: &dyn Diagnostic = findings;
        Some(Box::new(std::iter::once(findings)))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.kind.help()))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let text = match self.first_line {
            Some(line) => format!("{}; first in line {line}", self.kind.label()),
            None => self.kind.label().to_owned(),
        };
        Some(Box::new(self.span.iter().map(move |span| LabeledSpan::at(span.clone(), text.clone()))))
    }
}
