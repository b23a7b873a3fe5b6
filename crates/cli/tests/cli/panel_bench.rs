//! Commissioning by the panel: the program `takt panel CONFIG` with simulated drives, as pages meet it.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::open_page::*;

/// The program, and where it listens.
struct Bench {
    program: Child,
    address: SocketAddr,
    /// Kept open, so that the program may still say something.
    _said: BufReader<ChildStderr>,
}

impl Bench {
    fn start(name: &str) -> Self {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("configs").join(name);
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command
            .args(["panel", "--address", "127.0.0.1:0", "--panel-open"])
            .arg(path)
            .stderr(Stdio::piped())
            .stdin(Stdio::null());
        let mut program = command.spawn().unwrap();
        let mut said = BufReader::new(program.stderr.take().unwrap());
        let address = shown_address(&mut said);
        Self { program, address, _said: said }
    }

    fn open(&self) -> Page {
        Page::open(self.address).unwrap()
    }

    fn commander(&self) -> Page {
        let mut page = self.open();
        let begun = Instant::now();
        // The page before it may not be gone yet.
        while page.control("take").0 != 200 {
            assert!(begun.elapsed() < LONG);
            thread::sleep(Duration::from_millis(50));
        }
        // What was told before is not for this page.
        page.newest_state();
        page
    }

    fn machine(&self) -> Value {
        get(self.address, "/api/machine", "X-Takt-Panel: 1\r\n").2
    }

    fn frames(&self) -> Vec<String> {
        let (mut all, mut seen) = (vec![], 0);
        loop {
            let wanted = json!({ "after": seen }).to_string();
            let (_, _, value) = post(self.address, "/api/frames", "", &wanted);
            let frames = value["frames"].as_array().unwrap();
            let Some(last) = frames.last() else { return all };
            seen = last["number"].as_u64().unwrap();
            all.extend(frames.iter().map(|frame| frame["frame"].as_str().unwrap().to_owned()));
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.program.kill();
        self.program.wait().unwrap();
    }
}

/// The address that the program says it listens at.
fn shown_address(said: &mut impl BufRead) -> SocketAddr {
    let mut all = String::new();
    loop {
        let mut line = String::new();
        assert!(said.read_line(&mut line).unwrap() > 0, "it has ended: {all}");
        all.push_str(&line);
        if let Some((_, rest)) = line.split_once("http://") {
            return rest.split('/').next().unwrap().parse().unwrap();
        }
    }
}

fn until(page: &Page, what: &str, mut is_so: impl FnMut(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let state = page.newest_state();
        if is_so(&state) {
            return state;
        }
        assert!(begun.elapsed() < LONG, "{what}: {state}");
    }
}

/// Gives a command as soon as nothing else is done.
fn ask(page: &mut Page, command: &Value) {
    let begun = Instant::now();
    loop {
        let answer = page.command(command);
        if answer == (200, json!({ "done": true })) {
            return;
        }
        assert!(answer.1["error"] == "busy_with_drive" && begun.elapsed() < LONG, "{command}: {answer:?}");
        // Fewer than a page may send.
        thread::sleep(Duration::from_millis(150));
    }
}

fn task(page: &mut Page, drive: usize, task: &Value) -> Value {
    ask(page, &json!({ "do": "task", "drive": drive, "task": task }));
    page.next("outcome")
}

fn is_done(outcome: &Value) {
    assert_eq!(outcome["ended"], "done", "{outcome}");
}

fn profile() -> Value {
    json!({ "velocity": null, "acceleration": null })
}

fn watch(page: &mut Page, drive: usize) {
    ask(page, &json!({ "do": "watch", "drive": drive, "every_ms": 20 }));
}

fn runs(state: &Value) -> bool {
    state["reading"]["velocity"].as_f64().is_some_and(|velocity| velocity.abs() > 0.01)
}

fn rests(state: &Value) -> bool {
    state["reading"]["velocity"].as_f64().is_some_and(|velocity| velocity.abs() < 0.002)
}

#[test]
fn a_scan_lists_who_is_there_and_an_unknown_drive_can_be_added_by_its_family() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    assert_eq!(bench.machine()["drives"][0]["found"], Value::Null);
    ask(&mut page, &json!({ "do": "scan", "bus": 0, "from": 1, "to": 4 }));
    until(&page, "a scan that has found something", |state| state["version"] == 2);
    let machine = bench.machine();
    let found = &machine["drives"][0]["found"];
    assert_eq!(found["protocol"]["text"], "CANopen SDO", "{machine}");
    assert_eq!(
        (found["vendor"].as_str(), found["product"].as_str()),
        (Some("ZeroErr"), Some("eRob")),
        "{machine}"
    );
    assert_eq!(machine["drives"].as_array().unwrap().len(), 1, "{machine}");
    ask(&mut page, &json!({ "do": "add", "bus": 0, "node": 9, "family": "yz-aim" }));
    until(&page, "a drive more", |state| state["version"] == 3);
    assert_eq!(bench.machine()["drives"][1]["family"], "yz-aim");
    // Nobody is there: that is told, and nothing else happens.
    let outcome = task(&mut page, 1, &json!({ "kind": "info" }));
    assert_eq!(outcome["ended"], "failed", "{outcome}");
    let info = task(&mut page, 0, &json!({ "kind": "info" }));
    is_done(&info);
    assert!(info["items"].as_array().unwrap().len() > 5, "{info}");
    let cycle = task(&mut page, 0, &json!({ "kind": "cycle", "write_us": 2000 }));
    is_done(&cycle);
    let cycle = task(&mut page, 0, &json!({ "kind": "cycle", "write_us": null }));
    assert!(cycle["items"].to_string().contains("2000"), "{cycle}");
}

#[test]
fn every_motion_of_a_canopen_drive_is_done_and_ends_without_torque_unless_it_was_enabled() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    let move_to = |to: f64| json!({ "kind": "absolute", "to": to, "profile": { "velocity": 1.0, "acceleration": 5.0 } });
    is_done(&task(&mut page, 0, &move_to(0.2)));
    until(&page, "no torque", |state| state["torque"][0] == "off");
    is_done(&task(&mut page, 0, &json!({ "kind": "enable" })));
    until(&page, "torque", |state| state["torque"][0] == "on");
    is_done(&task(&mut page, 0, &json!({ "kind": "relative", "by": -0.1, "profile": profile() })));
    let reciprocating = json!({ "kind": "reciprocate", "to": 0.2, "times": 1, "dwell": 0.0, "profile": { "velocity": 1.0, "acceleration": 5.0 } });
    is_done(&task(&mut page, 0, &reciprocating));
    until(&page, "torque still", |state| state["torque"][0] == "on");
    let outside = task(&mut page, 0, &move_to(1000.0));
    assert_eq!(outside["ended"], "refused", "{outside}");
    is_done(&task(&mut page, 0, &json!({ "kind": "disable" })));
    until(&page, "no torque after all", |state| state["torque"][0] == "off");
    for kind in [
        json!({ "kind": "continuous", "is_forward": true, "profile": profile() }),
        json!({ "kind": "velocity", "value": 0.2, "profile": profile() }),
    ] {
        ask(&mut page, &json!({ "do": "task", "drive": 0, "task": kind }));
        until(&page, "motion", runs);
        page.is_refused(
            &json!({ "do": "task", "drive": 0, "task": { "kind": "info" } }),
            409,
            "busy_with_drive",
        );
        page.does(&json!({ "do": "end" }));
        assert_eq!(page.next("outcome")["ended"], "interrupted");
        until(&page, "no torque at the end", |state| {
            state["torque"][0] == "off" && state["running"].is_null()
        });
    }
    watch(&mut page, 0);
    until(&page, "rest", rests);
}

#[test]
fn a_drive_of_each_other_protocol_is_enabled_moved_and_disabled() {
    for (config, drive) in [("turntable-erob-can.toml", 0), ("gantry-yz-aim.toml", 0), ("hollow-arm.toml", 0)]
    {
        let bench = Bench::start(config);
        let mut page = bench.commander();
        let info = task(&mut page, drive, &json!({ "kind": "info" }));
        assert_eq!(info["ended"], "done", "{config}: {info}");
        let distance = if config.starts_with("gantry") { 0.01 } else { 0.05 };
        let relative = json!({ "kind": "relative", "by": distance, "profile": profile() });
        let mut moved = task(&mut page, drive, &relative);
        // On a machine that is too busy a drive is not enabled in time.
        for _ in 0..5 {
            if english(&moved["failure"]).contains("timeout") {
                moved = task(&mut page, drive, &relative);
            }
        }
        assert_eq!(moved["ended"], "done", "{config}: {moved}");
        let disabled = task(&mut page, drive, &json!({ "kind": "disable" }));
        assert_eq!(disabled["ended"], "done", "{config}: {disabled}");
        until(&page, "no torque", |state| state["torque"][drive] == "off");
    }
}

#[test]
fn a_page_that_is_lost_leaves_no_drive_moving_and_none_with_torque() {
    let bench = Bench::start("single-erob.toml");
    let watcher = bench.open();
    for begins in [
        json!({ "kind": "continuous", "is_forward": true, "profile": profile() }),
        json!({ "kind": "enable" }),
    ] {
        let mut page = bench.commander();
        ask(&mut page, &json!({ "do": "task", "drive": 0, "task": begins }));
        until(&watcher, "torque", |state| state["torque"][0] == "on" && state["running"]["step"] != "");
        if begins["kind"] == "continuous" {
            until(&watcher, "motion", runs);
        } else {
            is_done(&page.next("outcome"));
        }
        page.kill();
        until(&watcher, "no torque", |state| state["torque"][0] == "off" && state["running"].is_null());
        let mut page = bench.commander();
        watch(&mut page, 0);
        until(&page, "rest", |state| rests(state) && state["reading"]["state"] != "operation enabled");
        page.kill();
    }
}

#[test]
fn a_page_that_hangs_ends_what_it_moves() {
    let bench = Bench::start("single-erob.toml");
    let watcher = bench.open();
    let mut page = bench.commander();
    ask(
        &mut page,
        &json!({ "do": "task", "drive": 0, "task": { "kind": "continuous", "is_forward": true, "profile": profile() } }),
    );
    until(&watcher, "motion", runs);
    page.confirms.store(false, Ordering::Relaxed);
    until(&watcher, "no torque", |state| state["torque"][0] == "off" && state["running"].is_null());
}

#[test]
fn everybody_may_stop_and_a_stop_takes_the_torque_of_a_drive_that_was_left_enabled() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    let other = bench.open();
    let stop = || post(bench.address, "/api/stop", "", r#"{"category": 1}"#).0;
    is_done(&task(&mut page, 0, &json!({ "kind": "enable" })));
    assert_eq!(stop(), 200);
    until(&other, "no torque", |state| state["torque"][0] == "off");
    ask(
        &mut page,
        &json!({ "do": "task", "drive": 0, "task": { "kind": "continuous", "is_forward": true, "profile": profile() } }),
    );
    until(&other, "motion", runs);
    assert_eq!(stop(), 200);
    assert_eq!(page.next("outcome")["ended"], "interrupted");
    until(&other, "no torque and nothing done", |state| {
        state["torque"][0] == "off" && state["running"].is_null()
    });
    // The page goes on as before.
    is_done(&task(&mut page, 0, &json!({ "kind": "info" })));
}

#[test]
fn what_is_held_ends_when_it_is_not_renewed() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    let held = json!({ "do": "task", "drive": 0, "held": true, "task": { "kind": "velocity", "value": 0.2, "profile": profile() } });
    let (begun, mut is_held) = (Instant::now(), false);
    loop {
        let state = page.newest_state();
        if runs(&state) {
            break;
        }
        assert!(begun.elapsed() < LONG, "{state}");
        // On a machine that is too busy to renew it in time, it is pressed again.
        let (status, value) = page.command(&if is_held { json!({ "do": "renew" }) } else { held.clone() });
        let is_late =
            ["nothing_to_renew", "busy_with_drive", "too_often"].iter().any(|key| value["error"] == *key);
        assert!(status == 200 || is_late, "{value}");
        is_held = status == 200 || value["error"] == "too_often";
    }
    until(&page, "no torque", |state| state["torque"][0] == "off" && state["running"].is_null());
    page.is_refused(&json!({ "do": "renew" }), 409, "nothing_to_renew");
    watch(&mut page, 0);
    until(&page, "rest", rests);
}

#[test]
fn a_frame_is_sent_and_shown_with_the_answer_but_not_while_a_drive_has_torque() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    let node = bench.machine()["drives"][0]["node"].as_u64().unwrap();
    let request = format!("{:03X}#4000100000000000", 0x600 + node);
    let send = json!({ "do": "send", "bus": 0, "frame": request, "count": 2, "period_ms": 10 });
    ask(&mut page, &send);
    let answers = || {
        let answered = format!("{:03X}#43001000", 0x580 + node);
        bench.frames().iter().filter(|frame| frame.starts_with(&answered)).count()
    };
    let begun = Instant::now();
    while answers() < 2 {
        assert!(begun.elapsed() < LONG, "{:?}", bench.frames());
        thread::sleep(Duration::from_millis(20));
    }
    is_done(&task(&mut page, 0, &json!({ "kind": "enable" })));
    // The procedures read this object, too.
    let requests = || bench.frames().iter().filter(|frame| **frame == request).count();
    let before = requests();
    ask(&mut page, &send);
    let problem = page.next("problem");
    assert!(english(&problem["words"]).contains("has torque"), "{problem}");
    assert_eq!(requests(), before);
    ask(&mut page, &json!({ "do": "send", "bus": 0, "frame": "181", "count": 1, "period_ms": 10 }));
    assert!(english(&page.next("problem")["words"]).contains('#'));
}

#[test]
fn who_does_not_command_asks_too_often_or_comes_from_elsewhere_does_nothing() {
    let bench = Bench::start("single-erob.toml");
    let mut page = bench.commander();
    let mut other = bench.open();
    let enable = json!({ "do": "task", "drive": 0, "task": { "kind": "enable" } });
    other.is_refused(&enable, 409, "not_commander");
    let body = json!({ "number": 1, "command": enable }).to_string();
    let own = format!("X-Takt-Page: {}\r\n", page.key);
    assert_eq!(
        post(bench.address, "/api/command", &format!("{own}Origin: http://evil.example\r\n"), &body).0,
        403
    );
    let address = bench.address;
    let no_header = format!("POST /api/frames HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    assert_eq!(exchange(address, &no_header).0, 403);
    assert_eq!(post(address, "/api/frames", "", r#"{"after": -1}"#).0, 400);
    page.is_refused(&json!({ "do": "scan", "bus": 0, "from": 1, "to": 200 }), 400, "malformed");
    let answers: Vec<u16> = (0..60)
        .map(|_| page.command(&json!({ "do": "add", "bus": 9, "node": 1, "family": "x" })).0)
        .collect();
    assert!(answers.contains(&429), "{answers:?}");
    assert_eq!(page.newest_state()["torque"][0], "off");
    assert_eq!(post(bench.address, "/api/stop", "", r#"{"category": 1}"#).0, 200);
}
