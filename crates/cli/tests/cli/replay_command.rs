//! `takt replay` as a user meets it: a recording in, the run again out.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// A run of one joint, recorded once for all tests.
struct Recorded {
    folder: TempDir,
    run: PathBuf,
}

fn takt(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt"))
        .args(arguments)
        .current_dir(folder)
        .env("COLUMNS", "80")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn recorded() -> &'static Recorded {
    static RECORDED: OnceLock<Recorded> = OnceLock::new();
    RECORDED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/first.toml");
        fs::copy(config, folder.path().join("first.toml")).unwrap();
        let output = takt(folder.path(), &["run", "first.toml", "--record", "run.mcap"]);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        // The recording has it.
        fs::remove_file(folder.path().join("first.toml")).unwrap();
        Recorded { run: folder.path().join("run.mcap"), folder }
    })
}

fn replay(arguments: &[&str]) -> Output {
    let Recorded { folder, run } = recorded();
    takt(folder.path(), &[&["replay", run.to_str().unwrap()], arguments].concat())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn refused(output: &Output) -> String {
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{output:?}");
    text(&output.stderr)
}

#[test]
fn the_replay_of_a_run_in_real_time_is_identical_without_the_file_of_its_configuration() {
    let output = replay(&["--json"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let count = |key: &str| result[key].as_u64().unwrap();
    assert!(result["identical"].as_bool().unwrap(), "{result}");
    assert!(count("compared") > 1000 && count("cycles") >= count("compared"), "{result}");
    assert_eq!((count("differing"), count("missing")), (0, 0));
    assert!(text(&replay(&[]).stdout).contains("all are identical, bit for bit"));
}

#[test]
fn a_changed_configuration_shows_what_it_would_have_done_and_its_replay_can_be_reported() {
    let arguments = ["--set", "axes.joint.limits.velocity=20 deg/s", "--record", "slower.mcap", "--json"];
    let output = replay(&arguments);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(!result["identical"].as_bool().unwrap());
    let velocity = &result["axes"][0]["velocity"];
    let [recorded, replayed] = ["recorded", "replayed"].map(|which| velocity[which].as_f64().unwrap());
    assert!(replayed <= 20_f64.to_radians() + 1e-9 && recorded > replayed, "{velocity}");
    let report = takt(recorded_folder(), &["report", "slower.mcap"]);
    assert_eq!(report.status.code(), Some(0), "{report:?}");
}

fn recorded_folder() -> &'static Path {
    recorded().folder.path()
}

#[test]
fn what_differs_is_told_within_the_columns_of_the_terminal() {
    let output = replay(&["--set", "axes.joint.limits.velocity=20 deg/s"]);
    let shown = text(&output.stdout);
    assert!(shown.contains("the first is slot ") && shown.contains("position set-point"), "{shown}");
    assert!(shown.contains("The drives followed the recorded set-points"), "{shown}");
    let rows = shown.lines().skip_while(|line| !line.contains("distance")).take(2);
    assert!(rows.clone().count() == 2 && rows.clone().all(|row| row.chars().count() <= 80), "{shown}");
}

#[test]
fn a_value_that_there_is_not_or_that_is_wrong_is_refused() {
    let error = refused(&replay(&["--set", "axes.elbow.limits.jerk=200"]));
    assert!(error.contains("there is no \"elbow\" here; there is: joint"), "{error}");
    let error = refused(&replay(&["--set", "axes.joint.limits.velocity=-1"]));
    assert!(error.contains("velocity"), "{error}");
    let error = refused(&replay(&["--set", "axes.joint.limits.speed=1"]));
    assert!(error.contains("speed"), "{error}");
    let output = replay(&["--set", "jerk"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}

#[test]
fn a_recording_that_was_cut_off_is_replayed_to_its_end() {
    let bytes = fs::read(&recorded().run).unwrap();
    let cut = recorded_folder().join("cut.mcap");
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let output = takt(recorded_folder(), &["replay", "cut.mcap", "--json"]);
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["differing"].as_u64(), Some(0), "{result}");
    assert!(result["compared"].as_u64().unwrap() > 100, "{result}");
}

#[test]
fn a_recording_in_several_files_is_replayed_from_its_first_one_alone() {
    let folder = tempfile::tempdir().unwrap();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/first.toml");
    fs::copy(config, folder.path().join("first.toml")).unwrap();
    let recorded =
        ["--record", "run.mcap", "--record-uncompressed", "--record-size-limit", "1M", "--duration", "4"];
    let output = takt(folder.path(), &[&["run", "first.toml"], &recorded[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let output = takt(folder.path(), &["replay", "run.0001.mcap", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(result["identical"].as_bool().unwrap(), "{result}");
    let cycles = |file: &str| -> u64 {
        let output = takt(folder.path(), &["report", file, "--json"]);
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["cycles"].as_u64().unwrap()
    };
    let [first, second] = ["run.0001.mcap", "run.0002.mcap"].map(cycles);
    assert!(first > 0 && second > 0 && result["compared"].as_u64().unwrap() >= first + second, "{result}");

    let error = refused(&takt(folder.path(), &["replay", "run.0002.mcap"]));
    assert!(error.contains("begins in an earlier file, run.0001.mcap: replay that one"), "{error}");
    fs::remove_file(folder.path().join("run.0001.mcap")).unwrap();
    let error = refused(&takt(folder.path(), &["replay", "run.0002.mcap"]));
    assert!(error.contains("run.0001.mcap: which is not there any more"), "{error}");
}

#[test]
fn sizes_and_numbers_of_files_that_make_no_sense_are_refused_with_the_option() {
    for (arguments, what) in [
        (&["--record-size-limit", "12X"][..], "a size is a whole number of bytes"),
        (&["--record-size-limit", "-1M"], "a size is a whole number of bytes"),
        (&["--record-size-limit", "99999999999G"], "a size is a whole number of bytes"),
        (&["--record-size-limit", "1023K"], "needs 1M at least"),
        (&["--record-size-limit", "1M", "--record-keep", "0"], "--record-keep"),
        (&["--record-keep", "3"], "--record-size-limit"),
    ] {
        let error = refused(&takt(recorded_folder(), &[&["run", "none.toml"], arguments].concat()));
        assert!(error.contains(what) && error.contains("--record-"), "{arguments:?}: {error}");
    }
}

#[test]
fn what_has_no_journal_is_refused_with_the_reason() {
    let replay_of_replay = replay(&["--record", "again.mcap"]);
    assert_eq!(replay_of_replay.status.code(), Some(0), "{replay_of_replay:?}");
    let error = refused(&takt(recorded_folder(), &["replay", "again.mcap"]));
    assert!(error.contains("this has no journal"), "{error}");
    let error = refused(&takt(recorded_folder(), &["replay", "nothing.mcap"]));
    assert!(error.contains("nothing.mcap"), "{error}");
}

#[test]
fn a_recording_that_cannot_be_written_is_an_error_after_the_result() {
    let output = replay(&["--record", "run.mcap/replay.mcap"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(text(&output.stderr).contains("cannot write"), "{output:?}");
}

#[test]
fn the_black_box_of_a_run_that_was_not_recorded_is_replayed_and_shows_other_limits() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let config = fs::read_to_string(root.join("configs/first.toml")).unwrap();
    fs::write(folder.path().join("first.toml"), format!("{config}\n[telemetry]\nblack_box = \"300 ms\"\n"))
        .unwrap();
    let fault =
        "[[fault]]\nkind = \"stall\"\naxis = \"joint\"\nwhen = \"moving\"\nat = \"600 ms\"\nfor = \"1 s\"\n";
    fs::write(folder.path().join("blocked.toml"), fault).unwrap();
    let output = takt(folder.path(), &["run", "first.toml", "--faults", "blocked.toml"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let found = fs::read_dir(folder.path().join("runs")).unwrap();
    let mut files = found.map(|file| file.unwrap().path());
    let black_box = files.find(|file| file.to_str().unwrap().contains("black-box")).unwrap();
    let replay = |settings: &[&str]| {
        let arguments = [&["replay", black_box.to_str().unwrap(), "--json"], settings].concat();
        let output = takt(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let same = replay(&[]);
    assert_eq!(same["identical"], true, "{same:#}");
    // The slots of 300 ms and of the stop, but for those that were missed.
    assert!(same["compared"].as_u64().unwrap() >= 100, "{same:#}");
    let stricter = replay(&["--set", "axes.joint.limits.jerk=20"]);
    assert_eq!(stricter["cycles"], same["cycles"], "{stricter:#}");
}

#[test]
fn every_channel_of_a_recording_is_one_that_readers_of_ros_2_decode() {
    let bytes = fs::read(&recorded().run).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let topics: Vec<&str> = summary.channels.values().map(|channel| channel.topic.as_str()).collect();
    assert!(topics.contains(&"/journal") && topics.contains(&"/joint_states"), "{topics:?}");
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().unwrap_or_else(|| panic!("{}", channel.topic));
        assert_eq!((&*channel.message_encoding, &*schema.encoding), ("cdr", "ros2msg"), "{}", channel.topic);
        let offered = &channel.metadata["offered_qos_profiles"];
        assert!(offered.starts_with("- history: 1\n  depth: 10\n  reliability: 1\n"), "{offered}");
    }
    let header = mcap::parse_record(mcap::records::op::HEADER, &bytes[mcap::MAGIC.len() + 9..]).unwrap();
    assert!(matches!(header, mcap::records::Record::Header(header) if header.profile == "ros2"));
}
