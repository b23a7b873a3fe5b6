//! `takt scan` as a user meets it: simulated drives behind an adapter, and on a serial line.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

use crate::printed::{ends_with, errors, said};
use crate::simulated::Simulated;

fn takt(subcommand: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg(subcommand).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command.env_remove("COLUMNS").env_remove("NO_COLOR");
    command
}

fn scan(arguments: &[&str]) -> Output {
    takt("scan").args(arguments).output().unwrap()
}

fn adapter(simulated: &Simulated) -> String {
    format!("slcan:{}", simulated.path.display())
}

fn serial(simulated: &Simulated) -> String {
    format!("serial:{}", simulated.path.display())
}

#[test]
fn the_drive_of_the_first_configuration_is_found_in_every_width() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    for columns in [None, Some("60"), Some("80"), Some("200")] {
        let mut command = takt("scan");
        command.args(["--bus", &adapter(&simulated), "--to", "8"]).env("NO_COLOR", "1");
        if let Some(columns) = columns {
            command.env("COLUMNS", columns);
        }
        let output = command.output().unwrap();
        ends_with(0, &output);
        let text = said(&output);
        for words in ["1 device", "servo drive (CiA 402)", "ZeroErr", "CANopen SDO", "\"erob-canopen\""] {
            assert!(text.contains(words), "{columns:?}: {words}: {text}");
        }
        let width: usize = columns.map_or(usize::MAX, |columns| columns.parse().unwrap());
        // The name of the interface is as long as its path.
        let too_long = text.lines().skip(1).find(|line| line.chars().count() > width);
        assert_eq!(too_long, None, "{columns:?}");
        assert!(!text.contains('\u{1b}') && errors(&output).is_empty(), "{}", errors(&output));
    }
}

#[test]
fn what_was_found_is_an_object_and_a_configuration_that_check_accepts() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let output = scan(&["--bus", &adapter(&simulated), "--to", "8", "--json"]);
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!((&object["ended"], &object["buses"][0]["devices"][0]["node"]), (&"done".into(), &1.into()));
    assert_eq!(object["buses"][0]["devices"][0]["identity"]["vendor"], 0x5A65_726F);
    let output = scan(&["--bus", &adapter(&simulated), "--to", "8", "--config"]);
    ends_with(0, &output);
    let file = simulated.path.with_file_name("found.toml");
    fs::write(&file, said(&output)).unwrap();
    let checked = takt("check").arg(&file).output().unwrap();
    ends_with(0, &checked);
    assert!(said(&output).contains("# YOURS"), "{}", said(&output));
}

#[test]
fn motors_with_registers_become_a_configuration_that_drives_them() {
    let simulated = Simulated::new(&["../../configs/damiao-arm.toml"]);
    let output = scan(&["--bus", &adapter(&simulated), "--to", "8", "--config"]);
    ends_with(0, &output);
    let text = said(&output);
    for words in ["damiao-dm-mit", "master_id = 0x012", "position_full_scale = \"12.5 rad\"", "# YOURS"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let file = simulated.path.with_file_name("found.toml");
    // What only the owner of the machine knows.
    let joint =
        "inertia = \"0.03 kg m^2\", viscous_friction = \"0.05 Nm s/rad\", coulomb_friction = \"0.1 Nm\"";
    let text = text.replace("kd = 1.5", &format!("joint = {{ {joint} }}\nkd = 1.5"));
    let program = "\n[[program.move]]\nto = [\"20 deg\", \"-20 deg\", \"10 deg\"]\n";
    fs::write(&file, text + program).unwrap();
    let checked = takt("check").arg(&file).output().unwrap();
    ends_with(0, &checked);
    let run = takt("run").arg(&file).args(["--bus", "bus=sim", "--json"]).output().unwrap();
    ends_with(0, &run);
    let report: Value = serde_json::from_str(&said(&run)).unwrap();
    for (axis, degrees) in [20.0f64, -20.0, 10.0].into_iter().enumerate() {
        let reached = report["axes"][axis]["final_position"].as_f64().unwrap();
        assert!((reached - degrees.to_radians()).abs() < 0.03, "{report}");
    }
}

#[test]
fn slaves_on_a_serial_line_are_found_at_the_bit_rate_that_is_theirs() {
    let simulated = Simulated::new(&["--serial", "erob-modbus:2,5"]);
    let output = scan(&["--bus", &serial(&simulated), "--to", "6", "--json"]);
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    let devices = object["buses"][0]["devices"].as_array().unwrap();
    let found: Vec<_> =
        devices.iter().map(|device| (device["node"].clone(), device["drive"].clone())).collect();
    assert_eq!(found, [(2.into(), "erob-modbus".into()), (5.into(), "erob-modbus".into())]);
}

#[test]
fn a_motor_behind_the_converter_is_read_and_not_commanded() {
    let simulated = Simulated::new(&["--serial", "hollow-modbus"]);
    let output = scan(&["--bus", &format!("{}@19200", serial(&simulated)), "--to", "2", "--json"]);
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(object["buses"][0]["devices"][0]["drive"], "hollow-can-fd", "{object}");
}

#[test]
fn ctrl_c_in_the_middle_shows_what_has_been_found() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let mut command = takt("scan");
    command.args(["--bus", &adapter(&simulated), "--listen-for", "60 s", "--verbose"]);
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The identity of the drive has been read when its firmware is asked for.
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
    let has_read = lines.any(|line| line.unwrap().contains("601#400A10"));
    assert!(has_read);
    thread::sleep(Duration::from_millis(300));
    kill(Pid::from_raw(process.id().cast_signed()), Signal::SIGINT).unwrap();
    // Or the pipe is full before the process ends.
    lines.for_each(drop);
    let output = process.wait_with_output().unwrap();
    ends_with(130, &output);
    let text = said(&output);
    assert!(text.contains("1 device") && text.contains("interrupted: this is what had been found"), "{text}");
}

#[test]
fn a_bus_that_another_takt_commands_is_not_scanned() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let interface = adapter(&simulated);
    let mut watch = takt("drive")
        .args(["--bus", &interface, "--node", "1", "--family", "erob-canopen", "watch"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(watch.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let output = scan(&["--bus", &interface]);
    let listening = scan(&["--bus", &interface, "--listen"]);
    let monitor = takt("monitor").args(["--bus", &interface, "--duration", "1"]).output().unwrap();
    watch.kill().unwrap();
    watch.wait().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("has a master already"), "{}", errors(&output));
    for refused in [listening, monitor] {
        ends_with(2, &refused);
        assert!(errors(&refused).contains("one program"), "{}", errors(&refused));
    }
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let takt = env!("CARGO_BIN_EXE_takt");
    let line = format!("{takt} scan --bus {} --to 4 | head -1; echo ${{PIPESTATUS[0]}}", adapter(&simulated));
    let output = Command::new("bash").args(["-c", &line]).output().unwrap();
    let text = said(&output);
    assert_eq!(text.lines().last(), Some("0"), "{text}{}", errors(&output));
    assert!(!errors(&output).contains("panicked"), "{}", errors(&output));
}

#[test]
fn what_is_no_bus_is_named_before_anything_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().display();
    for (arguments, words) in [
        (vec!["--bus", "takt-none"], "there is no interface takt-none"),
        (vec!["--bus", "sim"], "--pty"),
        (vec!["--bus", "slcan:/dev/takt-none"], "takt-none"),
        (vec!["--bus", &format!("slcan:{folder}")], "is no serial line"),
        (vec!["--bus", &format!("serial:{folder}")], "is no serial line"),
        (vec!["--bus", "can0", "--from", "9", "--to", "3"], "--from 9 is above --to 3"),
        (vec!["--bus", "can0", "--to", "200"], "node IDs are 1 to 127"),
        (vec!["--bus", "can0", "--line-rate", "19200"], "--bit-rate"),
        (vec!["--bus", "can0", "--eds", "."], "--eds ."),
        (vec!["--bus", "serial:/dev/ttyUSB0", "--listen"], "say nothing unless they are asked"),
    ] {
        let output = scan(&arguments);
        ends_with(2, &output);
        assert!(errors(&output).contains(words), "{arguments:?}: {}", errors(&output));
    }
}

#[test]
fn the_help_says_who_is_only_listened_for() {
    let output = scan(&["--help"]);
    ends_with(0, &output);
    let text = said(&output);
    assert!(text.contains("nothing moves, and nothing is written to a drive"), "{text}");
    assert!(text.contains("motor commands on CAN: a motor that has torque loses it"), "{text}");
}

#[test]
fn a_scan_on_an_interface_that_goes_fails_and_says_so() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let arguments = ["--bus", &adapter(&simulated), "--to", "2", "--listen-for", "4 s"];
    let mut command = takt("scan");
    let scan = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_millis(1_500));
    drop(simulated);
    let output = scan.wait_with_output().unwrap();
    ends_with(1, &output);
    assert!(said(&output).contains("the interface went down"), "{}", said(&output));
}
