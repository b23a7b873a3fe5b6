//! Serial lines in a configuration: what a line is, and what is wrong with one, each at its place.

use std::path::Path;

use takt::config::{Bus, CommandFrames, Interface, Problem, SerialDevice};
use takt::{Config, ConfigError};

fn text() -> String {
    std::fs::read_to_string("../../configs/turntable-modbus.toml").unwrap()
}

fn parse(changes: &[(&str, &str)]) -> Result<Config, ConfigError> {
    let mut text = text();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    Config::parse("line.toml", &text)
}

const RATE: &str = "bit_rate = \"115200 bit/s\"";

/// A problem in words, behind the number of its line.
fn words(error: &ConfigError) -> Vec<String> {
    let show = |problem: &Problem| {
        format!("line {}: {} {}", error.line(problem).unwrap_or(0), problem.kind, problem.kind.help())
    };
    error.problems().iter().map(show).collect()
}

/// The one problem of a changed configuration says all of this.
#[track_caller]
fn refused(changes: &[(&str, &str)], says: &[&str]) {
    let error = parse(changes).expect_err("it was taken");
    let words = words(&error);
    assert_eq!(words.len(), 1, "{words:?}");
    for part in says {
        assert!(words[0].contains(part), "{part:?} is not in: {words:?}");
    }
}

#[test]
fn a_bus_is_a_line_by_its_interface_or_by_the_drives_on_it() {
    let config = parse(&[]).unwrap();
    assert_eq!([0, 1].map(|bus| config.is_serial_line(bus)), [false, true]);
    assert_eq!((config.buses[0].bit_rate, config.buses[1].bit_rate), (1_000_000, 115_200));
    let config = parse(&[(RATE, "")]).unwrap();
    assert_eq!(config.buses[1].bit_rate, 115_200, "that is the usual rate of a line");
    let config = parse(&[(RATE, "interface = \"serial:/dev/ttyUSB0\"")]).unwrap();
    let device = |bit_rate| Interface::Serial(SerialDevice { device: "/dev/ttyUSB0".to_owned(), bit_rate });
    assert_eq!((&config.buses[1].interface, config.buses[1].bit_rate), (&device(None), 115_200));
    let config = parse(&[(RATE, "interface = \"serial:/dev/ttyUSB0@19200\"")]).unwrap();
    assert_eq!((&config.buses[1].interface, config.buses[1].bit_rate), (&device(Some(19_200)), 19_200));
    config.validate().unwrap();
}

#[test]
fn another_interface_may_bring_its_bit_rate() {
    let mut config = parse(&[]).unwrap();
    config.override_interface("table", "serial:/dev/ttyUSB0").unwrap();
    assert_eq!(config.buses[1].bit_rate, 115_200);
    config.override_interface("table", "serial:/dev/ttyUSB0@9600").unwrap();
    assert_eq!(config.buses[1].bit_rate, 9_600);
    config.validate().unwrap();
    config.override_interface("table", "can0").unwrap();
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("on the CAN bus `table`"), "{error}");
    let mut config = parse(&[]).unwrap();
    config.override_interface("arm", "serial:/dev/ttyUSB1").unwrap();
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("which is a serial line"), "{error}");
}

#[test]
fn a_line_without_a_period_has_10_ms_and_hasty_values_are_warned_of() {
    // With a period that is given, and without one.
    let of_line = |changes: &[(&str, &str)]| {
        let config = parse(changes).unwrap();
        assert!(config.warnings().is_empty(), "{:?}", config.warnings());
        (config.bus_cycle(1).period_ns / 1_000_000, config.axes[2].missed_feedback_cycles)
    };
    assert_eq!(of_line(&[]), (10, 5));
    assert_eq!(of_line(&[(RATE, "bit_rate = \"19200 bit/s\"")]), (10, 5));
    assert_eq!(of_line(&[(RATE, "period = \"20 ms\"")]), (20, 5));
    let hasty = [("drive = \"erob-modbus\"", "drive = \"erob-modbus\"\nmissed_feedback_cycles = 1")];
    let warnings: Vec<String> = parse(&hasty).unwrap().warnings().iter().map(ToString::to_string).collect();
    assert!(
        warnings.iter().any(|warning| warning.contains("or more `missed_feedback_cycles`")),
        "{warnings:?}"
    );
    let brief = [("\"500 ms\"", "\"50 ms\"")];
    let warnings: Vec<String> = parse(&brief).unwrap().warnings().iter().map(ToString::to_string).collect();
    assert!(
        warnings.iter().any(|warning| warning.contains("`communication_timeout` is 50 ms")),
        "{warnings:?}"
    );
}

#[test]
fn the_keys_of_a_can_bus_mean_nothing_on_a_line() {
    for key in [
        "data_bit_rate = \"5 Mbit/s\"",
        "restart_ms = 100",
        "service_frames_per_cycle = 1",
        "sdo_while_enabled = false",
        "command_frames = \"shared\"",
    ] {
        let name = key.split(' ').next().unwrap();
        refused(&[(RATE, key)], &[&format!("`bus.{name}` means nothing on a serial line"), "line 13:"]);
    }
}

#[test]
fn what_is_wrong_with_a_line_is_named_at_its_place() {
    refused(
        &[(RATE, "bit_rate = \"57600 bit/s\"")],
        &["57.6 kbit/s", "the bit rates of the eRob with Modbus-RTUs", "line 13:"],
    );
    refused(
        &[(RATE, "interface = \"serial:/dev/ttyUSB0@57600\"")],
        &["57.6 kbit/s", "the bit rates of the eRob with Modbus-RTUs", "line 13:"],
    );
    refused(
        &[(RATE, "bit_rate = \"9600 bit/s\"\ninterface = \"serial:/dev/ttyUSB0@19200\"")],
        &["as `interface` says", "line 13:"],
    );
    refused(
        &[(RATE, "interface = \"serial:ttyUSB0\"")],
        &["cannot be the path of a serial line", "line 13:"],
    );
    refused(
        &[(RATE, "interface = \"can0\"")],
        &["\"erob-modbus\" on the CAN bus `table`", "serial:/dev/ttyUSB0"],
    );
    // It has the address of the drive that is there already, too.
    let mixed =
        parse(&[("name = \"elbow\"\nbus = \"arm\"", "name = \"elbow\"\nbus = \"table\"")]).unwrap_err();
    let says = "`axis.bus` cannot be \"table\", which is a serial line, allowed: a CAN bus";
    assert!(words(&mixed).iter().any(|problem| problem.contains(says)), "{:?}", words(&mixed));
    refused(
        &[("node = 2\ndrive = \"erob-modbus\"", "node = 248\ndrive = \"erob-modbus\"")],
        &["`axis.node` cannot be 248", "1 to 247"],
    );
    refused(
        &[("communication_timeout = \"500 ms\"", "communication_timeout = \"5 s\"")],
        &["`axis.communication_timeout` cannot be 5 s"],
    );
}

#[test]
fn a_slave_may_have_the_address_of_the_master_of_the_can_buses_and_two_may_not_be_alike() {
    let config =
        parse(&[("node = 2\ndrive = \"erob-modbus\"", "node = 127\ndrive = \"erob-modbus\"")]).unwrap();
    assert_eq!((config.axes[2].node, config.master.node), (127, 127));
    config.validate().unwrap();
    let second =
        "[[axis]]\nname = \"second\"\nbus = \"table\"\nnode = 2\ndrive = \"erob-modbus\"\n\n[[program";
    let error = Config::parse("line.toml", &text().replacen("[[program", second, 1)).unwrap_err();
    let words = words(&error);
    let says = "the node ID 2 is already taken on the bus \"table\"";
    assert!(words.iter().any(|problem| problem.contains(says)), "{words:?}");
}

#[test]
fn one_device_is_one_bus() {
    let both = [
        (RATE, "interface = \"serial:/dev/ttyUSB0\""),
        ("name = \"arm\"", "name = \"arm\"\ninterface = \"slcan:/dev/ttyUSB0@1000000\""),
    ];
    refused(&both, &["already belongs to another bus"]);
}

#[test]
fn a_line_that_is_set_up_in_code_is_checked_by_the_same_rules() {
    let spoil = |change: fn(&mut Bus), says: &str| {
        let mut config = parse(&[]).unwrap();
        change(&mut config.buses[1]);
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains(says), "{says}: {error}");
    };
    spoil(|bus| bus.data_bit_rate = Some(5_000_000), "`bus.data_bit_rate` means nothing on a serial line");
    spoil(|bus| bus.sdo_while_enabled = true, "`bus.sdo_while_enabled` means nothing on a serial line");
    spoil(|bus| bus.command_frames = CommandFrames::Shared, "`bus.command_frames` means nothing");
    spoil(|bus| bus.bit_rate = 57_600, "the bit rates of the eRob with Modbus-RTUs");
    spoil(|bus| bus.interface = Interface::SocketCan("can0".to_owned()), "on the CAN bus `table`");
    let device = SerialDevice { device: "/dev/ttyUSB0".to_owned(), bit_rate: Some(9_600) };
    let mut config = parse(&[]).unwrap();
    config.buses[1].interface = Interface::Serial(device);
    let error = config.validate().unwrap_err().to_string();
    assert!(error.contains("as `interface` says"), "{error}");
}

#[test]
fn takt_check_says_how_often_each_drive_of_a_line_is_spoken_to() {
    let check = |json: bool| {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/turntable-modbus.toml");
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_takt"));
        command.arg("check").arg(config).args(json.then_some("--json"));
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let text = check(false);
    assert!(text.contains("Serial lines, beside the cycle"), "{text}");
    assert!(text.contains("21.3 ms") && text.contains("10.0 ms") && text.contains("500.0 ms"), "{text}");
    let json: serde_json::Value = serde_json::from_str(&check(true)).unwrap();
    let line = &json["lines"][0];
    assert_eq!((&line["name"], &line["bit_rate"]), (&"table".into(), &115_200.into()));
    assert_eq!((&line["round_ns"], &line["watchdog_ns"]), (&21_281_251.into(), &500_000_000.into()));
}
