//! `takt drive` as a user meets it.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
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

/// On the joint of the smallest configuration, in simulated time.
fn drive(arguments: &[&str]) -> Output {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let mut all = vec![config.to_str().unwrap(), "joint", "--fast"];
    all.extend(arguments);
    takt(&all).output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
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
fn info_is_a_table_for_people_and_one_object_for_programs() {
    let output = drive(&["info"]);
    ends_with(0, &output);
    assert!(said(&output).contains("vendor ID        0x5A65726F"), "{}", said(&output));
    let output = drive(&["info", "--json"]);
    ends_with(0, &output);
    let object = json(&output);
    assert_eq!((&object["ended"], &object["action"]), (&"done".into(), &"info".into()));
    assert_eq!(object["result"]["rated_torque"], 31.0);
    assert!(output.stderr.is_empty());
}

#[test]
fn an_axis_may_be_left_out_where_there_is_only_one_and_is_asked_for_elsewhere() {
    let configs = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs");
    let of = |name: &str| configs.join(name).to_str().unwrap().to_owned();
    ends_with(0, &takt(&[&of("single-erob.toml"), "--fast", "info"]).output().unwrap());
    let output = takt(&[&of("arm6-erob.toml"), "--fast", "info"]).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("the axes are: joint1, joint2"), "{}", errors(&output));
    let output = takt(&[&of("arm6-erob.toml"), "joint5", "--fast", "info", "--json"]).output().unwrap();
    ends_with(0, &output);
    assert_eq!(json(&output)["axis"], "joint5");
}

#[test]
fn objects_are_read_by_address_and_name_and_written_with_units() {
    let output = drive(&["read", "1018:01", "position actual value", "--json"]);
    ends_with(0, &output);
    let objects = json(&output)["result"]["objects"].clone();
    assert_eq!((&objects[0]["raw"], &objects[1]["object"]), (&0x5A65_726F_u32.into(), &"6064:00".into()));
    let output = drive(&["write", "profile velocity", "36 deg/s", "--json"]);
    ends_with(0, &output);
    assert_eq!(json(&output)["result"]["read_back"], 52_429);
    let output = drive(&["write", "6081", "0x100", "--raw", "--json"]);
    assert_eq!(json(&output)["result"]["read_back"], 256);
}

#[test]
fn bad_objects_types_and_units_are_refused() {
    is_refused(&["read", "no such name"], "is no object");
    is_refused(&["write", "6081", "20 rad"], "`rad` is not the unit of an angular velocity");
    is_refused(&["write", "6081", "20"], "has no unit");
    is_refused(&["write", "6041", "1"], "can only be read");
    is_refused(&["write", "607A", "5000000000", "--raw"], "does not fit the 32 bits");
    is_refused(&["write", "5000:01", "1"], "say its type with --type");
    is_refused(&["write", "6060", "1", "--type", "u32"], "not what --type says");
    is_refused(&["move", "absolute", "45 furlong"], "`furlong` is not known");
    is_refused(&["move", "absolute", "1.5", "--raw"], "is no whole number");
    is_refused(&["set-bitrate", "12 bananas"], "is no bit rate");
    let output = drive(&["read", "5000:01"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("0x06020000 (object does not exist"), "{}", errors(&output));
    let output = drive(&["read", "6041", "--type", "u8"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("expected 1 bytes, got 2"), "{}", errors(&output));
}

#[test]
fn every_motion_ends_where_it_should_and_without_torque() {
    for (arguments, degrees) in [
        (vec!["move", "absolute", "-12 deg", "--velocity", "60 deg/s"], -12.0),
        (vec!["move", "relative", "-5 deg"], -5.0),
        (vec!["move", "relative", "-14564", "--raw"], -10.0),
        (vec!["move", "reciprocate", "5 deg", "--times", "2", "--dwell", "0.05"], 0.0),
    ] {
        let output = drive(&[&arguments[..], &["--json"]].concat());
        ends_with(0, &output);
        let result = json(&output)["result"].clone();
        assert!((result["position"].as_f64().unwrap().to_degrees() - degrees).abs() < 0.02, "{result}");
        assert_eq!(result["state"], "switch on disabled", "{arguments:?}");
    }
    for arguments in [
        vec!["move", "continuous", "backward", "--duration", "0.5"],
        vec!["velocity", "-20 deg/s", "--duration", "0.5"],
        vec!["torque", "-0.93 Nm", "--duration", "0.5"],
    ] {
        let output = drive(&[&arguments[..], &["--json"]].concat());
        ends_with(0, &output);
        let result = json(&output)["result"].clone();
        assert!(result["travelled"].as_f64().unwrap() < -0.01, "{result}");
        assert_eq!(result["state"], "switch on disabled", "{arguments:?}");
    }
    for arguments in [vec!["enable", "--duration", "0.2"], vec!["disable"]] {
        ends_with(0, &drive(&arguments));
    }
    let output = drive(&["enable", "--keep-enabled", "--json"]);
    assert_eq!(json(&output)["result"]["state"], "operation enabled");
    assert_eq!(json(&output)["notes"][0], "the axis stays enabled");
}

#[test]
fn what_is_beyond_the_limits_or_the_drive_is_refused() {
    is_refused(&["move", "absolute", "171 deg"], "lies outside the limits of the axis");
    is_refused(&["move", "absolute", "1 deg", "--velocity", "91 deg/s"], "lies outside the limits");
    is_refused(&["torque", "32 Nm"], "lies outside the limits");
    is_refused(&["home"], "does not declare homing");
    is_refused(&["zero"], "add --yes to do it");
    is_refused(&["set-id", "5"], "object 0043");
    is_refused(&["set-bitrate", "500 kbit/s"], "fixed at 1 Mbit/s");
    is_refused(&["gains"], "vendor's tool");
    let output = drive(&["move", "continuous", "forward", "--velocity", "80 deg/s"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("stopped at the limit of the axis"), "{}", errors(&output));
}

#[test]
fn upkeep_reports_what_it_has_done() {
    ends_with(0, &drive(&["save"]));
    ends_with(0, &drive(&["zero", "--yes"]));
    let output = drive(&["clear-fault"]);
    ends_with(0, &output);
    assert!(said(&output).contains("none, nothing to clear"), "{}", said(&output));
}

#[test]
fn verbose_shows_every_step_and_every_frame_with_its_meaning() {
    let output = drive(&["move", "absolute", "1 deg", "--verbose"]);
    ends_with(0, &output);
    let shown = errors(&output);
    for words in [
        "── set-point",
        "> 601#2F60600001000000   set 6060:00 (modes of operation) to 1: profile position",
        "> 601#2B4060001F000000   set 6040:00 (controlword) to 0x001F: enable operation, new set-point",
        "< 581#6040600000000000   6040:00 (controlword) accepted",
        "> 000#0101               start node 1",
        "< 701#00                 boot-up",
    ] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
}

#[test]
fn a_watch_prints_a_reading_at_a_time() {
    let output = drive(&["watch", "--duration", "0.5", "--interval", "0.1", "--json"]);
    ends_with(0, &output);
    let readings: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(readings.len(), 6);
    assert!(readings.iter().all(|reading| reading["state"] == "switch on disabled"));
}

#[test]
fn a_wrong_node_and_a_missing_interface_are_named() {
    let output = drive(&["--node", "9", "info"]);
    ends_with(1, &output);
    assert!(errors(&output).contains("node 9 does not answer"), "{}", errors(&output));
    let output = takt(&["--bus", "takt-none", "--node", "1", "--family", "yz-aim", "info"]).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("there is no interface takt-none"), "{}", errors(&output));
    let output = takt(&["--bus", "can0", "--node", "1", "info"]).output().unwrap();
    ends_with(2, &output);
    assert!(errors(&output).contains("--bus INTERFACE --node N --family FAMILY"), "{}", errors(&output));
    ends_with(2, &takt(&["--bus", "can0", "--node", "128", "--family", "yz-aim", "info"]).output().unwrap());
}

/// On a wall clock, so that there is time for a signal.
fn started(arguments: &[&str]) -> Child {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let all = [&[config.to_str().unwrap(), "joint"], arguments].concat();
    let child = takt(&all).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_secs(2));
    child
}

fn interrupted(child: Child) -> Output {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), Signal::SIGINT).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn ctrl_c_stops_the_axis_disables_it_and_ends_with_130() {
    let output = interrupted(started(&["velocity", "20 deg/s", "--keep-enabled", "--json"]));
    ends_with(130, &output);
    let object = json(&output);
    assert_eq!((&object["ended"], &object["step"]), (&"interrupted".into(), &"run".into()));
    let note = object["notes"][0].as_str().unwrap();
    assert!(note.ends_with("switch on disabled"), "{object}");
}

#[test]
fn ctrl_c_ends_a_watch() {
    let output = interrupted(started(&["watch"]));
    ends_with(130, &output);
    assert!(said(&output).lines().count() > 3, "{}", said(&output));
    assert!(output.stderr.is_empty(), "{}", errors(&output));
}

/// `takt drive … watch | head`
#[test]
fn a_watch_that_nobody_reads_any_more_ends() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let mut child = takt(&[config.to_str().unwrap(), "joint", "watch", "--interval", "0.01", "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut readings = BufReader::new(child.stdout.take().unwrap());
    let mut reading = String::new();
    readings.read_line(&mut reading).unwrap();
    assert!(reading.contains("position"), "{reading}");
    drop(readings);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn how_fast_has_no_direction() {
    for option in ["--velocity", "--acceleration", "--deceleration"] {
        let unit = if option == "--velocity" { "deg/s" } else { "deg/s^2" };
        is_refused(&["move", "absolute", "5 deg", option, &format!("-1 {unit}")], "is below zero");
    }
    is_refused(&["torque", "1 Nm", "--max-velocity", "-1 deg/s"], "is below zero");
}

#[test]
fn a_drive_of_any_maker_is_commissioned_by_its_configuration() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/three-drives.toml");
    let of = |arguments: &[&str]| {
        let all = [&[config.to_str().unwrap(), "shoulder", "--fast", "--json"], arguments].concat();
        takt(&all).output().unwrap()
    };
    let output = of(&["move", "absolute", "10 deg"]);
    ends_with(0, &output);
    assert!((json(&output)["result"]["position"].as_f64().unwrap().to_degrees() - 10.0).abs() < 0.1);
    ends_with(0, &of(&["save"]));
    let output = of(&["restore"]);
    ends_with(2, &output);
    assert!(json(&output)["failure"].as_str().unwrap().contains("add --yes to do it"), "{}", said(&output));
}

#[test]
fn a_drive_without_a_configuration_is_named_by_its_data_sheet() {
    let sheet =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/eds/vendors/schunk-lwa4p.eds");
    let sheet = sheet.to_str().unwrap();
    let of = |arguments: &[&str]| {
        takt(&[&["--bus", "nosuchcan", "--node", "3"], arguments].concat()).output().unwrap()
    };
    let output = of(&["--eds", sheet, "info"]);
    ends_with(2, &output);
    assert!(errors(&output).contains("--counts-per-turn"), "{}", errors(&output));
    // The interface is looked for only when everything is known of the drive.
    let output = of(&["--eds", sheet, "--counts-per-turn", "65536", "info"]);
    ends_with(2, &output);
    assert!(errors(&output).contains("nosuchcan"), "{}", errors(&output));
    let output = of(&["--family", "cia402", "info"]);
    ends_with(2, &output);
    assert!(errors(&output).contains("--eds FILE"), "{}", errors(&output));
}
