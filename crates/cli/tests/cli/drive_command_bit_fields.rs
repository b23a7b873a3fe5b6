//! `takt drive` with drives of bit fields (hollow-shaft motors, and any drive with a description), as a user meets it.

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

fn of_axis(config: &str, axis: &str, option: &[&str], arguments: &[&str]) -> Command {
    let config = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs").join(config);
    takt(&[&[config.to_str().unwrap(), axis], option, arguments].concat())
}

/// The axes of the shipped configurations: classic CAN in normal and in extended mode, and CAN FD.
const PAN: (&str, &str) = ("hollow-arm.toml", "pan");
const SPINDLE: (&str, &str) = ("hollow-arm.toml", "spindle");
const HIP: (&str, &str) = ("hollow-leg-fd.toml", "hip");

fn drive((config, axis): (&str, &str), arguments: &[&str]) -> Output {
    of_axis(config, axis, &["--fast"], arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = said(output);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

#[track_caller]
fn result(axis: (&str, &str), arguments: &[&str]) -> Value {
    let output = drive(axis, &[arguments, &["--json"]].concat());
    ends_with(0, &output);
    json(&output)["result"].clone()
}

#[track_caller]
fn degrees(result: &Value) -> f64 {
    result["position"].as_f64().unwrap().to_degrees()
}

/// A refusal says so on standard error, names what is wrong, and does nothing.
#[track_caller]
fn is_refused(axis: (&str, &str), arguments: &[&str], words: &str) {
    let output = drive(axis, arguments);
    ends_with(2, &output);
    assert!(errors(&output).contains(words), "{}", errors(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn info_shows_what_a_reply_has_and_says_that_asking_takes_the_torque_away() {
    for (axis, words) in [
        (PAN, &["CAN normal mode", "reply identifier", "0x065"][..]),
        (SPINDLE, &["CAN extended mode", "0x066"]),
        (HIP, &["CAN FD", "temperature       30 °C", "error             none", "mode              position"]),
    ] {
        let output = drive(axis, &["info"]);
        ends_with(0, &output);
        for words in words {
            assert!(said(&output).contains(words), "{words}: {}", said(&output));
        }
        assert!(errors(&output).contains("no request that only reads"), "{}", errors(&output));
    }
}

#[test]
fn watch_shows_a_reading_in_each_interval() {
    let output = drive(HIP, &["watch", "--interval", "0.05", "--duration", "0.4", "--json"]);
    ends_with(0, &output);
    let readings: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(readings.len() > 4, "{readings:?}");
    assert!(readings.iter().all(|reading| reading["state"] == "stopped"), "{readings:?}");
    assert!(readings.iter().all(|reading| reading["temperature_c"] == 30.0), "{readings:?}");
}

#[test]
fn watch_shows_the_temperature_in_a_column_where_the_drive_reports_it() {
    for (axis, has_temperature) in [(HIP, true), (PAN, false)] {
        let output = drive(axis, &["watch", "--interval", "0.05", "--duration", "0.2"]);
        ends_with(0, &output);
        let columns: Vec<Option<usize>> = said(&output)
            .lines()
            .filter(|line| line.contains("rad/s"))
            .map(|line| line.find("30 °C"))
            .collect();
        assert!(columns.len() > 2 && columns.windows(2).all(|pair| pair[0] == pair[1]), "{}", said(&output));
        assert_eq!(columns[0].is_some(), has_temperature, "{}", said(&output));
    }
}

#[test]
fn every_motion_ends_where_it_should_and_without_torque() {
    for axis in [PAN, SPINDLE] {
        for (arguments, expected) in [
            (vec!["move", "absolute", "-12 deg", "--velocity", "60 deg/s"], -12.0),
            (vec!["move", "relative", "20 deg"], 20.0),
            (vec!["move", "reciprocate", "5 deg", "--times", "2", "--dwell", "0.05"], 0.0),
        ] {
            let result = result(axis, &arguments);
            assert!((degrees(&result) - expected).abs() < 1.0, "{axis:?}: {result}");
            assert_eq!(result["state"], "stopped", "{arguments:?}");
        }
    }
    for axis in [PAN, SPINDLE, HIP] {
        for arguments in [
            vec!["move", "continuous", "backward", "--duration", "0.5"],
            vec!["velocity", "-10 deg/s", "--duration", "0.5"],
            vec!["torque", "-0.2 Nm", "--duration", "0.3", "--max-velocity", "2 rad/s"],
        ] {
            let result = result(axis, &arguments);
            assert!(result["travelled"].as_f64().unwrap() < -0.01, "{axis:?} {arguments:?}: {result}");
            assert_eq!(result["state"], "stopped", "{arguments:?}");
        }
        for arguments in [vec!["enable", "--duration", "0.2"], vec!["disable"]] {
            assert_eq!(result(axis, &arguments)["state"], "stopped", "{axis:?} {arguments:?}");
        }
    }
    assert_eq!(result(PAN, &["enable", "--keep-enabled"])["state"], "running");
}

#[test]
fn what_is_beyond_the_limits_is_refused_before_the_first_frame() {
    is_refused(PAN, &["move", "absolute", "171 deg"], "lies outside the limits of the axis");
    is_refused(PAN, &["move", "absolute", "1 deg", "--velocity", "3 rad/s"], "lies outside the limits");
    is_refused(PAN, &["velocity", "3 rad/s"], "lies outside the limits");
    is_refused(PAN, &["torque", "2.5 Nm"], "lies outside the limits");
    is_refused(PAN, &["torque", "100", "--raw"], "has a unit");
    // That leg is led by torques in the cycle, and its configuration has no gains for positions.
    is_refused(HIP, &["move", "absolute", "1 deg"], "`kp` and `kd` of the axis must be given");
    let output = drive(PAN, &["move", "relative", "179 deg"]);
    ends_with(2, &output);
    assert!(errors(&output).contains("lies outside the limits"), "{}", errors(&output));
}

#[test]
fn what_the_protocol_lacks_is_refused_by_its_name() {
    for (arguments, words) in [
        (vec!["home"], "the protocol has no homing"),
        (vec!["save"], "keeps nothing that is set over this protocol"),
        (vec!["set-id", "3"], "sets neither ID nor bit rate"),
        (vec!["scan"], "no request that only reads"),
        (vec!["read", "6064"], "has no entries"),
        (vec!["clear-fault"], "no frame that clears a fault"),
        (vec!["gains"], "the gains of the position loop go with each command"),
        (vec!["release-brake"], "knows no brake"),
    ] {
        is_refused(PAN, &arguments, words);
    }
}

#[test]
fn zero_needs_consent_and_makes_the_present_position_zero() {
    is_refused(PAN, &["zero"], "COUNT OF TURNS IS CLEARED");
    for axis in [PAN, SPINDLE, HIP] {
        let zeroed = result(axis, &["zero", "--yes"]);
        assert_eq!(zeroed["after_counts"], 0, "{axis:?}");
    }
}

#[test]
fn the_gain_frames_are_those_of_the_manual() {
    let output = drive(SPINDLE, &["gains", "--velocity-kp", "1", "--current-ki", "0.5", "--verbose"]);
    ends_with(0, &output);
    for words in ["> 00000002#00013F8000000000", "> 00000002#00043F0000000000", "> 00000002#0000000000000000"]
    {
        assert!(errors(&output).contains(words), "{words}: {}", errors(&output));
    }
    assert!(said(&output).contains("velocity_loop_kp  the preset gain times 1"), "{}", said(&output));
    is_refused(PAN, &["gains", "--velocity-kp=-1"], "cannot be multiplied by -1");
}

#[test]
fn the_mode_is_told_without_torque_and_shown_where_the_motor_shows_it() {
    assert_eq!(result(HIP, &["mode", "velocity"])["mode"], "velocity");
    let output = drive(PAN, &["mode", "torque", "--verbose"]);
    ends_with(0, &output);
    assert!(errors(&output).contains("#FFFFFFFFFFFFFFF9"), "{}", errors(&output));
    assert!(errors(&output).contains("does not show its mode"), "{}", errors(&output));
    let output = of_axis("damiao-arm.toml", "shoulder", &["--fast"], &["mode", "torque"]).output().unwrap();
    ends_with(2, &output);
}

#[test]
fn a_drive_without_a_configuration_is_known_by_keys() {
    let keys =
        |keys: &[&'static str]| -> Vec<&'static str> { keys.iter().flat_map(|key| ["--set", key]).collect() };
    let target = ["--bus", "sim", "--node", "7", "--family", "hollow-can", "--fast"];
    let known = keys(&[
        "master_id=0x67",
        "velocity_full_scale=58.6 rad/s",
        "current_full_scale=10",
        "torque_constant=0.23",
        "position_full_scale=1 turn",
        "kp=2000",
        "kd=500",
    ]);
    let limits = keys(&[
        "limits.position=[\"-90 deg\", \"90 deg\"]",
        "limits.velocity=2 rad/s",
        "limits.acceleration=8 rad/s^2",
        "limits.torque=2 Nm",
    ]);
    let output = takt(&[&target[..], &known, &["info", "--json"]].concat()).output().unwrap();
    ends_with(0, &output);
    assert_eq!(json(&output)["result"]["motor_id"], 7);
    // Without limits nothing moves.
    let output = takt(&[&target[..], &known, &["velocity", "0.1 rad/s"]].concat()).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("the limits of the axis"), "{}", errors(&output));
    let moves = ["move", "absolute", "10 deg", "--json"];
    let output = takt(&[&target[..], &known, &limits, &moves].concat()).output().unwrap();
    ends_with(0, &output);
    assert!((degrees(&json(&output)["result"]) - 10.0).abs() < 1.0);
    // A key that is missing is named.
    let output = takt(&[&target[..], &known[2..], &["info"]].concat()).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("master_id"), "{}", errors(&output));
}

#[test]
fn a_described_drive_of_another_make_is_moved_too() {
    let output = of_axis("damiao-arm.toml", "shoulder", &["--fast"], &["info"]).output().unwrap();
    ends_with(0, &output);
    assert!(said(&output).contains("Damiao"), "{}", said(&output));
}

#[test]
fn a_silent_motor_is_named_with_what_to_check() {
    let output = drive(PAN, &["--node", "9", "info"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("node 9 does not answer"), "{}", errors(&output));
}

#[test]
fn ctrl_c_stops_the_joint_in_control_and_ends_with_130() {
    let mut command = of_axis(PAN.0, PAN.1, &[], &["velocity", "20 deg/s", "--json"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_secs(3));
    kill(Pid::from_raw(child.id().cast_signed()), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    ends_with(130, &output);
    let ended = json(&output);
    assert_eq!((&ended["ended"], &ended["step"]), (&"interrupted".into(), &"run".into()), "{ended}");
    assert!(ended["notes"][0].as_str().unwrap().contains("stopped"), "{ended}");
}
