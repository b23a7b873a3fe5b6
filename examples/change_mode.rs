//! Changes the mode of operation of an eRob while the controller runs: positions in CSP, velocities in CSV, a soft spring in CST, and
//! back. An eRob must be disabled for each change, and its brake holds the joint meanwhile.
//!
//! ```text
//! cargo run --release --example change_mode configs/erob-modes/erob-changing.toml
//! ```

use std::path::Path;
use std::time::Duration;

use takt::{AxisPoint, Config, Controller, Handle, OperationMode, Phase, SessionOptions, StopCategory};

const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/erob-modes/erob-changing.toml".to_owned());
    let arm = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    run(&arm)?;
    arm.finish()?;
    Ok(())
}

/// Takes the first joint through its three modes, and leaves it where it began.
pub fn run(arm: &Handle) -> takt::Result {
    let home = arm.move_to(&[0.5])?;
    arm.wait(home, PATIENCE)?;

    // While the drive is enabled, it takes no other mode. The answer says why.
    let refused = arm.change_mode(OperationMode::CyclicSynchronousVelocity)?;
    if let Err(error) = arm.wait(refused, PATIENCE) {
        println!("{error}");
    }

    change(arm, OperationMode::CyclicSynchronousVelocity)?;
    stream(arm, AxisPoint::Velocity(0.3))?;

    change(arm, OperationMode::CyclicSynchronousTorque)?;
    // A spring of 60 N·m/rad, and 3 N·m against the weight of the joint.
    let here = arm.state().axes()[0].position;
    stream(arm, AxisPoint::position(here).with_impedance(60.0, 8.0).with_torque(3.0))?;

    change(arm, OperationMode::CyclicSynchronousPosition)?;
    let back = arm.move_to(&[0.0])?;
    arm.wait(back, PATIENCE)?;
    Ok(())
}

/// Disables the joint, changes its mode, and enables it again.
fn change(arm: &Handle, mode: OperationMode) -> takt::Result {
    arm.disable()?;
    arm.wait_for(Phase::Disabled, PATIENCE)?;
    let change = arm.change_mode(mode)?;
    arm.wait(change, PATIENCE)?;
    arm.enable()?;
    arm.wait_for(Phase::Holding, PATIENCE)?;
    let joint = arm.state().axes[0];
    println!("{mode:?}: the drive shows mode {:?} at {:.3} rad", joint.mode, joint.position);
    Ok(())
}

/// Streams a point every ten cycles, for half a second at 1 kHz, and stops.
fn stream(arm: &Handle, point: AxisPoint) -> takt::Result {
    arm.begin_stream()?;
    for _ in 0..50 {
        arm.stream().push_now(&[point])?;
        arm.advance(10)?;
    }
    let joint = arm.state().axes[0];
    println!("at {:.3} rad, {:.2} rad/s, {:.1} N·m", joint.position, joint.velocity, joint.torque_set);
    arm.stop(StopCategory::Two)?;
    arm.wait_for(Phase::Holding, PATIENCE)?;
    Ok(())
}
