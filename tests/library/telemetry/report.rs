use serde_json::{Value, json};
use takt::telemetry::{
    Emphasis, LogSummary, Logger, RealtimeReport, RecordingDestination, RunEnd, RunOutcome, RunReport,
};
use takt_rt::{BusHealth, BusState, HostInterface, Snapshot, StopReason};

use crate::telemetry::run::{Disk, Notices, STOP, cycle, options, run, sides};

const COLUMNS: usize = 80;

fn outcome(last: Snapshot, stop: Option<StopReason>) -> RunOutcome {
    RunOutcome {
        ended: if stop.is_some() { RunEnd::Stopped } else { RunEnd::Finished },
        realtime: RealtimeReport {
            policy: "SCHED_OTHER".to_owned(),
            page_faults: 2,
            refused: vec!["SCHED_FIFO priority 80: operation not permitted".to_owned()],
            grant_with: vec!["sudo setcap cap_sys_nice+ep target/release/takt".to_owned()],
            ..RealtimeReport::default()
        },
        last,
        buses_open_ns: 40_000_000,
        targets: vec![],
        stop,
        is_power_off: true,
    }
}

/// Twenty cycles, two of which the ring dropped, on a bus that was occupied for half of the time.
fn run_and_summarise(destination: Option<RecordingDestination>) -> (LogSummary, Snapshot) {
    let (mut rt, host, log) = sides(8);
    let mut logger = Logger::new(log, options(destination), Notices::default().sink());
    run(&mut rt, &mut logger, 0..10);
    assert_eq!((10..20).filter(|slot| rt.record(&cycle(*slot))).count(), 8);
    let mut last = host.snapshot();
    last.missed_slots = 3;
    last.buses[0] = BusHealth {
        state: BusState::ErrorPassive,
        tx_frames: 80,
        rx_frames: 40,
        tx_overruns: 5,
        errors: 6,
        busy_ns: 20_000_000,
        ..BusHealth::default()
    };
    (logger.finish(), last)
}

#[test]
fn the_report_has_the_keys_of_the_contract_with_the_values_of_the_run() {
    let (log, last) = run_and_summarise(None);
    let report = serde_json::to_value(RunReport::new(&log, &outcome(last, Some(STOP)))).unwrap();
    for (key, value) in [
        ("cycle_ns", json!(1_000_000)),
        ("cycles", json!(20)),
        ("missed_slots", json!(3)),
        ("duration_s", json!(0.018)),
    ] {
        assert_eq!(report[key], value, "{key}");
    }
    for (key, p50, max) in [
        ("wake_ns", 1008, 1017),
        ("sync_ns", 2008, 2017),
        ("compute_ns", 3009, 3017),
        ("sent_ns", 4009, 4017),
    ] {
        assert_eq!((&report[key]["p50"], &report[key]["max"]), (&json!(p50), &json!(max)), "{key}");
        assert!(report[key]["p99"].is_u64() && report[key]["p999"].is_u64(), "{key}");
        let counted: u64 =
            report[key]["histogram"].as_array().unwrap().iter().filter_map(Value::as_u64).sum();
        assert_eq!(counted, 18, "{key}");
    }
    let expected = json!({
        "policy": "SCHED_OTHER", "priority": null, "cpu": null, "memory_locked": false, "preempt_rt": false,
        "spin_guard_ns": 0, "page_faults": 2, "refused": ["SCHED_FIFO priority 80: operation not permitted"],
        "grant_with": ["sudo setcap cap_sys_nice+ep target/release/takt"],
    });
    assert_eq!(report["realtime"], expected);
    let expected = json!({
        "name": "slide", "unit": "m", "following_error_max": 1.0625, "following_error_at_s": 0.017,
        "following_error_velocity": 1.5, "final_position": 17.4375, "final_report_slot": 17, "target_position": 17.5,
        "final_error_counts": -5215.2,
        "set_point_max": { "velocity": 1.5, "acceleration": 2.5, "jerk": 40.0 },
        "limits": { "velocity": 2.0, "acceleration": 10.0, "jerk": 50.0 },
        "set_point_part": { "velocity": 0.75, "acceleration": 0.25, "jerk": 0.8 },
    });
    assert_eq!(report["axes"][1], expected);
    // The drive of the other axis has not reported.
    let other = &report["axes"][0];
    assert_eq!([&other["final_position"], &other["final_error_counts"]], [&Value::Null; 2]);
    let expected = json!({
        "name": "left", "interface": "can0", "load_percent": 50.0, "tx_frames": 80, "rx_frames": 40,
        "tx_overruns": 5, "rx_overruns": 0, "errors": 6, "state": "error passive",
    });
    assert_eq!(report["buses"], json!([expected]));
    assert_eq!((&report["telemetry"]["records"], &report["telemetry"]["dropped"]), (&json!(18), &json!(2)));
    let expected = json!({
        "category": 1, "reason": "slide was 0.2500 m from its set-point (allowed: 0.1250 m)",
        "rule": "following_error", "axis": "slide", "bus": null, "value": 0.25, "limit": 0.125, "slot": 7,
        "phase": "moving",
        "cure": "look for an obstacle or a brake that is not released; then clear the fault and move more slowly",
    });
    assert_eq!(report["stop"], expected);
}

#[test]
fn the_report_of_a_finished_program_has_no_stop_and_has_its_targets() {
    let (log, last) = run_and_summarise(None);
    let outcome = RunOutcome { targets: vec![Some(17.0), Some(17.4375)], ..outcome(last, None) };
    let report = RunReport::new(&log, &outcome);
    assert_eq!(serde_json::to_value(&report).unwrap()["stop"], Value::Null);
    assert_eq!((report.axes[1].target_position, report.axes[1].final_error_counts), (17.4375, Some(0.0)));
    assert_eq!(report.axes[0].target_position, 17.0);
}

#[test]
fn a_run_without_a_cycle_can_be_reported() {
    let (_rt, host, log) = sides(8);
    let log = Logger::new(log, options(None), Notices::default().sink()).finish();
    let report = RunReport::new(&log, &outcome(host.snapshot(), Some(STOP)));
    assert_eq!((report.cycles, report.duration_s, report.axes[0].following_error_max), (0, 0.0, None));
    let text = report.render(Emphasis::None);
    assert!(text.contains("never enabled") && !text.contains("timing"), "{text}");
}

/// A text whose lines are not broken, with single spaces.
pub fn unbroken(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_text_has_every_part_of_the_report() {
    let (log, last) = run_and_summarise(Some(Disk::new(3).destination()));
    let text = RunReport::new(&log, &outcome(last, Some(STOP))).render(Emphasis::None);
    for part in [
        "arm  ✗ category 1 stop after 20 cycles of 1 ms, 0.02 s",
        "power        off: every drive has confirmed that it has no torque",
        "slide was 0.2500 m from its set-point (allowed: 0.1250 m) while moving (slot 7)",
        "missed slots             3 of 23",
        "slide                1062.500 mm   0.02 s, +1.50 m/s = 708.3 ms late",
        "shoulder           1062.500 mrad   0.02 s, +1.50 rad/s = 708.3 ms late",
        "slide               75.00 %       25.00 %    80.00 %      17.43750 m     -5215.2",
        "%  never reported",
        "left        can0       50.0 %        80        40        5      6  error passive",
        "18 records, 2 dropped",
        "no recording: cannot write the disk: ",
        "SCHED_OTHER, memory not locked, kernel without PREEMPT_RT, 2 page faults",
        "refused: SCHED_FIFO priority 80: operation not permitted",
        "sudo setcap cap_sys_nice+ep target/release/takt",
    ] {
        assert!(unbroken(&text).contains(&unbroken(part)), "{part:?} is not in\n{text}");
    }
}

#[test]
fn the_text_has_colours_only_on_request_and_no_line_is_too_long() {
    let (log, last) = run_and_summarise(None);
    let report = RunReport::new(&log, &outcome(last, Some(STOP)));
    let plain = report.render(Emphasis::None);
    assert!(!plain.contains('\x1b'));
    for line in plain.lines() {
        assert!(line.chars().count() <= COLUMNS && !line.ends_with(' '), "{line:?}");
    }
    let coloured = report.render(Emphasis::Ansi);
    let stripped: String = coloured
        .split('\x1b')
        .enumerate()
        .map(|(index, part)| if index == 0 { part } else { part.split_once('m').unwrap().1 })
        .collect();
    let trimmed = |text: &str| text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n");
    assert_eq!(trimmed(&stripped), trimmed(&plain));
}
