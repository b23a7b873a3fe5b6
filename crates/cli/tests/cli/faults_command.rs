//! `takt run --faults`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn folder() -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs")
}

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

#[test]
fn an_error_of_a_drive_has_the_words_of_its_quirk_file_in_the_run_its_report_its_recording_and_its_black_box()
{
    const WORDS: &str = "0x3210 (the bus bar of the vendor is too hot)";
    let place = tempfile::tempdir().unwrap();
    let sheets = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/eds/vendors");
    let drive = |name: &str, node: u8, more: &str| {
        format!(
            "[[axis]]\nname = {name:?}\nbus = \"can\"\nnode = {node}\ndrive = \"cia402\"\ncounts_per_turn = 65536\n\
             eds = {:?}\n{more}\nlimits = {{ position = [-2, 2], velocity = 2, acceleration = 8, torque = 10 }}\n",
            sheets.join("eyou-euservo.eds").display().to_string()
        )
    };
    let text = format!(
        "name = \"two\"\n[[bus]]\nname = \"can\"\n{}{}[[program.move]]\nto = 1.5\n",
        drive("named", 1, "quirks = \"named.toml\""),
        drive("plain", 2, "")
    );
    fs::write(place.path().join("two.toml"), text).unwrap();
    fs::write(
        place.path().join("named.toml"),
        "[drive]\nvendor = \"V\"\nproduct = \"P\"\nstatus = \"from its data sheet, not tried on hardware\"\nsources = []\n\
         [errors]\n3210 = \"the bus bar of the vendor is too hot\"\n",
    )
    .unwrap();
    let fault = "[[fault]]\nkind = \"over-voltage\"\naxis = \"named\"\nwhen = \"moving\"\nat = \"200 ms\"\n";
    fs::write(place.path().join("faults.toml"), fault).unwrap();
    let takt = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_takt")).current_dir(place.path()).args(arguments).output().unwrap()
    };
    let output = takt(&["run", "two.toml", "--faults", "faults.toml", "--record", "run.mcap"]);
    let (said, shown) =
        (String::from_utf8(output.stderr).unwrap(), String::from_utf8(output.stdout).unwrap());
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains(WORDS), "the events: {said}");
    assert!(unbroken(&shown).contains(WORDS), "the report: {shown}");
    assert!(!said.contains("DC link over-voltage"), "{said}");
    let black_box = fs::read_dir(place.path().join("runs")).unwrap().map(|entry| entry.unwrap().path());
    let black_box = black_box.last().unwrap();
    for file in [place.path().join("run.mcap"), black_box] {
        let output = takt(&["report", file.to_str().unwrap()]);
        let shown = String::from_utf8(output.stdout).unwrap();
        assert!(unbroken(&shown).contains(WORDS), "{}: {shown}", file.display());
    }
}

/// A text whose lines are not broken, with single spaces.
fn unbroken(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
