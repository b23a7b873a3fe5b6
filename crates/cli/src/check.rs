//! `takt check`: everything that can be known before motion.

mod lines;
mod result;
mod supervision;
mod text;
mod unattended;

use std::path::PathBuf;

use clap::Args;
use takt::config::Config;

use super::exit::Exit;
use super::print;
use super::usage_error::UsageError;
use result::Check;

/// Check a configuration: limits, units, bus load, and the worst-case response time of every message
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The configuration
    config: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// Checks a configuration and prints the result. The exit code is 0 when it can be run, else 2.
pub fn run(arguments: &Arguments) -> Exit {
    let config = match Config::load(&arguments.config) {
        Ok(config) => config,
        Err(error) => return UsageError::from(error).print(arguments.json),
    };
    let check = Check::of(&config);
    let exit = if check.fits { Exit::Done } else { Exit::Usage };
    if arguments.json {
        print::indented_json(&check, exit)
    } else {
        print::text(&text::whole(&check, &config), exit)
    }
}
