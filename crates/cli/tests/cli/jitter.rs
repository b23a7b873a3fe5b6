//! `takt jitter` as a user meets it.

use std::fs;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

fn start(options: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_takt"))
        .arg("jitter")
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn run(options: &[&str]) -> Output {
    start(options).wait_with_output().unwrap()
}

fn report(output: &Output) -> Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn both_ways_of_waiting_are_measured_cycle_by_cycle() {
    let output = run(&["--cycles", "300", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let report = report(&output);
    assert_eq!((&report["cycle_ns"], &report["cycles"]), (&Value::from(1_000_000), &Value::from(300)));
    assert_eq!((&report["bus"], &report["is_whole"]), (&Value::Null, &Value::from(true)));
    for (pass, pacing) in report["passes"].as_array().unwrap().iter().zip(["sleep", "sleep_then_spin"]) {
        assert_eq!(pass["pacing"], pacing);
        assert_eq!(pass["cycles"], 300);
        assert_eq!(pass["sync_sent"], Value::Null);
        for key in ["wake_ns", "sync_ns"] {
            for quantile in ["min", "p50", "p99", "p999", "max"] {
                assert!(pass[key][quantile].is_u64(), "{key}.{quantile}");
            }
            let counts =
                pass[key]["histogram"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap());
            assert_eq!(counts.sum::<u64>() + pass["records_dropped"].as_u64().unwrap(), 300, "{key}");
        }
    }
    assert_eq!(report["passes"][0]["spin_guard_ns"], 0);
    assert!(report["passes"][1]["spin_guard_ns"].as_u64().unwrap() > 0);
    for key in ["policy", "priority", "cpu", "memory_locked", "preempt_rt", "refused", "grant_with"] {
        assert!(report["realtime"].get(key).is_some(), "realtime.{key}");
    }
}

#[test]
fn with_a_bus_a_sync_leaves_in_every_cycle() {
    let output = run(&["--cycles", "200", "--bus", "sim", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let report = report(&output);
    assert_eq!(report["bus"], "sim");
    for pass in report["passes"].as_array().unwrap() {
        // The loop goes on for a few cycles until it is told to leave.
        assert!(pass["sync_sent"].as_u64().unwrap() >= 199, "{pass}");
        assert_eq!((&pass["tx_overruns"], &pass["bus_errors"]), (&Value::from(0), &Value::from(0)));
    }
}

#[test]
fn people_get_tables_and_histograms_and_an_svg() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jitter.svg");
    let output =
        run(&["--cycles", "100", "--period-us", "2000", "--priority", "0", "--svg", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in
        ["100 cycles of 2.00 ms", "sleep only", "sleep, then spin", "99.9 %", "missed slots", "SCHED_OTHER"]
    {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    assert!(!text.contains('\x1b'), "colours are for terminals");
    let svg = fs::read_to_string(path).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    // Two histograms with a curve for each kind of pacing.
    assert_eq!(svg.matches("<polygon ").count(), 4);
}

#[test]
fn ctrl_c_ends_early_with_130_and_what_there_is() {
    let child = start(&["--cycles", "1000000000", "--json"]);
    thread::sleep(Duration::from_millis(1_000));
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
    let report = report(&output);
    assert_eq!(report["is_whole"], false);
    assert_eq!(report["passes"].as_array().unwrap().len(), 1, "the second way was not begun");
    assert!(report["passes"][0]["cycles"].as_u64().unwrap() > 0);
}

#[test]
fn what_cannot_be_measured_is_refused_with_2() {
    for options in [
        &["--period-us", "100"][..],
        &["--cycles", "0"],
        &["--priority", "100"],
        &["--bus", "a/b"],
        &["--bus", "nosuchcan9"],
    ] {
        let output = run(options);
        assert_eq!(output.status.code(), Some(2), "{options:?}: {}", errors(&output));
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{options:?}");
    }
}

#[test]
fn an_svg_that_cannot_be_written_ends_with_1_and_the_figures_are_printed_all_the_same() {
    let output = run(&["--cycles", "20", "--json", "--svg", "/nowhere/at/all.svg"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(errors(&output).contains("/nowhere/at/all.svg"), "{}", errors(&output));
    assert_eq!(report(&output)["passes"].as_array().unwrap().len(), 2);
}
