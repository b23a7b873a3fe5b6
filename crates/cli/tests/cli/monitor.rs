//! `takt monitor` as a user meets it: logs with known content (`tests/monitor`), and an adapter on a pseudo-terminal.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;
use takt::sim::pseudo_terminal::PseudoTerminal;
use tempfile::TempDir;

use crate::printed::{ends_with, errors, said};
use crate::simulated::Simulated;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn takt() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.arg("monitor").current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command.env_remove("COLUMNS").env_remove("NO_COLOR");
    command
}

fn monitor(arguments: &[&str]) -> Output {
    takt().args(arguments).output().unwrap()
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

#[track_caller]
fn shows(arguments: &[&str], expected: &str) {
    let output = monitor(arguments);
    ends_with(0, &output);
    let expected = fs::read_to_string(here(expected)).unwrap();
    assert_eq!(said(&output), expected, "{arguments:?}");
}

#[track_caller]
fn is_refused(arguments: &[&str], words: &str) {
    let output = monitor(arguments);
    ends_with(2, &output);
    assert!(errors(&output).contains(words), "{}", errors(&output));
    assert!(output.stdout.is_empty());
}

#[test]
fn every_service_of_a_bus_without_a_configuration_has_its_meaning() {
    shows(&["tests/monitor/every_service.log"], "tests/monitor/every_service.txt");
}

#[test]
fn a_family_that_is_named_gives_words_and_units_and_so_does_a_data_sheet() {
    let log = "tests/monitor/every_service.log";
    shows(&[log, "--family", "5=erob-canopen", "--node", "5"], "tests/monitor/family.txt");
    shows(
        &[log, "--eds", "../../configs/eds/erob-canopen.eds", "--node", "5", "--kind", "sdo"],
        "tests/monitor/data_sheet.txt",
    );
}

#[test]
fn a_configuration_gives_names_to_the_axes_and_units_to_process_data_of_every_family() {
    for name in ["canopen", "hollow", "own_protocol", "two_buses"] {
        let (log, config) = (format!("tests/monitor/{name}.log"), format!("tests/monitor/{name}.toml"));
        shows(&[&log, &config], &format!("tests/monitor/{name}.txt"));
    }
}

#[test]
fn each_frame_is_one_json_object_in_a_line() {
    let output = monitor(&["tests/monitor/canopen.log", "tests/monitor/canopen.toml", "--json"]);
    ends_with(0, &output);
    assert!(output.stderr.is_empty(), "{}", errors(&output));
    let objects: Vec<Value> = said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let feedback = objects.iter().find(|object| object["service"] == "TPDO1").unwrap();
    assert_eq!(
        (&feedback["axis"], &feedback["node"], &feedback["to_drives"]),
        (&"joint".into(), &1.into(), &false.into())
    );
    let position = &feedback["values"][1];
    assert_eq!((&position["object"], &position["raw"]), (&"6064:00".into(), &131_072.into()));
    assert!((position["value"].as_f64().unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{position}");
}

#[test]
fn frames_are_chosen_by_identifier_node_axis_and_kind() {
    let log = "tests/monitor/every_service.log";
    let frames = |arguments: &[&str]| {
        let mut all = vec![log, "--json"];
        all.extend(arguments);
        let output = monitor(&all);
        ends_with(0, &output);
        let object = |line: &str| serde_json::from_str::<Value>(line).unwrap();
        said(&output).lines().map(|line| object(line)["id"].as_u64().unwrap()).collect::<Vec<u64>>()
    };
    assert_eq!(frames(&["--kind", "sync,emcy"]), [0x085, 0x080, 0x080]);
    assert_eq!(frames(&["--id", "7E4:7FE"]), [0x7E5, 0x7E4, 0x7E5, 0x7E5, 0x7E4]);
    assert_eq!(frames(&["--id", "12345678"]), [0x1234_5678]);
    assert_eq!(frames(&["--node", "5", "--kind", "heartbeat"]), [0x705, 0x705, 0x705, 0x705]);
    assert_eq!(frames(&["--count", "2"]), [0, 0x705]);
    assert_eq!(frames(&["--duration", "0.4"]), [0, 0x705]);
    is_refused(&[log, "--axis", "joint"], "a configuration names the axes");
    is_refused(&[log, "tests/monitor/canopen.toml", "--axis", "elbow"], "the axes are: joint");
    is_refused(&[log, "--kind", "everything"], "the kinds are nmt, sync");
    is_refused(&[log, "--id", "18x"], "write an identifier in hexadecimal");
}

#[test]
fn what_cannot_be_watched_is_named_with_the_cure() {
    is_refused(&[], "say what to watch");
    is_refused(&["no-such.log"], "no-such.log: No such file");
    is_refused(&["Cargo.toml", "../../configs/first.toml"], "there is a configuration already");
    is_refused(&["README.md"], "this is no log of a bus; line 1");
    is_refused(&["tests"], "this is a folder");
    is_refused(&["../../configs/first.toml"], "say what it is connected to");
    is_refused(&["--bus", "takt-none"], "there is no interface takt-none");
    is_refused(&["--bus", "arm=can0"], "a configuration names the buses");
    is_refused(&["x.log", "--bus", "can0"], "are watched at a time");
    is_refused(&["x.log", "--family", "no-such"], "the families are");
    is_refused(&["x.log", "--write", "frames.xyz"], "the end of its name says how");
}

/// What was read from a log, whatever its kind: identifier, data and direction.
fn frames_of(path: &Path) -> Vec<Value> {
    let output = monitor(&[path.to_str().unwrap(), "--json"]);
    ends_with(0, &output);
    let object = |line: &str| serde_json::from_str::<Value>(line).unwrap();
    said(&output).lines().map(|line| object(line)["frame"].clone()).collect()
}

#[test]
fn every_kind_of_log_is_written_and_read_to_the_same_frames() {
    let log = here("tests/monitor/every_service.log");
    let original = frames_of(&log);
    assert!(original.len() > 60);
    let folder = folder();
    for end in ["log", "txt", "pcapng", "csv"] {
        let written = folder.path().join(format!("frames.{end}"));
        let output = monitor(&[log.to_str().unwrap(), "--quiet", "--write", written.to_str().unwrap()]);
        ends_with(0, &output);
        assert!(output.stdout.is_empty());
        assert_eq!(frames_of(&written), original, "{end}");
        let again = monitor(&[log.to_str().unwrap(), "--write", written.to_str().unwrap()]);
        ends_with(2, &again);
        assert!(errors(&again).contains("there is such a file already"), "{}", errors(&again));
    }
    let original = fs::read_to_string(&log).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("frames.log")).unwrap(), original);
}

#[test]
fn logs_of_other_programs_are_read() {
    for (name, frames) in [("printed_by_candump.txt", 7), ("vendor_tool.csv", 4), ("wireshark.pcapng", 62)] {
        let path = here("tests/monitor").join(name);
        assert_eq!(frames_of(&path).len(), frames, "{name}");
    }
    let directions = monitor(&["tests/monitor/printed_by_candump.txt", "--json"]);
    assert!(said(&directions).contains("\"direction\":\"sent\""), "{}", said(&directions));
}

#[test]
fn a_log_from_standard_input_is_shown_line_by_line() {
    let mut child = takt().arg("-").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    for _ in 0..2 {
        input.write_all(b" (0.000000)  can0  080   [0]\n").unwrap();
        assert!(lines.next().unwrap().unwrap().ends_with("SYNC"));
    }
    drop(input);
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_black_box_is_shown_with_directions_and_the_names_of_its_buses() {
    let folder = folder();
    let scenario = folder.path().join("scenario.toml");
    fs::write(
        &scenario,
        "[[fault]]\nkind = \"alarm\"\naxis = \"joint\"\ncode = 0x4310\nwhen = \"moving\"\nat = \"20 ms\"\n",
    )
    .unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("run")
        .arg(here("tests/monitor/canopen.toml"))
        .arg("--faults")
        .arg(&scenario)
        .current_dir(folder.path())
        .output()
        .unwrap();
    ends_with(1, &run);
    let runs = fs::read_dir(folder.path().join("runs")).unwrap().map(|entry| entry.unwrap().path());
    let is_box = |path: &PathBuf| path.to_string_lossy().contains("black-box");
    let (boxes, others): (Vec<PathBuf>, Vec<PathBuf>) = runs.partition(is_box);
    let output = monitor(&[boxes[0].to_str().unwrap(), "tests/monitor/canopen.toml", "--json"]);
    ends_with(0, &output);
    let objects: Vec<Value> = said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let has = |key: &str, value: &str| objects.iter().any(|object| object[key] == value);
    assert!(has("direction", "sent") && has("direction", "received") && has("bus", "can"));
    assert!(has("service", "SYNC") && has("service", "EMCY") && has("axis", "joint"));
    assert!(objects.is_sorted_by(|one, other| one["time"].as_f64() <= other["time"].as_f64()));
    // The log of the same run has at least as many frames, and the recording has none.
    let log = others.iter().find(|path| path.extension().is_some_and(|end| end == "log")).unwrap();
    assert!(frames_of(log).len() >= objects.len());
    let recording = others.iter().find(|path| path.extension().is_some_and(|end| end == "mcap")).unwrap();
    is_refused(&[recording.to_str().unwrap()], "this recording has no frames");
}

#[test]
fn damaged_lines_are_passed_over_and_told() {
    let folder = folder();
    let log = folder.path().join("damaged.log");
    fs::write(&log, "(1.0) can0 080#\n(1.1) can0 08\n(1.2) can0 20000004#0000\n(1.3) can0 080#01\n").unwrap();
    let output = monitor(&[log.to_str().unwrap()]);
    ends_with(0, &output);
    assert_eq!(said(&output).lines().count(), 2);
    assert!(
        errors(&output).contains("1 lines (blocks) of") && errors(&output).contains("the first one is 2: ")
    );
    assert!(errors(&output).contains("1 messages of CAN controllers"), "{}", errors(&output));
}

#[test]
fn rates_and_load_are_a_table_for_people_and_one_object_for_programs() {
    let output = monitor(&["tests/monitor/canopen.log", "tests/monitor/canopen.toml", "--stats"]);
    ends_with(0, &output);
    assert!(said(&output).contains("bus load") && said(&output).contains("TPDO1 joint"), "{}", said(&output));
    let output = monitor(&["tests/monitor/canopen.log", "tests/monitor/canopen.toml", "--stats", "--json"]);
    let object: Value = serde_json::from_str(&said(&output)).unwrap();
    let sync = &object["buses"][0]["ids"][0];
    assert_eq!((&sync["id"], &sync["mean_ns"]), (&0x080.into(), &1_000_000.into()), "{object}");
}

#[test]
fn a_reader_that_ends_ends_it_quietly() {
    let folder = folder();
    let log = folder.path().join("long.log");
    fs::write(&log, "(1.0) can0 080#\n".repeat(200_000)).unwrap();
    let mut child = takt().arg(&log).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.ends_with("SYNC\n"), "{line}");
    let output = child.wait_with_output().unwrap();
    ends_with(0, &output);
    assert!(output.stderr.is_empty(), "{}", errors(&output));
}

/// What is printed on a terminal with so many columns.
fn on_terminal(columns: &str, variables: &[(&str, &str)]) -> String {
    let mut terminal = PseudoTerminal::open().unwrap();
    let device = fs::OpenOptions::new().read(true).write(true).open(terminal.path()).unwrap();
    let mut command = takt();
    command.arg("tests/monitor/every_service.log").env("COLUMNS", columns).envs(variables.iter().copied());
    let mut child = command.stdout(Stdio::from(device)).stderr(Stdio::null()).spawn().unwrap();
    let mut text = String::new();
    loop {
        let has_ended = child.try_wait().unwrap().is_some();
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = terminal.read(&mut bytes) {
            text.push_str(&String::from_utf8_lossy(&bytes[..count]));
        }
        if has_ended {
            return text;
        }
        thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_terminal_gets_colours_unless_they_are_not_wanted_and_lines_that_fit() {
    assert!(on_terminal("100", &[]).contains("\x1b[1;31mEMCY node 5\x1b[0m"));
    for columns in [60, 80, 200] {
        let text = on_terminal(&columns.to_string(), &[("NO_COLOR", "1")]);
        assert!(!text.contains('\x1b') && text.contains("EMCY node 5"), "{text}");
        let longest = text.lines().map(|line| line.trim_end().chars().count()).max().unwrap();
        assert!(longest <= columns, "{longest} of {columns}: {text}");
    }
}

/// An adapter on a pseudo-terminal, which the test plays.
struct Adapter {
    line: PseudoTerminal,
    from_host: String,
}

impl Adapter {
    fn new() -> Self {
        Self { line: PseudoTerminal::open().unwrap(), from_host: String::new() }
    }

    fn interface(&self) -> String {
        format!("slcan:{}", self.line.path().display())
    }

    /// Sends these lines again and again, once the channel is open, until `is_enough`. The host drops what comes together with the answer
    /// to its command.
    fn play(&mut self, lines: &[u8], mut is_enough: impl FnMut() -> bool) {
        while !is_enough() {
            let mut bytes = [0; 256];
            while let Ok(count @ 1..) = self.line.read(&mut bytes) {
                self.from_host.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
            }
            if self.from_host.contains("O\r") {
                self.line.write_all(lines).unwrap();
            }
            thread::sleep(Duration::from_millis(20));
        }
    }
}

fn spawned(command: &mut Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_live_bus_is_shown_and_nothing_is_sent_on_it() {
    let mut adapter = Adapter::new();
    let bus = adapter.interface();
    let mut child = spawned(takt().args(["--bus", &bus, "tests/monitor/canopen.toml", "--count", "3"]));
    adapter.play(b"t0800\rt181737160000020008\rt701105\r", || child.try_wait().unwrap().is_some());
    let output = child.wait_with_output().unwrap();
    ends_with(0, &output);
    let text = said(&output);
    for words in
        ["SYNC\n", "TPDO1 joint: statusword 0x1637: operation enabled", "heartbeat joint: operational\n"]
    {
        assert!(text.contains(words), "{text}");
    }
    assert!(errors(&output).starts_with("3 frames"), "{}", errors(&output));
    let frames = adapter.from_host.contains(['t', 'T', 'r', 'R', 'd', 'D', 'b', 'B']);
    assert!(!frames, "{:?}", adapter.from_host);
}

#[test]
fn ctrl_c_ends_it_with_a_summary() {
    let mut adapter = Adapter::new();
    let mut child = spawned(takt().args(["--bus", &adapter.interface()]));
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    let (line_in, line_out) = mpsc::channel();
    let reader = thread::spawn(move || {
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        line_in.send(line).unwrap();
        stdout.read_to_string(&mut String::new()).unwrap();
    });
    let mut line = None;
    adapter.play(b"t0800\r", || {
        line = line_out.try_recv().ok();
        line.is_some()
    });
    assert!(line.unwrap().ends_with("SYNC\n"));
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    reader.join().unwrap();
    ends_with(130, &output);
    assert!(errors(&output).contains(" frame"), "{}", errors(&output));
}

#[test]
fn a_bus_whose_interface_goes_is_named_at_the_end_and_the_monitor_fails() {
    let simulated = Simulated::new(&["../../configs/first.toml"]);
    let bus = format!("slcan:{}", simulated.path.display());
    let mut command = takt();
    command.args(["--bus", &bus, "--duration", "3"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let watching = command.spawn().unwrap();
    thread::sleep(Duration::from_millis(1_000));
    drop(simulated);
    let output = watching.wait_with_output().unwrap();
    ends_with(1, &output);
    assert!(errors(&output).contains("went down, or has gone"), "{}", errors(&output));
}

#[test]
fn what_the_times_of_a_log_do_not_say_is_said_and_not_shown() {
    let folder = folder();
    let shown = |name: &str, text: &str, arguments: &[&str]| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        let output = monitor(&[&[path.to_str().unwrap()], arguments].concat());
        ends_with(0, &output);
        (said(&output), errors(&output))
    };
    let (frames, notes) = shown(
        "arm.asc",
        "base hex  timestamps absolute\n 1.5 1 080 Rx d 0\n 1.75 1 080 Rx d 0\n",
        &["--time", "clock"],
    );
    assert!(frames.contains("0.250000") && !frames.contains("1970"), "{frames}");
    assert!(notes.contains("the log has no times of day"), "{notes}");
    let (object, _) = shown("arm.trc", ";$FILEVERSION=1.1\n 1) 1.5 Rx 0080 0\n", &["--json"]);
    let object: Value = serde_json::from_str(&object).unwrap();
    assert_eq!((&object["time"], &object["frame"]), (&Value::Null, &"080#".into()));
    let (frames, notes) = shown("back.log", "(2.0) can0 080#\n(1.0) can0 080#\nEND\n", &[]);
    assert_eq!(frames.lines().count(), 2);
    assert!(
        notes.contains("go back at 1 of its frames, first at frame 2") && notes.contains("1 lines"),
        "{notes}"
    );
}
