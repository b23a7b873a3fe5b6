//! `takt replay`: runs the engine again on what a recording holds.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use takt_rt::{CycleRecord, Event};

use takt::config::{Config, ConfigSources, SourcesError};
use takt::telemetry::{Machine, Recorded, ReplayRecording, recorded_journal, words};
use takt_tools::replay::{Comparison, ComparisonReport, Setting, apply, compare, complete_journal};

use super::exit::Exit;
use super::print;
use super::table::{Table, UNBROKEN};
use super::usage_error::UsageError;

/// Run the engine again on the frames, requests and times of a recording: the same set-points, bit for bit, or those of a changed
/// configuration
#[derive(Args, Debug)]
pub struct Arguments {
    /// The recording of `takt run`; of several files, the first one
    recording: PathBuf,
    /// Change a value of the configuration before: axes.wrist.limits.jerk=200
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<Setting>,
    /// Take this configuration in place of that of the recording
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Write the replay as a recording, for `takt report` and Foxglove
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs it. The exit code is 0 when the replay is as the recording, or when it was to be another one; 1 when it differs though the
/// configuration is the same; 2 when there is nothing to be replayed.
pub fn run(arguments: &Arguments) -> Exit {
    match tell(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

fn tell(arguments: &Arguments) -> Result<Exit, UsageError> {
    let path = &arguments.recording;
    let found = recorded_journal(path).map_err(|error| error.to_string())?;
    let is_changed = arguments.config.is_some() || !arguments.settings.is_empty();
    let (sources, files) = (found.sources.clone(), found.files.clone());
    let journal = complete_journal(&path.display().to_string(), found)?;
    let config = configuration(arguments, sources)?;
    let machine = Machine::of(&config);
    let mut written = match &arguments.record {
        None => None,
        Some(file) => Some(ReplayRecording::begin(file, path, &machine).map_err(|error| error.to_string())?),
    };
    let each = |record: &CycleRecord, events: &[Event]| {
        if let Some(written) = &mut written {
            written.cycle(record, events, &machine);
        }
    };
    let files = files.iter().map(|file| Recorded::open(file));
    let comparison = compare(files, &config, journal, each).map_err(|error| error.to_string())?;
    let is_written = written.is_none_or(|written| match written.finish() {
        Ok(file) => {
            say!("takt: the replay is recorded in {}", file.display());
            true
        }
        Err(error) => {
            say!("takt: {error}");
            false
        }
    });
    let exit = match is_written && (is_changed || comparison.is_identical()) {
        true => Exit::Done,
        false => Exit::Stopped,
    };
    Ok(if arguments.json {
        print::json(&ComparisonReport::new(&comparison, &config, &machine), exit)
    } else {
        print::text(&text(&comparison, &config, &machine, is_changed), exit)
    })
}

/// The configuration of the replay.
fn configuration(arguments: &Arguments, recorded: ConfigSources) -> Result<Config, UsageError> {
    let mut sources = match &arguments.config {
        Some(file) => ConfigSources::load(file)?.1,
        None => recorded,
    };
    if sources.main.is_none() {
        return Err("the recording has no file of its configuration, which was made in code; name one: --config FILE.toml".into());
    }
    apply(&arguments.settings, &mut sources).map_err(|error| format!("--set {error}"))?;
    let config = sources.config().map_err(|error| match error {
        SourcesError::Config(error) => UsageError::from(error),
        other => other.to_string().into(),
    })?;
    config.validate()?;
    Ok(config)
}

fn text(comparison: &Comparison, config: &Config, machine: &Machine, is_changed: bool) -> String {
    let Comparison { cycles, compared, differing, first, .. } = comparison;
    let mut text = String::new();
    let _ = match (differing, is_changed) {
        (0, _) => {
            writeln!(text, "{cycles} cycles replayed, {compared} compared: all are identical, bit for bit")
        }
        (_, true) => writeln!(text, "{cycles} cycles replayed, {compared} compared: {differing} differ"),
        (_, false) => writeln!(
            text,
            "{cycles} cycles replayed, {compared} compared: {differing} differ, though the configuration is the same"
        ),
    };
    if let Some(first) = first {
        let (recorded, replayed) = &first.values;
        let _ = writeln!(
            text,
            "the first is slot {}: {}: {recorded} recorded, {replayed} replayed",
            first.slot, first.what
        );
        let _ = writeln!(text, "\nrecorded → replayed, the largest values of the set-points\n");
        let _ = write!(text, "{}", axes(comparison, config));
        if is_changed {
            let _ = writeln!(
                text,
                "\nThe drives followed the recorded set-points: their positions are those of the recording, so that a following error of \
                 the replay\ndoes not show what they would have done."
            );
        }
        let (recorded_s, replayed_s) = comparison.last_motion_s;
        let _ = writeln!(text, "\nlast motion after {recorded_s:.3} s → {replayed_s:.3} s");
    }
    if comparison.missing > 0 {
        let _ = writeln!(text, "the replay ends {} cycles before the recording", comparison.missing);
    }
    for (_, stop) in &comparison.stops {
        let _ = writeln!(text, "stop in the replay: {}", words::stop(stop, machine));
    }
    text
}

fn axes(comparison: &Comparison, config: &Config) -> Table {
    let mut table = Table::new(["axis", ">distance", ">velocity", ">acceleration", ">jerk"]);
    for (axis, difference) in config.axes.iter().zip(&comparison.axes) {
        let pair = |(was, is): (f64, f64)| format!("{was:.4}{UNBROKEN}→{UNBROKEN}{is:.4}");
        table.row([
            axis.name.clone(),
            format!("{:.6}", difference.position),
            pair(difference.velocity),
            pair(difference.acceleration),
            pair(difference.jerk),
        ]);
    }
    table
}
