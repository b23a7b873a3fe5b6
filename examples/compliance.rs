//! Streams what a joint in cyclic synchronous torque (CST) takes: a soft spring, a torque, and a velocity. Each point is stamped on
//! its arrival, from an ordinary thread. The loops are closed by the controller, and every limit is kept.
//!
//! ```text
//! cargo run --release --example compliance configs/erob-modes/erob-cst.toml
//! ```

use std::path::Path;

use takt::{AxisPoint, Config, Controller, Handle, SessionOptions};

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/erob-modes/erob-cst.toml".to_owned());
    let arm = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    run(&arm)?;
    arm.finish()?;
    Ok(())
}

/// Streams each kind to the first joint, a point every ten cycles, for half a second at 1 kHz. The others stay where they are.
pub fn run(arm: &Handle) -> takt::Result {
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    // A spring of 60 N·m/rad and a damper of 8 N·m·s/rad. `[axis.torque_loop] stiffness_max` and `damping_max` limit both.
    let soft = AxisPoint::position(home[0] + 0.1).with_impedance(60.0, 8.0);

    arm.begin_stream()?;
    for (name, point) in [
        ("impedance", soft),
        // The same spring, and 2 N·m that pull beside it, as against a weight.
        ("impedance with a torque", soft.with_torque(2.0)),
        ("torque", AxisPoint::Torque(1.0)),
        // A joint that moves is not stopped by a change of the kind: it goes on from where it is, as fast as it is.
        ("velocity", AxisPoint::Velocity(-0.2)),
    ] {
        let mut points: Vec<AxisPoint> = home.iter().map(|position| (*position).into()).collect();
        points[0] = point;
        for _ in 0..50 {
            arm.stream().push_now(&points)?;
            arm.advance(10)?;
        }
        let state = arm.state();
        let joint = &state.axes()[0];
        println!("{name}: at {:.3} rad with {:.3} N·m", joint.position, joint.torque_set);
    }

    // What an axis does not take is refused before it is sent, with the axis and what is allowed.
    let too_stiff = vec![soft.with_impedance(1e6, 8.0); home.len()];
    if let Err(error) = arm.stream().push_now(&too_stiff) {
        println!("refused: {error}");
    }
    Ok(())
}
