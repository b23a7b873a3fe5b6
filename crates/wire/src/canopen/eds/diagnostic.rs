//! The problems of a file as diagnostics of `miette`.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, SourceCode};

use super::findings::Findings;
use super::problem::{EdsProblem, Severity};

impl Diagnostic for Findings {
    fn severity(&self) -> Option<miette::Severity> {
        Some(if self.has_errors() { miette::Severity::Error } else { miette::Severity::Warning })
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(self.source())
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        fn diagnostic(problem: &EdsProblem) -> &dyn Diagnostic {
            problem
        }
        Some(Box::new(self.shown().map(diagnostic)))
    }
}

impl Diagnostic for EdsProblem {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.kind.severity() {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.kind.help()))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(self.label().map(|text| LabeledSpan::at(self.span.clone(), text)).into_iter()))
    }
}
