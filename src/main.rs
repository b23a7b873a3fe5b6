//! The command line of takt.

mod cli;

use clap::Parser;

fn main() -> cli::Exit {
    cli::CommandLine::try_parse().map_or_else(|error| cli::refuse(&error), cli::CommandLine::execute)
}
