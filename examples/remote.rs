//! Moves an arm that another process serves: `takt run configs/arm6-erob.toml --serve arm`, and beside it `cargo run --example remote arm`.

use std::time::Duration;

/// Moves each axis of the arm by 0.05 rad (m).
pub fn run(name: &str) -> takt::Result {
    let arm = takt::connect(name)?;
    let target: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set + 0.05).collect();
    let motion = arm.move_to(&target)?;
    arm.wait(motion, Duration::from_secs(10))?;
    println!("{} is at {target:.3?}", arm.machine().name);
    Ok(())
}

fn main() -> takt::Result {
    run(&std::env::args().nth(1).unwrap_or_else(|| "arm".to_owned()))
}
