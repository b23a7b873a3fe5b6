//! Configurations that cannot be: what is said of them, and where.

use miette::{GraphicalReportHandler, GraphicalTheme};
use proptest::prelude::*;
use takt::config::ProblemKind::*;
use takt::config::{Config, ConfigError, InterfaceError, ProblemKind};

/// Two axes on one bus; every case below spoils one thing of it.
const SOUND: &str = r#"name = "sound"

[cycle]
period = "1 ms"
command_phase = 0.55

[realtime]
priority = 80
cpu = 1
lock_memory = true
spin_guard = "50 us"

[master]
node = 127
heartbeat = "100 ms"
heartbeat_timeout = "500 ms"

[[bus]]
name = "left"
interface = "sim"
bit_rate = "1 Mbit/s"
restart_ms = 250
service_frames_per_cycle = 1

[[bus]]
name = "right"
interface = "can1"

[defaults.axis]
drive = "erob-canopen"
transmission_type = 1

[[axis]]
name = "first"
bus = "left"
node = 1
mode = "csp"
gear_ratio = 1.0
zero_counts = 0
feedback = ["velocity"]

[axis.limits]
position = ["-90 deg", "90 deg"]
velocity = "100 deg/s"
acceleration = "8 rad/s^2"
jerk = 500
torque = "31 Nm"

[axis.following_error]
limit = "5 deg"
time = "20 ms"

[axis.torque_loop]
damping = "20 Nm s/rad"

[axis.identity]
vendor = 0x5A65726F

[axis.joint]
inertia = "1 kg m^2"

[axis.simulated]
initial_position = "10 deg"

[[axis]]
name = "second"
bus = "left"
node = 2
limits = { position = [-1, 1], velocity = 1.0, acceleration = 5, torque = 20 }

[program]
repeat = 1

[[program.move]]
to = ["30 deg", 0.5]
velocity = "80 %"
dwell = "200 ms"

[[program.move]]
to = 0

[telemetry]
directory = "runs"
record = true
black_box = "5 s"
ring_records = 4096

[simulation]
seed = 1
longest_gap = "2 ms"
"#;

fn error_of(text: &str) -> ConfigError {
    match Config::parse("machine.toml", text) {
        Ok(config) => panic!("accepted: {config:#?}"),
        Err(error) => error,
    }
}

/// Replaces the first `from` by `to`, and expects exactly one problem, of that kind, in the line that contains
/// `line`.
fn check(from: &str, to: &str, line: &str, is_expected: impl Fn(&ProblemKind) -> bool) {
    assert!(SOUND.contains(from), "{from:?} is not in the sound configuration");
    let text = SOUND.replacen(from, to, 1);
    let error = error_of(&text);
    let case = format!("{from:?} -> {to:?}:\n{:?}", error.problems());
    let [problem] = error.problems() else { panic!("not one problem: {case}") };
    assert!(is_expected(&problem.kind), "another kind: {case}");
    assert!(!problem.kind.help().is_empty() && !problem.to_string().is_empty());
    let number = text.lines().position(|candidate| candidate.contains(line)).map(|index| index + 1);
    assert_eq!(error.line(problem), Some(number.expect("the line is there")), "another line: {case}");
}

macro_rules! cases {
    ($($name:ident { $($from:literal => $to:literal, at $line:literal: $pattern:pat $(if $guard:expr)?,)* })*) => {
        $(#[test]
        fn $name() {
            $(check($from, $to, $line, |kind| matches!(kind, $pattern $(if $guard)?));)*
        })*
    };
}

cases! {
    unknown_keys_are_found_and_the_nearest_known_is_suggested {
        "velocity = \"100 deg/s\"" => "velocty = \"100 deg/s\"", at "velocty": UnknownKey { key, nearest: Some("velocity"), .. } if key == "axis.limits.velocty",
        "[cycle]" => "[cicle]", at "[cicle]": UnknownKey { nearest: Some("cycle"), .. },
        "period = \"1 ms\"" => "periode = \"1 ms\"", at "periode": UnknownKey { nearest: Some("period"), .. },
        "priority = 80" => "prio = 80", at "prio": UnknownKey { key, .. } if key == "realtime.prio",
        "node = 127" => "id = 127", at "id = 127": UnknownKey { nearest: None, known, .. } if known.contains(&"node"),
        "interface = \"sim\"" => "iface = \"sim\"", at "iface": UnknownKey { nearest: Some("interface"), .. },
        "mode = \"csp\"" => "Mode = \"csp\"", at "Mode": UnknownKey { nearest: Some("mode"), .. },
        "initial_position" => "coulomb_friction = 1\ninitial_position", at "coulomb_friction":
            Replaced { by: "it in [axis.joint]: real drives obey it too", .. },
        "initial_position" => "power_up = \"1 s\"\ninitial_position", at "\"1 s\"": Replaced { .. },
        "initial_position" => "power_up = \"operational\"\ninitial_position", at "\"operational\"": OutOfRange { .. },
        "inertia = \"1 kg" => "inertias = \"1 kg", at "inertias": UnknownKey { nearest: Some("inertia"), .. },
        "gear_ratio = 1.0\nzero_counts = 0" => "home_offset = 0.5", at "home_offset": UnknownKey { nearest: Some("position_at_zero_counts"), .. },
        "zero_counts = 0" => "zero_counts = 0\nposition_at_zero_counts = 0.5", at "position_at_zero_counts": Ignored { beside: "zero_counts", .. },
        "dwell" => "dwel", at "dwel =": UnknownKey { key, nearest: Some("dwell"), .. } if key == "program.move.dwel",
        "seed" => "sead", at "sead": UnknownKey { nearest: Some("seed"), .. },
        "record = true" => "recording = true", at "recording": UnknownKey { nearest: Some("record"), .. },
        "transmission_type = 1" => "transmision_type = 1", at "transmision": UnknownKey { nearest: Some("transmission_type"), .. },
        "transmission_type = 1" => "node = 3", at "node = 3": UnknownKey { key, .. } if key == "axis.node",
        "transmission_type = 1" => "on_violation = \"clamp\"", at "on_violation": Replaced { key, by } if key == "axis.on_violation" && by.contains("follow = \"smooth\""),
        "[realtime]" => "[stream]\ndelay = \"2 s\"\n[realtime]", at "\"2 s\"": OutOfRange { key, .. } if key == "stream.delay",
        "[defaults.axis]" => "[defaults.bus]\n[defaults.axis]", at "[defaults.bus]": UnknownKey { key, .. } if key == "defaults.bus",
    }

    wrong_types_are_named {
        "period = \"1 ms\"" => "period = true", at "period": WrongType { expected: "a number or a text with number and unit", found: "true or false", .. },
        "priority = 80" => "priority = 80.5", at "priority": WrongType { expected: "a whole number", found: "a number", .. },
        "lock_memory = true" => "lock_memory = \"yes\"", at "lock_memory": WrongType { expected: "true or false", found: "a text", .. },
        "seed = 1" => "stops_for_missed_slots = 1", at "stops_for": WrongType { key, .. } if key == "simulation.stops_for_missed_slots",
        "name = \"left\"" => "name = 1", at "name = 1": WrongType { key, expected: "a text in quotes", .. } if key == "bus.name",
        "feedback = [\"velocity\"]" => "feedback = \"velocity\"", at "feedback": WrongType { expected: "a list", .. },
        "to = [\"30 deg\", 0.5]" => "to = [\"30 deg\", [0.5]]", at "to = [\"30": WrongType { found: "a list", .. },
        "limits = { position = [-1, 1], velocity = 1.0, acceleration = 5, torque = 20 }" => "limits = 5", at "limits = 5": WrongType { expected: "a table", .. },
        "gear_ratio = 1.0" => "gear_ratio = \"121:1\"", at "gear_ratio": WrongType { expected: "a number", .. },
        "directory = \"runs\"" => "directory = 2026-01-01", at "directory": WrongType { found: "a date or time", .. },
        "[cycle]\nperiod = \"1 ms\"\ncommand_phase = 0.55" => "cycle = \"1 ms\"", at "cycle": WrongType { key, .. } if key == "cycle",
    }

    a_table_that_should_be_one_of_a_list_is_named {
        "[[axis]]\nname = \"second\"" => "[master.axis]\n[[axis]]\nname = \"second\"", at "[master.axis]": UnknownKey { .. },
        "to = 0\n" => "speed = 0\nfor = \"1 s\"\n", at "speed = 0": OutOfRange { allowed, .. } if allowed.contains("for one of them"),
        "[program]\nrepeat = 1\n\n[[program.move]]\nto = [\"30 deg\", 0.5]\nvelocity = \"80 %\"\ndwell = \"200 ms\"\n\n[[program.move]]" => "[program.move]", at "[program.move]": WrongType { expected, found: "a table", .. } if expected.contains("[[double brackets]]"),
    }

    modes_to_change_to_are_checked_each_with_its_loop {
        "mode = \"csp\"" => "modes = [\"csp\", \"pv\"]", at "modes": UnknownChoice { key, given, .. } if key == "axis.modes" && given == "pv",
        "mode = \"csp\"" => "modes = \"csv\"", at "modes": WrongType { expected: "a list", .. },
        "mode = \"csp\"" => "modes = [\"csv\", \"csp\", \"csv\"]", at "modes": Repeated { key, given } if key == "axis.modes" && given == "csv",
        "mode = \"csp\"" => "mode = \"pp\"\nmodes = [\"csv\"]", at "modes": OutOfRange { key, value, .. } if key == "axis.modes" && value.contains("another mode than"),
        "mode = \"csp\"" => "modes = [\"csv\"]\nvelocity_loop = { position_gain = \"900 1/s\" }", at "position_gain": OutOfRange { key, .. } if key == "axis.velocity_loop.position_gain",
    }

    wrong_units_are_named {
        "velocity = \"100 deg/s\"" => "velocity = \"100 deg\"", at "\"100 deg\"": WrongUnit { unit, quantity, .. } if unit == "deg" && quantity.unit == "rad/s",
        "torque = \"31 Nm\"" => "torque = \"31 N\"", at "31 N\"": WrongUnit { quantity, .. } if quantity.unit == "Nm",
        "\"-90 deg\"" => "\"-90 mm\"", at "-90 mm": WrongUnit { key, .. } if key == "axis.limits.position",
        "to = [\"30 deg\"" => "to = [\"30 %\"", at "30 %": WrongUnit { quantity, .. } if quantity.unit == "rad",
        "period = \"1 ms\"" => "period = \"1 mm\"", at "1 mm": WrongUnit { .. },
        "inertia = \"1 kg m^2\"" => "inertia = \"1 kg m\"", at "1 kg m\"": WrongUnit { .. },
        "damping = \"20 Nm s/rad\"" => "damping = \"20 Nm/rad\"", at "20 Nm/rad": WrongUnit { .. },
        "bit_rate = \"1 Mbit/s\"" => "bit_rate = \"1 Mbit\"", at "1 Mbit\"": WrongUnit { .. },
        "velocity = \"80 %\"" => "velocity = \"2 rad/s\"", at "2 rad/s": WrongUnit { key, .. } if key == "program.move.velocity",
        "acceleration = \"8 rad/s^2\"" => "acceleration = \"8 furlong/s^2\"", at "furlong": UnknownUnit { symbol, .. } if symbol == "furlong",
        "velocity = \"100 deg/s\"" => "velocity = \"100 degree/s\"", at "degree": UnknownUnit { symbol, .. } if symbol == "degree",
        "velocity = \"100 deg/s\"" => "velocity = \"100\"", at "\"100\"": MissingUnit { .. },
        "velocity = \"100 deg/s\"" => "velocity = \"fast\"", at "fast": NotAQuantity { .. },
    }

    impossible_values_are_named_with_what_is_allowed {
        "period = \"1 ms\"" => "period = \"1 us\"", at "1 us": OutOfRange { value, allowed, .. } if value == "1 µs" && allowed == "250 µs to 100 ms",
        "period = \"1 ms\"" => "period = 1", at "period": OutOfRange { value, .. } if value == "1 s",
        "period = \"1 ms\"" => "period = \"1000.5 us\"", at "1000.5": OutOfRange { allowed, .. } if allowed == "whole microseconds",
        "command_phase = 0.55" => "command_phase = 1.2", at "command_phase": OutOfRange { value, allowed, .. } if value == "120 %" && allowed == "5 % to 95 %",
        "command_phase = 0.55" => "command_phase = \"2 ms\"", at "command_phase": OutOfRange { allowed, .. } if allowed == "50 µs to 950 µs",
        "command_phase = 0.55" => "command_phase = \"automatic\"", at "automatic": NotAQuantity { .. },
        "priority = 80" => "priority = 100", at "priority": OutOfRange { value, allowed, .. } if value == "100" && allowed == "1 to 99",
        "cpu = 1" => "cpu = -1", at "cpu": OutOfRange { .. },
        "spin_guard = \"50 us\"" => "spin_guard = \"600 us\"", at "spin_guard": OutOfRange { allowed, .. } if allowed == "0 s to 500 µs",
        "node = 127" => "node = 128", at "128": OutOfRange { key, .. } if key == "master.node",
        "heartbeat = \"100 ms\"" => "heartbeat = \"1 ms\"", at "heartbeat = \"1 ms": OutOfRange { .. },
        "heartbeat = \"100 ms\"" => "heartbeat = \"10.5 ms\"", at "10.5": OutOfRange { allowed, .. } if allowed == "whole milliseconds",
        "heartbeat_timeout = \"500 ms\"" => "heartbeat_timeout = \"100 ms\"", at "heartbeat_timeout": OutOfRange { allowed, .. } if allowed == "longer than heartbeat, 100 ms",
        "heartbeat = \"100 ms\"" => "time = \"1 ms\"", at "time = \"1 ms": OutOfRange { .. },
        "heartbeat = \"100 ms\"" => "time = \"7200 s\"", at "7200 s": OutOfRange { .. },
        "heartbeat_timeout = \"500 ms\"" => "heartbeat_timeout = \"66 s\"", at "66 s": OutOfRange { .. },
        "bit_rate = \"1 Mbit/s\"" => "bit_rate = 999999", at "999999": OutOfRange { key, .. } if key == "bus.bit_rate",
        "restart_ms = 250" => "restart_ms = 60001", at "restart": OutOfRange { allowed, .. } if allowed == "0 to 60000",
        "restart_ms = 250" => "restart_ms = \"100 ms\"", at "restart": WrongType { .. },
        "service_frames_per_cycle = 1" => "service_frames_per_cycle = 0", at "service": OutOfRange { .. },
        "bit_rate = \"1 Mbit/s\"" => "data_bit_rate = \"500 kbit/s\"", at "data_bit": OutOfRange { allowed, .. } if allowed == "1 Mbit/s to 8 Mbit/s",
        "transmission_type = 1" => "transmission_type = 241", at "241": OutOfRange { .. },
        "gear_ratio = 1.0" => "gear_ratio = -1", at "gear_ratio": OutOfRange { .. },
        "gear_ratio = 1.0" => "gear_ratio = nan", at "gear_ratio": OutOfRange { .. },
        "zero_counts = 0" => "zero_counts = 3000000000", at "zero_counts": OutOfRange { .. },
        "zero_counts = 0" => "missed_feedback_cycles = 0", at "missed": OutOfRange { .. },
        "zero_counts = 0" => "missed_feedback_time = \"0.9 ms\"", at "missed": OutOfRange { allowed, .. } if allowed == "1 ms to 1 s",
        "zero_counts = 0" => "missed_feedback_time = \"5 ms\"\nmissed_feedback_cycles = 5", at "missed_feedback_time": Ignored { .. },
        "zero_counts = 0" => "feedback_delay = \"-1 us\"", at "feedback_delay": OutOfRange { .. },
        "velocity = \"100 deg/s\"" => "velocity = 0", at "velocity = 0": OutOfRange { allowed, .. } if allowed.contains("check the unit"),
        "acceleration = \"8 rad/s^2\"" => "acceleration = inf", at "= inf": OutOfRange { .. },
        "jerk = 500" => "jerk = 0", at "jerk": OutOfRange { allowed, .. } if allowed.contains("inf for no limit"),
        "torque = \"31 Nm\"" => "torque = -31", at "-31": OutOfRange { .. },
        "position = [\"-90 deg\", \"90 deg\"]" => "position = [\"-90 deg\"]", at "position = [\"-90": OutOfRange { .. },
        "limit = \"5 deg\"" => "limit = 0", at "limit = 0": OutOfRange { key, .. } if key == "axis.following_error.limit",
        "vendor = 0x5A65726F" => "vendor = 0x1_0000_0000", at "vendor": OutOfRange { .. },
        "velocity = \"80 %\"" => "velocity = \"180 %\"", at "180 %": OutOfRange { value, .. } if value == "180 %",
        "dwell = \"200 ms\"" => "dwell = \"-1 s\"", at "dwell": OutOfRange { .. },
        "repeat = 1" => "repeat = 0", at "repeat": OutOfRange { .. },
        "black_box = \"5 s\"" => "black_box = \"5 ms\"", at "5 ms": OutOfRange { .. },
        "ring_records = 4096" => "ring_records = 1", at "ring": OutOfRange { .. },
        "directory = \"runs\"" => "directory = \"\"", at "directory": OutOfRange { .. },
        "seed = 1" => "seed = 99999999999999999999", at "seed": OutOfRange { .. },
        "longest_gap = \"2 ms\"" => "longest_gap = \"900 us\"", at "longest_gap": OutOfRange { .. },
        "longest_gap = \"2 ms\"" => "longest_gap = \"61 s\"", at "longest_gap": OutOfRange { .. },
        "bit_rate = \"1 Mbit/s\"" => "bit_rate = \"500 kbit/s\"", at "500 kbit/s": OutOfRange { key, .. } if key == "bus.bit_rate",
    }

    values_far_from_those_of_machines_are_refused_with_the_reason {
        "velocity = \"100 deg/s\"" => "velocity = \"1e-9 deg/s\"", at "1e-9": OutOfRange { allowed, .. } if allowed.contains("a slower joint takes hours"),
        "velocity = \"100 deg/s\"" => "velocity = 1e6", at "velocity = 1e6": OutOfRange { allowed, .. } if allowed.contains("no joint is faster"),
        "acceleration = \"8 rad/s^2\"" => "acceleration = 1e308", at "1e308": OutOfRange { allowed, .. } if allowed.contains("no joint accelerates"),
        "acceleration = \"8 rad/s^2\"" => "acceleration = 5e-324", at "5e-324": OutOfRange { allowed, .. } if allowed.contains("check the unit"),
        "acceleration = \"8 rad/s^2\"" => "acceleration = 0.01", at "0.01": OutOfRange { key, allowed, .. } if key == "axis.limits.acceleration" && allowed.contains("within 10 s"),
        "jerk = 500" => "jerk = 1e308", at "jerk": OutOfRange { .. },
        "jerk = 500" => "jerk = 5e-324", at "jerk": OutOfRange { .. },
        "jerk = 500" => "jerk = 1e-3", at "jerk": OutOfRange { .. },
        "jerk = 500" => "jerk = 0.05", at "jerk": OutOfRange { allowed, .. } if allowed.contains("within 10 s"),
        "gear_ratio = 1.0" => "counts_per_turn = 1", at "counts_per_turn": OutOfRange { allowed, .. } if allowed.contains("coarser encoders"),
        "gear_ratio = 1.0" => "gear_ratio = 1e-300", at "gear_ratio": OutOfRange { .. },
        "position = [-1, 1]" => "position = [0, 1e-300]", at "1e-300": OutOfRange { allowed, .. } if allowed.contains("one count of the drive"),
        "position = [-1, 1]" => "position = [nan, 1]", at "nan": OutOfRange { .. },
        "inertia = \"1 kg m^2\"" => "inertia = 1e-300", at "1e-300": OutOfRange { .. },
        "velocity = \"80 %\"" => "velocity = 1e-300", at "1e-300": OutOfRange { .. },
    }

    keys_that_are_not_used_are_checked_as_well {
        "gear_ratio = 1.0" => "lead = []", at "lead": WrongType { .. },
        "gear_ratio = 1.0" => "lead = nan", at "lead": OutOfRange { .. },
        "dwell = \"200 ms\"" => "for = nan", at "for": Ignored { key, beside: "to", .. } if key == "program.move.for",
        "dwell = \"200 ms\"" => "for = \"2 s\"", at "for": Ignored { .. },
        "damping = \"20 Nm s/rad\"" => "stiffness = []", at "stiffness": WrongType { .. },
        "damping = \"20 Nm s/rad\"" => "bandwidth = nan", at "bandwidth": OutOfRange { .. },
    }

    words_that_mean_nothing_are_refused {
        "mode = \"csp\"" => "mode = \"csq\"", at "csq": UnknownChoice { nearest: Some("csp" | "csv" | "cst"), .. },
        "drive = \"erob-canopen\"" => "drive = \"erob\"", at "\"erob\"": UnknownChoice { nearest: Some("erob-canopen"), .. },
        "feedback = [\"velocity\"]" => "mapping = \"mine\"", at "mine": UnknownChoice { choices, .. } if choices.contains(&"as-stored"),
        "feedback = [\"velocity\"]" => "feedback = [\"colour\"]", at "colour": UnknownChoice { nearest: None, choices, .. } if choices.contains(&"torque"),
        "gear_ratio = 1.0" => "travel = \"sideways\"", at "sideways": UnknownChoice { .. },
        "feedback = [\"velocity\"]" => "feedback = [\"velocity\", \"velocity\"]", at "feedback": Repeated { .. },
        "name = \"first\"" => "name = \"\"", at "name = \"\"": BadName { .. },
        "name = \"right\"" => "name = \"a=b\"", at "a=b": BadName { given, .. } if given == "a=b",
    }

    interfaces_that_takt_cannot_use_are_refused {
        "interface = \"can1\"" => "interface = \"slcan:ttyACM0\"", at "slcan": Interface { reason: InterfaceError::Device { given } } if given == "ttyACM0",
        "interface = \"can1\"" => "interface = \"slcan:/dev/ttyACM0@0\"", at "slcan": Interface { reason: InterfaceError::BaudRate { given } } if given == "0",
        "interface = \"can1\"" => "interface = \"slcan:/dev/ttyACM0\"\ndata_bit_rate = \"2.5 Mbit/s\"", at "2.5 Mbit/s": OutOfRange { allowed, .. } if allowed.contains("SLCAN"),
        "interface = \"can1\"" => "interface = \"can 1\"", at "can 1": Interface { reason: InterfaceError::Name { .. } },
    }

    what_must_be_unique_is {
        "name = \"right\"" => "name = \"left\" # again", at "# again": DuplicateName { what: "bus", name } if name == "left",
        "name = \"second\"" => "name = \"first\" # again", at "# again": DuplicateName { what: "axis", name } if name == "first",
        "node = 2" => "node = 1 # again", at "# again": DuplicateNode { node: 1, bus } if bus == "left",
        "node = 2" => "node = 127 # again", at "# again": DuplicateNode { node: 127, .. },
        "interface = \"can1\"" => "interface = \"can1\"\n[[bus]]\nname = \"third\"\ninterface = \"can1\" # again", at "# again": DuplicateInterface { interface } if interface == "can1",
    }

    what_belongs_together_fits {
        "bus = \"left\"" => "bus = \"lefd\"", at "lefd": UnknownBus { nearest: Some(nearest), .. } if nearest == "left",
        "bus = \"left\"" => "bus = \"can0\"", at "bus = \"can0\"": UnknownBus { nearest: None, known, .. } if known == &["left", "right"],
        "position = [-1, 1]" => "position = [-100000, 1]", at "-100000": BeyondCounts { key, .. } if key == "axis.limits.position",
        "gear_ratio = 1.0" => "gear_ratio = 16000", at "velocity = \"100": BeyondCounts { key, .. } if key == "axis.limits.velocity",
        "to = 0" => "to = [0]", at "to = [0]": TargetCount { given: 1, axes: 2, group: None },
        "to = [\"30 deg\", 0.5]" => "to = [0, 0, 0]", at "to = [0, 0, 0]": TargetCount { given: 3, axes: 2, group: None },
        "to = [\"30 deg\", 0.5]" => "to = [\"30 deg\", 1.5]", at "1.5]": TargetOutsideLimits { axis, allowed, .. } if axis == "second" && allowed.starts_with("-1 rad"),
        "to = 0" => "to = \"80 deg\"", at "to = \"80": TargetOutsideLimits { axis, .. } if axis == "second",
        "initial_position = \"10 deg\"" => "initial_position = \"91 deg\"", at "91 deg": InitialPositionOutsideLimits { axis, value, .. } if axis == "first" && value.contains("91 deg"),
    }
}

#[test]
fn a_missing_key_is_shown_at_the_header_of_its_table() {
    for (line, key, header) in [
        ("name = \"sound\"\n", "name", ""),
        ("torque = \"31 Nm\"\n", "axis.limits.torque", "[axis.limits]"),
        ("velocity = \"100 deg/s\"\n", "axis.limits.velocity", "[axis.limits]"),
        ("acceleration = \"8 rad/s^2\"\n", "axis.limits.acceleration", "[axis.limits]"),
        ("bus = \"left\"\n", "axis.bus", "[[axis]]"),
        ("node = 1\n", "axis.node", "[[axis]]"),
        ("name = \"first\"\n", "axis.name", "[[axis]]"),
        ("to = [\"30 deg\", 0.5]\n", "program.move.to", "[[program.move]]"),
    ] {
        check(line, "", header, |kind| matches!(kind, MissingKey { key: missing, .. } if missing == key));
    }
}

#[test]
fn a_list_of_limits_must_rise() {
    for range in ["[\"90 deg\", \"-90 deg\"]", "[1, 1]"] {
        let text = SOUND.replace("[\"-90 deg\", \"90 deg\"]", range);
        let error = error_of(&text);
        assert!(matches!(error.problems()[0].kind, EmptyRange { .. }), "{:?}", error.problems());
    }
}

#[test]
fn a_linear_axis_needs_its_lead() {
    let text = SOUND.replace("gear_ratio = 1.0", "travel = \"linear\"");
    let error = error_of(&text);
    let missing = |kind: &ProblemKind| matches!(kind, MissingKey { key, .. } if key == "axis.lead");
    assert!(error.problems().iter().any(|problem| missing(&problem.kind)), "{:?}", error.problems());
    let lengths = |kind: &ProblemKind| matches!(kind, WrongUnit { quantity, .. } if quantity.unit == "m");
    assert!(!error.problems().iter().any(|problem| lengths(&problem.kind)), "one mistake, one message");
}

#[test]
fn a_machine_needs_a_bus_and_an_axis() {
    let error = error_of("name = \"empty\"\n");
    let keys: Vec<_> = error.problems().iter().map(|problem| problem.to_string()).collect();
    assert_eq!(keys, ["`bus` is missing", "`axis` is missing"]);
}

#[test]
fn more_axes_or_buses_than_one_controller_can_do_are_refused() {
    let bus = |n: usize| format!("[[bus]]\nname = \"b{n}\"\n");
    let axis = |n: usize| {
        let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
        format!("[[axis]]\nname = \"a{n}\"\nbus = \"b0\"\nnode = {n}\ndrive = \"erob-canopen\"\n{limits}\n")
    };
    let text = |buses: usize, axes: usize| {
        let buses: String = (0..buses).map(bus).collect();
        format!("name = \"many\"\n{buses}{}", (1..=axes).map(axis).collect::<String>())
    };
    assert!(Config::parse("many", &text(16, 32)).is_ok());
    let error = error_of(&text(17, 33));
    let [buses, axes] = error.problems() else { panic!("{:?}", error.problems()) };
    assert_eq!(buses.kind, TooMany { what: "buses", given: 17, limit: 16 });
    assert_eq!(axes.kind, TooMany { what: "axes", given: 33, limit: 32 });
}

#[test]
fn every_problem_of_a_file_is_reported_at_once_and_in_its_order() {
    let text = SOUND
        .replace("period = \"1 ms\"", "period = \"1 us\"")
        .replace("velocity = \"100 deg/s\"", "velocty = \"100 deg/s\"")
        .replace("torque = \"31 Nm\"", "torque = \"31 N\"")
        .replace("name = \"second\"", "name = \"first\"")
        .replace("to = 0", "to = [0]");
    let error = error_of(&text);
    let lines: Vec<_> = error.problems().iter().map(|problem| error.line(problem).unwrap()).collect();
    assert_eq!(lines.len(), 5, "{:?}", error.problems());
    assert!(lines.is_sorted());
    assert_eq!(error.to_string(), "machine.toml cannot be used: 5 problems");
}

#[test]
fn a_problem_of_the_defaults_is_reported_once_for_all_axes() {
    let text = SOUND.replace("transmission_type = 1", "transmission_type = 0");
    assert_eq!(error_of(&text).problems().len(), 1);
}

#[test]
fn what_is_not_toml_is_shown_where_it_ceases_to_be() {
    for (from, to, line) in [
        ("priority = 80", "priority = ", 8),
        ("name = \"left\"", "name = \"left", 19),
        ("[realtime]", "[realtime", 7),
        ("cpu = 1", "priority = 1", 9),
    ] {
        let error = error_of(&SOUND.replacen(from, to, 1));
        assert!(matches!(error.problems()[0].kind, Syntax { .. }), "{:?}", error.problems());
        assert_eq!(error.line(&error.problems()[0]), Some(line), "{:?}", error.problems());
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Config::load("no/such/file.toml".as_ref()).unwrap_err();
    assert!(matches!(error.problems()[0].kind, Unreadable { .. }));
    assert_eq!(error.to_string(), "no/such/file.toml cannot be used");
    assert_eq!(error.line(&error.problems()[0]), None);
}

#[test]
fn a_file_that_is_no_text_is_shown_where_it_ceases_to_be() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, [SOUND.as_bytes(), b"# \xE4ndern\n"].concat()).unwrap();
    let error = Config::load(&path).unwrap_err();
    assert_eq!(error.problems()[0].kind, NotText);
    assert_eq!(error.line(&error.problems()[0]), Some(SOUND.lines().count() + 1));
    assert!(rendered(&error).contains("ndern"), "{}", rendered(&error));
}

#[test]
fn a_period_that_cannot_be_is_told_once_and_not_also_of_the_axes_on_its_bus() {
    let text =
        include_str!("../../configs/mixed-arm.toml").replace("period = \"2 ms\"", "period = \"1.5 ms\"");
    let error = error_of(&text);
    let said: Vec<String> = error.problems().iter().map(ToString::to_string).collect();
    assert_eq!(said, ["`bus.period` cannot be 1.5 ms"]);
}

#[test]
fn a_bus_whose_cycle_has_more_cycles_than_the_engine_can_wait_is_refused_at_its_line() {
    let with = |period: &str| {
        include_str!("../../configs/single-erob.toml").replacen(
            "[[bus]]\n",
            &format!("[[bus]]\n{period}\n"),
            1,
        )
    };
    let text = with("period = \"33 ms\"");
    let error = error_of(&text);
    let [problem] = error.problems() else { panic!("{error:?}") };
    assert_eq!(problem.to_string(), "`bus.period` cannot be 33 ms");
    assert!(problem.kind.help().contains("1 ms to 32 ms: 32 cycles at most"), "{}", problem.kind.help());
    assert_eq!(
        error.line(problem),
        text.lines().position(|line| line.starts_with("period")).map(|line| 1 + line)
    );
    // The longest one can be set up.
    let config = Config::parse("longest.toml", &with("period = \"32 ms\""));
    let config = config.unwrap_or_else(|error| panic!("{error:?}"));
    takt::controller::assemble::engine(&config).unwrap_or_else(|error| panic!("{error:?}"));
}

fn rendered(error: &ConfigError) -> String {
    let mut text = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(100)
        .render_report(&mut text, error)
        .unwrap();
    text
}

#[test]
fn a_person_reads_the_line_what_is_wrong_with_it_and_what_to_do() {
    let text =
        SOUND.replace("velocity = \"100 deg/s\"", "velocity = \"100 deg\"").replace("node = 2", "node = 1");
    let expected = r#"  × machine.toml cannot be used: 2 problems

Error: 
  × `axis.limits.velocity` is an angular velocity, and "deg" is not a unit of that
    ╭─[machine.toml:44:12]
 43 │ position = ["-90 deg", "90 deg"]
 44 │ velocity = "100 deg"
    ·            ────┬────
    ·                ╰── wrong unit
 45 │ acceleration = "8 rad/s^2"
    ╰────
  help: write an angular velocity, as in "137 deg/s", or a bare number in rad/s

Error: 
  × the node ID 1 is already taken on the bus "left"
    ╭─[machine.toml:68:8]
 67 │ bus = "left"
 68 │ node = 1
    ·        ┬
    ·        ╰── again; first in line 33
 69 │ limits = { position = [-1, 1], velocity = 1.0, acceleration = 5, torque = 20 }
    ╰────
  help: give each node of a bus a node ID of its own, 1 to 127; on every bus, [master] node is the
        ID of the controller. Axes of one drive have one node ID, one `eds`, and each another
        `node_axis`
"#;
    assert_eq!(rendered(&error_of(&text)), expected);
}

proptest! {
    #[test]
    fn any_text_is_answered_without_a_panic(text in ".{0,200}") {
        let _ = Config::parse("any.toml", &text);
    }

    /// Cuts and insertions anywhere in a sound file give an answer, and every problem lies within the file and can
    /// be shown.
    #[test]
    fn any_spoilt_configuration_is_answered_without_a_panic(
        at in 0..SOUND.len(), length in 0usize..40, insertion in "[a-z0-9=\"\\[\\]{}. \n-]{0,12}",
    ) {
        let end = (at + length).min(SOUND.len());
        let text = format!("{}{insertion}{}", &SOUND[..at], &SOUND[end..]);
        if let Err(error) = Config::parse("spoilt.toml", &text) {
            prop_assert!(!error.problems().is_empty());
            for problem in error.problems() {
                let span = problem.span().unwrap();
                prop_assert!(span.start <= span.end && span.end <= text.len());
            }
            prop_assert!(!rendered(&error).is_empty());
        }
    }
}

/// A bus that can carry its axes at no command phase, and two that would need different ones.
#[test]
fn an_automatic_command_phase_that_does_not_exist_is_refused_with_the_sums() {
    let auto = SOUND.replace("command_phase = 0.55", "command_phase = \"auto\"");
    assert!(Config::parse("auto.toml", &auto).is_ok());
    let help = |text: &str| {
        let error = Config::parse("auto.toml", text).unwrap_err();
        let [problem] = error.problems() else { panic!("{:?}", error.problems()) };
        assert!(matches!(problem.kind, NoCommandPhase { .. }), "{problem:?}");
        assert_eq!(&text[problem.span().unwrap()], "\"auto\"");
        problem.kind.help()
    };

    let slow = help(&auto.replace("gear_ratio = 1.0", "feedback_delay = \"600 us\""));
    assert!(slow.starts_with("the bus \"left\" needs it at "), "{slow}");
    assert!(slow.contains("600 drives' delay") && slow.contains("what would fit:\n    - "), "{slow}");
    assert!(slow.contains("a cycle of 2 ms"), "{slow}");

    // The one is late with its feedback, the other has much to send.
    let late = auto.replace("gear_ratio = 1.0", "feedback_delay = \"400 us\"");
    let other = late.replace("bus = \"left\"\nnode = 2", "bus = \"right\"\nnode = 2");
    assert!(Config::parse("auto.toml", &other).is_ok());
    let axis = |node: usize| {
        format!(
            "[[axis]]\nname = \"x{node}\"\nbus = \"right\"\nnode = {node}\n\
             limits = {{ position = [-1, 1], velocity = 1.0, acceleration = 5, torque = 20 }}\n"
        )
    };
    let axes = axis(11) + &axis(12);
    let program = other.find("[program]").unwrap();
    let targets = other[program..].replace("to = [\"30 deg\", 0.5]", "to = 0");
    let both = help(&format!("{}{axes}{targets}", &other[..program]));
    assert_eq!(both.lines().count(), 2, "{both}");
    assert!(both.contains("\"left\" needs it") && both.contains("\"right\" needs it"), "{both}");
}
