//! `takt play` as a user meets it: a file of points in, what was commanded out.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A folder with files of points.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, text: impl AsRef<[u8]>) {
        fs::write(self.path("points.csv"), text).unwrap();
    }

    fn play(&self, options: &[&str]) -> Output {
        self.play_on(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml"), options)
    }

    fn play_on(&self, config: &Path, options: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_takt"))
            .arg("play")
            .arg(config)
            .arg(self.path("points.csv"))
            .args(options)
            .current_dir(self.folder.path())
            .stdin(Stdio::null())
            .output()
            .unwrap()
    }

    /// Plays the file as a trajectory in virtual time. Returns the report, and what was commanded as rows of numbers.
    fn commanded(&self) -> (Value, Vec<Vec<f64>>) {
        let output = self.play(&["--trajectory", "--virtual", "--json", "--out", "out.csv"]);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let text = fs::read_to_string(self.path("out.csv")).unwrap();
        let rows =
            text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect());
        (json(&output), rows.collect())
    }

    /// Plays a file that is refused, and returns what is said of it.
    fn refused(&self, text: impl AsRef<[u8]>) -> String {
        self.write(text);
        let output = self.play(&["--trajectory", "--virtual", "--out", "out.csv"]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(output.stdout.is_empty() && !self.path("out.csv").exists());
        String::from_utf8(output.stderr).unwrap()
    }
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Position and velocity after a share of a reach of 1 rad with the least jerk, in 1 s.
fn reach(share: f64) -> (f64, f64) {
    let u = share.clamp(0.0, 1.0);
    (u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * u * u * (1.0 - u) * (1.0 - u))
}

/// A reach of two joints within 2 s from 0.1 s on.
fn reaching(has_velocities: bool) -> String {
    let mut text = String::from("arrive,at,joint2,joint5\n");
    if has_velocities {
        text = String::from("arrive,at,joint2,joint2.velocity,joint5,joint5.velocity\n");
    }
    for step in 0..=40 {
        let (position, velocity) = reach(f64::from(step) / 40.0);
        let (arrive, at) = (f64::from(step) * 0.05, 0.1 + f64::from(step) * 0.05);
        if has_velocities {
            let rates = (0.6 * velocity / 2.0, -0.9 * velocity / 2.0);
            writeln!(text, "{arrive},{at},{},{},{},{}", 0.6 * position, rates.0, -0.9 * position, rates.1)
                .unwrap();
        } else {
            writeln!(text, "{arrive},{at},{},{}", 0.6 * position, -0.9 * position).unwrap();
        }
    }
    text
}

#[test]
fn a_file_is_executed_as_one_trajectory_at_its_times() {
    let place = Place::new();
    for has_velocities in [false, true] {
        place.write(reaching(has_velocities));
        let (report, rows) = place.commanded();
        // The slopes of positions alone are estimated: monotone, and not those of the motion between the points.
        let (off_by, slower_by) = if has_velocities { (1e-6, 1e-4) } else { (1e-4, 1e-2) };
        for row in &rows {
            let (position, velocity) = reach((row[0] - 0.1) / 2.0);
            assert!((row[2] - 0.6 * position).abs() < off_by, "{row:?}");
            assert!((row[5] + 0.9 * position).abs() < off_by, "{row:?}");
            assert!((row[8] - 0.3 * velocity).abs() < slower_by, "{row:?}");
            assert!([1, 3, 4, 6].iter().all(|joint| row[*joint] == 0.0), "a joint that is not named moves");
        }
        assert_eq!((rows[0][0], rows[1][0]), (0.1, 0.101));
        assert!(rows.last().unwrap()[0] >= 2.1);
        let numbers =
            ["points", "late_points", "lag_s", "lag_max_s"].map(|key| report[key].as_f64().unwrap());
        assert_eq!((&report["stop"], numbers), (&Value::Null, [41.0, 0.0, 0.0, 0.0]));
    }
}

#[test]
fn the_largest_rates_are_the_differences_of_what_was_commanded_and_keep_the_limits() {
    let place = Place::new();
    place.write(reaching(false));
    let (report, rows) = place.commanded();
    let axes = report["axes"].as_array().unwrap();
    let limits = [(2.3925, 8.0, 100.0), (2.3925, 8.0, 100.0), (2.3925, 8.0, 100.0)];
    let limits =
        limits.into_iter().chain([(2.3925, 15.0, 250.0), (2.871, 15.0, 250.0), (2.871, 15.0, 250.0)]);
    for ((joint, axis), limits) in (1..).zip(axes).zip(limits) {
        assert_eq!(axis["name"], format!("joint{joint}"));
        let positions: Vec<f64> = rows.iter().map(|row| row[joint]).collect();
        let differences =
            |of: &[f64]| of.windows(2).map(|pair| (pair[1] - pair[0]) / 0.001).collect::<Vec<f64>>();
        let velocities = differences(&positions);
        let accelerations = differences(&velocities);
        let jerks = differences(&accelerations);
        let largest = |of: &[f64]| of.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        for (key, values, limit) in [
            ("velocity_max", velocities, limits.0),
            ("acceleration_max", accelerations, limits.1),
            ("jerk_max", jerks, limits.2),
        ] {
            let (told, seen) = (axis[key].as_f64().unwrap(), largest(&values));
            assert!(
                told >= seen * (1.0 - 1e-4) && told <= limit,
                "{key} of joint{joint}: {told}, {seen}, {limit}"
            );
        }
    }
}

#[test]
fn every_run_in_virtual_time_is_the_same_bit_for_bit() {
    let place = Place::new();
    place.write(reaching(true));
    let run = || {
        let output = place.play(&["--trajectory", "--virtual", "--json", "--out", "out.csv"]);
        (output.stdout, fs::read(place.path("out.csv")).unwrap())
    };
    assert_eq!(run(), run());
}

#[test]
fn the_arm_is_led_to_the_first_point_before() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,5,0.7\n0,5.5,0.7\n0,6.5,0.5\n");
    let (_, rows) = place.commanded();
    assert_eq!((rows[0][0], rows[0][3]), (5.0, 0.7));
    assert!((rows.last().unwrap()[3] - 0.5).abs() < 1e-12);
}

#[test]
fn rows_are_executed_in_the_order_of_the_times_that_they_are_meant_for() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,2,0.2\n0.1,0,0\n0.2,1,0.1\n");
    let (_, rows) = place.commanded();
    let at = |time: f64| rows.iter().find(|row| (row[0] - time).abs() < 1e-9).unwrap()[3];
    assert_eq!((at(0.0), at(1.0)), (0.0, 0.1));
}

#[test]
fn a_row_that_breaks_a_limit_is_named_with_its_line_its_joint_and_the_limit() {
    let place = Place::new();
    let head = "arrive,at,joint1,joint2\n0,0,0,0\n0,1,0.1,0\n";
    let words = place.refused(format!("{head}0,2,0.1,1.9\n"));
    assert!(words.contains("line 4: joint2: the position 1.9") && words.contains("1.8326"), "{words}");
    let words = place.refused(format!("{head}0,1.1,0.4,0\n0,3,0.4,0\n"));
    assert!(words.contains("line 4: joint1: the velocity 3.0") && words.contains("2.3925"), "{words}");
    let words = place.refused(format!("{head}0,1.2,0.5,0\n0,1.4,0.1,0\n0,3,0.1,0\n"));
    assert!(words.contains("joint1: the ") && words.contains("is beyond the limit of"), "{words}");
    let words = place.refused("arrive,at,joint1,joint1.velocity\n0,0,0,0\n0,3,2.6,1\n0,3.4,2.94,0.7\n");
    assert!(words.contains("line 4: joint1: the last point is passed in motion"), "{words}");
    let words = place.refused("arrive,at,joint1,joint1.velocity\n0,0,0,0.3\n0,1,0.1,0\n");
    assert!(words.contains("line 2: joint1: the trajectory begins at rest"), "{words}");
}

#[test]
fn a_wrong_file_is_refused_at_its_line_and_column_before_anything_moves() {
    let place = Place::new();
    let refused = |text: &str, expected: &str| {
        let words = place.refused(text);
        assert!(words.contains(expected), "{words}");
    };
    refused("", "line 1: the file is empty");
    refused("arrive,at,joint1\n", "line 2: there is no row");
    refused("arrive,at,joint7\n0,0,0\n", "line 1, column 11: the column `joint7` is not known");
    refused("arrive,at,joint1\n0,0,0\n0,1,nan\n", "line 3, column 5: `joint1` is not a finite number");
    refused("arrive,at,joint1\n0,0,0\n0,1\n", "line 3: this row has 2 cells");
    refused(
        "arrive,at,joint1\n0.5,0,0\n0.4,1,0\n",
        "line 3, column 1: rows stand in the order of their arrival",
    );
    refused("arrive,at,joint1\n0,0,0\n0,1,0.1\n0,1,0.1\n", "line 4: another row is meant for 1 s too");
    refused(
        "arrive,at,joint1,joint1.velocity\n0,0,0,0\n0,1,0.1,\n",
        "line 3: joint1: its velocity is missing",
    );
    refused(
        "arrive,at,joint1,joint1.torque\n0,0,0,0\n0,1,0.1,1\n",
        "line 1, column 18: a trajectory takes no torques",
    );
    let words = place.refused(b"arrive,at,joint1\n0,0,\xff\n");
    assert!(words.contains("line 2: the file is not text"), "{words}");
}

#[test]
fn a_wrong_file_is_an_object_with_json() {
    let place = Place::new();
    place.write("arrive,at,joint1\n0,0,0\n0,1,x\n");
    let output = place.play(&["--trajectory", "--virtual", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let printed = json(&output);
    let problem = &printed["problems"][0];
    assert_eq!((problem["line"].as_u64(), problem["column"].as_u64()), (Some(3), Some(5)));
    assert!(printed["error"].as_str().unwrap().contains("points.csv: line 3, column 5: `joint1`"));
}

#[test]
fn files_of_spreadsheets_are_read() {
    let place = Place::new();
    place.write("\u{feff}\"arrive\", \"at\" , joint1\r\n0, 0, \"0\"\r\n\r\n0, 1, 0.1\r\n");
    let (report, _) = place.commanded();
    assert_eq!(report["points"], 2);
}

#[test]
fn a_file_that_cannot_be_read_or_written_is_refused_before_anything_moves() {
    let place = Place::new();
    let output = place.play(&["--trajectory", "--virtual"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot read"));
    place.write(reaching(false));
    let output = place.play(&["--trajectory", "--virtual", "--out", "missing/out.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write missing/out.csv"));
    assert!(output.stdout.is_empty());
}

#[test]
fn a_joint_whose_drive_plans_its_own_profile_cannot_be_played() {
    let place = Place::new();
    place.write("arrive,at,joint\n0,0,0\n0,1,0.1\n");
    for mode in [&["--trajectory", "--virtual"][..], &["--virtual"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_takt"))
            .arg("play")
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/erob-modes/erob-pv.toml"))
            .arg(place.path("points.csv"))
            .args(mode)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("`joint` is in a profile mode"));
    }
}

#[test]
fn the_file_that_is_played_is_not_written_over() {
    let place = Place::new();
    place.write(reaching(false));
    let output = place.play(&["--trajectory", "--virtual", "--out", "./points.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(fs::read_to_string(place.path("points.csv")).unwrap(), reaching(false));
}

#[test]
fn a_full_disk_is_told_and_is_no_success() {
    let place = Place::new();
    place.write(reaching(false));
    let output = place.play(&["--trajectory", "--virtual", "--json", "--out", "/dev/full"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("/dev/full cannot be written"));
    assert_eq!(json(&output)["stop"], Value::Null);
}

/// 0.2 rad there and back in two seconds each, of joint 3, as often as asked for; from 0, at rest.
fn swing(at_s: f64) -> f64 {
    0.1 * (1.0 - (std::f64::consts::PI * at_s.clamp(0.0, 4.0)).cos())
}

/// The swing as a stream at 50 Hz, each row at its time.
fn swinging() -> String {
    let rows = (0..=200).map(|step| {
        let at_s = f64::from(step) / 50.0;
        format!("{at_s},{at_s},{}\n", swing(at_s))
    });
    format!("arrive,at,joint3\n{}", rows.collect::<String>())
}

/// Plays a stream in virtual time. Returns the report, and what was commanded.
fn streamed(place: &Place, options: &[&str]) -> (Value, Vec<Vec<f64>>) {
    let output = place.play(&[&["--virtual", "--json", "--out", "out.csv"], options].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = fs::read_to_string(place.path("out.csv")).unwrap();
    let rows = text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect());
    (json(&output), rows.collect())
}

/// The largest distance of what was commanded from the swing so much earlier.
fn distance(rows: &[Vec<f64>], lag_s: f64) -> f64 {
    let inside = rows.iter().filter(|row| (1.0..4.0).contains(&(row[0] - lag_s)));
    inside.map(|row| (row[3] - swing(row[0] - lag_s)).abs()).fold(0.0, f64::max)
}

#[test]
fn a_stream_follows_the_rows_behind_by_the_lag_that_is_told() {
    let place = Place::new();
    place.write(swinging());
    let (report, rows) = streamed(&place, &[]);
    let lag_s = report["lag_s"].as_f64().unwrap();
    assert!(lag_s > 0.0 && lag_s <= report["lag_max_s"].as_f64().unwrap());
    assert!(distance(&rows, lag_s) < 5e-4, "{} at {lag_s}", distance(&rows, lag_s));
    assert_eq!((rows[0][0], &report["stop"], &report["points"]), (0.0, &Value::Null, &Value::from(201)));
    let (report, rows) = streamed(&place, &["--delay", "0.1"]);
    assert_eq!(report["lag_s"].as_f64(), Some(0.1));
    assert!(distance(&rows, 0.1) < 5e-4, "{}", distance(&rows, 0.1));
    let again = || fs::read(place.path("out.csv")).unwrap();
    let (first, _) = (again(), streamed(&place, &["--delay", "0.1"]));
    assert_eq!(first, again(), "bit for bit");
}

#[test]
fn later_chunks_take_the_place_of_what_earlier_ones_said_of_the_future() {
    let place = Place::new();
    let mut text = String::from("arrive,at,joint3,chunk\n");
    for chunk in 0..20 {
        for step in 0..30 {
            let at_s = f64::from(chunk) * 0.2 + f64::from(step) / 50.0;
            // What is far in the future is wrong at first.
            let wrong = if step < 20 { 0.0 } else { 0.05 };
            writeln!(text, "{},{at_s},{},{chunk}", f64::from(chunk) * 0.2, swing(at_s) + wrong).unwrap();
        }
    }
    place.write(text);
    let (report, rows) = streamed(&place, &["--delay", "0.02"]);
    assert!(distance(&rows[..3_000], 0.02) < 2e-3, "{}", distance(&rows[..3_000], 0.02));
    assert_eq!(report["stop"], Value::Null);
}

#[test]
fn a_step_is_followed_within_the_limits_or_stops_the_arm_as_asked() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,0.1,0\n0.1,0.2,0\n0.2,0.3,0.5\n0.3,0.4,0.5\n0.4,0.5,0.5\n1.5,1.6,0.5\n");
    let (report, rows) = streamed(&place, &["--follow", "smooth"]);
    let axis = &report["axes"][2];
    let largest = ["velocity_max", "acceleration_max", "jerk_max"].map(|key| axis[key].as_f64().unwrap());
    let limits = [2.3925, 8.0, 100.0];
    assert!(largest.iter().zip(limits).all(|(largest, limit)| *largest <= limit * 1.000_01), "{largest:?}");
    assert!((rows.last().unwrap()[3] - 0.5).abs() < 1e-6);
    let output = place.play(&["--virtual", "--json", "--follow", "exact"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(json(&output)["stop"]["reason"].is_string());
}

#[test]
fn a_first_point_outside_the_limits_is_refused_at_its_line() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,0.1,0\n0.1,0.05,2.5\n");
    let output = place.play(&["--virtual"]);
    assert_eq!(output.status.code(), Some(2));
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(words.contains("line 3: joint3: the arm is led to this point first"), "{words}");
}

#[test]
fn a_trajectory_in_real_time_commands_what_it_commands_in_virtual_time() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,0,0\n0,0.5,0.1\n0,0.8,0.05\n");
    let (_, rows) = place.commanded();
    let output = place.play(&["--trajectory", "--json", "--out", "real.csv"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = fs::read_to_string(place.path("real.csv")).unwrap();
    let real = text.lines().skip(1).map(|line| line.split(',').nth(3).unwrap().parse().unwrap());
    // A slot that is missed on a busy machine delays the motion, and the set-point before it may have two rows.
    let without_repeats = |mut positions: Vec<f64>| {
        positions.dedup();
        positions
    };
    assert_eq!(without_repeats(real.collect()), without_repeats(rows.iter().map(|row| row[3]).collect()));
}

#[test]
fn an_interruption_stops_the_arm_in_control() {
    let place = Place::new();
    place.write("arrive,at,joint3\n0,0,0\n0,30,0.5\n0,60,0\n");
    let child = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("play")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml"))
        .arg(place.path("points.csv"))
        .args(["--trajectory", "--json", "--out", "out.csv"])
        .current_dir(place.folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Rows are written in blocks: the first of them means that the arm moves.
    while fs::metadata(place.path("out.csv")).map_or(0, |file| file.len()) < 10_000 {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let pid = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    assert_eq!(json(&output)["stop"]["category"], 2);
}

/// The swing with a torque that is fed forward, in the arm's configuration with one line replaced.
fn with_torques(place: &Place, line: [&str; 2], torque: &str) -> Output {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml");
    let text = fs::read_to_string(config).unwrap().replacen(line[0], line[1], 1);
    fs::write(place.path("arm.toml"), text).unwrap();
    let rows = swinging().replace("joint3\n", "joint3,joint3.torque\n");
    let with = |line: &str| if line.contains("joint") { line.to_owned() } else { format!("{line},{torque}") };
    place.write(rows.lines().map(with).collect::<Vec<_>>().join("\n"));
    Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("play")
        .args([place.path("arm.toml"), place.path("points.csv")])
        .args(["--virtual", "--json"])
        .current_dir(place.folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

#[test]
fn a_column_of_torques_is_fed_forward_where_the_drive_takes_it() {
    let place = Place::new();
    for line in [
        ["mode = \"csp\"", "mode = \"cst\""],
        ["mode = \"csp\"", "mode = \"csp\"\nfeed_forward = \"torque\""],
    ] {
        let output = with_torques(&place, line, "3");
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        assert_eq!(json(&output)["stop"], Value::Null);
    }
}

#[test]
fn a_torque_that_a_joint_does_not_take_is_named_with_its_line_the_joint_and_what_is_allowed() {
    let place = Place::new();
    let as_it_is = ["mode = \"csp\"", "mode = \"csp\""];
    let torque_loop = ["mode = \"csp\"", "mode = \"cst\""];
    for (line, torque, words) in [
        (as_it_is, "3", "feed_forward = \\\"torque\\\""),
        (torque_loop, "88", "a torque of 88 is beyond the limit of 87"),
    ] {
        let output = with_torques(&place, line, torque);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(said.contains(words) && said.contains("joint3"), "{said}");
    }
}

/// An arm of three joints and a finger, each a group, whose drives follow positions.
fn arm_and_finger(place: &Place) -> PathBuf {
    let text =
        include_str!("../../../../configs/arm-and-gripper.toml").replace("mode = \"pt\" ", "mode = \"csp\"");
    let (machine, _program) = text.split_once("# The moves of a group").unwrap();
    let path = place.path("machine.toml");
    fs::write(&path, machine).unwrap();
    path
}

#[test]
fn the_groups_of_the_joints_that_a_file_names_follow_it_at_the_same_times() {
    let place = Place::new();
    let machine = arm_and_finger(&place);
    let mut text = String::from("arrive,at,shoulder,finger\n");
    for step in 0..=50 {
        let (at, (position, _)) = (f64::from(step) * 0.02, reach(f64::from(step) / 50.0));
        writeln!(text, "{at},{},{},{}", at + 0.05, 0.3 * position, 0.2 * position).unwrap();
    }
    place.write(text);
    let output = place.play_on(&machine, &["--virtual", "--json", "--out", "out.csv"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let (report, out) = (json(&output), fs::read_to_string(place.path("out.csv")).unwrap());
    assert_eq!(
        (&report["points"], &report["late_points"], &report["stop"]),
        (&51.into(), &0.into(), &Value::Null)
    );
    let rows: Vec<Vec<f64>> = (out.lines().skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    // t, base, shoulder, elbow, finger. The two move in the same proportion in every cycle, and the others hold.
    for row in &rows {
        assert!((row[2] / 0.3 - row[4] / 0.2).abs() < 2e-3, "{row:?}");
        assert!(row[1].abs() < 1e-3 && row[3].abs() < 1e-3, "{row:?}");
    }
    let last = rows.last().unwrap();
    assert!((last[2] - 0.3).abs() < 1e-3 && (last[4] - 0.2).abs() < 1e-3, "{last:?}");
}

#[test]
fn a_trajectory_is_for_one_group_and_says_whose_joints_it_names() {
    let place = Place::new();
    let machine = arm_and_finger(&place);
    place.write("arrive,at,shoulder,finger\n0,1,0.1,0.1\n0,2,0.2,0.2\n");
    let output = place.play_on(&machine, &["--trajectory", "--virtual"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let expected = "a trajectory is for one group: this joint is of \"gripper\", and another one of \"arm\"";
    assert!(said.contains("finger") && said.contains(expected), "{said}");

    place.write("arrive,at,finger\n0,1,0.1\n0,2,0.2\n");
    let output = place.play_on(&machine, &["--trajectory", "--virtual", "--out", "out.csv"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let out = fs::read_to_string(place.path("out.csv")).unwrap();
    let last: Vec<f64> = out.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((last[4] - 0.2).abs() < 1e-6, "{last:?}");
}

#[test]
fn a_joint_trajectory_of_ros_and_a_table_of_it_are_executed_and_said_to_be_done() {
    let place = Place::new();
    let message = r#"{"joint_names": ["joint2", "joint1"], "points": [
        {"positions": [-0.2, 0.1], "time_from_start": {"sec": 0, "nanosec": 0}},
        {"positions": [-0.25, 0.2], "time_from_start": {"sec": 0, "nanosec": 700000000}},
        {"positions": [-0.3, 0.3], "time_from_start": {"sec": 1, "nanosec": 500000000}}]}"#;
    let yaml = "joint_names: [joint2, joint1]\npoints:\n- positions: [-0.2, 0.1]\n  time_from_start: {sec: 0, nanosec: 0}\n\
                - positions: [-0.25, 0.2]\n  time_from_start: {sec: 0, nanosec: 700000000}\n\
                - positions: [-0.3, 0.3]\n  time_from_start: {sec: 1, nanosec: 500000000}\n---\n";
    let table = "time_from_start,joint2,joint1\n0,-0.2,0.1\n0.7,-0.25,0.2\n1.5,-0.3,0.3\n";
    let mut ends = vec![];
    for text in [message, yaml, table] {
        place.write(text);
        let output = place.play(&["--virtual", "--out", "out.csv"]);
        let (said, words) =
            (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
        assert_eq!(output.status.code(), Some(0), "{said}{words}");
        assert!(words.contains("points.csv lasts 1.5 s from its first point"), "{words}");
        assert!(said.starts_with("done: 3 points"), "{said}");
        ends.push(fs::read_to_string(place.path("out.csv")).unwrap());
    }
    assert!(ends[0] == ends[1] && ends[1] == ends[2] && ends[0].lines().count() > 1500);
    let refused = place.refused(message.replace("0.3]", "0.3, 0.4]"));
    assert!(
        refused.contains("line 4") && refused.contains("`positions` has 3 numbers for 2 joints"),
        "{refused}"
    );
}
