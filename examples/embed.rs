//! Embeds the controller in a program. It moves the arm, prints the positions, and streams its own set-points: a slow circle
//! of the first two joints.
//!
//! ```text
//! cargo run --release --example embed configs/arm6-erob.toml
//! ```

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use miette::IntoDiagnostic;
use takt::config::{Config, OnViolation};
use takt::controller::Controller;
use takt::controller::session::SessionOptions;
use takt_rt::plan::State;

fn main() -> miette::Result<()> {
    let path = std::env::args().nth(1).map_or_else(|| PathBuf::from("configs/arm6-erob.toml"), PathBuf::from);
    let mut config = Config::load(&path)?;
    // This thread is not real-time, so its set-points come unevenly. Those beyond the limits are clamped.
    config.axes.iter_mut().for_each(|axis| axis.on_violation = OnViolation::Clamp);
    let cycle_ns = config.cycle.period_ns;
    let arm = Controller::start(config, SessionOptions::default()).into_diagnostic()?;

    let middle = |axis: &takt::config::Axis| 0.5 * (axis.limits.position_min + axis.limits.position_max);
    let targets: Vec<f64> = arm.axes().iter().map(middle).collect();
    let motion = arm.move_to(&targets).into_diagnostic()?;
    arm.wait(motion, Duration::from_secs(30)).into_diagnostic()?;
    print(&arm, "moved");

    // In every slot, one set-point for every axis, computed for the time of that slot. The present time of this thread would
    // make the set-points uneven.
    arm.begin_stream().into_diagnostic()?;
    let period_s = cycle_ns as f64 * 1e-9;
    let (first, mut last) = (arm.state().slot, 0);
    while last - first.min(last) < (3.0 / period_s) as u64 {
        let slot = arm.state().slot;
        if slot == last {
            thread::sleep(Duration::from_micros(100));
            continue;
        }
        last = slot;
        let at = |slot: f64| circle(&targets, (slot - first as f64) * period_s);
        // With the velocity, the controller can bridge a late set-point smoothly.
        let (now, next) = (at(slot as f64), at(slot as f64 + 0.01));
        let set_points: Vec<State> = (now.iter().zip(next))
            .map(|(&position, next)| State {
                position,
                velocity: (next - position) / (0.01 * period_s),
                acceleration: 0.0,
            })
            .collect();
        arm.stream(&set_points, Duration::from_millis(50)).into_diagnostic()?;
    }
    print(&arm, "streamed");
    println!("{} set-points were clamped to the limits", arm.state().clamped);

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
