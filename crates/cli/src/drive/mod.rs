//! `takt drive`: commissioning of a single drive.

mod entries;
mod inspection;
mod keys;
mod line;
mod motion;
mod options;
mod output;
mod pulse_width;
mod session;
mod target;
mod upkeep;

use clap::{Args, Subcommand};

use takt_tools::commission::{Failure, TargetDrive, Task};

use super::exit::Exit;
use super::ownership::if_owned;
use options::Options;
use target::Place;

pub use target::USUAL_LINE_RATE;

/// In the help of an action, its own options come first.
const TO_THE_DRIVE: &str = "Which drive, and the way to it";

/// Commission one drive: inspect it, move it, set it up
///
/// An axis of a configuration: `takt drive CONFIG AXIS ACTION`, where AXIS may be left out if there is only one.
///
/// A drive without a configuration: `takt drive --bus can0 --node 1 --family FAMILY ACTION`; on a serial line with
/// `--bus serial:/dev/ttyUSB0`. No limits are known of it. A CiA 402 drive without a family of its own is named by its data sheet
/// (`--eds drive.eds`), one of bit fields by the keys that an axis has in a configuration (`--set KEY=VALUE`, also for its limits).
///
/// Values have a unit and are the joint's ("90 deg", "20 deg/s"); with --raw they are whole numbers of the drive's own. Every motion ends
/// at rest without torque, also after Ctrl-C, unless --keep-enabled is given.
#[derive(Args, Debug)]
#[command(subcommand_value_name = "ACTION", subcommand_help_heading = "Actions")]
pub struct Arguments {
    #[command(flatten, next_help_heading = TO_THE_DRIVE)]
    target: target::Target,
    #[command(flatten, next_help_heading = "Options of every action")]
    options: Options,
    /// Have another takt of this host that commands the bus stop in control first, and take the bus over
    #[arg(long, global = true, help_heading = TO_THE_DRIVE)]
    take_over: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    Entries(entries::Arguments),
    PulseWidth(pulse_width::Arguments),
    #[command(flatten)]
    Task(TaskAction),
}

/// An action that needs the drive.
#[derive(Subcommand, Debug)]
enum TaskAction {
    #[command(flatten)]
    Inspect(inspection::Action),
    #[command(flatten)]
    Motion(motion::Action),
    #[command(flatten)]
    Upkeep(upkeep::Action),
}

impl TaskAction {
    /// Its name on the command line.
    const fn name(&self) -> &'static str {
        match self {
            Self::Inspect(action) => action.name(),
            Self::Motion(action) => action.name(),
            Self::Upkeep(action) => action.name(),
        }
    }

    fn task(&self, target: &TargetDrive, is_raw: bool) -> Result<Task, Failure> {
        match self {
            Self::Inspect(action) => Ok(action.task(is_raw)),
            Self::Motion(action) => action.task(target, is_raw),
            Self::Upkeep(action) => action.task(is_raw),
        }
    }
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    let action = match &arguments.action {
        Action::Entries(entries) => {
            return entries::run(entries, arguments.target.drive(), arguments.options.json);
        }
        Action::PulseWidth(asked) => {
            return pulse_width::run(asked, arguments.target.family(), arguments.options.json);
        }
        Action::Task(action) => action,
    };
    let is_scan = matches!(action, TaskAction::Inspect(inspection::Action::Scan));
    let (target, place) = match arguments.target.resolve(is_scan) {
        Ok(resolved) => resolved,
        Err(error) => return error.print(arguments.options.json),
    };
    let mut output = output::Output::new(&target, action.name(), arguments.options);
    let task = match action.task(&target, arguments.options.raw) {
        Ok(task) => task,
        Err(failure) => return output.refuse(&failure),
    };
    let run = |task, output: &mut _| match &place {
        Place::Bus(bus) => {
            session::run(&target, task, bus, if_owned(arguments.take_over), arguments.options, output)
        }
        Place::Line(line) => line::run(&target, task, line, arguments.options, output),
    };
    let mut outcome = run(task.clone(), &mut output);
    if let Ok(Err(failed)) = &outcome
        && let Failure::NeedsConsent { consequence, .. } = failed.failure
        && output.asks_for(consequence)
    {
        outcome = run(task.confirmed(), &mut output);
    }
    match outcome {
        Ok(outcome) => output.finish(&outcome),
        Err(exit) => exit,
    }
}
