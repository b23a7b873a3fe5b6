//! `takt play`: points from a file into the arm.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::{Args, ValueEnum};
use serde::Serialize;

use takt::config::{Config, Travel};
use takt::controller::realtime_thread::StartError;
use takt::controller::session::{SessionError, SessionOptions};
use takt::controller::{Controller, Outcome, StartFailure};
use takt::schedule;
use takt::telemetry::{Machine, StopReport, words};
use takt_rt::{Follow, NANOSECONDS_PER_SECOND, Snapshot, StopReason, StreamDelay};
use takt_tools::play::{
    ArmedFrom, AxisMaxima, FileStream, FileTrajectory, PlayError, PlayFile, PlayFileError, PlayedGroup,
    RealStage, SetPointLog, SharedSetPointLog, Stage, StreamSummary, VirtualStage, execute, stream,
};
use takt_wire::printable::printable_path;

use super::configuration::{self, BusOverride};
use super::exit::Exit;
use super::interruption;
use super::ownership;
use super::print;
use super::table::{Table, UNBROKEN};
use super::usage_error::UsageError;

/// Play points from a file into the arm, which first moves to the first of them.
///
/// The header of a CSV file is `arrive,at,JOINT[,JOINT.velocity][,JOINT.acceleration]…`: seconds from the start, rad (m). Rows stand in the
/// order of their arrival. Joints that are not named hold. With `time_from_start` instead of `arrive,at` the rows are one trajectory, as
/// with --trajectory; so is a `JointTrajectory` of ROS in YAML or JSON, alone or in a `RobotTrajectory` or goal.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The configuration (TOML)
    config: PathBuf,
    /// The points (CSV; JointTrajectory as YAML or JSON)
    file: PathBuf,
    /// What is done where the points ask for more than the limits allow: smooth follows as closely as they go, exact stops
    #[arg(long, value_enum, conflicts_with = "trajectory")]
    follow: Option<FollowArgument>,
    /// How far the set-points run behind the times of the points, in seconds [default: as the points and their lateness need]
    #[arg(long, value_name = "S", conflicts_with = "trajectory", allow_negative_numbers = true, value_parser = delay)]
    delay: Option<Duration>,
    /// Execute the rows, by the times that they are meant for, as one trajectory that is checked as a whole before it starts
    #[arg(long)]
    trajectory: bool,
    /// Play to simulated drives in virtual time, as fast as possible: every run is the same, bit for bit
    #[arg(long = "virtual", conflicts_with_all = ["buses", "take_over", "require_realtime"])]
    is_virtual: bool,
    /// Write what was commanded to this file, a row a cycle
    #[arg(long, value_name = "SETPOINTS.csv")]
    out: Option<PathBuf>,
    /// Connect a bus to another interface than the configuration says: sim, can0, vcan0 …
    #[arg(long = "bus", value_name = "[NAME=]INTERFACE")]
    buses: Vec<BusOverride>,
    /// Have another takt of this host that commands one of the buses stop in control first, and take them over
    #[arg(long)]
    take_over: bool,
    /// End with exit code 3 before anything moves if the system refuses a step of the real-time set-up
    #[arg(long)]
    require_realtime: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

/// `--follow`
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FollowArgument {
    Smooth,
    Exact,
}

/// The longest delay that the configuration allows.
const LONGEST_DELAY_S: f64 = 1.0;

fn delay(text: &str) -> Result<Duration, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of seconds"))?;
    if (0.0..=LONGEST_DELAY_S).contains(&number) {
        Ok(Duration::from_secs_f64(number))
    } else {
        Err(format!("a delay is a number of seconds from 0 to {LONGEST_DELAY_S}"))
    }
}

/// What is played.
enum Piece {
    Trajectory(FileTrajectory),
    Stream(FileStream),
}

impl Piece {
    /// The time of the set-points from which a trajectory begins. A stream has the clock of its file.
    fn begins_s(&self) -> f64 {
        match self {
            Self::Trajectory(trajectory) => trajectory.begins_s(),
            Self::Stream(_) => 0.0,
        }
    }

    fn groups(&self) -> &[PlayedGroup] {
        match self {
            Self::Trajectory(trajectory) => std::slice::from_ref(trajectory.group()),
            Self::Stream(file) => file.groups(),
        }
    }

    fn play(&self, stage: &mut impl Stage, armed: &ArmedFrom) -> Result<StreamSummary, PlayError> {
        match self {
            // A trajectory has no late points, and its set-points are on time.
            Self::Trajectory(trajectory) => {
                execute(stage, trajectory, armed).map(|()| StreamSummary::default())
            }
            Self::Stream(file) => stream(stage, file, armed),
        }
    }
}

/// The result.
#[derive(Serialize)]
struct Printed {
    /// Why it ended before the end of the file; null if it did not, or for a reason in `failure`.
    stop: Option<StopReport>,
    /// Why the run ended, in words, where that was neither its end, nor Ctrl-C, nor a stop.
    failure: Option<String>,
    /// From the first point to the last one.
    duration_s: f64,
    points: usize,
    late_points: u64,
    /// Points that found no room, or could not be used.
    lost_points: u64,
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
    let mut config = match configuration::load(&arguments.config, &arguments.buses) {
        Ok(config) => config,
        Err(error) => return error.print(arguments.json),
    };
    if let Some(follow) = arguments.follow {
        let follow = match follow {
            FollowArgument::Smooth => Follow::Smooth,
            FollowArgument::Exact => Follow::Exact,
        };
        config.axes.iter_mut().for_each(|axis| axis.follow = follow);
    }
    if let Some(delay) = arguments.delay {
        config.stream_delay = StreamDelay::Fixed(delay.as_nanos() as u64);
    }
    if let Err(error) = config.validate() {
        return UsageError::from(error).print(arguments.json);
    }
    if !arguments.is_virtual
        && let Err(refused) = schedule::verify(&config)
    {
        return UsageError::from(refused.to_string()).print(arguments.json);
    }
    let (file, piece) = match read(arguments, &config) {
        Ok(read) => read,
        Err(exit) => return exit,
    };
    let is_same = |out: &Path| matches!((out.canonicalize(), arguments.file.canonicalize()), (Ok(out), Ok(file)) if out == file);
    if arguments.out.as_deref().is_some_and(is_same) {
        return UsageError::from("--out names the file that is to be played").print(arguments.json);
    }
    let out = match arguments.out.as_deref().map(create).transpose() {
        Ok(out) => out,
        Err(words) => return UsageError::from(words).print(arguments.json),
    };
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    if !arguments.json {
        say!(
            "takt: {} lasts {:.1} s from its first point",
            printable_path(&arguments.file),
            file.duration_s()
        );
    }
    let armed = ArmedFrom::default();
    let names: Vec<String> = config.axes.iter().map(|axis| axis.name.clone()).collect();
    let log = SetPointLog::new(&names, config.cycle.period_ns, piece.begins_s(), armed.clone(), out)
        .of_groups(piece.groups().iter().map(|group| group.number));
    let played = if arguments.is_virtual {
        play_in_virtual_time(&config, &piece, log, &armed, &interrupted)
    } else {
        play_in_real_time(arguments, config.clone(), &piece, log, &armed, &interrupted)
    };
    match played {
        Ok(played) => report(arguments, &config, &file, played),
        Err(error) => refuse(&error, arguments.json),
    }
}

/// The file, and what is to be played of it.
fn read(arguments: &Arguments, config: &Config) -> Result<(PlayFile, Piece), Exit> {
    let wrong_file = |error: PlayFileError| print_problem(&arguments.file, &error, arguments.json);
    let bytes = takt_tools::play::read(&arguments.file).map_err(|error| {
        let words = format!("cannot read {}: {error}", arguments.file.display());
        UsageError::from(words).print(arguments.json)
    })?;
    let names: Vec<String> = config.axes.iter().map(|axis| axis.name.clone()).collect();
    let file = PlayFile::parse(&bytes, &names).map_err(wrong_file)?;
    file.check_modes(&config.axes).map_err(wrong_file)?;
    let is_streamed = arguments.follow.is_some() || arguments.delay.is_some();
    if !arguments.trajectory && (is_streamed || !file.is_trajectory) {
        let stream = FileStream::new(&file, config).map_err(wrong_file)?;
        return Ok((file, Piece::Stream(stream)));
    }
    let trajectory = FileTrajectory::new(&file, config).map_err(wrong_file)?;
    let period_s = config.cycle.period_ns as f64 / NANOSECONDS_PER_SECOND as f64;
    trajectory.check(&config.axes, period_s).map_err(wrong_file)?;
    Ok((file, Piece::Trajectory(trajectory)))
}

/// What came of it.
struct Played {
    result: Result<StreamSummary, PlayError>,
    /// How the run ended, where that was not because the file was over.
    outcome: Option<Outcome>,
    /// The state at the end.
    last: Snapshot,
    axes: Vec<AxisMaxima>,
    not_written: Option<io::Error>,
}

/// Why nothing was played.
enum Refused {
    Words(String),
    Session(SessionError),
}

fn play_in_virtual_time(
    config: &Config,
    piece: &Piece,
    log: SetPointLog,
    armed: &ArmedFrom,
    interrupted: &AtomicBool,
) -> Result<Played, Refused> {
    let stage = VirtualStage::new(config, log, interrupted);
    let mut stage = stage.map_err(|error| Refused::Words(error.to_string()))?;
    let result = piece.play(&mut stage, armed);
    let (outcome, snapshot, log) = stage.finish();
    let (axes, not_written) = log.finish();
    Ok(Played { result, outcome, last: snapshot, axes, not_written })
}

fn play_in_real_time(
    arguments: &Arguments,
    config: Config,
    piece: &Piece,
    log: SetPointLog,
    armed: &ArmedFrom,
    interrupted: &AtomicBool,
) -> Result<Played, Refused> {
    let log = SharedSetPointLog::new(log);
    let each_cycle = log.clone();
    let options = SessionOptions {
        is_realtime_required: arguments.require_realtime,
        if_owned: ownership::if_owned(arguments.take_over),
        each_cycle: Some(Box::new(move |record| each_cycle.add(record))),
        ..SessionOptions::default()
    };
    let (result, session, was_interrupted) = match Controller::start(config, options) {
        Ok(controller) => {
            let mut stage = RealStage::new(controller, log.clone(), interrupted);
            let result = piece.play(&mut stage, armed);
            let was_interrupted = stage.was_interrupted();
            (result, stage.finish(), was_interrupted)
        }
        Err(StartFailure::NotEnabled(session)) => (Err(PlayError::Ended), Ok(*session), false),
        Err(StartFailure::Session(error)) => return Err(Refused::Session(error)),
        Err(error) => return Err(Refused::Words(error.to_string())),
    };
    let session = session.map_err(|error| Refused::Words(error.to_string()))?;
    let (axes, not_written) = log.finish();
    let outcome = match session.outcome {
        Outcome::Finished if was_interrupted => Some(Outcome::Interrupted),
        Outcome::Finished => None,
        outcome => Some(outcome),
    };
    Ok(Played { result, outcome, last: session.snapshot, axes, not_written })
}

fn refuse(error: &Refused, is_json: bool) -> Exit {
    match error {
        Refused::Words(words) => UsageError::from(words.clone()).print(is_json),
        Refused::Session(SessionError::Claim(error)) => ownership::usage_error(error).print(is_json),
        Refused::Session(error) => {
            let exit = UsageError::from(error.to_string()).print(is_json);
            if matches!(error, SessionError::Start(StartError::Refused(_))) {
                Exit::RealtimeRefused
            } else {
                exit
            }
        }
    }
}

fn report(arguments: &Arguments, config: &Config, file: &PlayFile, played: Played) -> Exit {
    let machine = Machine::of(config);
    let summary = played.result.clone().unwrap_or_default();
    let (exit, stop, failure) = ending(played.result, played.outcome, played.last.first_stop(), &machine);
    let exit = match (&played.not_written, &arguments.out) {
        (Some(error), Some(path)) => {
            say!("takt: {} cannot be written: {error}", path.display());
            exit.and_failed()
        }
        _ => exit,
    };
    let printed = Printed {
        stop: stop.map(|stop| StopReport::new(&stop, &played.last, &machine)),
        failure,
        duration_s: file.duration_s(),
        points: file.rows.len(),
        late_points: summary.late_points,
        lost_points: summary.lost_points,
        lag_s: summary.lag_ns as f64 / 1e9,
        lag_max_s: summary.lag_max_ns as f64 / 1e9,
        axes: played.axes,
    };
    if arguments.json {
        print::json(&printed, exit)
    } else {
        print::text(&text(&printed, config, exit == Exit::Done), exit)
    }
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
    result: Result<StreamSummary, PlayError>,
    outcome: Option<Outcome>,
    last_stop: Option<StopReason>,
    machine: &Machine,
) -> (Exit, Option<StopReason>, Option<String>) {
    match (result, outcome) {
        (_, Some(Outcome::Interrupted | Outcome::TakenOver { .. })) => (Exit::Interrupted, last_stop, None),
        (_, Some(Outcome::Stopped(stop))) | (Err(PlayError::Stopped(stop)), _) => {
            (Exit::Stopped, Some(stop), None)
        }
        (Err(PlayError::Ended), Some(outcome)) => (Exit::Stopped, None, Some(outcome.words(machine))),
        (Err(error), _) => (Exit::Stopped, None, Some(failure(error, machine))),
        (Ok(_), _) => (Exit::Done, None, None),
    }
}

fn failure(error: PlayError, machine: &Machine) -> String {
    match error {
        PlayError::Ended => "the run has ended".to_owned(),
        PlayError::Stopped(stop) => words::stop(&stop, machine).to_string(),
        PlayError::Replaced => "another client has moved the arm".to_owned(),
        PlayError::Refused(Some(refusal)) => words::rejection(&refusal, machine).to_string(),
        PlayError::Refused(None) => "a request was refused; the reason is no longer known".to_owned(),
        PlayError::Command(words) => words,
    }
}

fn text(printed: &Printed, config: &Config, is_done: bool) -> String {
    let mut text = String::new();
    if let Some(stop) = &printed.stop {
        text += &format!("stopped (category {}): {}\n", stop.category, stop.reason);
    }
    if let Some(failure) = &printed.failure {
        text += &format!("{failure}\n");
    }
    if printed.stop.is_none() && printed.failure.is_none() {
        text += if is_done { "done: " } else { "interrupted: " };
    }
    text += &format!(
        "{} points, {} late, {} lost; lag {:.1} ms, {:.1} ms at most\n",
        printed.points,
        printed.late_points,
        printed.lost_points,
        printed.lag_s * 1e3,
        printed.lag_max_s * 1e3
    );
    text + &format!("\nlargest set-points\n{}", maxima(&printed.axes, config))
}

/// The largest values of each axis beside their limits.
fn maxima(axes: &[AxisMaxima], config: &Config) -> Table {
    let mut table = Table::new(["axis", "unit", ">velocity", ">acceleration", ">jerk"]);
    for (AxisMaxima { name, velocity_max, acceleration_max, jerk_max }, axis) in axes.iter().zip(&config.axes)
    {
        let limits = &axis.limits;
        let jerk = if limits.jerk.is_finite() {
            format!("of {:.1}", limits.jerk)
        } else {
            "without limit".to_owned()
        };
        let row = [
            name.clone(),
            if axis.travel == Travel::Rotary { "rad" } else { "m" }.to_owned(),
            format!("{velocity_max:.4} of {:.4}", limits.velocity),
            format!("{acceleration_max:.3} of {:.3}", limits.acceleration.max(limits.deceleration)),
            format!("{jerk_max:.1} {jerk}"),
        ];
        table.row(row.map(|cell| cell.replace(' ', &UNBROKEN.to_string())));
    }
    table
}
