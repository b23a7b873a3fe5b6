//! `takt replay`: runs the engine again on what a recording holds.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use takt_rt::{CycleRecord, Event};

use crate::config::{Config, ConfigSources, SourcesError};
use crate::replay::{Comparison, Setting, apply, compare};
use crate::telemetry::{Machine, RecordedJournal, ReplayRecording, recorded_journal, words};

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

/// The result as an object.
#[derive(Serialize)]
struct Printed {
    identical: bool,
    cycles: u64,
    compared: u64,
    missing: u64,
    differing: u64,
    first_difference: Option<PrintedDifference>,
    axes: Vec<PrintedAxis>,
    stops: Vec<String>,
    last_motion_s: Pair,
}

#[derive(Serialize)]
struct PrintedDifference {
    slot: u64,
    what: String,
    recorded: String,
    replayed: String,
}

#[derive(Serialize)]
struct PrintedAxis {
    name: String,
    position_difference: f64,
    slot: u64,
    velocity: Pair,
    acceleration: Pair,
    jerk: Pair,
}

/// A value of the recording, and of the replay.
#[derive(Serialize)]
struct Pair {
    recorded: f64,
    replayed: f64,
}

impl From<(f64, f64)> for Pair {
    fn from((recorded, replayed): (f64, f64)) -> Self {
        Self { recorded, replayed }
    }
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
    let journal = complete(path, found)?;
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
    let comparison = compare(&files, &config, journal, each).map_err(|error| error.to_string())?;
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
        print::json(&printed(&comparison, &config, &machine), exit)
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

/// The journal, if all of it is there.
fn complete(path: &Path, found: RecordedJournal) -> Result<crate::journal::Journal, UsageError> {
    let path = path.display();
    if let Some(first) = found.begins_in {
        let is_there = if first.exists() {
            "replay that one, and this one follows it"
        } else {
            "which is not there any more"
        };
        return Err(format!(
            "{path}: the journal of this run begins in an earlier file, {}: {is_there}",
            first.display()
        )
        .into());
    }
    if found.is_of_other_version {
        return Err(format!(
            "{path}: its journal is of another version of takt; replay it with that version"
        )
        .into());
    }
    if let Some(defect) = found.defect {
        return Err(format!("{path}: {defect}").into());
    }
    match (found.journal, found.lost) {
        (None, _) => Err(format!(
            "{path}: this has no journal: only recordings of `takt run` have one, not black boxes, and not those of takt 0.1"
        )
        .into()),
        (_, Some(lost)) if lost > 0 => Err(format!(
            "{path}: {lost} entries of the journal were lost, because the logger was late: it cannot be replayed"
        )
        .into()),
        (Some(journal), _) => Ok(journal),
    }
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

fn printed(comparison: &Comparison, config: &Config, machine: &Machine) -> Printed {
    Printed {
        identical: comparison.is_identical(),
        cycles: comparison.cycles,
        compared: comparison.compared,
        missing: comparison.missing,
        differing: comparison.differing,
        first_difference: comparison.first.clone().map(|first| PrintedDifference {
            slot: first.slot,
            what: first.what,
            recorded: first.values.0,
            replayed: first.values.1,
        }),
        axes: config
            .axes
            .iter()
            .zip(&comparison.axes)
            .map(|(axis, difference)| PrintedAxis {
                name: axis.name.clone(),
                position_difference: difference.position,
                slot: difference.slot,
                velocity: difference.velocity.into(),
                acceleration: difference.acceleration.into(),
                jerk: difference.jerk.into(),
            })
            .collect(),
        stops: comparison.stops.iter().map(|(_, stop)| words::stop(stop, machine)).collect(),
        last_motion_s: comparison.last_motion_s.into(),
    }
}
