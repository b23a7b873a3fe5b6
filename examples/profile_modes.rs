//! Drives that plan by themselves: a velocity for an axis in profile velocity, a torque for one in profile torque.
//!
//! ```text
//! cargo run --release --example profile_modes configs/erob-modes/erob-pv.toml
//! cargo run --release --example profile_modes configs/erob-modes/erob-pt.toml
//! ```

use std::path::Path;
use std::time::Duration;

use takt::config::Control;
use takt::{Config, Controller, Handle, Phase, SessionOptions};

/// Unless it is given again within this time, the group stops: nothing moves on behind a program that hangs.
const VALID_FOR: Duration = Duration::from_millis(200);
const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/erob-modes/erob-pv.toml".to_owned());
    let machine = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    run(&machine)
}

/// Drives the first axis with a tenth of what its limits allow, for a second at 1 kHz, and lets it come to rest.
pub fn run(machine: &Handle) -> takt::Result {
    let axis = &machine.axes()[0];
    let drive = |part: f64| match axis.control {
        Control::ProfileTorque => machine.torque(0, part * axis.limits.torque, VALID_FOR),
        _ => machine.velocity(0, part * axis.limits.velocity, VALID_FOR),
    };
    for _ in 0..20 {
        drive(0.1)?;
        // A quarter of the time within which the next command must follow.
        machine.advance(50)?;
    }
    let now = machine.state().axes[0];
    println!("{} turns at {:+.3} rad/s", axis.name, now.velocity);

    let ending = drive(0.0)?;
    machine.wait(ending, PATIENCE)?;
    machine.wait_for(Phase::Holding, PATIENCE)?;
    println!("at rest");
    Ok(())
}
