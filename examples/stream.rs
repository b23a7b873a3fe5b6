//! Streams set-points of its own: a slow circle of the first two joints, in step with the cycles.
//!
//! ```text
//! cargo run --release --example stream configs/arm6-erob.toml
//! ```

use std::f64::consts::TAU;
use std::path::Path;
use std::time::Duration;

use takt::plan::State;
use takt::{Config, Controller, SessionOptions};

const PATIENCE: Duration = Duration::from_secs(30);

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    run(Config::load(Path::new(&path))?)
}

/// Streams for two seconds.
pub fn run(mut config: Config) -> takt::Result {
    // This thread is not real-time, so its set-points come unevenly. Those beyond the limits are clamped.
    config.axes.iter_mut().for_each(|axis| axis.on_violation = takt::config::OnViolation::Clamp);
    let period_s = config.cycle.period_ns as f64 * 1e-9;
    let arm = Controller::start(config, SessionOptions::default())?;
    let centre: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();

    arm.begin_stream()?;
    let mut slot = arm.state().slot;
    let end = slot + (2.0 / period_s) as u64;
    let first = slot;
    while slot < end {
        // The set-points are those of a slot. The present time of this thread would make them uneven.
        slot = arm.cycle_after(slot, PATIENCE)?.slot;
        let at = |slot: u64| circle(&centre, (slot - first) as f64 * period_s);
        let next = at(slot + 1);
        let velocity = |(to, from): (&f64, f64)| (to - from) / period_s;
        let velocities: Vec<f64> = next.iter().zip(at(slot)).map(velocity).collect();
        let states = next.iter().zip(velocities);
        let states: Vec<State> = states
            .map(|(position, velocity)| State { position: *position, velocity, acceleration: 0.0 })
            .collect();
        arm.stream(&states, Duration::from_millis(100))?;
    }
    let off = arm.state().axes().iter().map(|axis| axis.following_error.abs()).fold(0.0, f64::max);
    println!("streamed {} slots, {off:.4} rad off at most at the end", slot - first);
    Ok(())
}

/// The first two joints on a circle of 0.1 rad, which begins at rest, at its centre.
fn circle(centre: &[f64], time_s: f64) -> Vec<f64> {
    let radius = 0.1 * (time_s / 1.5).min(1.0).powi(3);
    let (sine, cosine) = (TAU * 0.25 * time_s).sin_cos();
    let offset = |joint: usize| match joint {
        0 => radius * sine,
        1 => radius * cosine,
        _ => 0.0,
    };
    centre.iter().enumerate().map(|(joint, centre)| centre + offset(joint)).collect()
}
