//! Configurations with drives of bit fields.

use takt::Config;
use takt::config::Axis;
use takt_wire::bit_fields::FieldDevice;

/// The keys of a hollow-shaft motor with the scales of the manual's examples.
pub const HOLLOW: &str = r#"drive = "hollow-can"
velocity_full_scale = 200
current_full_scale = 4
torque_constant = 1
position_full_scale = "1 turn"
kp = 2000
kd = 400
"#;

/// The keys of a hollow-shaft motor over CAN FD.
pub const HOLLOW_FD: &str = r#"drive = "hollow-can-fd"
torque_constant = 1
pole_pairs = 14
kp = 100
kd = 20
"#;

/// The keys of a drive in MIT mode.
pub const MIT: &str = r#"drive = "bit-fields"
position_full_scale = 12.5
velocity_full_scale = 30
torque_full_scale = 10
kp = 60
kd = 1.5
"#;

const LIMITS: &str = r#"following_error = { limit = 0.2, time = "50 ms" }
limits = { position = [-2.5, 2.5], velocity = 2, acceleration = 10, jerk = 200, torque = 3 }
joint = { inertia = 0.03, viscous_friction = 0.05, coulomb_friction = 0.05 }
simulated = { initial_position = 0.4 }
"#;

/// A machine with one axis for each of these texts of keys, on one bus at this period.
pub fn text(period: &str, bus: &str, axes: &[String]) -> String {
    let mut text =
        format!("name = \"fields\"\n[cycle]\nperiod = {period:?}\n[[bus]]\nname = \"can\"\n{bus}\n");
    for (axis, number) in axes.iter().zip(1..) {
        let limits = if axis.contains("limits") { "" } else { LIMITS };
        let node = if axis.contains("node =") { String::new() } else { format!("node = {number}\n") };
        text += &format!("[[axis]]\nname = \"joint{number}\"\nbus = \"can\"\n{node}{axis}{limits}");
    }
    text
}

/// A machine of one axis that does one step of a program.
pub fn one(period: &str, bus: &str, axis: &str, step: &str) -> Config {
    let text = format!("{}\n[[program.move]]\n{step}\n", text(period, bus, &[axis.to_owned()]));
    Config::parse("one.toml", &text).unwrap_or_else(|error| panic!("{error:?}\n{text}"))
}

/// The axis of a machine of one hollow-shaft motor whose joint is its shaft.
pub fn axis(keys: &str) -> Axis {
    let bus = if keys.contains("fd") { "data_bit_rate = \"5 Mbit/s\"" } else { "" };
    one("1 ms", bus, keys, "to = 0").axes.remove(0)
}

pub fn device(axis: &Axis) -> &FieldDevice {
    axis.drive.description().unwrap()
}

/// The problems of a text that is wrong.
pub fn problems(text: &str) -> String {
    match Config::parse("wrong.toml", text) {
        Ok(_) => panic!("it is right:\n{text}"),
        Err(error) => format!("{error:?}"),
    }
}
