//! Executes a trajectory: points with times, checked as a whole before the arm moves. It is slowed down, paused and resumed on its
//! path. Then the arm goes home through waypoints, without stopping there.
//!
//! ```text
//! cargo run --release --example execute configs/arm6-erob.toml
//! ```

use std::path::Path;
use std::thread;
use std::time::Duration;

use takt::{Config, Controller, SessionOptions, TrajectoryPoint};

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    run(Config::load(Path::new(&path))?)
}

/// Executes one trajectory that is refused, and one that is not.
pub fn run(config: Config) -> takt::Result {
    let arm = Controller::start(config, SessionOptions::default())?;
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    // The first two joints so far from home, and the others there.
    let beside = |way: f64| -> Vec<f64> {
        home.iter().enumerate().map(|(joint, at)| if joint < 2 { at + way } else { *at }).collect()
    };

    // Times from the start, as in a JointTrajectory of ROS; velocities and accelerations may be given too.
    let point = |time_s: f64, way: f64| TrajectoryPoint {
        time_s,
        positions: beside(way),
        ..TrajectoryPoint::default()
    };
    if let Err(error) = arm.execute(&[point(1.0, 0.1), point(1.1, 0.6)]) {
        println!("refused: {error}");
    }

    let motion = arm.execute(&[point(1.0, 0.2), point(2.0, 0.4), point(3.0, 0.3)])?;
    thread::sleep(Duration::from_millis(500));
    arm.set_speed(motion, 0.5)?;
    thread::sleep(Duration::from_millis(500));
    arm.pause(motion)?;
    thread::sleep(Duration::from_millis(500));
    if let Some(progress) = arm.trajectory_progress(motion) {
        println!("paused at {:.3} s of {:.3} s", progress.path_s, progress.of_s);
    }
    arm.set_speed(motion, 1.0)?;
    arm.resume(motion)?;
    arm.wait(motion, Duration::from_secs(10))?;

    let back = arm.move_through(&[beside(0.2), beside(0.1), home.clone()])?;
    arm.wait(back, Duration::from_secs(10))?;
    arm.finish()?;
    Ok(())
}
