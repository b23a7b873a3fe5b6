//! Moves an arm that another process serves: `takt run configs/arm6-erob.toml --serve arm`, and beside it `cargo run --example remote arm`.
//! `docs/another-process.md` shows it.

use std::error::Error;
use std::time::Duration;

/// Moves each axis of the arm by 0.05 rad (m), and then each by 0.01 rad (m) by a point of a stream.
pub fn run(name: &str) -> Result<(), Box<dyn Error>> {
    let arm = takt_remote::connect(name)?;
    let here: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let shifted = |by: f64| here.iter().map(|position| position + by).collect::<Vec<f64>>();
    let motion = arm.move_to(&shifted(0.05))?;
    arm.wait(motion, Duration::from_secs(10))?;
    arm.begin_stream()?;
    arm.stream().push_now(&shifted(0.06))?;
    println!("{} is at {:.3?}, and goes on by 0.01", arm.machine().name, shifted(0.05));
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&std::env::args().nth(1).unwrap_or_else(|| "arm".to_owned()))
}
