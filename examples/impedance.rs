//! Impedance: a spring and a damper hold every joint at its place. Somebody pushes the first one, which gives way and comes back.
//!
//! ```text
//! cargo run --release --example impedance configs/arm6-erob-cst.toml
//! ```

use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use takt::{CallbackOptions, Config, Controller, FaultInjector, Scenario, SessionOptions};

/// N·m/rad and N·m·s/rad.
const STIFFNESS: f64 = 200.0;
const DAMPING: f64 = 30.0;
/// Somebody pushes the simulated joint. A real one is pushed by hand.
const PUSH: &str = r#"
    [[fault]]
    kind = "load"
    axis = "joint1"
    torque = "20 Nm"
    when = "moving"
    at = "0.5 s"
    for = "1 s"
"#;

fn main() -> takt::Result {
    let path = std::env::args().nth(1).unwrap_or_else(|| "configs/arm6-erob-cst.toml".to_owned());
    run(Config::load(Path::new(&path))?).map(drop)
}

/// Returns how far the first joint has given way, and how far it is from its place in the end.
pub fn run(config: Config) -> takt::Result<(f64, f64)> {
    let push = FaultInjector::new(Scenario::parse("a push", PUSH, &config)?);
    let options = SessionOptions { fault_injector: Some(Arc::new(push)), ..SessionOptions::default() };
    let arm = Controller::start(config, options)?;
    let place: Vec<f64> = arm.state().axes().iter().map(|axis| axis.position_set).collect();
    let first = place[0];

    let mut elapsed_s = 0.0;
    // Without a real-time kernel, a call may be interrupted.
    let options = CallbackOptions { overruns_allowed: 20, ..CallbackOptions::default() };
    let spring = arm.in_loop_with(options, move |_, cycle, command| {
        command.impedance(0, first, STIFFNESS, DAMPING, 0.0);
        for (axis, place) in place.iter().enumerate().skip(1) {
            command.impedance(axis, *place, 0.2 * STIFFNESS, 0.05 * DAMPING, 0.0);
        }
        elapsed_s += cycle.dt_s;
        if elapsed_s > 3.0 {
            command.finish();
        }
    })?;
    let mut farthest = 0.0_f64;
    let mut away = 0.0;
    while spring.result().is_none() {
        away = (arm.state().axes[0].position - first).abs();
        farthest = farthest.max(away);
        thread::sleep(Duration::from_millis(2));
    }
    spring.wait(Duration::ZERO)?;
    println!("the joint gave way by {farthest:.3} rad, and is {away:.3} rad from its place");
    Ok((farthest, away))
}
