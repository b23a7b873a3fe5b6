//! takt.

mod cli;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// A hard-real-time joint-motion controller for CAN drives
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(cli::check::CheckArgs),
}

fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Check(args) => cli::check::run(&args),
    }
}
