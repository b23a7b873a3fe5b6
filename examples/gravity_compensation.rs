//! Gravity compensation: a function in the real-time thread gives every joint the torque that carries its own weight. The arm stays where
//! it is, and a hand could move it.
//!
//! ```text
//! cargo run --release --example gravity_compensation configs/arm6-erob-cst.toml
//! ```

use std::path::Path;
use std::time::Duration;

use takt::{CallbackOptions, Config, Controller, Handle, SessionOptions};

const PATIENCE: Duration = Duration::from_secs(60);
/// The torque of gravity at each joint, a quarter turn from where it hangs: N·m. A real arm needs its model here.
const GRAVITY: [f64; 6] = [0.0, 30.0, 15.0, 1.5, 1.0, 0.5];
/// Takes the energy out of a joint that is pushed: N·m·s/rad.
const DAMPING: f64 = 0.5;
const POSE: [f64; 6] = [0.4, -0.5, 0.6, -1.0, 0.5, 0.8];

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob-cst.toml".to_owned());
    let config = with_gravity(Config::load(Path::new(&path))?);
    let arm = Controller::start(config, SessionOptions::default())?;
    run(&arm).map(drop)
}

/// Adds the weight of the joints to their simulation.
pub fn with_gravity(mut config: Config) -> Config {
    for (axis, gravity) in config.axes.iter_mut().zip(GRAVITY) {
        axis.simulated.gravity = gravity;
    }
    config
}

/// Lets the arm float for two seconds. Returns how far the joint has moved that has moved farthest.
pub fn run(arm: &Handle) -> takt::Result<f64> {
    arm.wait(arm.move_to(&POSE)?, PATIENCE)?;
    let before = arm.state();

    let mut elapsed_s = 0.0;
    // Without a real-time kernel, a call may be interrupted.
    let options = CallbackOptions { overruns_allowed: 20, ..CallbackOptions::default() };
    let floating = arm.in_loop_with(options, move |state, cycle, command| {
        for (number, (axis, gravity)) in state.axes().zip(GRAVITY).enumerate() {
            command.torque(number, gravity * axis.position.sin() - DAMPING * axis.velocity);
        }
        elapsed_s += cycle.dt_s;
        if elapsed_s > 2.0 {
            command.finish();
        }
    })?;
    floating.wait(PATIENCE)?;

    let after = arm.state();
    let moved =
        after.axes().iter().zip(before.axes()).map(|(now, then)| (now.position - then.position).abs());
    let farthest = moved.fold(0.0, f64::max);
    println!("floated for 2 s and moved {:.1} mrad at most: {:?}", 1e3 * farthest, floating.times());
    Ok(farthest)
}
