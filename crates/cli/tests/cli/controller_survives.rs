//! `takt run` when disks, files or other parts of the system fail. The motion goes on or stops in control, and the loss is
//! reported.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use takt::config::Config;
use takt::telemetry::{Recorded, RecordedCycle};
use takt_rt::Phase;
use tempfile::TempDir;

/// A folder with a configuration of the six-axis arm with two moves. Recordings go into `runs` beside it.
struct Place {
    folder: TempDir,
}

impl Place {
    /// With changes of the configuration: pairs of the old text and the new text.
    fn new(changes: &[(&str, &str)]) -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml");
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

    /// Starts a run and waits until its recording shows that the arm is well under way. The recording is up to a third of a
    /// second late.
    fn start_and_wait_for_motion(&self) -> Child {
        let mut child = self.start(takt());
        while !self.is_well_under_way() {
            assert_eq!(child.try_wait().unwrap(), None, "the run has ended before the arm moved");
            thread::sleep(Duration::from_millis(20));
        }
        child
    }

    fn is_well_under_way(&self) -> bool {
        let Ok(mut files) = fs::read_dir(self.runs()) else { return false };
        let recorded = files.next().and_then(|file| Recorded::open(&file.unwrap().path()).ok());
        let cycles = recorded.and_then(|recorded| recorded.cycles(&(0..=u64::MAX)).ok()).unwrap_or_default();
        cycles.last().is_some_and(|last| last.groups[0].phase == Phase::Moving)
            && distance(&cycles) > UNDER_WAY_RAD
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

/// The program with a limit on the size of its files.
fn takt_with_file_size(bytes: u64) -> Command {
    let mut command = Command::new("prlimit");
    command.arg(format!("--fsize={bytes}:{bytes}")).arg(env!("CARGO_BIN_EXE_takt"));
    command
}

/// The following error in the first move is larger than this limit. Where a busy machine misses slots, the drive may fault before.
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
    assert_eq!((&report["ended"], &report["is_power_off"]), (&"finished".into(), &true.into()));
    for axis in report["axes"].as_array().unwrap() {
        assert!(axis["final_error_counts"].as_f64().unwrap().abs() <= 2.0, "{axis}");
    }
}

#[test]
fn a_recording_that_is_deleted_during_the_run_is_reported_and_the_motion_goes_on() {
    let place = Place::new(&[]);
    let child = place.start_and_wait_for_motion();
    fs::remove_file(&place.files()[0]).unwrap();
    let output = child.wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_arrived(&report);
    assert_eq!(
        (&report["telemetry"]["recording"], &report["telemetry"]["dropped"]),
        (&Value::Null, &0.into())
    );
    let failures = not_written(&report);
    assert!(failures.len() == 1 && failures[0].ends_with("was removed during the run"), "{failures:?}");
    assert!(errors(&output).contains("was removed during the run"), "{}", errors(&output));
}

#[test]
fn a_folder_that_is_deleted_during_the_run_is_made_again_for_the_black_box() {
    let place = Place::new(&[FAULT]);
    // The bring-up takes longer than this.
    let child = place.start(takt());
    while !place.runs().exists() {
        thread::sleep(Duration::from_millis(1));
    }
    thread::sleep(Duration::from_millis(20));
    fs::remove_dir_all(place.runs()).unwrap();
    let report = report(&child.wait_with_output().unwrap(), 1);
    assert_eq!(report["stop"]["category"], 1);
    let files = place.files();
    assert_eq!(files.len(), 1);
    assert_eq!(report["telemetry"]["black_boxes"][0].as_str(), files[0].to_str());
}

#[test]
fn a_file_size_limit_ends_the_recording_and_the_motion_goes_on() {
    let place = Place::new(&[]);
    let output = place.start(takt_with_file_size(600_000)).wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_arrived(&report);
    let failures = not_written(&report);
    assert!(failures.len() == 1 && failures[0].starts_with("the recording ends here: "), "{failures:?}");
    assert_eq!(errors(&output).lines().count(), 1, "{}", errors(&output));
    let recorded = Recorded::open(&place.files()[0]).unwrap();
    assert!(recorded.statistics.cycles > 100 && !recorded.warnings.is_empty(), "{:?}", recorded.warnings);
}

#[test]
fn a_full_disk_ends_the_black_box_and_the_stop_is_regular() {
    let place = Place::new(&[FAULT]);
    // Slots that are missed are not recorded: half of what a run without them writes.
    let output = place.start(takt_with_file_size(150_000)).wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_eq!(report["stop"]["category"], 1);
    let failures = not_written(&report);
    assert_eq!(failures.iter().filter(|failure| failure.contains("black box")).count(), 1, "{failures:?}");
    assert_eq!(failures.len(), 2, "{failures:?}");
}

#[test]
fn with_an_unwritable_folder_a_fault_stops_the_arm_and_each_loss_is_reported_once() {
    let place = Place::new(&[FAULT]);
    fs::write(place.runs(), "in the way").unwrap();
    let output = place.start(takt()).wait_with_output().unwrap();
    let report = report(&output, 1);
    assert_eq!(report["stop"]["category"], 1);
    let failures = not_written(&report);
    assert!(
        failures.len() == 2
            && failures[0].starts_with("no recording: ")
            && failures[1].starts_with("no black box: "),
        "{failures:?}"
    );
}

#[test]
fn a_fault_leaves_a_black_box_without_a_recording_and_its_path_is_in_text_and_json() {
    let place = Place::new(&[FAULT]);
    let text = fs::read_to_string(place.config()).unwrap();
    fs::write(place.config(), format!("{text}record = false\n")).unwrap();
    let json = report(&place.start(takt()).wait_with_output().unwrap(), 1);
    let files = place.files();
    assert_eq!(files.len(), 1);
    assert_eq!(json["telemetry"]["black_boxes"].as_array().unwrap().len(), 1);
    let name = format!("-black-box-{}.mcap", json["stop"]["rule"].as_str().unwrap());
    assert!(files[0].to_str().unwrap().ends_with(&name), "{files:?}");
    let recorded = Recorded::open(&files[0]).unwrap();
    assert_eq!(Value::from(recorded.cause().unwrap().slot), json["stop"]["slot"]);
    let text = takt().arg("run").arg(place.config()).output().unwrap();
    assert!(String::from_utf8(text.stdout).unwrap().contains("-black-box-"));
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
fn the_recording_of_a_killed_controller_can_be_read() {
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

fn pause(pid: Pid, time: Duration) {
    kill(pid, Signal::SIGSTOP).unwrap();
    thread::sleep(time);
    kill(pid, Signal::SIGCONT).unwrap();
}

/// What all axes together have moved by when the arm is well under way. The first move is over 5 rad long.
const UNDER_WAY_RAD: f64 = 0.1;

/// The sum of what the set-points of all axes have moved by while the drives follow them, in rad.
fn distance(cycles: &[RecordedCycle]) -> f64 {
    let followed = cycles.windows(2).filter(|pair| pair.iter().all(is_enabled));
    let steps = followed.flat_map(|pair| pair[0].axes.iter().zip(&pair[1].axes));
    steps.map(|(from, to)| (to.position_set - from.position_set).abs()).sum()
}

/// From cycle to cycle, the position changes within the velocity limit and the velocity within the acceleration limit. Between
/// two cycles the trajectory advances by one period, however many slots have passed.
fn assert_moved_smoothly(place: &Place) {
    let config = Config::load(&place.config()).unwrap();
    let recorded = Recorded::open(&place.files()[0]).unwrap();
    let cycles = recorded.cycles(&(0..=u64::MAX)).unwrap();
    let period_s = config.cycle.period_ns as f64 * 1e-9;
    for pair in cycles.windows(2) {
        let [before, after] = pair else { continue };
        if !is_enabled(before) || !is_enabled(after) {
            continue;
        }
        for ((axis, from), to) in config.axes.iter().zip(&before.axes).zip(&after.axes) {
            let step = (to.position_set - from.position_set).abs();
            assert!(step <= axis.limits.velocity * period_s * 1.000_01, "{}: {step} rad", axis.name);
            let change = f64::from((to.velocity_set - from.velocity_set).abs());
            let allowed = axis.limits.acceleration.max(axis.limits.deceleration) * period_s;
            assert!(change <= allowed * 1.001 + 1e-6, "{}: {change} rad/s", axis.name);
        }
    }
    let moved = distance(&cycles);
    assert!(moved > UNDER_WAY_RAD, "the arm has moved by {moved} rad");
}

#[test]
fn a_process_that_is_paused_in_motion_goes_on_smoothly() {
    let place = Place::new(&[]);
    let child = place.start_and_wait_for_motion();
    let pid = Pid::from_raw(i32::try_from(child.id()).unwrap());
    for _ in 0..3 {
        pause(pid, Duration::from_millis(60));
        thread::sleep(Duration::from_millis(60));
    }
    let report = report(&child.wait_with_output().unwrap(), 0);
    assert_arrived(&report);
    assert!(report["missed_slots"].as_u64().unwrap() >= 3 * 50, "{}", report["missed_slots"]);
    assert!(Recorded::open(&place.files()[0]).unwrap().statistics.missed_slots >= 3 * 50);
    assert_moved_smoothly(&place);
}

/// The setting makes simulated buses stop for missed slots, as real ones do.
#[test]
fn a_process_that_is_paused_for_too_long_stops_the_arm_without_a_jump_and_counts_the_missed_slots() {
    let minding = ("[defaults.axis]", "[simulation]\nstops_for_missed_slots = true\n\n[defaults.axis]");
    let place = Place::new(&[minding]);
    let child = place.start_and_wait_for_motion();
    pause(Pid::from_raw(i32::try_from(child.id()).unwrap()), Duration::from_millis(400));
    let report = report(&child.wait_with_output().unwrap(), 1);
    let stop = &report["stop"];
    assert_eq!((&stop["rule"], &stop["category"]), (&"timing_unfit".into(), &1.into()));
    assert_eq!((&stop["phase"], &stop["limit"]), (&"moving".into(), &250.0.into()));
    assert!(stop["value"].as_f64().unwrap() >= 350.0, "{stop}");
    assert!(report["missed_slots"].as_u64().unwrap() >= 350, "{}", report["missed_slots"]);
    assert_moved_smoothly(&place);
}

/// Returns `true` if the drives follow set-points.
fn is_enabled(record: &RecordedCycle) -> bool {
    matches!(record.groups[0].phase, Phase::Holding | Phase::Moving | Phase::Stopping)
}
