//! `takt run --faults`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::arm::folder;

fn run(faults: &Path) -> Output {
    let place = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(folder().join("arm6-erob.toml")).unwrap();
    let config = place.path().join("arm.toml");
    fs::write(&config, format!("{text}\n[telemetry]\nrecord = false\n")).unwrap();
    Command::new(env!("CARGO_BIN_EXE_takt"))
        .args(["run", "--json", "--faults"])
        .args([faults, &config])
        .output()
        .unwrap()
}

#[test]
fn a_run_with_faults_reports_when_each_began_and_ends_with_the_stop() {
    let output = run(&folder().join("faults/drive-reboots.toml"));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("fault `reboot` on axis joint3 (line 5) has begun"), "{said}");
    assert_eq!(output.status.code(), Some(1), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ended"], "stopped", "{report}");
}

#[test]
fn an_invalid_scenario_is_refused_before_any_motion() {
    let place = tempfile::tempdir().unwrap();
    let faults = place.path().join("wrong.toml");
    fs::write(&faults, "[[fault]]\nkind = \"stall\"\naxis = \"elbow\"\n").unwrap();
    let output = run(&faults);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    let refusal: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(refusal["error"].as_str().unwrap().contains("wrong.toml"), "{refusal}");
    let problem = &refusal["problems"][0];
    assert_eq!(problem["line"], 3, "{refusal}");
    assert!(problem["message"].as_str().unwrap().contains("elbow"), "{refusal}");
    assert!(problem["help"].as_str().unwrap().contains("joint1"), "{refusal}");
}
