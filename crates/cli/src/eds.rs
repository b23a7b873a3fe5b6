//! `takt eds`: shows the contents of an EDS or DCF.

mod problem;
mod text;
mod view;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use takt::Config;
use takt::config::mode_word;
use takt::family::{cia402, refused_by_data_sheets};
use takt_wire::canopen::eds::{self, Findings};
use takt_wire::printable::printable_path;

use super::exit::Exit;
use super::print;
use super::say;
use problem::{PrintedProblem, problems};
use view::View;

/// Print the object dictionary of an EDS or DCF, with its PDOs and with what is wrong in the file
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The EDS or DCF
    file: PathBuf,
    /// The node ID that replaces $NODEID; a DCF has its own
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// Print a configuration to start with, for a drive that this file describes
    #[arg(long, conflicts_with = "json")]
    config: bool,
    /// The quirks of the drive, for --config
    #[arg(long, value_name = "FILE", requires = "config")]
    quirks: Option<PathBuf>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// Reads the file and prints it. The exit code is 0 when it is usable, else 2.
pub fn run(arguments: &Arguments) -> Exit {
    if arguments.config {
        return starting_configuration(arguments);
    }
    let loaded = match eds::load(&arguments.file) {
        Ok(loaded) => loaded,
        Err(findings) => {
            if arguments.json {
                let problems = problems(&findings);
                let printed = PrintedFindings { error: findings.to_string(), problems };
                return print::indented_json(&printed, Exit::Usage);
            }
            show(findings);
            return Exit::Usage;
        }
    };
    let node = arguments.node.or(loaded.dictionary.commissioned_node());
    let view = View::of(&loaded.dictionary, node, problems(&loaded.warnings));
    if arguments.json {
        return print::indented_json(&view, Exit::Done);
    }
    let exit = print::text(&text::whole(&view), Exit::Done);
    if !loaded.warnings.is_empty() {
        show(loaded.warnings);
    }
    exit
}

/// Prints a configuration with one axis.
fn starting_configuration(arguments: &Arguments) -> Exit {
    let quirks = arguments.quirks.as_deref();
    let configuration = cia402::Device::load(&arguments.file, quirks).and_then(|device| {
        let node = arguments.node.or(device.dictionary.commissioned_node()).unwrap_or(1);
        let mut reasons = vec![];
        for mode in device.usual_modes() {
            let text = cia402::starting_configuration(&device, &arguments.file, quirks, node, Some(mode));
            match refusal(&text) {
                None => return Ok(text),
                Some(reason) => reasons.push(format!("{}: {reason}", mode_word(mode.operation_mode()))),
            }
        }
        let file = printable_path(&arguments.file);
        Err(format!("by {file}, takt can command this drive in no mode\n{}", reasons.join("\n")))
    });
    match configuration {
        Ok(text) => print::text(&text, Exit::Done),
        Err(reason) => {
            say!("takt: {reason}");
            Exit::Usage
        }
    }
}

/// Why a configuration cannot be run with the drives of its data sheets.
fn refusal(text: &str) -> Option<String> {
    match Config::parse("the configuration", text) {
        Ok(config) => refused_by_data_sheets(&config).first().map(ToString::to_string),
        Err(error) => Some(format!("{:?}", miette::Report::new(error))),
    }
}

/// A file that cannot be used, as an object.
#[derive(Serialize)]
struct PrintedFindings {
    error: String,
    problems: Vec<PrintedProblem>,
}

fn show(findings: Findings) {
    say::styled(&format!("{:?}", miette::Report::new(findings)));
}
