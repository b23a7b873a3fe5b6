//! `takt eds`: what an EDS or DCF says of its device.

mod picture;
mod text;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use takt::canopen::eds::{self, Findings, Severity};

use super::exit::Exit;
use super::print;
use super::say;
use picture::Picture;

/// Print the object dictionary of an EDS or DCF, with its PDOs and with what is wrong in the file
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The EDS or DCF
    file: PathBuf,
    /// The node number to put in the place of $NODEID; a DCF has its own
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// Reads the file and prints it. The exit code is 0 when it is usable, else 2.
pub fn run(arguments: &Arguments) -> Exit {
    let loaded = match eds::load(&arguments.file) {
        Ok(loaded) => loaded,
        Err(findings) => {
            if arguments.json {
                let problems = problems(&findings);
                let refusal = Refusal { error: findings.to_string(), problems };
                return print::indented_json(&refusal, Exit::Usage);
            }
            show(findings);
            return Exit::Usage;
        }
    };
    let node = arguments.node.or(loaded.dictionary.commissioned_node());
    let picture = Picture::of(&loaded.dictionary, node, problems(&loaded.warnings));
    if arguments.json {
        return print::indented_json(&picture, Exit::Done);
    }
    let exit = print::text(&text::whole(&picture), Exit::Done);
    if !loaded.warnings.is_empty() {
        show(loaded.warnings);
    }
    exit
}

#[derive(Serialize)]
struct Refusal {
    error: String,
    problems: Vec<ProblemPicture>,
}

/// A problem of the file.
#[derive(Serialize)]
struct ProblemPicture {
    severity: &'static str,
    line: usize,
    column: usize,
    /// The line itself.
    source: String,
    message: String,
    help: String,
}

fn problems(findings: &Findings) -> Vec<ProblemPicture> {
    let picture = |problem| {
        let place = findings.position(problem);
        ProblemPicture {
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
    findings.problems().iter().map(picture).collect()
}

fn show(findings: Findings) {
    say::report(&miette::Report::new(findings));
}
