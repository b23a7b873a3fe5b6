//! A run of two groups, of which one is led by a callback and stops: in the recording, in the black box, and in both reports.

use std::fs;

use serde_json::{Value as Json, json};
use takt::telemetry::{
    BlackBoxOptions, Emphasis, LogSummary, Logger, LoggerOptions, Machine, RealtimeReport, Recorded,
    RecordingDestination, RecordingReport, RunEnd, RunOutcome, RunReport,
};
use takt_rt::{
    CycleRecord, Event, EventKind, Fault, GroupRecord, HostInterface, Origin, Phase, RecordedStop, Rule,
    Snapshot, StopCategory, StopCause, StopReason,
};
use tempfile::TempDir;

use crate::telemetry::reader::{Value, messages};
use crate::telemetry::report::unbroken;
use crate::telemetry::run::{Notices, cycle, event, machine, options, sides};

const STOP: StopReason = StopReason {
    category: StopCategory::One,
    cause: StopCause::Fault(Fault::CallbackOverrun { spent_ns: 70_000, budget_ns: 50_000 }),
    origin: Origin::Group,
    slot: 6,
    phase: Phase::Streaming,
};

/// The second axis is the gripper.
fn two_groups() -> Machine {
    let mut machine = machine();
    machine.groups = ["arm", "gripper"].map(str::to_owned).to_vec();
    machine.axes[1].group = 1;
    machine
}

fn cycle_of_two(slot: u64) -> CycleRecord {
    let mut record = CycleRecord { group_count: 2, ..cycle(slot) };
    record.groups[1] = match slot {
        0..6 => GroupRecord { phase: Phase::Streaming, stop: None, callback_ns: Some(1_000 * (slot + 1)) },
        6 => GroupRecord {
            phase: Phase::Stopping,
            stop: Some(RecordedStop::of(&STOP)),
            callback_ns: Some(70_000),
        },
        _ => GroupRecord { phase: Phase::Disabled, stop: Some(RecordedStop::of(&STOP)), callback_ns: None },
    };
    record
}

struct Files {
    folder: TempDir,
    log: LogSummary,
}

/// Ten cycles.
fn files() -> Files {
    let folder = tempfile::tempdir().unwrap();
    let (mut rt, _host, log) = sides(16);
    let file = RecordingDestination::File(folder.path().join("run.mcap"));
    let black_box = BlackBoxOptions { span_ns: 1_000_000_000, directory: folder.path().to_owned() };
    let options = LoggerOptions { machine: two_groups(), black_box: Some(black_box), ..options(Some(file)) };
    let mut logger = Logger::new(log, options, Notices::default().sink());
    for slot in 0..10 {
        if slot == STOP.slot {
            rt.event(&Event { group: Some(1), ..event(slot, EventKind::Stop(STOP)) });
        }
        assert!(rt.record(&cycle_of_two(slot)));
        logger.drain();
    }
    Files { folder, log: logger.finish() }
}

fn run_report(log: &LogSummary) -> RunReport {
    let mut last = Snapshot { group_count: 2, ..Snapshot::default() };
    last.groups[1].stop = Some(STOP);
    RunReport::new(
        log,
        &RunOutcome {
            ended: RunEnd::Stopped,
            realtime: RealtimeReport::default(),
            last,
            buses_open_ns: 10_000_000,
            targets: vec![],
            stop: Some(STOP),
            is_power_off: false,
        },
    )
}

#[test]
fn a_recording_has_a_channel_for_each_group() {
    let files = files();
    let recording = fs::read(files.folder.path().join("run.mcap")).unwrap();
    let number = |number: u64| Value::Number(number as f64);
    let arm = messages(&recording, "/group/arm");
    assert_eq!(arm.len(), 10);
    assert!(arm.iter().all(|(_, fields)| fields["phase"] == number(Phase::Moving as u64)));
    assert!(arm.iter().all(|(_, fields)| fields["is_stopped"] == number(0)));
    let gripper = messages(&recording, "/group/gripper");
    let expected = [
        ("slot", 6),
        ("phase", Phase::Stopping as u64),
        ("is_stopped", 1),
        ("category", 1),
        ("rule", Rule::CallbackOverrun as u64),
        ("is_called", 1),
        ("callback_ns", 70_000),
    ];
    assert_eq!(gripper[6].1, expected.map(|(name, value)| (name.to_owned(), number(value))).into());
}

#[test]
fn the_report_of_a_run_has_the_stop_and_the_callbacks_of_each_group() {
    let report = run_report(&files().log);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(
        (&json["stop"]["rule"], &json["stop"]["group"]),
        (&json!("callback_overrun"), &json!("gripper"))
    );
    assert_eq!(json["groups"][0], json!({ "name": "arm", "stop": null }));
    let gripper = &json["groups"][1];
    assert_eq!((&gripper["name"], &gripper["stop"]), (&json!("gripper"), &json["stop"]));
    for of in [gripper, &json] {
        let callback = &of["callback_ns"];
        assert_eq!([&callback["p50"], &callback["max"]], [&json!(4_001), &json!(70_000)]);
        assert!(callback["p99"].is_u64() && callback["p999"].is_u64());
    }
    // The arm went on, the gripper did not.
    assert_eq!(json["axes"][0]["following_error_at_s"], json!(0.009));
    assert_eq!(json["axes"][1]["following_error_at_s"], json!(0.006));
    let text = report.render(Emphasis::None);
    for part in [
        "groups       arm: no stop",
        "gripper: category 1 stop: the callback took 70.0 µs (allowed: 50.0 µs) while streaming",
        "gripper: the callback took 70.0 µs",
        "callback                 1.00 µs     4.00 µs",
    ] {
        assert!(unbroken(&text).contains(&unbroken(part)), "{part:?} is not in\n{text}");
    }
}

#[test]
fn what_was_asked_for_is_no_stop_of_a_group_in_a_run_that_finished() {
    let log = files().log;
    let mut last = Snapshot { group_count: 2, ..Snapshot::default() };
    last.groups[0].stop = Some(StopReason { cause: StopCause::Requested, ..STOP });
    let outcome = |stop| RunOutcome {
        ended: RunEnd::Finished,
        realtime: RealtimeReport::default(),
        last,
        buses_open_ns: 10_000_000,
        targets: vec![],
        stop,
        is_power_off: false,
    };
    let stop_of = |stop| RunReport::new(&log, &outcome(stop)).groups[0].stop.as_ref().map(|stop| stop.rule);
    assert_eq!((stop_of(None), stop_of(last.groups[0].stop)), (None, Some("requested")));
}

#[test]
fn a_run_of_one_group_without_callbacks_has_neither_in_its_report() {
    let (_rt, _host, log) = sides(8);
    let log = Logger::new(log, options(None), Notices::default().sink()).finish();
    let json = serde_json::to_value(run_report(&log)).unwrap();
    assert_eq!((json.get("groups"), json.get("callback_ns"), json["stop"].get("group")), (None, None, None));
}

#[test]
fn the_report_of_a_recording_and_of_a_black_box_shows_each_group() {
    let files = files();
    assert_eq!(files.log.black_boxes.files.len(), 1);
    for file in [&files.folder.path().join("run.mcap"), &files.log.black_boxes.files[0]] {
        let recorded = Recorded::open(file).unwrap();
        assert_eq!(recorded.warnings, [""; 0]);
        let report = RecordingReport::new(&recorded, Some(1), 3).unwrap();
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(
            (&json["cause"]["rule"], &json["cause"]["group"]),
            (&json!("callback_overrun"), &json!("gripper"))
        );
        let [arm, gripper] = [0, 1].map(|group| &json["groups"][group]);
        assert_eq!(
            [&arm["name"], &arm["phase"], &arm["stop"]],
            [&json!("arm"), &json!("moving"), &Json::Null]
        );
        assert_eq!(
            [&gripper["phase"], &gripper["stop"]["rule"]],
            [&json!("disabled"), &json!("callback_overrun")]
        );
        assert_eq!(gripper["callback_ns"]["max"], json!(70_000));
        let phases: Vec<&str> =
            report.axis.iter().flat_map(|axis| &axis.cycles).map(|cycle| cycle.phase).collect();
        assert_eq!(phases, ["streaming", "streaming", "stopping"], "those of the gripper");
        let text = report.render(Emphasis::None);
        for part in ["arm: no stop; moving at the end", "(slot 6); disabled at the end", "callback "] {
            assert!(unbroken(&text).contains(part), "{part:?} is not in\n{text}");
        }
    }
}
