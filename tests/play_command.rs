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
        Command::new(env!("CARGO_BIN_EXE_takt"))
            .arg("play")
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/arm6-erob.toml"))
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
        for row in &rows {
            let (position, velocity) = reach((row[0] - 0.1) / 2.0);
            assert!((row[2] - 0.6 * position).abs() < 1e-6, "{row:?}");
            assert!((row[5] + 0.9 * position).abs() < 1e-6, "{row:?}");
            assert!((row[8] - 0.3 * velocity).abs() < 1e-4, "{row:?}");
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
fn a_full_disk_is_told_and_is_no_success() {
    let place = Place::new();
    place.write(reaching(false));
    let output = place.play(&["--trajectory", "--virtual", "--json", "--out", "/dev/full"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("/dev/full cannot be written"));
    assert_eq!(json(&output)["stop"], Value::Null);
}
