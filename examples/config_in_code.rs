//! A configuration without a file: two simulated joints, each made in a line.
//!
//! ```text
//! cargo run --release --example config_in_code
//! ```

use std::time::Duration;

use takt::config::{Axis, Bus, Interface, Limits};
use takt::family;
use takt::{Config, Controller, Handle, SessionOptions};

fn main() -> takt::Result {
    let arm = Controller::start(config(), SessionOptions::default())?;
    run(&arm)
}

/// Everything that is not named has the default of a file, and is checked by the same rules.
pub fn config() -> Config {
    let limits = Limits {
        position_min: -2.9,
        position_max: 2.9,
        velocity: 2.0,
        acceleration: 8.0,
        deceleration: 8.0,
        jerk: 100.0,
        torque: 87.0,
    };
    let shoulder = Axis::new("shoulder", 0, 1, family::EROB_CANOPEN, limits);
    let elbow = Axis { reversed: true, ..Axis::new("elbow", 0, 2, family::EROB_CANOPEN, limits) };
    // On the machine: Interface::SocketCan("can0".to_owned())
    let bus = Bus::new("can", Interface::Simulated);
    let mut config = Config::new("two-joints", vec![bus], vec![shoulder, elbow]);
    config.telemetry.is_recorded = false;
    config
}

/// Moves both joints.
pub fn run(arm: &Handle) -> takt::Result {
    let motion = arm.move_to(&[0.5, -0.5])?;
    arm.wait(motion, Duration::from_secs(10))?;
    println!("arrived");
    Ok(())
}
