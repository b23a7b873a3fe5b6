//! Streams positions: a slow circle of the first two joints, a point every 10 ms from an ordinary thread. The controller
//! interpolates, and keeps every limit, however unevenly the points come.
//!
//! ```text
//! cargo run --release --example stream configs/arm6-erob.toml
//! ```

use std::f64::consts::TAU;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use takt::{Config, Controller, SessionOptions};

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    run(Config::load(Path::new(&path))?)
}

/// Streams for two seconds, and then a chunk of points that are meant for later.
pub fn run(config: Config) -> takt::Result {
    let arm = Controller::start(config, SessionOptions::default())?;
    let centre: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();

    let stream = arm.stream();
    arm.begin_stream()?;
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(2) {
        // Stamped on its arrival.
        stream.push_now(&circle(&centre, begun.elapsed().as_secs_f64()))?;
        thread::sleep(Duration::from_millis(10));
    }
    println!("followed {:?} behind", stream.lag());

    // The next half second at once, as a policy gives it. A later chunk would take the place of what is left of this one.
    let (from_s, interval) = (begun.elapsed().as_secs_f64(), Duration::from_millis(20));
    let at = |number: i32| circle(&centre, from_s + f64::from(number) * interval.as_secs_f64());
    let chunk: Vec<Vec<f64>> = (0..25).map(at).collect();
    stream.push_chunk(stream.now_ns(), interval, &chunk)?;
    thread::sleep(Duration::from_secs(1));

    // The points have run out, so the arm has come to rest. It would go on with the next ones.
    let report = stream.report();
    println!("{:?} after {} points", report.state, report.counts.points);
    arm.finish()?;
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
