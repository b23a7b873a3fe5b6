//! The command line of takt.

mod cli;

use clap::Parser;

fn main() -> cli::Exit {
    cli::CommandLine::parse().execute()
}
