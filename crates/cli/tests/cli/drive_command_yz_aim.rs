//! `takt drive` on a YZ-AIM as a user meets it: every action, in simulated time.

use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::printed::{ends_with, errors, said};

/// A servo on a ball screw of 10 mm.
const SERVO: &str = r#"
name = "one"
[[bus]]
name = "can"
period = "2 ms"
[[axis]]
name = "x"
bus = "can"
node = 1
drive = "yz-aim"
mode = "ip"
travel = "linear"
lead = "10 mm"
[axis.limits]
position = ["0 mm", "800 mm"]
velocity = "0.15 m/s"
acceleration = "1 m/s^2"
torque = "300 N"
"#;

fn drive(arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("servo.toml");
    std::fs::write(&config, SERVO).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("drive").arg(&config).args(["x", "--fast"]).args(arguments).stdin(Stdio::null());
    command.output().unwrap()
}

#[track_caller]
fn result(arguments: &[&str]) -> Value {
    let output = drive(&[arguments, &["--json"]].concat());
    ends_with(0, &output);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(object["ended"], "done");
    object["result"].clone()
}

#[track_caller]
fn is_refused(arguments: &[&str], words: &str) {
    let output = drive(arguments);
    ends_with(2, &output);
    assert!(errors(&output).contains(words), "{}", errors(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn it_is_looked_at() {
    assert!(said(&drive(&["info"])).contains("0x00000331"));
    let objects = result(&["read", "6064", "260E"])["objects"].clone();
    assert_eq!((&objects[0]["raw"], &objects[1]["meaning"]), (&0.into(), &"none".into()));
    assert_eq!(result(&["write", "6081", "0x100", "--raw"])["read_back"], 256);
    let output = drive(&["watch", "--duration", "0.3"]);
    ends_with(0, &output);
    assert!(said(&output).lines().count() >= 3, "{}", said(&output));
}

#[test]
fn every_motion_ends_where_it_should_and_without_torque() {
    for (arguments, millimetres) in [
        (vec!["move", "absolute", "20 mm", "--velocity", "100 mm/s"], 20.0),
        (vec!["move", "relative", "5 mm"], 5.0),
        (vec!["move", "relative", "32768", "--raw"], 10.0),
        (vec!["move", "reciprocate", "10 mm", "--times", "2"], 0.0),
        (vec!["home", "--method", "17"], 0.0),
    ] {
        let result = result(&arguments);
        let position = 1000.0 * result["position"].as_f64().unwrap();
        assert!((position - millimetres).abs() < 0.02, "{arguments:?}: {result}");
        assert!(result["state"].as_str().unwrap().starts_with("not enabled"), "{arguments:?}: {result}");
    }
    for arguments in [
        vec!["move", "continuous", "forward", "--duration", "0.5", "--velocity", "20 mm/s"],
        vec!["velocity", "20 mm/s", "--duration", "0.5"],
    ] {
        let result = result(&arguments);
        assert!((0.009..0.012).contains(&result["travelled"].as_f64().unwrap()), "{result}");
        assert!(result["state"].as_str().unwrap().starts_with("not enabled"), "{arguments:?}: {result}");
    }
    for arguments in [vec!["enable", "--duration", "0.2"], vec!["disable"]] {
        ends_with(0, &drive(&arguments));
    }
}

#[test]
fn it_is_set_up_and_stores_what_it_was_told() {
    ends_with(0, &drive(&["save"]));
    ends_with(0, &drive(&["zero", "--yes"]));
    assert!(said(&drive(&["clear-fault"])).contains("none, nothing to clear"));
    let output = drive(&["set-id", "9"]);
    ends_with(0, &output);
    assert!(
        errors(&output).contains("power-cycle the drive: until then it is node 1"),
        "{}",
        errors(&output)
    );
    let output = drive(&["set-bitrate", "500 kbit/s"]);
    ends_with(0, &output);
    assert!(said(&output).contains("500000 bit/s"), "{}", said(&output));
    assert!(errors(&output).contains("power-cycle the drive"), "{}", errors(&output));
}

#[test]
fn what_it_does_not_have_or_must_not_do_is_refused() {
    is_refused(&["torque", "2 N"], "a YZ-AIM has no torque mode");
    is_refused(&["move", "absolute", "900 mm"], "lies outside the limits of the axis");
    is_refused(&["home"], "--method must be given");
    is_refused(&["zero"], "--yes");
    is_refused(&["set-bitrate", "400 kbit/s"], "it has 1 Mbit/s, 500, 250 and 125 kbit/s");
}
