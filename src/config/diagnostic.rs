//! The problems of a configuration as diagnostics of `miette`.

use std::fmt;

use miette::{Diagnostic, LabeledSpan, SourceCode};

use super::error::{ConfigError, Location, Problem};

impl Diagnostic for ConfigError {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source().map(|source| -> &dyn SourceCode { source })
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        fn diagnostic(problem: &Problem) -> &dyn Diagnostic {
            problem
        }
        Some(Box::new(self.problems().iter().map(diagnostic)))
    }
}

impl Diagnostic for Problem {
    /// The problems of a file that the configuration names, at its lines.
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        let findings: &dyn Diagnostic = self.findings()?;
        Some(Box::new(std::iter::once(findings)))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(self.kind.help()))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let Location::Text { span, .. } = &self.location else { return None };
        Some(Box::new(std::iter::once(LabeledSpan::at(span.clone(), self.label()))))
    }
}
