//! What is stated of a stop: how long it takes and how far it leads.

use takt::config::{Axis, Config, Protocol};

use crate::off_cycle::is_beside_the_cycle;

/// How far behind its set-point a joint may be that obeys.
const LAG_S: f64 = 0.4;

/// A round of requests to a drive that is spoken to beside the cycle: it follows by velocities, so it is told to correct what it has
/// shown a round before, and does so in the next one.
const ROUND_S: f64 = 0.05;

/// The longest time after which a drive misses the heartbeat: a YZ-AIM whose communication has been reset has its factory setting.
const WATCHDOG_AT_MOST_S: f64 = 2.2;

fn stopping_s(axis: &Axis) -> f64 {
    let limits = &axis.limits;
    // At full speed and in full acceleration: the acceleration is taken back, turned round, and taken back again; and where a
    // position limit is too near for that, the joint still decelerates when it stands, and swings back.
    let turning_s = (limits.acceleration + 4.0 * limits.deceleration) / limits.jerk;
    limits.velocity / limits.deceleration + if turning_s.is_finite() { turning_s } else { 0.0 }
}

/// The longest trajectory of a stop of these axes: that of the slowest one, since they stop together.
pub fn planned_s(axes: &[Axis]) -> f64 {
    axes.iter().map(stopping_s).fold(0.0, f64::max)
}

/// From the reason of a stop of these axes to rest of every joint that obeys.
pub fn to_rest_s(axes: &[Axis]) -> f64 {
    let has_rounds = axes.iter().any(is_beside_the_cycle);
    planned_s(axes) + LAG_S + if has_rounds { 2.0 * ROUND_S } else { 0.0 }
}

/// How far a joint may travel until then: rad (m).
pub fn to_rest_distance(axes: &[Axis], axis: &Axis) -> f64 {
    axis.limits.velocity * (to_rest_s(axes) + LAG_S) / 2.0
}

/// How long a joint goes on at most whose drive has no brake, when its power is cut at full speed: until friction has
/// stopped it.
pub fn coasting_s(axis: &Axis) -> f64 {
    let joint = &axis.joint;
    match axis.drive.word {
        "yz-aim" => axis.limits.velocity * joint.inertia() / joint.coulomb_friction(),
        _ if axis.drive.protocol == Protocol::BitFields => {
            axis.limits.velocity * joint.inertia() / joint.coulomb_friction()
        }
        _ => 0.0,
    }
}

/// From the moment from which nothing gets to a drive any more until it has no torque: it misses the heartbeats, and its own
/// reaction brings the joint to rest.
pub fn unreached_s(config: &Config) -> f64 {
    WATCHDOG_AT_MOST_S + to_rest_s(&config.axes)
}

/// The most cycles in a phase that must pass by itself.
pub fn cycles(config: &Config, seconds: f64) -> u64 {
    (seconds * 1e9 / config.cycle.period_ns as f64) as u64
}
