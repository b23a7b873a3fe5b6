//! `takt report`: evaluates a recording or a black box.

mod charts;
mod curves;
mod histogram;
mod page;
mod timeline;

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use takt::telemetry::{Recorded, RecordedError, RecordingReport};

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
    /// Read only what is at least so many seconds after the first cycle
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    from: Option<f64>,
    /// Read only what is less than so many seconds after the first cycle
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    to: Option<f64>,
    /// Write a page with all axes, the timing and the events into this file; it needs nothing beside itself
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Draw position, velocity, acceleration, torque, following error and timing into this file: around the stop, or of what --from and
    /// --to say
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs it. The exit code is 2 when there is nothing to be read, 1 when a file cannot be written, else 0: that
/// the group stopped is no failure of the report.
pub fn run(arguments: &Arguments) -> Exit {
    match tell(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

fn tell(arguments: &Arguments) -> Result<Exit, UsageError> {
    let words = |error: RecordedError| error.to_string();
    let recorded = read(arguments)?;
    let axis = recorded.axis(arguments.axis.as_deref());
    if let (Some(name), None) = (&arguments.axis, axis) {
        let names: Vec<&str> = recorded.machine.axes.iter().map(|axis| axis.name.as_str()).collect();
        return Err(format!("there is no axis {name:?} in it; there are {}", names.join(", ")).into());
    }
    let report = RecordingReport::new(&recorded, axis, arguments.cycles).map_err(words)?;
    let mut is_written = true;
    if let Some(path) = &arguments.html {
        is_written &= write(path, page::render(&recorded, &report).map_err(words)?.as_bytes());
    }
    if let Some(path) = &arguments.svg {
        let is_whole = arguments.from.is_some() || arguments.to.is_some();
        let drawing = charts::render(&recorded, axis, is_whole).map_err(words)?;
        is_written &= write(path, drawing.as_bytes());
    }
    let exit = if is_written { Exit::Done } else { Exit::Stopped };
    Ok(if arguments.json {
        print::json(&report, exit)
    } else {
        print::text(&report.render(print::emphasis()), exit)
    })
}

/// Reads the recording, or the part of it that is asked for.
fn read(arguments: &Arguments) -> Result<Recorded, UsageError> {
    let Arguments { recording, from, to, .. } = arguments;
    if from.is_none() && to.is_none() {
        return Ok(Recorded::open(recording).map_err(|error| error.to_string())?);
    }
    let (from_s, to_s) = (from.unwrap_or(0.0), to.unwrap_or(f64::INFINITY));
    if from_s >= to_s {
        return Err(format!("--to ({to_s} s) must be after --from ({from_s} s)").into());
    }
    let recorded = Recorded::open_between(recording, from_s..to_s).map_err(|error| error.to_string())?;
    if recorded.slots.is_none() {
        let path = recording.display();
        return Err(
            format!("{path}: there is no cycle in it from --from ({from_s} s) to --to ({to_s} s)").into()
        );
    }
    Ok(recorded)
}

/// Seconds after the beginning of a recording.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "a time is a number of seconds after the first cycle, 0 or more".to_owned())
}

fn write(path: &Path, content: &[u8]) -> bool {
    let written = fs::write(path, content);
    if let Err(error) = &written {
        say!("takt: {} cannot be written: {error}", path.display());
    }
    written.is_ok()
}
