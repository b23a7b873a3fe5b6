//! Goes on after a stop, as an unattended machine does. It moves an arm to and fro for some time. After each stop it prints
//! the reason, resets the fault, enables the axes again and continues from their present positions.
//!
//! ```text
//! cargo run --release --example after_a_stop configs/arm6-erob.toml 20 configs/faults/bus-off.toml
//! ```
//!
//! On a real arm, a person must look at it first: this program does not know whether the cause of the stop is still there.

use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use takt::config::Axis;
use takt::{Config, Controller, FaultInjector, Handle, MotionError, Phase, Scenario, SessionOptions};

/// A bus may be down for some time, and a drive needs time to recover.
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(500);
const RESETS: usize = 4;
const BRING_UPS: usize = 4;

fn main() -> takt::Result {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    let seconds = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(10.0);
    let config = Config::load(Path::new(&path))?;
    let scenario = arguments.next().map(|path| Scenario::load(Path::new(&path), &config)).transpose()?;
    run(config, seconds, scenario).map(drop)
}

/// Moves to and fro for so many seconds. Returns the number of stops.
pub fn run(config: Config, seconds: f64, scenario: Option<Scenario>) -> takt::Result<usize> {
    let fault_injector = scenario.map(|scenario| Arc::new(FaultInjector::new(scenario)));
    let options = SessionOptions { fault_injector, ..SessionOptions::default() };
    let mut arm = Controller::start(config.clone(), options)?;
    let (to, fro) = (pose(arm.axes(), 0.6), pose(arm.axes(), 0.4));

    let (begun, mut stops) = (Instant::now(), 0);
    let print = |text: String| println!("{:6.2} s: {text}", begun.elapsed().as_secs_f64());
    while begun.elapsed().as_secs_f64() < seconds {
        match to_and_fro(&arm, &to, &fro) {
            Ok(()) => {}
            Err(takt::Error::Motion(MotionError::Stopped(stopped))) => {
                stops += 1;
                print(stopped.to_string());
                arm = if is_enabled_again(&arm) { arm } else { bring_up_again(arm, &config)? };
                print("the axes are enabled again".to_owned());
            }
            Err(error) => return Err(error),
        }
    }
    let session = arm.finish()?;
    println!("{:?} after {stops} {}", session.outcome, if stops == 1 { "stop" } else { "stops" });
    Ok(stops)
}

/// The positions of every axis at this fraction of its travel.
fn pose(axes: &[Axis], fraction: f64) -> Vec<f64> {
    axes.iter()
        .map(|axis| {
            axis.limits.position_min + fraction * (axis.limits.position_max - axis.limits.position_min)
        })
        .collect()
}

fn to_and_fro(arm: &Handle, to: &[f64], fro: &[f64]) -> takt::Result {
    for target in [to, fro] {
        let motion = arm.move_to(target)?;
        arm.wait(motion, Duration::from_secs(60))?;
    }
    Ok(())
}

/// Resets the fault and enables the axes. The bus may still be down at the first attempts.
fn is_enabled_again(arm: &Handle) -> bool {
    (0..RESETS).any(|_| {
        thread::sleep(BETWEEN_ATTEMPTS);
        let is_granted = arm.disable().is_ok()
            && arm.wait_for(Phase::Disabled, Duration::from_secs(10)).is_ok()
            && arm.reset_faults().is_ok()
            && arm.enable().is_ok();
        is_granted && arm.wait_for(Phase::Holding, Duration::from_secs(1)).is_ok()
    })
}

/// A drive that has restarted has lost its set-up, so it is brought up again.
fn bring_up_again(arm: Controller, config: &Config) -> takt::Result<Controller> {
    arm.finish()?;
    let mut attempt = Controller::start(config.clone(), SessionOptions::default());
    for _ in 1..BRING_UPS {
        if attempt.is_ok() {
            break;
        }
        thread::sleep(BETWEEN_ATTEMPTS);
        attempt = Controller::start(config.clone(), SessionOptions::default());
    }
    Ok(attempt?)
}
