//! `takt report`: evaluates a recording or a black box.

mod svg;

use std::fs;
use std::path::{Path, PathBuf};

use crate::telemetry::{Recorded, RecordedError, RecordingReport};
use clap::Args;

use super::exit::Exit;
use super::print;
use super::usage_error::UsageError;

/// Show from a recording or a black box why the group stopped, what led to it, and the timing
#[derive(Args, Debug)]
pub struct Arguments {
    /// The recording, or a file of the black box; one that was cut off is read as far as it goes
    recording: PathBuf,
    /// Show this axis instead of the one concerned
    #[arg(long, value_name = "NAME")]
    axis: Option<String>,
    /// Show so many cycles up to the stop
    #[arg(long, value_name = "N", default_value_t = 20, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    cycles: u64,
    /// Draw position, velocity, following error and timing around the stop into this file
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs it. The exit code is 2 when there is nothing to be read, 1 when the SVG cannot be written, else 0: that
/// the group stopped is no failure of the report.
pub fn run(arguments: &Arguments) -> Exit {
    match tell(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

fn tell(arguments: &Arguments) -> Result<Exit, UsageError> {
    let words = |error: RecordedError| error.to_string();
    let recorded = Recorded::open(&arguments.recording).map_err(words)?;
    let axis = recorded.axis(arguments.axis.as_deref());
    if let (Some(name), None) = (&arguments.axis, axis) {
        let names: Vec<&str> = recorded.machine.axes.iter().map(|axis| axis.name.as_str()).collect();
        return Err(format!("there is no axis {name:?} in it; there are {}", names.join(", ")).into());
    }
    let report = RecordingReport::new(&recorded, axis, arguments.cycles).map_err(words)?;
    let is_drawn = match &arguments.svg {
        Some(path) => write(path, &svg::render(&recorded, axis).map_err(words)?),
        None => true,
    };
    let exit = if is_drawn { Exit::Done } else { Exit::Stopped };
    Ok(if arguments.json {
        print::json(&report, exit)
    } else {
        print::text(&report.render(print::emphasis()), exit)
    })
}

fn write(path: &Path, svg: &str) -> bool {
    let written = fs::write(path, svg);
    if let Err(error) = &written {
        say!("takt: {} cannot be written: {error}", path.display());
    }
    written.is_ok()
}
