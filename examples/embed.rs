//! Embeds the controller in a program. It moves the arm, prints the positions, and streams positions: a slow circle
//! of the first two joints.
//!
//! ```text
//! cargo run --release --example embed configs/arm6-erob.toml
//! ```

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use miette::IntoDiagnostic;
use takt::config::Config;
use takt::controller::Controller;
use takt::controller::session::SessionOptions;

fn main() -> miette::Result<()> {
    let path = std::env::args().nth(1).map_or_else(|| PathBuf::from("configs/arm6-erob.toml"), PathBuf::from);
    let config = Config::load(&path)?;
    let arm = Controller::start(config, SessionOptions::default()).into_diagnostic()?;

    let middle = |axis: &takt::config::Axis| 0.5 * (axis.limits.position_min + axis.limits.position_max);
    let targets: Vec<f64> = arm.axes().iter().map(middle).collect();
    let motion = arm.move_to(&targets).into_diagnostic()?;
    arm.wait(motion, Duration::from_secs(30)).into_diagnostic()?;
    print(&arm, "moved");

    // A hundred times a second, a position for every axis, at whatever moment this thread happens to run.
    let stream = arm.stream();
    arm.begin_stream().into_diagnostic()?;
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(3) {
        stream.push_now(&circle(&targets, begun.elapsed().as_secs_f64())).into_diagnostic()?;
        thread::sleep(Duration::from_millis(10));
    }
    print(&arm, "streamed");
    let report = stream.report();
    println!("{} points, followed {:?} behind", report.counts.points, stream.lag());

    let session = arm.finish().into_diagnostic()?;
    println!("{:?} after {} cycles", session.outcome, session.log.statistics.cycles);
    Ok(())
}

/// The first two joints circle around their targets, from rest to rest. The amplitude rises and falls with the fourth power
/// of a sine.
fn circle(targets: &[f64], time_s: f64) -> Vec<f64> {
    let amplitude = 0.1 * (TAU / 6.0 * time_s).sin().max(0.0).powi(4);
    let mut positions = targets.to_vec();
    for (position, phase) in positions.iter_mut().zip([0.0, TAU / 4.0]) {
        *position += amplitude * (TAU / 3.0 * time_s + phase).sin();
    }
    positions
}

fn print(arm: &Controller, label: &str) {
    let state = arm.state();
    println!("{label}: {:?}{}", state.phase, state.stop.map_or(String::new(), |stop| format!(", {stop:?}")));
    for (axis, now) in arm.axes().iter().zip(state.axes) {
        println!("  {:<10} {:+.4}", axis.name, now.position);
    }
}
