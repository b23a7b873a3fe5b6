//! The machines that storms rage over: those that are shipped, and random ones of any drives in any modes.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::OnceLock;

use takt::config::{Axis, Config, Feedback};
use takt::family;
use takt_rt::Rule;

use crate::dice::Dice;

/// The shipped ones, each as often as it is picked.
const SHIPPED: [&str; 15] = [
    "arm6-erob",
    "arm6-erob",
    "arm6-erob-csv",
    "arm6-erob-cst",
    "gantry-yz-aim",
    "gantry-yz-aim",
    "mixed-arm",
    "mixed-arm",
    "erob-modes/erob-csp",
    "erob-modes/erob-cst",
    "erob-modes/erob-csv",
    "erob-modes/erob-ip",
    "erob-modes/erob-pp",
    "erob-modes/erob-pt",
    "erob-modes/erob-pv",
];
/// Those whose drives are spoken to by bit fields.
const OF_BIT_FIELDS: [&str; 3] = ["damiao-arm", "hollow-leg-fd", "hollow-arm"];
/// One drive that is spoken to outside of the cycle.
const TURNTABLE: &str = "turntable-erob-can";
/// One on a serial line, beside an arm on a CAN bus.
const ON_A_LINE: &str = "turntable-modbus";
/// Drives that are spoken to outside of the cycle, beside one that is spoken to in it.
const TURNTABLES: &str = r#"
name = "turntables"

[[bus]]
name = "tables"
period = "20 ms"

[[bus]]
name = "arm"

[[axis]]
name = "table"
bus = "tables"
node = 1
drive = "erob-can"

[axis.limits]
position = ["-170 deg", "170 deg"]
velocity = "60 deg/s"
acceleration = "120 deg/s^2"
torque = "31 Nm"

[[axis]]
name = "tilt"
bus = "tables"
node = 2
drive = "erob-can"
reversed = true

[axis.limits]
position = ["-60 deg", "60 deg"]
velocity = "30 deg/s"
acceleration = "60 deg/s^2"
jerk = "600 deg/s^3"
torque = "31 Nm"

[[axis]]
name = "arm"
bus = "arm"
node = 1
drive = "erob-canopen"
mode = "csp"

[axis.limits]
position = ["-170 deg", "170 deg"]
velocity = "90 deg/s"
acceleration = "360 deg/s^2"
torque = "31 Nm"

[[program.move]]
to = ["0 deg", "0 deg", "0 deg"]
"#;
/// As many axes as one controller moves.
const CROWD: &str = "axes32-erob";
const RANDOM_SHARE: f64 = 0.5;
const EROB_MODES: [&str; 8] = ["csp", "csp", "csv", "cst", "ip", "pp", "pv", "pt"];
const YZ_AIM_MODES: [&str; 3] = ["ip", "pp", "pv"];
/// Only the newest one is read.
const RECORDS: usize = 16;

/// A shipped machine, read once.
pub fn load(name: &str) -> Config {
    static READ: OnceLock<HashMap<&str, Config>> = OnceLock::new();
    let read = || {
        SHIPPED
            .into_iter()
            .chain(OF_BIT_FIELDS)
            .chain([CROWD, TURNTABLE, ON_A_LINE])
            .map(|name| (name, read(name)))
            .collect()
    };
    READ.get_or_init(read)[name].clone()
}

fn read(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"));
    let mut config = Config::load(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
    for axis in config.axes.iter_mut().filter(|axis| axis.drive == family::EROB_CANOPEN) {
        axis.feedback = vec![Feedback::OperationMode];
    }
    ready(config)
}

fn ready(mut config: Config) -> Config {
    config.axes.iter_mut().for_each(|axis| axis.power_up_ns = 5_000_000);
    // The drives go on while the controller is away, as real ones do.
    config.simulation.longest_gap_ns = 60_000_000_000;
    config.telemetry.ring_records = RECORDS;
    config
}

/// The largest machine that one controller moves.
pub fn crowd() -> Config {
    load(CROWD)
}

/// One with drives that are spoken to outside of the cycle. Some have just been switched on, and can be enabled only after seconds.
pub fn of_off_cycle(dice: &mut Dice) -> Config {
    let mut config = match dice.chance(0.5) {
        true => load(TURNTABLE),
        false => parse("turntables", TURNTABLES),
    };
    if dice.chance(0.2) {
        let power_up_ns = (dice.between(0.1, 8.0) * 1e9) as u64;
        for axis in config.axes.iter_mut().filter(|axis| axis.drive.enabled_from_ns > 0) {
            axis.power_up_ns = power_up_ns;
        }
    }
    config
}

/// One with a drive on a serial line.
pub fn on_a_line() -> Config {
    load(ON_A_LINE)
}

/// One whose drives are spoken to by bit fields.
pub fn of_bit_fields(dice: &mut Dice) -> Config {
    load(dice.pick(&OF_BIT_FIELDS))
}

/// Any machine; one with an eRob if that is needed.
pub fn any(dice: &mut Dice, needs_erob: bool) -> Config {
    loop {
        let config = match dice.chance(RANDOM_SHARE) {
            true => random(dice),
            false => load(dice.pick(&SHIPPED)),
        };
        let is_erob = |axis: &Axis| axis.drive == family::EROB_CANOPEN;
        if !needs_erob || config.axes.iter().any(is_erob) {
            return config;
        }
    }
}

fn random(dice: &mut Dice) -> Config {
    parse("random", &text(dice))
}

fn parse(name: &str, text: &str) -> Config {
    match Config::parse(name, text) {
        Ok(config) => ready(config),
        Err(error) => {
            let problems: Vec<String> = error.problems().iter().map(ToString::to_string).collect();
            panic!("{text}\n{problems:?}")
        }
    }
}

/// A machine as a user would write it down.
fn text(dice: &mut Dice) -> String {
    let cycle_us = dice.pick(&[500, 1000, 1000, 1000, 1000, 2000, 2000, 2000, 4000]);
    let mut text = format!("name = \"random\"\n[cycle]\nperiod = \"{cycle_us} us\"\n");
    if dice.chance(0.3) {
        text.push_str("[stops]\n");
        for rule in Rule::ALL.into_iter().filter(|rule| *rule != Rule::Requested) {
            if dice.chance(0.2) {
                let _ = writeln!(text, "{} = {}", rule.key(), dice.below(3));
            }
        }
    }
    let mut axes = String::new();
    let mut count = 0;
    for bus in 0..1 + dice.below(3) {
        let bus_us = if dice.chance(0.25) { 2 * cycle_us } else { cycle_us };
        let _ = writeln!(text, "[[bus]]\nname = \"bus{bus}\"\nperiod = \"{bus_us} us\"");
        let yz_aim_share = dice.pick(&[0.0, 0.0, 0.5, 1.0]);
        for node in 1..=1 + dice.below((bus_us / 500).min(4)) {
            count += 1;
            let is_yz_aim = dice.chance(yz_aim_share);
            axes.push_str(&axis(dice, &format!("joint{count}"), bus, node, bus_us, is_yz_aim));
        }
    }
    text + &axes
}

fn axis(dice: &mut Dice, name: &str, bus: usize, node: usize, bus_us: usize, is_yz_aim: bool) -> String {
    let (family, mode) = match is_yz_aim {
        // It interpolates in 2 ms and in no other time.
        true => ("yz-aim", if bus_us == 2000 { dice.pick(&YZ_AIM_MODES) } else { dice.pick(&["pp", "pv"]) }),
        false => ("erob-canopen", dice.pick(&EROB_MODES)),
    };
    let mut text = format!(
        "[[axis]]\nname = \"{name}\"\nbus = \"bus{bus}\"\nnode = {node}\ndrive = \"{family}\"\nmode = \"{mode}\"\n\
         reversed = {}\nmissed_feedback_cycles = {}\nfollow = \"{}\"\n",
        dice.chance(0.5),
        dice.pick(&[3, 5, 5, 10]),
        if dice.chance(0.3) { "exact" } else { "smooth" },
    );
    if dice.chance(0.2) {
        text.push_str("heartbeat = \"50 ms\"\n");
    }
    if is_yz_aim {
        text.push_str(if dice.chance(0.3) { "answers_sync = false\n" } else { "" });
    } else {
        let reports = ["", "\"operation_mode\"", "\"operation_mode\"", "\"operation_mode\", \"torque\""];
        let _ = writeln!(text, "feedback = [{}]", dice.pick(&reports));
    }
    let is_linear = is_yz_aim && dice.chance(0.5);
    text.push_str(match (is_yz_aim, is_linear) {
        (true, true) => "travel = \"linear\"\nlead = \"10 mm\"\n",
        (true, false) => "gear_ratio = 50\n",
        _ => "",
    });
    let (travel, velocity, acceleration, torque) = match is_linear {
        true => (dice.between(0.1, 0.8), dice.between(0.03, 0.2), dice.between(0.5, 2.0), 300.0),
        false => (dice.between(0.5, 3.0), dice.between(0.5, 2.5), dice.between(2.0, 12.0), 60.0),
    };
    let lowest = -dice.fraction() * travel;
    let deceleration = if dice.chance(0.5) { acceleration } else { acceleration * dice.between(0.5, 2.0) };
    let jerk = if dice.chance(0.5) {
        "inf".to_owned()
    } else {
        format!("{:.3}", acceleration * dice.between(8.0, 30.0))
    };
    let _ = write!(
        text,
        "[axis.limits]\nposition = [{lowest:.4}, {:.4}]\nvelocity = {velocity:.4}\nacceleration = {acceleration:.4}\n\
         deceleration = {deceleration:.4}\njerk = {jerk}\ntorque = {torque:.1}\n[axis.simulated]\n\
         initial_position = {:.4}\n[axis.joint]\n",
        lowest + travel,
        lowest + dice.between(0.05, 0.95) * travel,
    );
    text.push_str(match is_linear {
        true => "inertia = 4.0\nviscous_friction = 20.0\ncoulomb_friction = 5.0\n",
        false => "inertia = 0.5\nviscous_friction = 0.5\ncoulomb_friction = 0.5\n",
    });
    text
}
