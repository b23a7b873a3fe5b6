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

use miette::IntoDiagnostic;
use takt::config::{Axis, Config};
use takt::controller::session::SessionOptions;
use takt::controller::{Controller, MotionError};
use takt::faults::{FaultInjector, Scenario};
use takt_rt::Phase;

/// A bus may be down for some time, and a drive needs time to recover.
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(500);
const RESETS: usize = 4;
const BRING_UPS: usize = 4;

fn main() -> miette::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "configs/arm6-erob.toml".to_owned());
    let seconds: f64 = arguments.next().map_or(Ok(10.0), |text| text.parse()).into_diagnostic()?;
    let config = Config::load(Path::new(&path))?;
    let fault_injector = match arguments.next() {
        Some(path) => Some(Arc::new(FaultInjector::new(Scenario::load(Path::new(&path), &config)?))),
        None => None,
    };
    let mut arm =
        Controller::start(config.clone(), SessionOptions { fault_injector, ..SessionOptions::default() })
            .into_diagnostic()?;
    let (to, fro) = (pose(arm.axes(), 0.6), pose(arm.axes(), 0.4));

    let (begun, mut stops) = (Instant::now(), 0);
    let print = |text: String| println!("{:6.2} s: {text}", begun.elapsed().as_secs_f64());
    while begun.elapsed().as_secs_f64() < seconds {
        match to_and_fro(&mut arm, &to, &fro) {
            Ok(()) => {}
            Err(MotionError::Stopped(stopped)) => {
                stops += 1;
                print(stopped.to_string());
                arm = if is_enabled_again(&mut arm) { arm } else { bring_up_again(arm, &config)? };
                print("the axes are enabled again".to_owned());
            }
            Err(error) => return Err(error).into_diagnostic(),
        }
    }
    let session = arm.finish().into_diagnostic()?;
    println!("{:?} after {stops} {}", session.outcome, if stops == 1 { "stop" } else { "stops" });
    Ok(())
}

/// The positions of every axis at this fraction of its travel.
fn pose(axes: &[Axis], fraction: f64) -> Vec<f64> {
    axes.iter()
        .map(|axis| {
            axis.limits.position_min + fraction * (axis.limits.position_max - axis.limits.position_min)
        })
        .collect()
}

fn to_and_fro(arm: &mut Controller, to: &[f64], fro: &[f64]) -> Result<(), MotionError> {
    for target in [to, fro] {
        let motion = arm.move_to(target).map_err(|_| MotionError::Ended)?;
        arm.wait(motion, Duration::from_secs(60))?;
    }
    Ok(())
}

/// Resets the fault and enables the axes. The bus may still be down at the first attempts.
fn is_enabled_again(arm: &mut Controller) -> bool {
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
fn bring_up_again(arm: Controller, config: &Config) -> miette::Result<Controller> {
    let _ = arm.finish().into_diagnostic()?;
    let mut attempt = Controller::start(config.clone(), SessionOptions::default());
    for _ in 1..BRING_UPS {
        if attempt.is_ok() {
            break;
        }
        thread::sleep(BETWEEN_ATTEMPTS);
        attempt = Controller::start(config.clone(), SessionOptions::default());
    }
    attempt.into_diagnostic()
}
