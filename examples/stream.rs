//! Streams positions: a slow circle of the first two joints, a point every ten cycles from an ordinary thread. The controller
//! interpolates, and keeps every limit, however unevenly the points come.
//!
//! ```text
//! cargo run --release --example stream configs/arm6-erob.toml
//! ```

use std::f64::consts::TAU;
use std::path::Path;
use std::time::Duration;

use takt::{Config, Controller, Handle, SessionOptions};

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    let arm = Controller::start(Config::load(Path::new(&path))?, SessionOptions::default())?;
    run(&arm)?;
    arm.finish()?;
    Ok(())
}

/// Streams for two seconds, and then a chunk of points that are meant for later.
pub fn run(arm: &Handle) -> takt::Result {
    let centre: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();

    let stream = arm.stream();
    arm.begin_stream()?;
    let begun_ns = stream.now_ns();
    let elapsed_s = || (stream.now_ns() - begun_ns) as f64 * 1e-9;
    while elapsed_s() < 2.0 {
        // Stamped on its arrival.
        stream.push_now(&circle(&centre, elapsed_s()))?;
        arm.advance(10)?;
    }
    println!("followed {:?} behind", stream.lag());

    // The next half second at once, as a policy gives it. A later chunk would take the place of what is left of this one.
    let (from_s, interval) = (elapsed_s(), Duration::from_millis(20));
    let at = |number: i32| circle(&centre, from_s + f64::from(number) * interval.as_secs_f64());
    let chunk: Vec<Vec<f64>> = (0..25).map(at).collect();
    stream.push_chunk(stream.now_ns(), interval, &chunk)?;
    arm.advance(1_000)?;

    // The points have run out, so the arm has come to rest. It would go on with the next ones.
    let report = stream.report();
    println!("{:?} after {} points", report.state, report.counts.points);
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
