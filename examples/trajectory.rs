//! Trajectories: points with times, checked as a whole before they start, carried out exactly, slowed down and paused on the
//! path; and waypoints that the controller plans through without stopping.
//!
//! ```text
//! cargo run --release --example trajectory configs/arm6-erob.toml
//! ```

use std::path::Path;
use std::time::Duration;

use takt::{Config, Controller, Handle, SessionOptions, TrajectoryPoint};

const PATIENCE: Duration = Duration::from_secs(60);

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    let arm = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    run(&arm)
}

/// Executes a trajectory, slower in between, and goes back through waypoints.
pub fn run(arm: &Handle) -> takt::Result {
    let home: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let from_home = |offset: f64| -> Vec<f64> { home.iter().map(|home| home + offset).collect() };
    let point =
        |time_s, offset| TrajectoryPoint { time_s, positions: from_home(offset), ..Default::default() };

    // Smoothly from point to point, since they come without velocities.
    let points = [point(1.0, 0.05), point(2.0, 0.0), point(3.0, -0.05)];
    let motion = arm.execute(&points)?;
    arm.set_speed(motion, 0.5)?;
    arm.pause(motion)?;
    arm.advance(200)?;
    if let Some(progress) = arm.trajectory_progress(motion)? {
        println!("paused near {:.2} s of {:.2} s", progress.path_s, progress.of_s);
    }
    arm.resume(motion)?;
    arm.wait(motion, PATIENCE)?;

    // What breaks a limit anywhere is refused before anything moves.
    match arm.execute(&[point(0.01, 0.05)]) {
        Err(refused) => println!("refused: {refused}"),
        Ok(_) => println!("this arm is very fast"),
    }

    let waypoints = [from_home(0.02), from_home(0.05), home.clone()];
    let motion = arm.move_through(&waypoints)?;
    arm.wait(motion, PATIENCE)?;
    println!("back at the beginning");
    Ok(())
}
