//! The first program: brings the drives of an arm up, moves it, and shuts them down.
//!
//! ```text
//! cargo run --release --example embed configs/arm6-erob.toml
//! ```

use std::path::Path;
use std::time::Duration;

use takt::{Config, Controller, Handle, MoveOptions, SessionOptions};

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    let arm = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    for refused in arm.realtime().refused() {
        println!("the loop is less punctual than it could be: {refused:?}");
    }
    run(&arm)?;
    // Dropping the controller would do the same, without the result.
    let session = arm.finish()?;
    println!("{:?}", session.outcome);
    Ok(())
}

/// Moves every axis to the middle of its travel, and to a tenth of its travel above it.
pub fn run(arm: &Handle) -> takt::Result {
    let pose = |part: f64| -> Vec<f64> {
        let limits = arm.axes().iter().map(|axis| axis.limits);
        limits.map(|of| of.position_min + part * (of.position_max - of.position_min)).collect()
    };

    // As fast as the limits allow. All axes arrive at the same time.
    let motion = arm.move_to(&pose(0.5))?;
    arm.wait(motion, Duration::from_secs(30))?;

    // At half the velocity, within 3 s at the earliest. A move replaces the one that is under way.
    let gently = MoveOptions { velocity_scale: 0.5, minimum_duration_s: 3.0, ..MoveOptions::default() };
    let motion = arm.move_with(&pose(0.6), gently)?;
    arm.wait(motion, Duration::from_secs(30))?;

    for (axis, now) in arm.axes().iter().zip(arm.state().axes()) {
        println!(
            "{:<10} {:+.4} rad, {:+.1e} off its set-point",
            axis.name, now.position, now.following_error
        );
    }
    Ok(())
}
