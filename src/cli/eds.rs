//! `takt eds`: what an EDS or DCF says of its device.

mod picture;
mod text;

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use takt::canopen::eds::{self, Findings, Severity};

use super::exit::Exit;
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
                print_json(&Refusal { error: findings.to_string(), problems });
            } else {
                show(findings);
            }
            return Exit::Usage;
        }
    };
    let node = arguments.node.or(loaded.dictionary.commissioned_node());
    let picture = Picture::of(&loaded.dictionary, node, problems(&loaded.warnings));
    if arguments.json {
        print_json(&picture);
    } else {
        print(&text::whole(&picture));
        if !loaded.warnings.is_empty() {
            show(loaded.warnings);
        }
    }
    Exit::Done
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
        let place = findings.place(problem);
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
    say!("{:?}", miette::Report::new(findings));
}

fn print(text: &str) {
    // A reader that has seen enough (`| head`) is no failure.
    let _ = std::io::stdout().write_all(text.as_bytes());
}

fn print_json(value: &impl Serialize) {
    match serde_json::to_string_pretty(value) {
        Ok(text) => print(&format!("{text}\n")),
        Err(error) => print(&format!("{{\"error\": {:?}}}\n", error.to_string())),
    }
}
