//! The program `takt`: one file a subcommand, and what they share.
#![deny(unsafe_code)]

#[macro_use]
mod say;

mod chart;
mod check;
mod columns;
mod completions;
mod configuration;
mod doctor;
mod drive;
mod eds;
mod exit;
mod full_queue;
mod interruption;
mod jitter;
mod log;
mod lss;
mod manual;
mod metrics;
mod monitor;
mod ownership;
mod panel;
mod plan;
mod play;
mod print;
mod replay;
mod report;
mod run;
mod scan;
mod send;
mod service;
mod sim;
mod svg;
mod table;
mod top;
mod usage_error;

use std::process::{ExitCode, Termination};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use exit::Exit;
use log::LogLevel;

/// Does what the command line says.
fn main() -> ExitCode {
    let matches = command().try_get_matches();
    let exit = matches
        .and_then(|matches| CommandLine::from_arg_matches(&matches))
        .map_or_else(|error| usage_error::of_command_line(&error), CommandLine::execute);
    exit.report()
}

/// The whole command line.
fn command() -> clap::Command {
    CommandLine::command()
        .mut_subcommand("drive", |drive| {
            // clap leaves out in the usage of an action what stands before it and is not always needed.
            drive.mut_subcommands(|action| with_usage_behind(action, "takt drive [CONFIG [AXIS]]"))
        })
        // When it is called: every other command would read the descriptions of all drives before it begins.
        .mut_subcommand("scan", |scan| scan.defer(scan::with_end_of_help))
}

/// Has the usage of a command, and of those below it, begin with `before`.
fn with_usage_behind(command: clap::Command, before: &str) -> clap::Command {
    let usage = command.clone().render_usage().to_string();
    let own = usage.trim_start_matches("Usage:").trim_start();
    let before_below = format!("{before} {}", command.get_name());
    let usage = format!("{before} {own}");
    command.override_usage(usage).mut_subcommands(|below| with_usage_behind(below, &before_below))
}

/// Hard-real-time joint-motion controller for CAN drives.
#[derive(Parser, Debug)]
// 0: as wide as the text, for other programs.
#[command(name = "takt", version, arg_required_else_help = true, term_width = columns::columns().map_or(0, usize::from))]
struct CommandLine {
    /// Tell on standard error what happens, from this level on
    #[arg(
        long,
        global = true,
        value_name = "LEVEL",
        value_enum,
        env = "TAKT_LOG",
        hide_env_values = true,
        help_heading = "Diagnosis"
    )]
    log: Option<LogLevel>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    Run(run::Arguments),
    Report(report::Arguments),
    Replay(replay::Arguments),
    Check(check::Arguments),
    Plan(plan::Arguments),
    Play(play::Arguments),
    Panel(panel::Arguments),
    Sim(sim::Arguments),
    Doctor(doctor::Arguments),
    Drive(drive::Arguments),
    Eds(eds::Arguments),
    Lss(lss::Arguments),
    Scan(scan::Arguments),
    Monitor(monitor::Arguments),
    Send(send::Arguments),
    Jitter(jitter::Arguments),
    Top(top::Arguments),
    Completions(completions::Arguments),
    Manual(manual::Arguments),
}

impl CommandLine {
    /// Does what the command line says.
    fn execute(self) -> Exit {
        self.log.unwrap_or(LogLevel::Off).begin();
        match self.command {
            Command::Run(arguments) => run::run(arguments),
            Command::Report(arguments) => report::run(&arguments),
            Command::Replay(arguments) => replay::run(&arguments),
            Command::Check(arguments) => check::run(&arguments),
            Command::Plan(arguments) => plan::run(&arguments),
            Command::Play(arguments) => play::run(&arguments),
            Command::Panel(arguments) => panel::run(&arguments),
            Command::Sim(arguments) => sim::run(&arguments),
            Command::Doctor(arguments) => doctor::run(&arguments),
            Command::Drive(arguments) => drive::run(&arguments),
            Command::Eds(arguments) => eds::run(&arguments),
            Command::Lss(arguments) => lss::run(&arguments),
            Command::Scan(arguments) => scan::run(&arguments),
            Command::Monitor(arguments) => monitor::run(&arguments),
            Command::Send(arguments) => send::run(&arguments),
            Command::Jitter(arguments) => jitter::run(&arguments),
            Command::Top(arguments) => top::run(&arguments),
            Command::Completions(arguments) => completions::run(arguments, &mut command()),
            Command::Manual(arguments) => manual::run(&arguments, command()),
        }
    }
}
