//! The controller is gone for good at full speed, in each mode: how long a joint goes on, and how far.

use takt::config::Config;
use takt_rt::{BusPort, Phase};

use crate::drive_modes::wire::MILLISECOND_NS;
use crate::drive_modes::world::{World, parse};

fn one_erob(mode: &str, step: &str, master: &str) -> Config {
    let mut config = parse(&format!(
        r#"
name = "one"
{master}
[[bus]]
name = "can"
[[axis]]
name = "joint"
bus = "can"
node = 1
drive = "erob-canopen"
mode = "{mode}"
[axis.limits]
position = [-20, 20]
velocity = "137 deg/s"
acceleration = 20
torque = "87 Nm"
[axis.joint]
coulomb_friction = 0
[[program.move]]
{step}
"#
    ));
    config.simulation.longest_gap_ns = 60_000 * MILLISECOND_NS;
    config
}

/// The time in ms from the last SYNC until the joint is at rest, and how far it gets in that time, in rad.
fn coasting(config: Config) -> (u64, f64) {
    const SILENCE_MS: u64 = 3_000;
    let mut world = World::new(config);
    world.run_until(|world| world.phase() == Phase::Moving);
    world.run_until(|world| world.observe(0).velocity > 0.98 * 137.0_f64.to_radians());
    let gone_ns = world.run.snapshot().at_ns;
    let from = world.observe(0).position;
    world.run.clock().stall(SILENCE_MS * MILLISECOND_NS);
    let mut last_moving_ms = 0;
    for after_ms in 1..SILENCE_MS {
        for port in world.run.ports() {
            port.unconfirmed(gone_ns + after_ms * MILLISECOND_NS);
        }
        if world.observe(0).velocity.abs() > 1e-3 {
            last_moving_ms = after_ms;
        }
    }
    assert!(last_moving_ms + 100 < SILENCE_MS, "it still moves");
    (last_moving_ms, world.observe(0).position - from)
}

const MODES: [(&str, &str); 5] = [
    ("csp", "to = 10"),
    ("csv", "to = 10"),
    ("cst", "to = 10"),
    ("pv", "speed = \"137 deg/s\"\nfor = \"10 s\""),
    ("pt", "torque = \"4 Nm\"\nfor = \"10 s\""),
];

#[test]
fn a_joint_is_at_rest_within_the_time_and_the_travel_that_check_tells() {
    for (mode, step) in MODES {
        let config = one_erob(mode, step, "");
        let limits = config.axes[0].limits;
        let timeout_s = config.master.heartbeat_timeout_ns as f64 / 1e9;
        // A torque goes on to accelerate the joint.
        let acceleration = if matches!(mode, "cst" | "pt") { limits.acceleration } else { 0.0 };
        let speed = limits.velocity + acceleration * timeout_s;
        let braking_s = speed / limits.deceleration;
        let (time_ms, travel) = coasting(config);
        let before = coasting(one_erob(
            mode,
            step,
            "[master]\nheartbeat = \"100 ms\"\nheartbeat_timeout = \"500 ms\"",
        ));
        eprintln!(
            "{mode}: {time_ms} ms, {:.1} deg; with 500 ms: {} ms, {:.1} deg",
            travel.to_degrees(),
            before.0,
            before.1.to_degrees()
        );
        // As crates/cli/src/check/unattended.rs has it; a cycle more until the drive looks.
        let (longest_ms, farthest) = match mode {
            "csp" => (1e3 * (timeout_s + braking_s), 0.1 + limits.velocity * 1e-3),
            _ => (
                1e3 * (timeout_s + braking_s),
                0.5 * (limits.velocity + speed) * timeout_s + 0.5 * speed * braking_s,
            ),
        };
        assert!(time_ms as f64 <= longest_ms + 2.0, "{mode}: {time_ms} ms, told {longest_ms} ms");
        assert!(travel <= farthest + limits.velocity * 2e-3, "{mode}: {travel} rad, told {farthest} rad");
    }
}
