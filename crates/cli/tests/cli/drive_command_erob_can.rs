//! `takt drive` with an eRob that speaks its own CAN protocol, as a user meets it.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

use crate::printed::{ends_with, errors, said};

fn takt(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("drive").args(arguments).stdin(Stdio::null());
    command
}

fn of_configuration(option: &[&str], arguments: &[&str]) -> Command {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/turntable-erob-can.toml");
    takt(&[&[config.to_str().unwrap()], option, arguments].concat())
}

/// On the joint of the configuration, in simulated time.
fn drive(arguments: &[&str]) -> Output {
    of_configuration(&["--fast"], arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = said(output);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

#[track_caller]
fn result(arguments: &[&str]) -> Value {
    let output = drive(&[arguments, &["--json"]].concat());
    ends_with(0, &output);
    json(&output)["result"].clone()
}

/// A refusal says so on standard error, names what is wrong, and does nothing.
#[track_caller]
fn is_refused(arguments: &[&str], words: &str) {
    let output = drive(arguments);
    ends_with(2, &output);
    assert!(errors(&output).contains(words), "{}", errors(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn info_decodes_what_the_module_tells_of_itself() {
    let output = drive(&["info"]);
    ends_with(0, &output);
    for words in
        ["model number             eRob80H120I-BM-18CN", "operating mode           3 (position control)"]
    {
        assert!(said(&output).contains(words), "{}", said(&output));
    }
    let info = result(&["info"]);
    assert_eq!((&info["serial_number"], &info["error_code"]), (&"08000001001".into(), &0.into()));
}

#[test]
fn a_scan_finds_the_drives_without_a_node_id() {
    let output = drive(&["scan"]);
    ends_with(0, &output);
    assert_eq!(said(&output), "  node 1  eRob with its own protocol, firmware 520212171\n");
    assert_eq!(result(&["scan"])["nodes"], serde_json::json!([1]));
}

#[test]
fn entries_are_read_and_written_by_name_with_their_units_and_words() {
    let objects = result(&["read", "0x0002", "operating mode", "actual motor"]);
    let objects = objects["objects"].as_array().unwrap().clone();
    assert_eq!(objects[1]["meaning"], "position control");
    assert_eq!(objects[2]["object"], "0x0008");
    assert_eq!(result(&["write", "profile velocity", "36 deg/s"])["read_back"], 52_429);
    assert_eq!(result(&["write", "8A", "0x100", "--raw"])["read_back"], 256);
    assert_eq!(result(&["write", "operating mode", "torque control"])["read_back"], 1);
    is_refused(&["read", "no such name"], "is no entry");
    is_refused(&["read", "start motion"], "it is a command");
    is_refused(&["write", "profile velocity", "20"], "has no unit");
    is_refused(&["write", "CAN address", "65"], "it takes 1 to 64");
    is_refused(&["write", "error code", "0"], "can only be read");
    let output = drive(&["read", "0x0777"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("reading 0x0777: refused"), "{}", errors(&output));
}

#[test]
fn the_entries_are_listed_without_a_bus_in_80_columns() {
    let output = takt(&["--family", "erob-can", "entries"]).output().unwrap();
    ends_with(0, &output);
    let longest = said(&output).lines().map(|line| line.chars().count()).max().unwrap();
    assert!(longest <= 80, "{longest}");
    assert!(said(&output).contains("1 (torque control), 2 (velocity control), 3 (position control)"));
    let output = takt(&["--family", "erob-can", "entries", "brake", "--json"]).output().unwrap();
    assert_eq!(json(&output)["entries"][0]["address"], "0x014F");
    let output = takt(&["--family", "erob-canopen", "entries", "profile velocity"]).output().unwrap();
    assert!(said(&output).contains("6081:00   profile velocity (read, write"), "{}", said(&output));
}

#[test]
fn every_motion_ends_where_it_should_and_without_torque() {
    for (arguments, degrees) in [
        (vec!["move", "absolute", "-12 deg", "--velocity", "60 deg/s"], -12.0),
        (vec!["move", "relative", "-5 deg"], -5.0),
        (vec!["move", "relative", "-14564", "--raw"], -10.0),
        (vec!["move", "reciprocate", "5 deg", "--times", "2", "--dwell", "0.05"], 0.0),
    ] {
        let result = result(&arguments);
        assert!((result["position"].as_f64().unwrap().to_degrees() - degrees).abs() < 0.05, "{result}");
        assert_eq!(result["state"], "motor off", "{arguments:?}");
    }
    for arguments in [
        vec!["move", "continuous", "backward", "--duration", "0.5"],
        vec!["velocity", "-20 deg/s", "--duration", "0.5"],
        vec!["torque", "-5 Nm", "--duration", "0.5"],
        vec!["torque", "-1000", "--raw", "--duration", "0.5", "--max-velocity", "30000"],
    ] {
        let result = result(&arguments);
        assert!(result["travelled"].as_f64().unwrap() < -0.01, "{result}");
        assert_eq!(result["state"], "motor off", "{arguments:?}");
    }
    for arguments in [vec!["enable", "--duration", "0.2"], vec!["disable"], vec!["clear-fault"]] {
        ends_with(0, &drive(&arguments));
    }
    assert_ne!(result(&["enable", "--keep-enabled"])["state"], "motor off");
}

#[test]
fn what_is_beyond_the_limits_or_the_protocol_is_refused_with_what_to_do() {
    is_refused(&["move", "absolute", "171 deg"], "lies outside the limits of the axis");
    is_refused(&["move", "absolute", "1 deg", "--velocity", "61 deg/s"], "lies outside the limits");
    is_refused(&["torque", "32 Nm"], "lies outside the limits");
    is_refused(&["home"], "has no homing; its encoder is absolute");
    is_refused(&["gains"], "`read` and `write` them");
    is_refused(&["set-id", "65"], "a node ID from 1 to 64");
    let output = takt(&["--bus", "sim", "--node", "1", "--family", "erob-can", "info"]).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("needs a configuration"), "{}", errors(&output));
}

#[test]
fn what_cannot_be_undone_needs_consent_and_says_what_it_causes() {
    is_refused(&["zero"], "WIPES THE COUNT OF TURNS");
    is_refused(&["release-brake"], "nothing holds the joint");
    let zeroed = result(&["zero", "--yes"]);
    assert_eq!(zeroed["after_counts"], 0);
    assert_eq!(result(&["set-id", "5"])["node"], 5);
    assert_eq!(result(&["save"])["saved"], true);
}

#[test]
fn verbose_shows_requests_and_replies_with_their_meaning() {
    let output = drive(&["read", "profile velocity", "--verbose"]);
    ends_with(0, &output);
    for words in [
        "> 641#008A               read profile velocity (0x008A)",
        "< 5C1#000015BE3E         profile velocity (0x008A) is 5566 count/s = ",
    ] {
        assert!(errors(&output).contains(words), "{}", errors(&output));
    }
}

#[test]
fn a_silent_node_is_named_with_what_to_check() {
    let output = drive(&["--node", "9", "info"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("node 9 does not answer"), "{}", errors(&output));
    // That configuration has CANopen firmware on its node 1.
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let output = takt(&[config.to_str().unwrap(), "--family", "erob-can", "info"]).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("is configured as erob-canopen, not erob-can"), "{}", errors(&output));
}

#[test]
fn ctrl_c_stops_the_joint_disables_it_and_ends_with_130() {
    let mut command = of_configuration(&[], &["move", "continuous", "forward", "--json"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_secs(3));
    kill(Pid::from_raw(child.id().cast_signed()), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    ends_with(130, &output);
    let ended = json(&output);
    assert_eq!((&ended["ended"], &ended["step"]), (&"interrupted".into(), &"move".into()), "{ended}");
}
