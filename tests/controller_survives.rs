//! `takt run` when the world around it fails: disk, files, signals. The motion goes on or ends in control, and what
//! was lost is told.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use takt::config::Config;
use takt::telemetry::Recorded;
use takt_rt::{CycleRecord, Phase};
use tempfile::TempDir;

/// A folder with the six-axis arm and two of its moves, recording into `runs` beside it.
struct Place {
    folder: TempDir,
}

impl Place {
    /// With what stands in the configuration changed, each from and to.
    fn new(changes: &[(&str, &str)]) -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml");
        let text = fs::read_to_string(example).unwrap();
        let mut shortened =
            text.split("[[program.move]]").take(3).collect::<Vec<_>>().join("[[program.move]]");
        for (from, to) in changes {
            assert!(shortened.contains(from), "{from}");
            shortened = shortened.replace(from, to);
        }
        let telemetry = format!("{shortened}\n[telemetry]\ndirectory = {:?}\n", place.runs());
        fs::write(place.config(), telemetry).unwrap();
        place
    }

    fn config(&self) -> PathBuf {
        self.folder.path().join("arm.toml")
    }

    fn runs(&self) -> PathBuf {
        self.folder.path().join("runs")
    }

    fn start(&self, mut command: Command) -> Child {
        command.arg("run").arg(self.config()).arg("--json");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Starts a run and waits until its recording, which is a third of a second behind, shows that the arm moves.
    fn start_and_wait_for_motion(&self) -> Child {
        let mut child = self.start(takt());
        while !self.is_in_motion() {
            assert_eq!(child.try_wait().unwrap(), None, "the run has ended before the arm moved");
            thread::sleep(Duration::from_millis(20));
        }
        child
    }

    fn is_in_motion(&self) -> bool {
        let Ok(mut files) = fs::read_dir(self.runs()) else { return false };
        let recorded = files.next().and_then(|file| Recorded::open(&file.unwrap().path()).ok());
        let cycles = recorded.and_then(|recorded| recorded.cycles(&(0..=u64::MAX)).ok()).unwrap_or_default();
        cycles.last().is_some_and(|last| last.phase == Phase::Moving)
    }

    fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<_> =
            fs::read_dir(self.runs()).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }
}

fn takt() -> Command {
    Command::new(env!("CARGO_BIN_EXE_takt"))
}

/// A program whose files may grow to so many bytes.
fn takt_with_file_size(bytes: u64) -> Command {
    let mut command = Command::new("prlimit");
    command.arg(format!("--fsize={bytes}:{bytes}")).arg(env!("CARGO_BIN_EXE_takt"));
    command
}

/// The arm lags behind further than this in its first move.
const FAULT: (&str, &str) = (r#"limit = "0.1 rad", time = "50 ms""#, r#"limit = "0.001 rad", time = "5 ms""#);

fn report(output: &Output, code: i32) -> Value {
    assert_eq!(output.status.code(), Some(code), "{}", errors(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn not_written(report: &Value) -> Vec<&str> {
    report["telemetry"]["not_written"].as_array().unwrap().iter().filter_map(Value::as_str).collect()
}

fn assert_arrived(report: &Value) {
    assert_eq!(report["ended"], "finished");
    for axis in report["axes"].as_array().unwrap() {
        assert!(axis["final_error_counts"].as_f64().unwrap().abs() <= 2.0, "{axis}");
    }
}

#[test]
fn a_recording_that_is_deleted_in_mid_run_is_told_and_costs_nothing_else() {
    let place = Place::new(&[]);
    let child = place.start_and_wait_for_motion();
    fs::remove_file(&place.files()[0]).unwrap();
    let output = child.wait_with_output().unwrap();
    let report = report(&output, 0);
    assert_arrived(&report);
    assert_eq!(
        (&report["telemetry"]["recording"], &report["telemetry"]["dropped"]),
        (&Value::Null, &0.into())
    );
    let told = not_written(&report);
    assert!(told.len() == 1 && told[0].ends_with("was removed during the run"), "{told:?}");
    assert!(errors(&output).contains("was removed during the run"), "{}", errors(&output));
}

#[test]
fn a_folder_that_is_deleted_in_mid_run_is_made_again_for_the_black_box() {
    let place = Place::new(&[FAULT]);
    // The bring-up alone takes longer.
    let child = place.start(takt());
    while !place.runs().exists() {
        thread::sleep(Duration::from_millis(1));
    }
    thread::sleep(Duration::from_millis(20));
    fs::remove_dir_all(place.runs()).unwrap();
    let report = report(&child.wait_with_output().unwrap(), 1);
    assert_eq!(report["stop"]["rule"], "following_error");
    let files = place.files();
    assert_eq!(files.len(), 1);
    assert_eq!(report["telemetry"]["black_boxes"][0].as_str(), files[0].to_str());
}

#[test]
fn a_file_that_may_not_grow_is_a_full_disk_and_no_reason_to_die_in_motion() {
    let place = Place::new(&[]);
    let output = place.start(takt_with_file_size(600_000)).wait_with_output().unwrap();
    let report = report(&output, 0);
    assert_arrived(&report);
    let told = not_written(&report);
    assert!(told.len() == 1 && told[0].starts_with("the recording ends here: "), "{told:?}");
    assert_eq!(errors(&output).lines().count(), 1, "{}", errors(&output));
    let recorded = Recorded::open(&place.files()[0]).unwrap();
    assert!(recorded.statistics.cycles > 100 && !recorded.warnings.is_empty(), "{:?}", recorded.warnings);
}

#[test]
fn a_full_disk_costs_the_end_of_the_black_box_and_the_stop_is_as_it_should_be() {
    let place = Place::new(&[FAULT]);
    let output = place.start(takt_with_file_size(300_000)).wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_eq!(
        (&report["stop"]["rule"], &report["stop"]["category"]),
        (&"following_error".into(), &1.into())
    );
    let told = not_written(&report);
    assert_eq!(told.iter().filter(|told| told.contains("black box")).count(), 1, "{told:?}");
    assert_eq!(told.len(), 2, "{told:?}");
}

#[test]
fn in_an_unwritable_folder_a_fault_stops_the_arm_as_ever_and_each_loss_is_told_once() {
    let place = Place::new(&[FAULT]);
    fs::write(place.runs(), "in the way").unwrap();
    let output = place.start(takt()).wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_eq!(report["stop"]["rule"], "following_error");
    let told = not_written(&report);
    assert!(
        told.len() == 2 && told[0].starts_with("no recording: ") && told[1].starts_with("no black box: "),
        "{told:?}"
    );
}

#[test]
fn a_fault_leaves_a_black_box_whose_path_is_told_to_people_and_programs_even_without_a_recording() {
    let place = Place::new(&[FAULT]);
    let text = fs::read_to_string(place.config()).unwrap();
    fs::write(place.config(), format!("{text}record = false\n")).unwrap();
    let json = report(&place.start(takt()).wait_with_output().unwrap(), 1);
    let files = place.files();
    assert_eq!(files.len(), 1);
    assert_eq!(json["telemetry"]["black_boxes"].as_array().unwrap().len(), 1);
    assert!(files[0].to_str().unwrap().ends_with("-black-box-following_error.mcap"), "{files:?}");
    let recorded = Recorded::open(&files[0]).unwrap();
    assert_eq!(Value::from(recorded.cause().unwrap().slot), json["stop"]["slot"]);
    let text = takt().arg("run").arg(place.config()).output().unwrap();
    assert!(String::from_utf8(text.stdout).unwrap().contains("-black-box-following_error.mcap"));
}

#[test]
fn with_the_black_box_off_a_fault_leaves_nothing() {
    let place = Place::new(&[FAULT]);
    let text = fs::read_to_string(place.config()).unwrap();
    fs::write(place.config(), format!("{text}record = false\nblack_box = \"off\"\n")).unwrap();
    let report = report(&place.start(takt()).wait_with_output().unwrap(), 1);
    assert_eq!(report["telemetry"]["black_boxes"], Value::Array(vec![]));
    assert!(!place.runs().exists());
}

#[test]
fn what_a_killed_controller_has_recorded_can_be_read() {
    let place = Place::new(&[]);
    let mut child = place.start_and_wait_for_motion();
    child.kill().unwrap();
    child.wait().unwrap();
    let recorded = Recorded::open(&place.files()[0]).unwrap();
    assert!(recorded.warnings[0].contains("cut off"), "{:?}", recorded.warnings);
    assert!(recorded.statistics.cycles > 200, "{} cycles", recorded.statistics.cycles);
    let report = takt().arg("report").arg(&place.files()[0]).output().unwrap();
    assert_eq!(report.status.code(), Some(0), "{}", errors(&report));
}

fn freeze(pid: Pid, time: Duration) {
    kill(pid, Signal::SIGSTOP).unwrap();
    thread::sleep(time);
    kill(pid, Signal::SIGCONT).unwrap();
}

/// From cycle to cycle no set-point leaves its limits: position by velocity, velocity by acceleration. It is one
/// period of the trajectory from one cycle to the next, however many slots have passed between them.
fn assert_moved_smoothly(place: &Place) {
    let config = Config::load(&place.config()).unwrap();
    let recorded = Recorded::open(&place.files()[0]).unwrap();
    let cycles = recorded.cycles(&(0..=u64::MAX)).unwrap();
    let period_s = config.cycle.period_ns as f64 * 1e-9;
    let mut moved = 0.0_f64;
    for pair in cycles.windows(2) {
        let [before, after] = pair else { continue };
        if !is_enabled(before) || !is_enabled(after) {
            continue;
        }
        for ((axis, from), to) in config.axes.iter().zip(before.axes()).zip(after.axes()) {
            let step = (to.position_set - from.position_set).abs();
            assert!(step <= axis.limits.velocity * period_s * 1.000_01, "{}: {step} rad", axis.name);
            let change = f64::from((to.velocity_set - from.velocity_set).abs());
            let allowed = axis.limits.acceleration.max(axis.limits.deceleration) * period_s;
            assert!(change <= allowed * 1.001 + 1e-6, "{}: {change} rad/s", axis.name);
            moved += step;
        }
    }
    assert!(moved > 0.1, "the arm has moved by {moved} rad");
}

#[test]
fn a_process_that_is_frozen_in_motion_goes_on_smoothly() {
    let place = Place::new(&[]);
    let child = place.start_and_wait_for_motion();
    let pid = Pid::from_raw(i32::try_from(child.id()).unwrap());
    for _ in 0..3 {
        freeze(pid, Duration::from_millis(60));
        thread::sleep(Duration::from_millis(60));
    }
    let report = report(&child.wait_with_output().unwrap(), 0);
    assert_arrived(&report);
    assert!(report["missed_slots"].as_u64().unwrap() >= 3 * 50, "{}", report["missed_slots"]);
    assert!(Recorded::open(&place.files()[0]).unwrap().statistics.missed_slots >= 3 * 50);
    assert_moved_smoothly(&place);
}

/// As on real buses; simulated ones would not mind.
#[test]
fn a_process_that_is_frozen_in_motion_for_too_long_stops_the_arm_without_a_jump_and_counts_what_it_missed() {
    let minding = ("[defaults.axis]", "[simulation]\nstops_for_missed_slots = true\n\n[defaults.axis]");
    let place = Place::new(&[minding]);
    let child = place.start_and_wait_for_motion();
    freeze(Pid::from_raw(i32::try_from(child.id()).unwrap()), Duration::from_millis(400));
    let report = report(&child.wait_with_output().unwrap(), 1);
    let stop = &report["stop"];
    assert_eq!((&stop["rule"], &stop["category"]), (&"timing_unfit".into(), &1.into()));
    assert_eq!((&stop["phase"], &stop["limit"]), (&"moving".into(), &250.0.into()));
    assert!(stop["value"].as_f64().unwrap() >= 350.0, "{stop}");
    assert!(report["missed_slots"].as_u64().unwrap() >= 350, "{}", report["missed_slots"]);
    assert_moved_smoothly(&place);
}

/// Whether the drives follow set-points.
fn is_enabled(record: &CycleRecord) -> bool {
    matches!(record.phase, Phase::Holding | Phase::Moving | Phase::Stopping)
}
