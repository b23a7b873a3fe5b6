//! Options of every action.

use clap::Args;

/// How values are written and results are shown.
#[derive(Args, Clone, Copy, Debug)]
pub struct Options {
    /// Values are whole numbers in the drive's own units
    #[arg(long, global = true)]
    pub raw: bool,
    /// Show every step and every frame with its meaning
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Print the result as one JSON object (watch: one for each reading)
    #[arg(long, global = true)]
    pub json: bool,
    /// Run the time of a simulated bus as fast as possible
    #[arg(long, global = true)]
    pub fast: bool,
}
