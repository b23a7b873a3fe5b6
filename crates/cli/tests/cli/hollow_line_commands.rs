//! `takt drive` on the serial lines of the hollow-shaft motors, against the simulated devices on pseudo-terminals: the converter in its
//! Modbus mode, the console, the encoder, the pulse module; and the table of the PWM input.

use std::io::Read;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use takt::sim::pseudo_terminal::PseudoTerminal;

use crate::printed::{ends_with, errors, said};
use crate::simulated::Simulated;

/// A simulated device in a process of its own.
struct Device {
    _simulated: Simulated,
    line: String,
}

impl Device {
    fn new(kind: &str, faults: &[&str]) -> Self {
        let faults = faults.iter().flat_map(|fault| ["--line-fault", *fault]);
        let simulated = Simulated::new(&["--serial", kind].into_iter().chain(faults).collect::<Vec<_>>());
        let line = format!("serial:{}@19200", simulated.path.display());
        Self { _simulated: simulated, line }
    }

    fn drive(&self, family: &str, arguments: &[&str]) -> Output {
        takt(&[&["--family", family, "--bus", &self.line, "--json"], arguments].concat())
    }

    /// A motor behind the converter in its Modbus mode.
    fn motor(&self, arguments: &[&str]) -> Output {
        let keys = [
            "master_id=100",
            "torque_constant=0.23",
            "pole_pairs=14",
            "kp=100",
            "kd=20",
            "limits.position=[\"-170 deg\", \"170 deg\"]",
            "limits.velocity=2 rad/s",
            "limits.acceleration=4 rad/s^2",
            "limits.torque=2 Nm",
            "following_error={ limit = \"1 rad\", time = \"1 s\" }",
        ];
        let keys: Vec<&str> = keys.iter().flat_map(|key| ["--set", key]).collect();
        self.drive("hollow-can-fd", &[&["--node", "2"], &keys[..], arguments].concat())
    }
}

fn takt(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("drive").args(arguments).stdin(Stdio::null()).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = said(output);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}: {}", errors(output)))
}

#[track_caller]
fn result(output: &Output) -> Value {
    ends_with(0, output);
    json(output)["result"].clone()
}

#[track_caller]
fn is_refused(output: &Output, words: &str) {
    ends_with(2, output);
    assert!(said(output).contains(words), "{}", said(output));
}

#[test]
fn a_motor_behind_the_registers_of_the_converter_is_inspected_moved_and_zeroed() {
    let converter = Device::new("hollow-modbus", &[]);
    assert_eq!(result(&converter.motor(&["info"]))["temperature_c"], 30.0);
    let moved = result(&converter.motor(&["move", "absolute", "20 deg"]));
    let degrees = moved["position"].as_f64().unwrap().to_degrees();
    assert!((degrees - 20.0).abs() < 1.0 && moved["state"] == "stopped", "{moved}");
    assert_eq!(result(&converter.motor(&["zero", "--yes"]))["after_counts"], 0);
    is_refused(&converter.motor(&["gains", "--velocity-kp", "2"]), "does not carry the frames");
    let output = converter.motor(&["--node", "9", "info"]);
    ends_with(2, &output);
}

#[test]
fn a_motor_that_no_register_belongs_to_is_silent() {
    let converter = Device::new("hollow-modbus", &[]);
    let output = converter.drive(
        "hollow-can-fd",
        &[
            "--node",
            "9",
            "--set",
            "master_id=100",
            "--set",
            "torque_constant=0.23",
            "--set",
            "pole_pairs=14",
            "--set",
            "kp=1",
            "--set",
            "kd=1",
            "info",
        ],
    );
    ends_with(1, &output);
    assert!(json(&output)["failure"].as_str().unwrap().contains("no reply"), "{}", said(&output));
}

#[test]
fn another_bit_rate_than_that_of_the_line_is_refused() {
    let output = takt(&["--family", "hollow-console", "--bus", "serial:/dev/ttyUSB0", "info", "--json"]);
    is_refused(&output, "19200 baud");
}

#[test]
fn the_console_shows_its_parameters_and_takes_those_that_are_open() {
    let console = Device::new("hollow-console", &[]);
    let info = result(&console.drive("hollow-console", &["info"]));
    assert_eq!(
        (&info["can_id"], &info["master_id"], &info["pmax"]),
        (&1.0.into(), &100.0.into(), &1.0.into())
    );
    let read = result(&console.drive("hollow-console", &["read", "position loop gain", "h"]));
    assert_eq!(read["objects"][0]["value"], 20.0);
    assert_eq!(
        result(&console.drive("hollow-console", &["write", "position loop gain", "30"]))["read_back"],
        30
    );
    assert_eq!(result(&console.drive("hollow-console", &["read", "c"]))["objects"][0]["value"], 30.0);
    assert_eq!(result(&console.drive("hollow-console", &["set-id", "7"]))["read_back"], 7);
    is_refused(&console.drive("hollow-console", &["write", "a", "99"]), "100 to 2000");
    is_refused(&console.drive("hollow-console", &["write", "b", "1"]), "not open to users");
    is_refused(&console.drive("hollow-console", &["read", "x"]), "no entry of the console");
    is_refused(&console.drive("hollow-console", &["velocity", "1 rad/s"]), "without limits");
    is_refused(&console.drive("hollow-console", &["watch"]), "neither position nor velocity");
}

#[test]
fn the_pins_for_encoder_pulses_are_set_on_the_console() {
    let console = Device::new("hollow-console", &[]);
    assert_eq!(result(&console.drive("hollow-console", &["write", "STEP_CONFIG", "90"]))["read_back"], 90);
    is_refused(&console.drive("hollow-console", &["write", "STEP_CONFIG", "361"]), "STEP_CONFIG cannot be");
}

#[test]
fn a_zero_point_needs_consent_and_is_not_kept_near_that_of_the_factory() {
    let console = Device::new("hollow-console", &[]);
    is_refused(&console.drive("hollow-console", &["zero"]), "becomes the zero point");
    // The simulated motor stands at the zero of the factory.
    let output = console.drive("hollow-console", &["zero", "--yes"]);
    ends_with(1, &output);
    assert!(said(&output).contains("5 to 355 degrees"), "{}", said(&output));
    assert_eq!(
        result(&console.drive("hollow-console", &["write", "zero point", "factory"]))["read_back"],
        0.0
    );
    assert_eq!(result(&console.drive("hollow-console", &["mode", "velocity"]))["mode"], "velocity");
}

#[test]
fn a_console_with_disturbed_lines_is_asked_again_and_a_silent_one_is_named() {
    let console = Device::new("hollow-console", &["disturbed=400"]);
    assert_eq!(result(&console.drive("hollow-console", &["info"]))["pmax"], 1.0);
    let silent = Device::new("hollow-console", &["silent=0"]);
    let output = silent.drive("hollow-console", &["info"]);
    ends_with(1, &output);
    assert!(said(&output).contains("does not answer"), "{}", said(&output));
}

#[test]
fn the_entries_of_the_console_are_listed_with_their_ranges() {
    let output = takt(&["--family", "hollow-console", "entries", "loop"]);
    ends_with(0, &output);
    for words in ["a         current loop bandwidth (read, write)", "100 to 2000"] {
        assert!(said(&output).contains(words), "{}", said(&output));
    }
}

#[test]
fn the_hollow_encoder_is_read_and_watched() {
    let encoder = Device::new("hollow-encoder", &["disturbed=60"]);
    let info = result(&encoder.drive("hollow-encoder", &["info"]));
    assert_eq!(info["position_counts"], 678_257);
    assert!((info["angle"].as_f64().unwrap().to_degrees() - 232.861).abs() < 1e-3, "{info}");
    let output = encoder.drive("hollow-encoder", &["watch", "--interval", "0.02", "--duration", "0.3"]);
    ends_with(0, &output);
    let readings: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(readings.len() > 1 && readings.iter().all(|reading| reading["position_counts"] == 678_257));
    is_refused(&encoder.drive("hollow-encoder", &["disable"]), "only read");
}

#[test]
fn the_stiffness_frame_of_the_pulse_module_is_that_of_the_manual() {
    let mut line = PseudoTerminal::open().unwrap();
    let bus = format!("serial:{}@19200", line.path().display());
    let output =
        takt(&["--family", "hollow-pulse", "--bus", &bus, "gains", "--stiffness", "16", "--damping", "16"]);
    ends_with(0, &output);
    assert!(errors(&output).contains("contradicts itself"), "{}", errors(&output));
    let mut bytes = [0; 16];
    let count = line.read(&mut bytes).unwrap();
    assert_eq!(bytes[..count], [1, 1, 0x10, 0x10, 0, 0]);
    let output = takt(&["--family", "hollow-pulse", "--bus", &bus, "--json", "info"]);
    is_refused(&output, "stiffness settings alone");
}

#[test]
fn a_pulse_at_the_pwm_input_is_calculated_by_the_table_of_its_model() {
    let pulse = |arguments: &[&str]| {
        takt(&[&["--family", "hollow-can", "--json", "pulse-width"], arguments].concat())
    };
    let width = |arguments: &[&str]| json(&pulse(arguments))["width_us"].as_f64().unwrap();
    assert_eq!(width(&["HO6213", "--position", "1 turn"]), 2_000.0);
    assert_eq!(width(&["ho6213", "--velocity", "90"]), 2_000.0);
    assert_eq!(width(&["HO7213 high speed", "--velocity", "-20"]), 1_450.0);
    assert_eq!(width(&["HO10010", "--current", "0"]), 1_500.0);
    let means = json(&pulse(&["HO6213", "--width", "2000"]));
    assert_eq!((&means["velocity_hz"], &means["current_a"]), (&90.0.into(), &3.71.into()));
    for (arguments, words) in [
        (vec!["HO6213", "--velocity", "5"], "out of range"),
        (vec!["HO1", "--width", "1500"], "HO10025"),
        (vec!["HO6213", "--width", "900"], "1000 to 2000"),
    ] {
        let output = pulse(&arguments);
        ends_with(2, &output);
        assert!(said(&output).contains(words), "{}", said(&output));
    }
    let output = takt(&["--family", "erob-can", "pulse-width", "HO6213", "--width", "1500"]);
    ends_with(2, &output);
}
