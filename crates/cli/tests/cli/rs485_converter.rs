//! A hollow-shaft motor behind a transparent converter between RS-485 and CAN FD: read, checked, moved in a cycle and by `takt drive`,
//! against the simulated converter on a pseudo-terminal.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use takt::Config;

use crate::printed::{ends_with, errors, said};
use crate::simulated::{Simulated, at_once};

/// A simulated converter with motors 1 to 4, in a process of its own.
struct Converter {
    simulated: Simulated,
    interface: String,
}

impl Converter {
    fn new(faults: &[&str]) -> Self {
        let faults = faults.iter().flat_map(|fault| ["--line-fault", *fault]);
        let arguments: Vec<_> = ["--serial", "hollow-rs485"].into_iter().chain(faults).collect();
        let simulated = Simulated::new(&arguments);
        let interface = format!("rs485-canfd:{}", simulated.path.display());
        Self { simulated, interface }
    }
}

fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hollow-rs485.toml")
}

fn takt(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = said(output);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}: {}", errors(output)))
}

fn text() -> String {
    std::fs::read_to_string(config()).unwrap()
}

/// The problems of the configuration on a line, with a change.
fn problems(from: &str, to: &str) -> String {
    let text = text().replace("interface = \"sim\"", "interface = \"rs485-canfd:/dev/ttyUSB0\"");
    assert!(text.contains(from), "{from}");
    let error = Config::parse("test.toml", &text.replace(from, to)).unwrap_err();
    let report = miette::Report::new(error);
    format!("{report:?}").replace("\n", " ")
}

#[test]
fn a_line_carries_one_motor_of_can_fd_with_short_identifiers() {
    let same = "name = \"hollow-rs485\"";
    let text = text().replace("interface = \"sim\"", "interface = \"rs485-canfd:/dev/ttyUSB0\"");
    let read = Config::parse("test.toml", &text).unwrap();
    assert_eq!(read.buses[0].interface.to_string(), "rs485-canfd:/dev/ttyUSB0");
    // The converter sets the bus behind it up.
    assert!(Config::parse("test.toml", &text.replace("data_bit_rate = \"1 Mbit/s\"", "")).is_ok());
    assert!(problems("0x64", "0x164").contains("0xFF"), "{}", problems("0x64", "0x164"));
    assert!(problems("kd = 20", "kd = 20\nvelocity_loop_kp = 1.5").contains("left out"));
    let second = text.split("[[axis]]").nth(1).unwrap().split("[[program").next().unwrap().to_owned();
    let second = second.replace("table", "lift").replace("node = 1", "node = 2").replace("0x64", "0x65");
    let two = text.replace(
        "[[program.move]]\nto = \"40 deg\"",
        &format!("[[axis]]{second}[[program.move]]\nto = [\"40 deg\", \"0 deg\"]"),
    );
    let two = two.replace("to = \"0 deg\"", "to = [\"0 deg\", \"0 deg\"]");
    let error = format!("{:?}", miette::Report::new(Config::parse("test.toml", &two).unwrap_err()));
    assert!(error.contains("a line of its own"), "{error}");
    assert!(
        problems(same, "name = \"x\"\n[[bus]]\nname=\"other\"\ninterface = \"slcan:/dev/ttyUSB0\"")
            .contains("ttyUSB0")
    );
}

#[test]
fn a_bus_is_not_put_behind_a_converter_that_does_not_carry_it() {
    let mut config = Config::load(Path::new("../../configs/hollow-arm.toml")).unwrap();
    let error = config.override_interface("can", "rs485-canfd:/dev/ttyUSB0").unwrap_err().to_string();
    assert!(error.contains("does not carry the frames") && error.contains("`pan`"), "{error}");
}

#[test]
fn check_has_the_time_on_the_line_and_refuses_a_cycle_that_is_too_short() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("fast.toml");
    let on_line = text().replace("interface = \"sim\"", "interface = \"rs485-canfd:/dev/ttyUSB0\"");
    std::fs::write(&file, &on_line).unwrap();
    let output = takt(&["check", file.to_str().unwrap()]);
    ends_with(0, &output);
    let all = said(&output) + &errors(&output);
    assert!(all.contains("not hard real time"), "{all}");
    std::fs::write(&file, on_line.replace("period = \"5 ms\"", "period = \"1 ms\"")).unwrap();
    let output = takt(&["check", file.to_str().unwrap()]);
    assert_ne!(output.status.code(), Some(0), "{}", said(&output));
}

#[test]
fn a_motor_behind_the_converter_is_inspected_moved_and_zeroed() {
    let converter = Converter::new(&[]);
    let config = config();
    let drive = |arguments: &[&str]| {
        let bus = format!("line={}", converter.interface);
        takt(&[&["drive", config.to_str().unwrap(), "--bus", &bus, "--json"], arguments].concat())
    };
    let info = drive(&["info"]);
    ends_with(0, &info);
    assert_eq!(json(&info)["result"]["temperature_c"], 30.0);
    let moved = drive(&["move", "absolute", "30 deg"]);
    ends_with(0, &moved);
    let position = json(&moved)["result"]["position"].as_f64().unwrap().to_degrees();
    assert!((position - 30.0).abs() < 1.0, "{position}");
    let zeroed = drive(&["zero", "--yes"]);
    ends_with(0, &zeroed);
    assert_eq!(json(&zeroed)["result"]["after_counts"], 0);
    let gains = drive(&["gains", "--velocity-kp", "2"]);
    ends_with(2, &gains);
    assert!(json(&gains)["failure"].as_str().unwrap().contains("does not carry the frames"));
}

#[test]
fn a_motor_without_a_configuration_is_asked_over_the_line_by_its_keys() {
    let converter = Converter::new(&[]);
    let output = takt(&[
        "drive",
        "--bus",
        &converter.interface,
        "--node",
        "3",
        "--family",
        "hollow-can-fd",
        "--set",
        "master_id=100",
        "--set",
        "torque_constant=0.23",
        "--set",
        "pole_pairs=14",
        "--set",
        "kp=100",
        "--set",
        "kd=20",
        "info",
        "--json",
    ]);
    ends_with(0, &output);
    assert_eq!(json(&output)["result"]["motor_id"], 3);
}

#[test]
fn a_motor_behind_the_converter_follows_a_cycle() {
    let converter = Converter::new(&[]);
    let bus = format!("line={}", converter.interface);
    let recording = converter.simulated.path.with_file_name("run.mcap");
    let recording = recording.to_str().unwrap();
    let mut run = at_once(env!("CARGO_BIN_EXE_takt"));
    run.arg("run").arg(config()).args(["--bus", &bus, "--record", recording, "--json"]).stdin(Stdio::null());
    let output = run.output().unwrap();
    ends_with(0, &output);
    let report = json(&output);
    let position = report["axes"][0]["final_position"].as_f64().unwrap();
    assert!(position.abs() < 0.05, "{report}");
    assert!(report["buses"][0]["rx_frames"].as_u64().unwrap() > 100, "{report}");
}

#[test]
fn disturbed_bytes_cost_single_replies_and_no_motion() {
    let converter = Converter::new(&["disturbed=50"]);
    let bus = format!("line={}", converter.interface);
    let output =
        takt(&["drive", config().to_str().unwrap(), "--bus", &bus, "--json", "move", "absolute", "20 deg"]);
    ends_with(0, &output);
    let position = json(&output)["result"]["position"].as_f64().unwrap().to_degrees();
    assert!((position - 20.0).abs() < 1.0, "{position}");
}

#[test]
fn a_motor_that_falls_silent_in_a_move_is_named_with_what_to_do() {
    let converter = Converter::new(&["silent=0.8"]);
    let bus = format!("line={}", converter.interface);
    let output =
        takt(&["drive", config().to_str().unwrap(), "--bus", &bus, "--json", "move", "absolute", "160 deg"]);
    ends_with(1, &output);
    let ended = json(&output);
    assert!(ended["failure"].as_str().unwrap().contains("has not replied for"), "{ended}");
    assert!(ended["advice"].as_str().unwrap().contains("no watchdog"), "{ended}");
}
