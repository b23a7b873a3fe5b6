//! Hand guiding: a hand leads the arm while a function in the real-time thread records where it goes; another one replays it.
//!
//! ```text
//! cargo run --release --example hand_guiding configs/arm6-erob-cst.toml
//! ```

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use takt::ring;
use takt::{CallbackOptions, Config, Controller, FaultInjector, Scenario, SessionOptions};

const PATIENCE: Duration = Duration::from_secs(60);
/// How long a hand may guide, and how much heavier than by itself a joint feels: N·m·s/rad.
const GUIDED_S: f64 = 2.0;
const DAMPING: f64 = 1.0;
/// The hand at the simulated arm. At a real one it is yours.
const HAND: &str = r#"
    [[fault]]
    kind = "load"
    axis = "joint1"
    torque = "8 Nm"
    when = "moving"
    at = "0.3 s"
    for = "0.5 s"

    [[fault]]
    kind = "load"
    axis = "joint3"
    torque = "-5 Nm"
    when = "moving"
    at = "0.6 s"
    for = "0.4 s"
"#;

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob-cst.toml".to_owned());
    run(Config::load(Path::new(&path))?).map(drop)
}

/// Returns how far the first joint was guided, and how far from there its replay has ended.
pub fn run(config: Config) -> takt::Result<(f64, f64)> {
    let hand = FaultInjector::new(Scenario::parse("a hand", HAND, &config)?);
    let options = SessionOptions { fault_injector: Some(Arc::new(hand)), ..SessionOptions::default() };
    let arm = Controller::start(config, options)?;
    // Without a real-time kernel, a call may be interrupted.
    let options = CallbackOptions { overruns_allowed: 20, ..CallbackOptions::default() };

    // The function must not allocate or wait: a ring takes the recording out of the real-time thread.
    let (mut to_recording, mut recording) = ring::<[f64; 6]>(10_000);
    let mut elapsed_s = 0.0;
    let guided = arm.in_loop_with(options, move |state, cycle, command| {
        let mut positions = [0.0; 6];
        for (number, (axis, position)) in state.axes().zip(&mut positions).enumerate() {
            *position = axis.position;
            command.torque(number, -DAMPING * axis.velocity);
        }
        to_recording.push(positions);
        elapsed_s += cycle.dt_s;
        if elapsed_s > GUIDED_S {
            command.finish();
        }
    })?;
    guided.wait(PATIENCE)?;
    let recording: Vec<[f64; 6]> = std::iter::from_fn(|| recording.pop()).collect();
    let (Some(first), Some(last)) = (recording.first().copied(), recording.last().copied()) else {
        return Ok((0.0, 0.0));
    };
    println!("guided from {first:.3?} to {last:.3?} in {} cycles", recording.len());

    arm.wait(arm.move_to(&first)?, PATIENCE)?;
    let mut next = recording.into_iter();
    let replayed = arm.in_loop_with(options, move |_, _, command| match next.next() {
        Some(positions) => {
            positions.iter().enumerate().for_each(|(axis, position)| command.position(axis, *position));
        }
        None => command.finish(),
    })?;
    replayed.wait(PATIENCE)?;
    let off = (arm.state().axes[0].position_set - last[0]).abs();
    println!("replayed; joint1 ended {:.2} mrad from where it was guided to", 1e3 * off);
    Ok(((last[0] - first[0]).abs(), off))
}
