//! `takt play`: points from a file into the arm.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use takt::config::Config;
use takt::controller::Outcome;
use takt::play::{
    ArmedFrom, AxisMaxima, FileTrajectory, PlayError, PlayFile, PlayFileError, SetPointLog, VirtualStage,
    execute,
};
use takt::telemetry::{Machine, StopReport, words};
use takt_rt::StopReason;

use super::configuration;
use super::exit::Exit;
use super::interruption;
use super::print;
use super::usage_error::UsageError;

/// Play points from a CSV file into the arm, which is led to the first of them before.
///
/// The header is `arrive,at,JOINT[,JOINT.velocity][,JOINT.acceleration]…`: seconds from the start, rad (m). Rows stand in the order
/// of their arrival. Joints that are not named hold.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    config: PathBuf,
    /// The points (CSV)
    file: PathBuf,
    /// Execute the rows, by the times that they are meant for, as one trajectory that is checked as a whole before it starts
    #[arg(long)]
    trajectory: bool,
    /// Play to simulated drives in virtual time, as fast as possible: every run is the same, bit for bit
    #[arg(long = "virtual")]
    is_virtual: bool,
    /// Write what was commanded to this file, a row a cycle
    #[arg(long, value_name = "SETPOINTS.csv")]
    out: Option<PathBuf>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

/// The result.
#[derive(Serialize)]
struct Printed {
    /// Why it ended before the end of the file; null if it did not, or for a reason in `failure`.
    stop: Option<StopReport>,
    /// Why the run ended, in words, where that was neither its end, nor Ctrl-C, nor a stop.
    failure: Option<String>,
    points: usize,
    late_points: u64,
    lag_s: f64,
    lag_max_s: f64,
    axes: Vec<AxisMaxima>,
}

/// A problem of the file, as an object.
#[derive(Serialize)]
struct PrintedProblem {
    error: String,
    problems: [PlaceOfProblem; 1],
}

#[derive(Serialize)]
struct PlaceOfProblem {
    line: usize,
    column: Option<usize>,
    message: String,
}

/// Plays the file.
pub fn run(arguments: &Arguments) -> Exit {
    let config = match configuration::load(&arguments.config, &[]) {
        Ok(config) => config,
        Err(error) => return error.print(arguments.json),
    };
    if let Err(error) = config.validate() {
        return UsageError::from(error).print(arguments.json);
    }
    let wrong_file = |error: &PlayFileError| print_problem(&arguments.file, error, arguments.json);
    let names: Vec<String> = config.axes.iter().map(|axis| axis.name.clone()).collect();
    let bytes = match takt::play::read(&arguments.file) {
        Ok(bytes) => bytes,
        Err(error) => {
            let words = format!("cannot read {}: {error}", arguments.file.display());
            return UsageError::from(words).print(arguments.json);
        }
    };
    let file = match PlayFile::parse(&bytes, &names) {
        Ok(file) => file,
        Err(error) => return wrong_file(&error),
    };
    if !arguments.trajectory || !arguments.is_virtual {
        return UsageError::from("takt play needs --trajectory and --virtual so far").print(arguments.json);
    }
    let period_s = config.cycle.period_ns as f64 / 1e9;
    let trajectory = FileTrajectory::new(&file, config.axes.len())
        .and_then(|trajectory| trajectory.check(&config.axes, period_s).map(|_| trajectory));
    let trajectory = match trajectory {
        Ok(trajectory) => trajectory,
        Err(error) => return wrong_file(&error),
    };
    let out = match arguments.out.as_deref().map(create).transpose() {
        Ok(out) => out,
        Err(words) => return UsageError::from(words).print(arguments.json),
    };
    let armed = ArmedFrom::default();
    let log = SetPointLog::new(&names, config.cycle.period_ns, trajectory.begins_s(), armed.clone(), out);
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let mut stage = match VirtualStage::new(&config, log, &interrupted) {
        Ok(stage) => stage,
        Err(error) => return UsageError::from(error.to_string()).print(arguments.json),
    };
    let result = execute(&mut stage, &trajectory, &config.axes, period_s, &armed);
    let (outcome, snapshot, log) = stage.finish();
    let (axes, not_written) = log.finish();
    let machine = Machine::of(&config);
    let (exit, stop, failure) = ending(result, outcome, snapshot.stop, &machine, &arguments.file);
    let exit = match (&not_written, &arguments.out) {
        (Some(error), Some(path)) => {
            say!("takt: {} cannot be written: {error}", path.display());
            exit.and_failed()
        }
        _ => exit,
    };
    let printed = Printed {
        stop: stop.map(|stop| StopReport::new(&stop, &machine)),
        failure,
        points: file.rows.len(),
        // A trajectory has no late points, and its set-points are on time.
        late_points: 0,
        lag_s: 0.0,
        lag_max_s: 0.0,
        axes,
    };
    if arguments.json { print::json(&printed, exit) } else { print::text(&text(&printed, &config), exit) }
}

/// Creates the file before anything moves.
fn create(path: &Path) -> Result<Box<dyn Write + Send>, String> {
    let file = File::create(path).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    Ok(Box::new(BufWriter::new(file)))
}

fn print_problem(path: &Path, error: &PlayFileError, is_json: bool) -> Exit {
    let path = path.display();
    if is_json {
        let PlayFileError { line, column, problem } = error;
        let problems = [PlaceOfProblem { line: *line, column: *column, message: problem.to_string() }];
        let printed = PrintedProblem { error: format!("{path}: {error}"), problems };
        return print::indented_json(&printed, Exit::Usage);
    }
    say!("takt: {path}: {error}");
    Exit::Usage
}

/// The exit code, the stop, and the failure in words.
fn ending(
    result: Result<(), PlayError>,
    outcome: Option<Outcome>,
    last_stop: Option<StopReason>,
    machine: &Machine,
    path: &Path,
) -> (Exit, Option<StopReason>, Option<String>) {
    match (result, outcome) {
        (_, Some(Outcome::Interrupted | Outcome::TakenOver { .. })) => (Exit::Interrupted, last_stop, None),
        (_, Some(Outcome::Stopped(stop))) | (Err(PlayError::Stopped(stop)), _) => {
            (Exit::Stopped, Some(stop), None)
        }
        (Err(PlayError::Ended), Some(outcome)) => (Exit::Stopped, None, Some(outcome.words(machine))),
        (Err(error), _) => (Exit::Stopped, None, Some(failure(error, machine, path))),
        (Ok(()), _) => (Exit::Done, None, None),
    }
}

fn failure(error: PlayError, machine: &Machine, path: &Path) -> String {
    match error {
        PlayError::Ended => "the run has ended".to_owned(),
        PlayError::Stopped(stop) => words::stop(&stop, machine),
        PlayError::Replaced => "another client has moved the arm".to_owned(),
        PlayError::Refused(Some(refusal)) => words::rejection(&refusal, machine),
        PlayError::Refused(None) => "a request was refused; the reason is no longer known".to_owned(),
        PlayError::File(error) => format!("{}: {error}", path.display()),
    }
}

fn text(printed: &Printed, config: &Config) -> String {
    let mut text = String::new();
    if let Some(stop) = &printed.stop {
        text += &format!("stopped (category {}): {}\n", stop.category, stop.reason);
    }
    if let Some(failure) = &printed.failure {
        text += &format!("{failure}\n");
    }
    text += &format!(
        "{} points, {} late; lag {:.1} ms, {:.1} ms at most\n",
        printed.points,
        printed.late_points,
        printed.lag_s * 1e3,
        printed.lag_max_s * 1e3
    );
    let width = printed.axes.iter().map(|axis| axis.name.len()).max().unwrap_or(0);
    for (axis, of) in printed.axes.iter().zip(&config.axes) {
        let AxisMaxima { name, velocity_max, acceleration_max, jerk_max } = axis;
        let limits = &of.limits;
        text += &format!(
            "{name:<width$}  velocity {velocity_max:8.4} of {:.4}  acceleration {acceleration_max:9.4} of {:.4}  jerk {jerk_max:10.3} of {:.3}\n",
            limits.velocity,
            limits.acceleration.max(limits.deceleration),
            limits.jerk
        );
    }
    text
}
