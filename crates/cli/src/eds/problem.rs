//! A problem of the file as it is printed.

use serde::Serialize;
use takt_wire::canopen::eds::{Findings, Severity};

/// A problem of the file.
#[derive(Serialize)]
pub struct PrintedProblem {
    severity: &'static str,
    line: usize,
    column: usize,
    /// The line itself.
    source: String,
    message: String,
    help: String,
}

pub fn problems(findings: &Findings) -> Vec<PrintedProblem> {
    let printed = |problem| {
        let place = findings.position(problem);
        PrintedProblem {
            severity: match problem.kind.severity() {
                Severity::Warning => "warning",
                Severity::Error => "error",
            },
            line: place.line,
            column: place.column,
            source: findings.source_line(problem).to_owned(),
            message: problem.to_string(),
            help: problem.kind.help(),
        }
    };
    findings.problems().iter().map(printed).collect()
}
