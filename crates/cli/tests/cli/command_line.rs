//! `takt` as a user meets it: what it prints, what it leaves behind, and how it ends.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use tempfile::TempDir;

/// A folder with the six-axis arm and two of its moves, recording into `runs` beside it.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        // Somebody else than the owner reads it when the rights are dropped.
        fs::set_permissions(place.folder.path(), fs::Permissions::from_mode(0o777)).unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml");
        let text = fs::read_to_string(example).unwrap();
        let moves: Vec<&str> = text.split("[[program.move]]").collect();
        let shortened = moves[..3].join("[[program.move]]");
        let runs = place.folder.path().join("runs");
        fs::write(place.config(), format!("{shortened}\n[telemetry]\ndirectory = {runs:?}\n")).unwrap();
        place
    }

    fn config(&self) -> PathBuf {
        self.folder.path().join("arm.toml")
    }

    fn change(&self, from: &str, to: &str) {
        let text = fs::read_to_string(self.config()).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(self.config(), text.replace(from, to)).unwrap();
    }

    fn run(&self, options: &[&str]) -> Child {
        Command::new(env!("CARGO_BIN_EXE_takt"))
            .arg("run")
            .arg(self.config())
            .args(options)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Starts a run and waits until the arm moves. What the program writes on standard error is not kept.
    fn run_until_it_moves(&self, options: &[&str]) -> Child {
        let mut child = self.run(&[&["--log", "info"], options].concat());
        let mut told = BufReader::new(child.stderr.take().unwrap()).lines();
        assert!(
            told.any(|line| line.unwrap().contains("to=\"moving\"")),
            "the run has ended before the arm moved"
        );
        thread::spawn(move || told.for_each(drop));
        child
    }

    fn run_to_end(&self, options: &[&str]) -> Output {
        self.run(options).wait_with_output().unwrap()
    }

    /// Runs without any right that real time needs, whoever runs the tests.
    fn run_unprivileged(&self, options: &[&str]) -> Output {
        // Where the binary lies may be closed to others, so a copy runs.
        let program = self.folder.path().join("takt");
        fs::copy(env!("CARGO_BIN_EXE_takt"), &program).unwrap();
        let mut command = if nix::unistd::geteuid().is_root() {
            let mut command = Command::new("setpriv");
            command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all"]);
            command.arg("prlimit").args(["--rtprio=0:0", "--memlock=65536:65536"]).arg(&program);
            command
        } else {
            let mut command = Command::new("prlimit");
            command.args(["--rtprio=0:0", "--memlock=65536:65536"]).arg(&program);
            command
        };
        command.arg("run").arg(self.config()).args(options).stdin(Stdio::null()).output().unwrap()
    }
}

fn report(output: &Output) -> Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn signal(child: &Child, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
}

#[test]
fn a_run_ends_with_0_and_every_axis_within_two_counts_of_its_target() {
    let output = Place::new().run_to_end(&["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let report = report(&output);
    assert_eq!(report["ended"], "finished");
    assert_eq!(report["stop"], Value::Null);
    assert_eq!(report["telemetry"]["dropped"], 0);
    assert_eq!(report["cycle_ns"], 1_000_000);
    let axes = report["axes"].as_array().unwrap();
    assert_eq!(axes.len(), 6);
    for axis in axes {
        let counts = axis["final_error_counts"].as_f64().unwrap();
        assert!(counts.abs() <= 2.0, "{axis}");
        let following = axis["following_error_max"].as_f64().unwrap();
        assert!(following > 0.0 && following < 0.1, "{axis}");
        for derivative in ["velocity", "acceleration", "jerk"] {
            let (reached, limit) = (&axis["set_point_max"][derivative], &axis["limits"][derivative]);
            let part = reached.as_f64().unwrap() / limit.as_f64().unwrap();
            assert!(part > 0.01 && part <= 1.000_01, "{derivative} of {axis}");
        }
    }
    for bus in report["buses"].as_array().unwrap() {
        assert!(bus["load_percent"].as_f64().unwrap() > 20.0, "{bus}");
        assert_eq!((&bus["tx_overruns"], &bus["errors"]), (&Value::from(0), &Value::from(0)));
    }
    for key in ["wake_ns", "sync_ns", "compute_ns"] {
        for quantile in ["p50", "p99", "p999", "max"] {
            assert!(report[key][quantile].is_u64(), "{key}.{quantile}");
        }
    }
    for key in ["policy", "priority", "cpu", "memory_locked", "preempt_rt", "page_faults"] {
        assert!(report["realtime"].get(key).is_some(), "realtime.{key}");
    }
}

#[test]
fn a_run_leaves_a_recording_and_a_report_for_people() {
    let place = Place::new();
    let output = place.run_to_end(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in
        ["program finished", "wake-up latency", "SYNC release error", "joint6", "missed slots", "real-time"]
    {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    let recordings: Vec<_> = fs::read_dir(place.folder.path().join("runs")).unwrap().collect();
    assert_eq!(recordings.len(), 1);
}

#[test]
fn without_rights_the_run_is_done_all_the_same_and_says_what_was_refused_and_how_to_grant_it() {
    let place = Place::new();
    // An ordinary thread cannot keep every cycle of 1 ms on a busy machine.
    place.change("period = \"1 ms\"", "period = \"4 ms\"");
    let output = place.run_unprivileged(&["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let realtime = &report(&output)["realtime"];
    assert_eq!((&realtime["priority"], &realtime["memory_locked"]), (&Value::Null, &Value::Bool(false)));
    let commands = realtime["grant_with"].to_string();
    assert!(commands.contains("sudo setcap cap_sys_nice,cap_ipc_lock=ep "), "{commands}");
    assert!(realtime["refused"].to_string().contains("SCHED_FIFO"), "{realtime}");
}

#[test]
fn required_real_time_that_is_refused_ends_with_3_before_anything_moves() {
    let place = Place::new();
    let output = place.run_unprivileged(&["--require-realtime"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(output.stdout.is_empty());
    assert!(errors(&output).contains("sudo setcap"), "{}", errors(&output));
}

#[test]
fn a_wrong_configuration_ends_with_2_and_the_line() {
    let place = Place::new();
    place.change("velocity = \"2.3925 rad/s\"", "velocity = \"2.3925 kg\"");
    let output = place.run_to_end(&[]);
    assert_eq!(output.status.code(), Some(2));
    let errors = errors(&output);
    assert!(errors.contains("arm.toml:") && errors.contains("2.3925 kg"), "{errors}");
}

#[test]
fn a_bus_that_cannot_carry_its_traffic_is_refused_with_the_sums() {
    let place = Place::new();
    place.change("bus = \"wrist\"", "bus = \"base\"");
    let output = place.run_to_end(&[]);
    assert_eq!(output.status.code(), Some(2));
    let errors = errors(&output);
    assert!(errors.contains("base") && errors.contains("1495"), "{errors}");
}

#[test]
fn an_unknown_bus_on_the_command_line_is_refused() {
    let output = Place::new().run_to_end(&["--bus", "tail=can7"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(errors(&output).contains("tail"), "{}", errors(&output));
}

#[test]
fn ctrl_c_sigterm_and_a_closed_terminal_stop_in_control_and_end_with_130() {
    for which in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        let place = Place::new();
        let child = place.run_until_it_moves(&["--json"]);
        signal(&child, which);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
        let report = report(&output);
        assert_eq!(report["ended"], "interrupted");
        assert_eq!(report["stop"]["category"], 2, "{report}");
        assert_eq!(report["telemetry"]["dropped"], 0);
    }
}

/// Whatever `nohup` starts has this signal ignored.
#[test]
fn a_run_that_was_told_to_outlive_its_terminal_does() {
    let place = Place::new();
    let child = Command::new("nohup")
        .arg(env!("CARGO_BIN_EXE_takt"))
        .arg("run")
        .arg(place.config())
        .arg("--json")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_millis(1_500));
    signal(&child, Signal::SIGHUP);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    assert_eq!(report(&output)["ended"], "finished");
}

#[test]
fn a_second_ctrl_c_ends_at_once() {
    let place = Place::new();
    place.change("velocity = \"80 %\"", "velocity = \"5 %\"");
    let child = place.run_until_it_moves(&[]);
    let began = Instant::now();
    signal(&child, Signal::SIGINT);
    thread::sleep(Duration::from_millis(20));
    signal(&child, Signal::SIGINT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{} after {:?}", errors(&output), began.elapsed());
}

#[test]
fn a_process_that_is_frozen_in_motion_goes_on_and_counts_what_it_missed() {
    let place = Place::new();
    let child = place.run_until_it_moves(&["--json"]);
    signal(&child, Signal::SIGSTOP);
    thread::sleep(Duration::from_millis(200));
    signal(&child, Signal::SIGCONT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let report = report(&output);
    assert!(report["missed_slots"].as_u64().unwrap() >= 150, "{}", report["missed_slots"]);
    for axis in report["axes"].as_array().unwrap() {
        assert!(axis["final_error_counts"].as_f64().unwrap().abs() <= 2.0, "{axis}");
    }
}

#[test]
fn a_folder_that_cannot_be_written_costs_the_recording_and_ends_with_1_and_one_message() {
    let place = Place::new();
    fs::write(place.folder.path().join("runs"), "in the way").unwrap();
    let output = place.run_to_end(&["--json"]);
    assert_eq!(output.status.code(), Some(1), "{}", errors(&output));
    assert_eq!(errors(&output).lines().count(), 1, "{}", errors(&output));
    assert!(errors(&output).contains("runs/"), "{}", errors(&output));
    let report = report(&output);
    assert_eq!(report["telemetry"]["recording"], Value::Null);
    assert_eq!((&report["ended"], &report["stop"]), (&"finished".into(), &Value::Null));
}

#[test]
fn a_run_that_is_interrupted_before_it_is_enabled_does_not_say_that_it_has_finished() {
    let place = Place::new();
    let child = place.run(&[]);
    // The simulated drives take longer than that to power up.
    thread::sleep(Duration::from_millis(200));
    signal(&child, Signal::SIGINT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("interrupted before the axes were enabled"), "{text}");
    assert!(!text.contains("program finished"), "{text}");
}

/// `takt run … 2>&1 | head`
#[test]
fn a_run_whose_messages_nobody_reads_any_more_stops_and_reports_as_ever() {
    let place = Place::new();
    let (reader, nobody) = std::io::pipe().unwrap();
    drop(reader);
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/faults/blocked-joint.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("run")
        .arg(place.config())
        .args(["--json", "--faults"])
        .arg(scenario)
        .stderr(nobody)
        .output()
        .unwrap();
    assert_eq!(
        (output.status.code(), &report(&output)["stop"]["rule"]),
        (Some(1), &"following_error".into())
    );
}

/// The drive has no torque in the end, by SDO, and its statusword had said otherwise for longer than a drive may take to switch off.
#[test]
fn power_is_not_said_to_be_off_where_a_drive_has_contradicted_itself() {
    let place = Place::new();
    let scenario = place.folder.path().join("faults.toml");
    let fault = "[[fault]]\nkind = \"statusword\"\naxis = \"joint2\"\nset = 0x0027\nclear = 0x0048\nwhen = \"moving\"\nat = \"100 ms\"\n";
    fs::write(&scenario, fault).unwrap();
    let output = place.run_to_end(&["--json", "--faults", scenario.to_str().unwrap()]);
    let report = report(&output);
    assert_eq!(report["is_power_off"], Value::from(false), "{report}");
}

#[test]
fn a_duration_that_cannot_be_is_named_with_its_option() {
    let place = Place::new();
    // The last but one is more than the clock can count in nanoseconds.
    for duration in ["-1", "0", "nan", "inf", "soon", "18446744073.709551615", "1e300"] {
        let output = place.run_to_end(&["--duration", duration]);
        assert_eq!(output.status.code(), Some(2));
        let said = errors(&output);
        assert!(
            said.starts_with(&format!("error: invalid value '{duration}' for '--duration <S>': ")),
            "{said}"
        );
    }
}

/// Nothing was done, and a program can read why.
#[test]
fn whatever_is_refused_is_one_object_after_json_with_what_is_wrong() {
    let place = Place::new();
    let (config, folder) = (place.config(), place.folder.path());
    let nowhere = folder.join("nowhere");
    let (config, nowhere, folder) =
        (config.to_str().unwrap(), nowhere.to_str().unwrap(), folder.to_str().unwrap());
    let cases: &[(&[&str], &str)] = &[
        (&["run", nowhere], nowhere),
        (&["run", folder], folder),
        (&["run", config, "--faults", nowhere], nowhere),
        (&["run", config, "--bus", "tail=can7"], "tail"),
        (&["run", config, "--bus", "base=sim", "--bus", "base=sim"], "connected already"),
        (&["run", config, "--bus", "base=nobody0"], "no interface nobody0"),
        (&["run", config, "--duration", "nan"], "--duration <S>"),
        (&["run"], "<CONFIG>"),
        (&["check", nowhere], nowhere),
        (&["report", nowhere], nowhere),
        (&["report", config], "not an MCAP file"),
        (&["eds", nowhere], nowhere),
        (&["doctor", nowhere], nowhere),
        (&["jitter", "--bus", "nobody0"], "no interface nobody0"),
        (&["jitter", "--cycles", "-5"], "--cycles <N>"),
        (&["lss", "--bus", "sim", "scan"], "--simulate"),
        (&["lss", "--bus", "nobody0", "scan"], "no interface nobody0"),
        (&["lss", "--bus", "can0", "--simulate", "1:2:3:4", "scan"], "--bus sim"),
        (&["drive", nowhere, "joint1", "info"], nowhere),
        (&["drive", config, "elbow", "info"], "joint1, joint2"),
        (&["drive", config, "info"], "joint1, joint2"),
        (&["drive", config, "joint1", "--bus", "tail=sim", "info"], "tail"),
        (&["drive", config, "joint1", "--family", "yz-aim", "info"], "erob-canopen"),
        (&["drive", "--bus", "sim", "--node", "1", "--family", "yz-aim", "info"], "needs a configuration"),
        (&["drive", "--bus", "nobody0", "--node", "1", "--family", "yz-aim", "info"], "no interface nobody0"),
        (&["drive", config, "joint1", "dance"], "dance"),
        (&["dance"], "dance"),
    ];
    for (arguments, words) in cases {
        let output =
            Command::new(env!("CARGO_BIN_EXE_takt")).args(*arguments).arg("--json").output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", errors(&output));
        let refusal = report(&output);
        assert!(refusal["error"].as_str().unwrap().contains(words), "{arguments:?}: {refusal}");
        assert!(refusal["problems"].is_array() && output.stderr.is_empty(), "{arguments:?}: {refusal}");
    }
}

#[test]
fn required_real_time_that_is_refused_is_one_object_after_json_with_the_commands_that_grant_it() {
    let output = Place::new().run_unprivileged(&["--require-realtime", "--json"]);
    assert_eq!(output.status.code(), Some(3), "{}", errors(&output));
    let refusal = report(&output);
    assert!(refusal["error"].is_string(), "{refusal}");
    assert!(refusal["realtime"]["grant_with"].to_string().contains("sudo setcap"), "{refusal}");
}

#[test]
fn a_result_that_a_full_disk_has_swallowed_is_no_success() {
    let place = Place::new();
    for subcommand in [&["check"][..], &["check", "--json"]] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_takt"))
            .args(subcommand)
            .arg(place.config())
            .stdout(full)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(errors(&output).contains("cannot be written to standard output"), "{}", errors(&output));
    }
}

/// Whoever made the file must not have the terminal.
#[test]
fn what_a_terminal_would_obey_is_not_shown_of_a_file() {
    let place = Place::new();
    let config = place.config();
    let check = || {
        let output = Command::new(env!("CARGO_BIN_EXE_takt")).arg("check").arg(&config).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        output
    };
    for (text, words) in [
        ("\"a\\u001b[2Jkey\" = 1\n", "`a?[2Jkey` means nothing here"),
        ("name = \"raw \u{1b}[31m red\"\n", "raw ?[31m red"),
        ("# \u{9b}31m \u{202e}\nnam = \"arm\"\n", "# ¿31m \u{fffd}"),
    ] {
        fs::write(&config, text).unwrap();
        let said = errors(&check());
        assert!(said.contains(words), "{said}");
        assert!(!said.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{said:?}");
    }
    fs::write(&config, [b"name = \"arm\"\n# \xff".as_slice(), b"\x1b[2J\x07\n"].concat()).unwrap();
    assert!(!errors(&check()).contains(['\u{1b}', '\u{7}']));
}

/// Names that a shell has completed, and paths in a configuration, may be anybody's, too.
#[test]
fn what_a_terminal_would_obey_is_not_shown_of_an_argument_or_a_path() {
    let place = Place::new();
    let text = fs::read_to_string(place.config()).unwrap();
    let moves: Vec<&str> = text.split("[[program.move]]").collect();
    let folder = place.folder.path().join("a\u{1b}[31mb");
    let recorded = place.folder.path().join("recorded.toml");
    let telemetry = format!("[telemetry]\ndirectory = \"{}/a\\u001b[31mb\"\n", place.folder.path().display());
    fs::write(&recorded, [moves[0], "\n", &telemetry].concat()).unwrap();
    let with_dcf = place.folder.path().join("dcf.toml");
    let dcf = "name = \"joint1\"\ndcf = \"a\\u001b[31mb.dcf\"\n";
    fs::write(&with_dcf, moves[0].replacen("name = \"joint1\"\n", dcf, 1)).unwrap();
    let escaped = folder.to_str().unwrap();
    let (recorded, with_dcf) = (recorded.to_str().unwrap(), with_dcf.to_str().unwrap());
    for (arguments, status) in [
        (&["run", recorded][..], 0),
        (&["check", with_dcf], 2),
        (&["run", escaped], 2),
        (&["check", escaped], 2),
        (&["eds", escaped], 2),
        (&["report", escaped], 2),
        (&["plan", escaped], 2),
        (&["drive", recorded, escaped, "info"], 2),
        (&["run", recorded, "--bus", escaped], 2),
        (&["run", recorded, "--faults", escaped], 2),
        (&["run", recorded, escaped], 2),
        (&[escaped], 2),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).output().unwrap();
        let said = String::from_utf8([output.stdout.as_slice(), &output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said:?}");
        assert!(!said.contains('\u{1b}'), "{arguments:?}: {said:?}");
        // clap leaves escape sequences out where it does not print to a terminal.
        assert!(said.contains("[31mb") || said.contains("/ab'"), "{arguments:?}: {said:?}");
    }
    let on_a_terminal = Command::new("script")
        .args(["--quiet", "--return", "--command", "\"$TAKT\" \"$ARGUMENT\"", "/dev/null"])
        .env("TAKT", env!("CARGO_BIN_EXE_takt"))
        .env("ARGUMENT", escaped)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8(on_a_terminal.stdout).unwrap();
    assert!(said.contains("unrecognized subcommand") && !said.contains('\u{1b}'), "{said:?}");
}

#[test]
fn check_says_whether_a_configuration_fits() {
    let place = Place::new();
    let check = |options: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_takt"))
            .arg("check")
            .arg(place.config())
            .args(options)
            .output()
            .unwrap()
    };
    let output = check(&["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    assert_eq!(report(&output)["fits"], true);
    place.change("bus = \"wrist\"", "bus = \"base\"");
    let output = check(&["--json"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(report(&output)["fits"], false);
}

#[test]
fn shells_and_manual_pages_know_every_subcommand() {
    let takt =
        |arguments: &[&str]| Command::new(env!("CARGO_BIN_EXE_takt")).args(arguments).output().unwrap();
    let help = String::from_utf8(takt(&["--help"]).stdout).unwrap();
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names: Vec<&str> = commands
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.contains(&"run") && names.contains(&"manual"), "{help}");
    let folder = tempfile::tempdir().unwrap();
    assert!(takt(&["manual", folder.path().to_str().unwrap()]).status.success());
    for name in &names {
        let page = fs::read_to_string(folder.path().join(format!("takt-{name}.1"))).unwrap();
        assert!(page.contains("SYNOPSIS"), "{page}");
    }
    for shell in ["bash", "zsh", "fish"] {
        let script = String::from_utf8(takt(&["completions", shell]).stdout).unwrap();
        assert!(names.iter().all(|name| script.contains(name)), "{shell}: {script}");
    }
    let refused = takt(&["manual", "/nowhere"]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && message.contains("/nowhere"), "{message}");
}
