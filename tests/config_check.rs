//! `takt check` as a person or a script sees it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")
}

fn check(config: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(config).args(options).output().unwrap()
}

fn standard_output(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", standard_output(output)))
}

/// The arm with all of its axes on one bus.
fn six_on_one_bus(folder: &Path) -> PathBuf {
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    let path = folder.join("six.toml");
    std::fs::write(&path, arm.replace("bus = \"wrist\"", "bus = \"base\"")).unwrap();
    path
}

#[test]
fn a_configuration_that_fits_is_shown_with_limits_units_and_buses_and_exit_code_0() {
    let output = check(&configs().join("arm6-erob.toml"), &[]);
    let text = standard_output(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for part in [
        "arm6-erob: 6 axes on 2 buses",
        "-2.9671   2.9671",
        "83443.027 per rad",
        "199.6",
        "775 µs = 55 SYNC + 375 feedback + 345 set-points",
        "450 to 590              fits",
        "Every bus carries its traffic in the worst case.",
    ] {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
}

#[test]
fn a_script_reads_the_same_as_one_json_object() {
    let output = check(&configs().join("arm6-erob.toml"), &["--json"]);
    assert_eq!(output.status.code(), Some(0));
    let value = json(&output);
    assert_eq!(value["fits"], true);
    assert_eq!(value["axes"].as_array().map(Vec::len), Some(6));
    assert_eq!(value["axes"][3]["counts_range"][1], 7285.0);
    assert_eq!(value["buses"][1]["slot"]["set_points_done_ns"], 845_000);
}

#[test]
fn buses_that_cannot_carry_their_traffic_end_in_exit_code_2_and_what_would_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = six_on_one_bus(folder.path());
    let output = check(&path, &[]);
    let text = standard_output(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("1495 µs = 55 SYNC + 750 feedback + 690 set-points"), "{text}");
    assert!(text.contains("what would fit: 2 buses: 3 of these axes fit one"), "{text}");
    let output = check(&path, &["--json"]);
    assert_eq!((output.status.code(), &json(&output)["fits"]), (Some(2), &Value::Bool(false)));
}

#[test]
fn a_bad_configuration_ends_in_exit_code_2_and_its_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    std::fs::write(&path, "name = \"bad\"\n[cycle]\nperiod = \"1 m\"\n").unwrap();
    let output = check(&path, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(standard_output(&output).is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("period = \"1 m\"") && text.contains("`bus` is missing"), "{text}");

    let output = check(&path, &["--json"]);
    let value = json(&output);
    assert_eq!(output.status.code(), Some(2));
    let problems = value["problems"].as_array().unwrap();
    assert!(problems.iter().any(|problem| problem["line"] == 3), "{problems:?}");
    assert_eq!(problems.len(), 3);
}

#[test]
fn an_automatic_command_phase_is_shown_and_explained_where_there_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("auto.toml");
    let arm = std::fs::read_to_string(configs().join("arm6-erob.toml")).unwrap();
    let auto = arm.replace("command_phase = 0.5", "command_phase = \"auto\"");
    std::fs::write(&path, &auto).unwrap();
    let text = standard_output(&check(&path, &[]));
    assert!(text.contains("the command phase at 510 µs (as \"auto\" has it)"), "{text}");
    assert_eq!(json(&check(&path, &["--json"]))["command_phase_ns"], 510_000);

    std::fs::write(&path, auto.replace("bus = \"wrist\"", "bus = \"base\"")).unwrap();
    let output = check(&path, &["--json"]);
    assert_eq!(output.status.code(), Some(2));
    let problem = &json(&output)["problems"][0];
    assert_eq!(problem["message"], "no command phase suits every bus");
    let help = problem["help"].as_str().unwrap();
    assert!(help.contains("825 µs at the earliest") && help.contains("245 µs at the latest"), "{help}");
    assert!(help.contains("2 buses: 3 of these axes fit one"), "{help}");
}

#[test]
fn thirty_two_axes_that_are_alike_are_shown_once() {
    let text = standard_output(&check(&configs().join("axes32-erob.toml"), &[]));
    assert!(text.lines().count() < 60, "{text}");
    for part in ["axis1 … axis32 (32)", "bus1 … bus10 (10)", "Bus bus1, and 9 alike", "Bus bus11 (times"]
    {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 145), "{text}");
    let json = json(&check(&configs().join("axes32-erob.toml"), &["--json"]));
    assert_eq!(json["axes"].as_array().map(Vec::len), Some(32));
    assert_eq!(json["buses"].as_array().map(Vec::len), Some(11));
    assert_eq!(json["buses"][0]["messages"][0]["in_slot_ns"], 55_000);
}
