//! Runs a configuration with simulated drives in virtual time: ten seconds of motion take a tenth of a second, and every run
//! is the same. Use it to test a motion program without hardware.
//!
//! ```text
//! cargo run --release --example virtual_time configs/arm6-erob.toml
//! ```

use std::path::Path;

use takt::{Config, VirtualRun};

const CYCLES_AT_MOST: u64 = 10_000_000;

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    run(Config::load(Path::new(&path))?)
}

/// Runs the program of the configuration, and looks at every cycle.
pub fn run(config: Config) -> takt::Result {
    let (mut run, _log) = VirtualRun::simulated(&config)?;
    let mut largest = vec![0.0_f64; config.axes.len()];
    let outcome = run.run(CYCLES_AT_MOST, |run| {
        for (largest, axis) in largest.iter_mut().zip(run.snapshot().axes) {
            *largest = largest.max(axis.velocity.abs());
        }
    });
    println!("{outcome:?} after {} slots", run.snapshot().slot);
    for (axis, largest) in config.axes.iter().zip(largest) {
        println!("{:<10} reached {largest:.3} of {:.3} per second", axis.name, axis.limits.velocity);
    }
    Ok(())
}
