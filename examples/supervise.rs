//! Three threads with one controller: one moves the arm, one reads the state of every cycle, one prints what happens. Any of
//! them may stop the motion, and so may Ctrl-C.
//!
//! ```text
//! cargo run --release --example supervise configs/arm6-erob.toml
//! ```

use std::path::Path;
use std::thread;
use std::time::Duration;

use takt::{Config, Controller, Events, Handle, MotionError, SessionOptions, StopCategory, WaitError};

const PATIENCE: Duration = Duration::from_secs(30);

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    run(Config::load(Path::new(&path))?)
}

/// Moves the arm, and stops it when its first axis passes a position.
pub fn run(config: Config) -> takt::Result {
    let arm = Controller::start(config, SessionOptions::default())?;
    let stopping = arm.handle();
    // SAFETY: a stop is a few atomic operations. It takes no lock and allocates nothing, so a signal handler may call it.
    let _ = unsafe {
        signal_hook::low_level::register(signal_hook::consts::SIGINT, move || {
            let _ = stopping.stop(StopCategory::One);
        })
    };
    let (handle, events) = (arm.handle(), arm.events());
    let watching = thread::spawn(move || watch(&handle));
    let printing = thread::spawn(move || print(events));

    let target: Vec<f64> = arm.axes().iter().map(|axis| 0.9 * axis.limits.position_max).collect();
    let motion = arm.move_to(&target)?;
    match arm.wait(motion, PATIENCE) {
        Err(MotionError::Stopped(stopped)) => println!("the move did not arrive: {stopped}"),
        result => result?,
    }
    // The owner ends the run. The handles in the other threads say so.
    arm.finish()?;
    let slowest_ns = watching.join().unwrap_or_default();
    println!("the oldest feedback of the first axis was {} µs old", slowest_ns / 1000);
    let _ = printing.join();
    Ok(())
}

/// Reads the state of every cycle, and stops the motion when the first axis has passed 0.5 rad.
fn watch(arm: &Handle) -> u64 {
    let (mut slot, mut oldest_ns, mut is_stopped) = (0, 0, false);
    while let Ok(state) = arm.cycle_after(slot, PATIENCE) {
        slot = state.slot;
        let axis = state.axes[0];
        oldest_ns = oldest_ns.max(axis.feedback_age_ns(state.at_ns).unwrap_or(0));
        if !is_stopped && axis.position > 0.5 {
            is_stopped = arm.stop(StopCategory::Two).is_ok();
        }
    }
    oldest_ns
}

/// Prints the events until the end of the run.
fn print(mut events: Events) {
    loop {
        match events.wait(PATIENCE) {
            Ok(event) => println!("slot {}: {}", event.slot, events.words(&event)),
            Err(WaitError::NotInTime) => {}
            Err(WaitError::Ended) => break,
        }
    }
    println!("{} events were missed", events.missed());
}
