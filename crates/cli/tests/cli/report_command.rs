//! `takt report` on what a run leaves behind, whole or not.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use mcap::records::op;
use serde_json::Value;
use takt::channels::{ChannelSizes, GroupStream, channels};
use takt::config::Config;
use takt::faults::{FaultInjector, Scenario};
use takt::link::trace::traced;
use takt::telemetry::{
    BlackBoxOptions, BusDescription, Emphasis, LogSummary, Logger, LoggerOptions, Machine, RealtimeReport,
    Recorded, RecordingDestination, RecordingOptions, RunEnd, RunOutcome, RunReport, WallClock,
};
use takt::{Outcome, VirtualRun};
use takt_rt::{CycleRecord, HostInterface, Rule};
use tempfile::TempDir;

/// 2023-11-14 22:13:20 UTC
const UNIX_AT_ZERO_NS: u64 = 1_700_000_000_000_000_000;

/// The files of a run in virtual time that stopped for a following error.
struct RunFiles {
    folder: TempDir,
    recording: PathBuf,
    black_box: PathBuf,
}

fn stopped_run() -> RunFiles {
    let folder = tempfile::tempdir().unwrap();
    let mut config =
        Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml")).unwrap();
    config.axes[2].following_error.limit = 0.002;
    config.axes[2].following_error.time_ns = 5_000_000;
    let (ports, traces) = (0..config.buses.len())
        .map(|bus| traced(takt::simulated_bus(&config, bus), &config.buses[bus].name, 256))
        .unzip();
    let (mut run, log) = VirtualRun::new(&config, ports).unwrap();
    let options = LoggerOptions {
        machine: Machine::of(&config),
        wall_clock: WallClock::fixed(UNIX_AT_ZERO_NS),
        started_ns: 0,
        recording: Some(RecordingDestination::File(folder.path().join("run.mcap"))),
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: Some(BlackBoxOptions { span_ns: 5_000_000_000, directory: folder.path().to_owned() }),
        traces,
    };
    let mut logger = Logger::new(log, options, Box::new(|_| {}));
    let outcome = run.run(60_000, |_| {
        logger.drain();
    });
    assert!(
        matches!(outcome, Some(Outcome::Stopped(stop)) if stop.rule() == Rule::FollowingError),
        "{outcome:?}"
    );
    let summary = logger.finish();
    RunFiles {
        folder,
        recording: summary.recording.unwrap(),
        black_box: summary.black_boxes.files[0].clone(),
    }
}

/// Options that write a recording and nothing else.
fn recording_to(file: &Path, machine: Machine) -> LoggerOptions {
    LoggerOptions {
        machine,
        wall_clock: WallClock::fixed(UNIX_AT_ZERO_NS),
        started_ns: 0,
        recording: Some(RecordingDestination::File(file.to_owned())),
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: None,
        traces: vec![],
    }
}

fn report(file: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_takt")).arg("report").arg(file).args(options).output().unwrap()
}

fn text(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", errors(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The file was written before a refusal was recorded with its request and its reason.
#[test]
fn a_recording_of_an_earlier_version_is_read() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("fuzz/seeds/recording/of_an_earlier_version");
    let output = report(&file, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = text(&output);
    assert!(text.contains("disabled → enabling") && text.contains("recording of 6 cycles"), "{text}");
}

#[test]
fn the_report_of_a_black_box_has_the_reason_the_axis_its_last_cycles_the_events_and_the_timing() {
    let left = stopped_run();
    let output = report(&left.black_box, &["--cycles", "7"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = text(&output);
    let unbroken = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "black box of ",
        "joint3 was 0.0",
        "(allowed: 0.0020 rad) while moving",
        "joint3, the last 7 cycles up to the stop",
        "moving → stopping",
        "operation enabled",
        "computing",
        "missed slots 0 of ",
        "2023-11-14 22:13:20",
    ] {
        assert!(unbroken.contains(part), "{part:?} is not in\n{text}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn the_recording_and_the_black_box_of_a_run_agree_on_the_stop() {
    let left = stopped_run();
    let [recording, black_box] =
        [&left.recording, &left.black_box].map(|file| json(&report(file, &["--json"])));
    assert_eq!((&recording["is_black_box"], &black_box["is_black_box"]), (&false.into(), &true.into()));
    for key in ["reason", "rule", "category", "axis", "value", "limit", "slot", "phase"] {
        assert_eq!(recording["cause"][key], black_box["cause"][key], "{key}");
    }
    assert_eq!(black_box["cause"]["rule"], "following_error");
    assert_eq!(recording["axis"], black_box["axis"]);
    let cycles = black_box["axis"]["cycles"].as_array().unwrap();
    assert_eq!((cycles.len(), &cycles[19]["slot"]), (20, &black_box["cause"]["slot"]));
    assert!(cycles.iter().rev().skip(1).all(|cycle| cycle["phase"] == "moving"));
    let largest = cycles.iter().map(|cycle| cycle["following_error"].as_f64().unwrap().abs());
    assert!(largest.fold(0.0, f64::max) > 0.002);
}

#[test]
fn the_cycles_that_are_read_are_those_that_were_recorded() {
    let left = stopped_run();
    let recorded = Recorded::open(&left.recording).unwrap();
    let (first, last) = recorded.slots.unwrap();
    let cycles = recorded.cycles(&(first..=last)).unwrap();
    assert_eq!(cycles.len() as u64, recorded.statistics.cycles);
    assert_eq!((recorded.machine.axes.len(), recorded.machine.axes[5].name.as_str()), (6, "joint6"));
    let bytes = fs::read(&left.recording).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let written: Vec<f64> = messages
        .filter(|message| message.channel.topic == "/axis/joint4")
        // Behind the header of CDR, the slot and the set-point.
        .map(|message| f64::from_le_bytes(message.data[20..28].try_into().unwrap()))
        .collect();
    let read: Vec<f64> = cycles.iter().map(|cycle| cycle.axes[3].position).collect();
    assert_eq!(read, written);
    assert!(read.iter().any(|position| position.abs() > 0.1), "the joint has moved");
}

/// A recording of the arm in virtual time, one of whose buses is lost in motion.
fn recording_of_a_lost_bus(bus: &str, folder: &Path) -> PathBuf {
    run_with_a_lost_bus(bus, "0.1 s", folder).0.recording.unwrap()
}

/// What the logger has of that run, and the stop.
fn run_with_a_lost_bus(bus: &str, restart: &str, folder: &Path) -> (LogSummary, RunOutcome) {
    let config =
        Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm6-erob.toml")).unwrap();
    let fault = format!(
        "[[fault]]\nkind = \"bus-off\"\nbus = {bus:?}\nwhen = \"moving\"\nat = \"300 ms\"\nrestart = {restart:?}"
    );
    let scenario = Scenario::parse("scenario", &fault, &config).unwrap();
    let (mut run, log) = VirtualRun::with_faults(&config, Arc::new(FaultInjector::new(scenario))).unwrap();
    let options = LoggerOptions {
        machine: Machine::of(&config),
        wall_clock: WallClock::fixed(UNIX_AT_ZERO_NS),
        started_ns: 0,
        recording: Some(RecordingDestination::File(folder.join(format!("{bus}.mcap")))),
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: None,
        traces: vec![],
    };
    let mut logger = Logger::new(log, options, Box::new(|_| {}));
    let outcome = run.run(60_000, |_| {
        logger.drain();
    });
    let Some(Outcome::Stopped(stop)) = outcome else { panic!("{outcome:?}") };
    assert_eq!(stop.rule(), Rule::BusLost);
    let outcome = RunOutcome {
        ended: RunEnd::Stopped,
        realtime: RealtimeReport::default(),
        last: run.snapshot(),
        buses_open_ns: 1_000_000_000,
        targets: vec![],
        stop: Some(stop),
        is_power_off: false,
    };
    (logger.finish(), outcome)
}

#[test]
fn the_last_position_of_a_drive_that_has_fallen_silent_is_not_its_final_position() {
    let folder = tempfile::tempdir().unwrap();
    let (log, outcome) = run_with_a_lost_bus("wrist", "60 s", folder.path());
    let lost_in = outcome.stop.unwrap().slot;
    let report = RunReport::new(&log, &outcome);
    let told = serde_json::to_value(&report).unwrap();
    let text = report.render(Emphasis::None);
    for (number, axis) in told["axes"].as_array().unwrap().iter().enumerate() {
        let is_lost = number >= 3;
        assert_eq!(
            [axis["final_position"].is_null(), axis["final_error_counts"].is_null()],
            [is_lost; 2],
            "{axis}"
        );
        let reported = axis["final_report_slot"].as_u64().unwrap();
        let is_shown = text.contains(&format!("none since slot {reported}"));
        assert_eq!((reported <= lost_in, is_shown), (is_lost, is_lost), "{axis}, lost in {lost_in}\n{text}");
    }
}

#[test]
fn after_a_stop_for_a_bus_an_axis_on_that_bus_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    for (bus, axes) in [("base", ["joint1", "joint2", "joint3"]), ("wrist", ["joint4", "joint5", "joint6"])] {
        let recording = recording_of_a_lost_bus(bus, folder.path());
        let told = json(&report(&recording, &["--json"]));
        assert_eq!((&told["cause"]["bus"], &told["cause"]["axis"]), (&bus.into(), &Value::Null));
        let shown = told["axis"]["name"].as_str().unwrap();
        assert!(axes.contains(&shown), "{shown} is shown of bus {bus}");
        // That holds even if an axis on the other bus had a larger following error.
        let mut recorded = Recorded::open(&recording).unwrap();
        let other =
            recorded.machine.axes.iter().position(|axis| !axes.contains(&axis.name.as_str())).unwrap();
        recorded.statistics.axes[other].following_error_max.as_mut().unwrap().error = 9.0;
        let chosen = recorded.axis(None).unwrap();
        assert_eq!(recorded.machine.axes[chosen].name, shown);
        // An earlier version did not record which axis is on which bus.
        recorded.machine.axes.iter_mut().for_each(|axis| axis.bus = None);
        assert_eq!(recorded.axis(None), Some(other));
    }
}

#[test]
fn cycles_without_feedback_are_shown_as_such_and_not_as_the_last_values() {
    let folder = tempfile::tempdir().unwrap();
    let recording = recording_of_a_lost_bus("wrist", folder.path());
    let svg = folder.path().join("stop.svg");
    let output = report(&recording, &["--cycles", "4", "--svg", svg.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = text(&output);
    let row = text.lines().find(|line| line.contains("no feedback")).expect(&text);
    assert!(row.contains('–') && row.ends_with(char::is_numeric), "{row}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");

    let told = json(&report(&recording, &["--cycles", "4", "--json"]));
    let cycles = told["axis"]["cycles"].as_array().unwrap();
    let is_silent = |cycle: &&Value| cycle["feedback_age"].as_u64() > Some(0);
    assert!(cycles.iter().any(|cycle| is_silent(&cycle)), "{cycles:?}");
    for cycle in cycles {
        let reported = ["position", "velocity", "following_error"].map(|key| cycle[key].is_null());
        assert_eq!(reported, [is_silent(&cycle); 3], "{cycle}");
    }

    let svg = fs::read_to_string(svg).unwrap();
    assert!(svg.contains("grey: no feedback") && svg.contains("fill=\"#ddd\""), "{svg}");
    // The curves of what is commanded go on: of position, velocity, acceleration and torque, and three of the timing.
    let whole = svg.lines().filter(|line| line.starts_with("<polyline"));
    let longest = whole.clone().map(|line| line.matches(',').count()).max().unwrap();
    let (whole, cut): (Vec<_>, Vec<_>) = whole.partition(|line| line.matches(',').count() == longest);
    assert!(whole.len() == 7 && cut.len() >= 4, "{} whole and {} cut", whole.len(), cut.len());
}

/// The author of the file must not be able to control the terminal.
#[test]
fn control_characters_of_a_recording_are_not_printed() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let mut config = Config::load(&path).unwrap();
    config.program.moves.truncate(1);
    let (mut run, log) = VirtualRun::simulated(&config).unwrap();
    let mut machine = Machine::of(&config);
    machine.name = "arm\u{1b}[2J".to_owned();
    machine.axes[0].name = "joint\u{1b}[31m".to_owned();
    machine.buses[0].name = "can\u{9b}31m".to_owned();
    let mut logger =
        Logger::new(log, recording_to(&folder.path().join("run.mcap"), machine), Box::new(|_| {}));
    run.run(60_000, |_| {
        logger.drain();
    });
    let output = report(&logger.finish().recording.unwrap(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = text(&output);
    assert!(text.contains("arm?[2J") && text.contains("joint?[31m"), "{text}");
    assert!(!text.contains(['\u{1b}', '\u{9b}']), "{text:?}");
}

#[test]
fn another_axis_can_be_shown_and_an_unknown_one_is_an_error_that_lists_the_axes() {
    let left = stopped_run();
    let shown = json(&report(&left.black_box, &["--json", "--axis", "joint6", "--cycles", "3"]));
    assert_eq!((&shown["axis"]["name"], &shown["cause"]["axis"]), (&"joint6".into(), &"joint3".into()));
    assert_eq!(shown["axis"]["cycles"].as_array().unwrap().len(), 3);
    let output = report(&left.black_box, &["--axis", "elbow"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        errors(&output).contains("elbow") && errors(&output).contains("joint1, joint2"),
        "{}",
        errors(&output)
    );
}

#[test]
fn the_svg_shows_position_velocity_following_error_and_timing_and_marks_the_stop() {
    let left = stopped_run();
    let svg = left.folder.path().join("stop.svg");
    let output = report(&left.black_box, &["--svg", svg.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let svg = fs::read_to_string(svg).unwrap();
    for part in [
        "joint3: position, rad",
        "joint3: velocity",
        "joint3: acceleration, rad/s²",
        "joint3: torque, N·m",
        "joint3: following error, mrad",
        "timing, µs",
        "wake-up",
    ] {
        assert!(svg.contains(part), "{part}");
    }
    // Set and actual of position, velocity and torque, the set acceleration, the following error, and three times.
    assert_eq!(svg.matches("<polyline").count(), 11);
    assert!(svg.contains("-1.0 s") && !svg.contains("NaN"));
    // A path below a file cannot be written, not even by root.
    let below_a_file = left.black_box.join("stop.svg");
    let unwritable = report(&left.black_box, &["--svg", below_a_file.to_str().unwrap()]);
    assert_eq!(unwritable.status.code(), Some(1));
    assert!(text(&unwritable).contains("joint3 was"), "the text is printed all the same");
}

#[test]
fn the_page_shows_every_axis_the_events_and_the_buses_and_takes_nothing_from_elsewhere() {
    let left = stopped_run();
    for file in [&left.recording, &left.black_box] {
        let path = left.folder.path().join("run.html");
        let output = report(file, &["--html", path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
        let page = fs::read_to_string(path).unwrap();
        for axis in 1..=6 {
            for quantity in [
                "position, rad",
                "velocity, rad/s",
                "acceleration, rad/s²",
                "torque, N·m",
                "following error, mrad",
            ] {
                let label = format!("aria-label=\"joint{axis}: {quantity}\"");
                assert_eq!(page.matches(&label).count(), 1, "{label}");
            }
        }
        for part in [
            "bus load, %",
            "Stop: joint3 was 0.0",
            "moving → stopping",
            "<b>wake-up</b>",
            "prefers-color-scheme: dark",
        ] {
            assert!(page.contains(part), "{part}");
        }
        let before = |part: &str| page.find(part).unwrap();
        assert!(before("moving → stopping") < before("aria-label"), "events come first");
        for foreign in ["<script", "<link", " src=", "url(", "@import", "href=\"http", "NaN", "inf "] {
            assert!(!page.contains(foreign), "{foreign}");
        }
        // No drive of this arm tells its torque.
        let dashes = page.matches("<td class=\"number\">–</td></tr>").count();
        assert_eq!((dashes, page.contains("0.00 N·m")), (6, false));
        assert!(page.len() < 2_000_000, "{} bytes", page.len());
    }
}

#[test]
fn a_part_of_a_recording_is_read_alone() {
    let left = stopped_run();
    let whole = json(&report(&left.recording, &["--json"]));
    let part = json(&report(&left.recording, &["--json", "--from", "0.5", "--to", "0.75"]));
    assert_eq!(part["cycles"], 250);
    let span = |key: usize| part["span_s"][key].as_f64().unwrap();
    assert!((span(0) - 0.5).abs() < 1.5e-3 && (span(1) - 0.75).abs() < 1.5e-3, "{part}");
    let events = |report: &Value| report["events"].as_array().unwrap().clone();
    let inside: Vec<Value> = events(&whole)
        .into_iter()
        .filter(|event| (0.5..0.75).contains(&event["at_s"].as_f64().unwrap()))
        .collect();
    assert_eq!(events(&part), inside);
    let svg = left.folder.path().join("part.svg");
    report(&left.recording, &["--from", "0.5", "--to", "0.75", "--svg", svg.to_str().unwrap()]);
    assert!(fs::read_to_string(svg).unwrap().contains(">0.55 s<"), "times count from the beginning");

    for (arguments, what) in [
        (["--from", "2", "--to", "1"], "--to (1 s) must be after --from (2 s)"),
        (["--from", "900", "--to", "901"], "there is no cycle in it from --from (900 s)"),
        (["--from", "-1", "--to", "1"], "--from"),
        (["--from", "0", "--to", "soon"], "--to"),
    ] {
        let output = report(&left.recording, &arguments);
        assert_eq!(output.status.code(), Some(2));
        assert!(errors(&output).contains(what), "{}", errors(&output));
    }
}

#[test]
fn a_recording_has_the_load_of_every_bus() {
    let left = stopped_run();
    for file in [&left.recording, &left.black_box] {
        let told = json(&report(file, &["--json"]));
        let loads = told["bus_loads"].as_array().unwrap();
        assert_eq!(loads.len(), 2, "{told}");
        for load in loads {
            let (mean, most) = (load["mean"].as_f64().unwrap(), load["max"].as_f64().unwrap());
            assert!(mean > 0.05 && mean <= most && most < 1.0, "{load}");
        }
    }
}

#[test]
fn a_run_without_a_stop_is_shown_up_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/single-erob.toml");
    let config = Config::load(&path).unwrap();
    let (mut run, log) = VirtualRun::simulated(&config).unwrap();
    let options = recording_to(&folder.path().join("run.mcap"), Machine::of(&config));
    let mut logger = Logger::new(log, options, Box::new(|_| {}));
    let outcome = run.run(60_000, |_| {
        logger.drain();
    });
    assert_eq!(outcome, Some(Outcome::Finished));
    let recording = logger.finish().recording.unwrap();
    let told = json(&report(&recording, &["--json", "--cycles", "5"]));
    assert_eq!(told["cause"], Value::Null);
    let cycles = told["axis"]["cycles"].as_array().unwrap();
    assert_eq!((cycles.len(), &cycles[4]["slot"]), (5, &run.snapshot().slot.into()));
    let svg = folder.path().join("end.svg");
    let output = report(&recording, &["--svg", svg.to_str().unwrap()]);
    assert!(text(&output).contains("the last 20 cycles at the end"), "{}", text(&output));
    assert!(!fs::read_to_string(svg).unwrap().contains("NaN"));
}

#[test]
fn a_recording_that_was_cut_off_is_read_up_to_the_cut() {
    let left = stopped_run();
    let bytes = fs::read(&left.recording).unwrap();
    let whole = Recorded::open(&left.recording).unwrap();
    assert_eq!(whole.warnings, [""; 0]);
    let cut = left.folder.path().join("cut.mcap");
    let mut last = 0;
    for part in 1..=40 {
        let length = bytes.len() * part / 41;
        fs::write(&cut, &bytes[..length]).unwrap();
        let read = Recorded::open(&cut).unwrap_or_else(|error| panic!("{length} bytes: {error}"));
        let cycles = read.statistics.cycles;
        // A cycle of six axes takes 900 bytes, so only a few are lost at the end.
        assert!(cycles >= last && (cycles + 10) * 1000 > length as u64, "{cycles} cycles in {length} bytes");
        last = cycles;
        // Only the index follows the data, and the reader does not use it.
        assert!(
            cycles == whole.statistics.cycles || read.warnings[0].contains("cut off"),
            "{:?}",
            read.warnings
        );
    }
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let output = report(&cut, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    assert!(text(&output).contains("cut off"), "{}", text(&output));
}

#[test]
fn damaged_bytes_never_cause_a_panic_and_a_damaged_chunk_is_skipped_with_a_warning() {
    let left = stopped_run();
    let bytes = fs::read(&left.recording).unwrap();
    let whole = Recorded::open(&left.recording).unwrap().statistics.cycles;
    let damaged = left.folder.path().join("damaged.mcap");
    let mut warned = 0;
    for round in 0..60 {
        let mut broken = bytes.clone();
        // Over the whole file, and close together at its beginning.
        let at = if round < 30 { broken.len() / 30 * round + 17 } else { round * 13 };
        broken[at] ^= 0x5A;
        fs::write(&damaged, &broken).unwrap();
        if let Ok(read) = Recorded::open(&damaged) {
            assert!(read.statistics.cycles <= whole);
            warned += usize::from(!read.warnings.is_empty());
            read.cycles(&(0..=u64::MAX)).unwrap();
        }
    }
    assert!(warned >= 25, "{warned} of 30 damaged chunks were reported");
}

/// As [`report`], in a process that may have so much address space.
fn report_within(file: &Path, bytes: u64) -> Output {
    let limited = format!("ulimit -v {}; exec \"$0\" report \"$1\"", bytes / 1024);
    Command::new("sh").arg("-c").arg(limited).arg(env!("CARGO_BIN_EXE_takt")).arg(file).output().unwrap()
}

/// Far less than the 4 GiB that a length of 32 bits can ask for, and enough for the files below.
const ADDRESS_SPACE_BYTES: u64 = 400 << 20;

/// A record as MCAP writes it.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

#[test]
fn a_length_that_a_file_lies_about_costs_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lying.mcap");
    // A text of 4 GiB, and nothing of it there.
    let text = u32::MAX.to_le_bytes();
    let (schema, channel) = ([&[1, 0][..], &text].concat(), [&[1, 0, 1, 0][..], &text].concat());
    let bodies: [(u8, &[u8]); 4] =
        [(op::HEADER, &text), (op::SCHEMA, &schema), (op::CHANNEL, &channel), (op::METADATA, &text)];
    for (opcode, body) in bodies {
        fs::write(&file, [mcap::MAGIC, &record(opcode, body)].concat()).unwrap();
        let output = report_within(&file, ADDRESS_SPACE_BYTES);
        assert_eq!(output.status.code(), Some(2), "{}", errors(&output));
        assert!(errors(&output).contains("not a recording of takt"), "{}", errors(&output));
    }
}

#[test]
fn many_short_cycles_and_a_long_name_take_no_more_memory_than_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = ChannelSizes {
        groups: vec![GroupStream::default()],
        axes: 0,
        buses: 1,
        records: 1024,
        events: 1,
        requests: 1,
        service_out: 1,
        service_in: 1,
    };
    let (mut rt, _host, log) = channels(&sizes);
    let bus = BusDescription {
        name: "b".repeat(1 << 20),
        interface: String::new(),
        bit_rate: None,
        data_bit_rate: None,
    };
    let machine =
        Machine { name: "m".to_owned(), cycle_ns: 1_000_000, axes: vec![], buses: vec![bus], groups: vec![] };
    let file = folder.path().join("many.mcap");
    let mut logger = Logger::new(log, recording_to(&file, machine), Box::new(|_| {}));
    // All of them in the slot that a report shows.
    for _ in 0..300_000 / 1000 {
        (0..1000).for_each(|_| assert!(rt.record(&CycleRecord::default())));
        logger.drain();
    }
    logger.finish();
    let output = report_within(&file, ADDRESS_SPACE_BYTES);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    assert!(text(&output).contains("300000 cycles"), "{}", text(&output));
}

#[test]
fn a_file_that_is_not_a_recording_is_refused_with_its_name_and_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    let mut foreign = vec![];
    let mut writer = mcap::WriteOptions::new()
        .library("another")
        .compression(None)
        .disable_seeking(true)
        .create(mcap::write::NoSeek::new(&mut foreign))
        .unwrap();
    writer.finish().unwrap();
    drop(writer);
    for (content, reason) in [
        (&b""[..], "empty"),
        (b"(1700000000.001000) can0 080#\n", "not an MCAP file"),
        (&foreign[..], "not a recording of takt"),
        (&foreign[..4], "not an MCAP file"),
    ] {
        fs::write(&file, content).unwrap();
        let output = report(&file, &[]);
        assert_eq!(output.status.code(), Some(2));
        let said = errors(&output);
        assert!(said.contains(reason) && said.contains(file.to_str().unwrap()), "{said}");
        assert!(output.stdout.is_empty());
    }
    // A device or a folder is not a recording either.
    for absent in [folder.path().join("absent"), folder.path().to_owned(), "/dev/null".into()] {
        let output = report(&absent, &[]);
        assert_eq!(output.status.code(), Some(2));
        assert!(errors(&output).contains(absent.to_str().unwrap()), "{}", errors(&output));
    }
}
