//! The panel's server, as a browser, another site and a lost page meet it. The page itself is driven by `crates/panel/tests/panel/run`.

mod access;
mod open_page;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use takt::telemetry::FrameFeed;
use takt::{Controller, FaultInjector, Phase, Scenario, SessionOptions, StopCategory};
use takt_panel::{FrameSource, Listening};
use takt_tools::monitor::BusDecoder;

use open_page::*;

#[test]
fn a_page_sees_the_machine_and_its_states() {
    let shown = Shown::start("arm-and-gripper.toml");
    let (status, _, machine) = get(shown.address(), "/api/machine", "X-Takt-Panel: 1\r\n");
    assert_eq!((status, &machine["name"]), (200, &json!("arm-and-gripper")));
    assert_eq!(machine["groups"][1], json!({ "name": "gripper", "axes": [3] }));
    assert_eq!(machine["axes"][0]["position_max"].as_f64(), Some(150f64.to_radians()));
    let page = shown.open();
    let state = page.next("state");
    assert_eq!(state["groups"][0]["phase"], "holding");
    assert_eq!((state["axes"][0]["mode"].as_i64(), state["axes"][3]["mode"].as_i64()), (Some(8), Some(4)));
    assert_eq!(state["axes"][0]["drive"], "operation enabled");
    assert_eq!((&state["commander"], state["pages"].as_u64()), (&Value::Null, Some(1)));
}

#[test]
fn one_page_commands_and_everyone_may_stop() {
    let shown = Shown::start("arm6-erob.toml");
    let (mut first, mut second) = (shown.open(), shown.open());
    let words = first.is_refused(&json!({ "do": "disable" }), 409, "not_commander");
    assert!(words.contains("take command first"), "{words}");
    assert_eq!(first.control("take").0, 200);
    assert_eq!(second.control("take").0, 409);
    let words = second.is_refused(&json!({ "do": "disable" }), 409, "not_commander");
    assert!(words.contains(&format!("page {} does", first.number)), "{words}");

    let axis = json!({ "do": "move", "axis": 0, "to": 1.0, "relative": false, "velocity": 0.2, "acceleration": 0.5 });
    first.does(&axis);
    shown.until_phase(Phase::Moving);
    // Neither command nor a connection is needed for a stop.
    assert_eq!(post(shown.address(), "/api/stop", "", r#"{"category":2}"#).0, 200);
    shown.until_phase(Phase::Holding);
    let reached = shown.controller.state().axes[0].position_set;
    assert!((0.0..0.9).contains(&reached.abs()), "{reached}");

    first.does(&axis);
    shown.until_phase(Phase::Moving);
    assert_eq!(second.control("take_over").0, 200);
    shown.until_phase(Phase::Holding);
    first.is_refused(&axis, 409, "not_commander");
    second.does(&json!({ "do": "disable" }));
    shown.until_phase(Phase::Disabled);
    second.does(&json!({ "do": "enable" }));
    shown.until_phase(Phase::Holding);
    assert_eq!(second.newest_state()["commander"].as_u64(), Some(second.number));
}

#[test]
fn an_axis_moves_to_a_position_by_a_distance_to_and_fro_and_with_its_group() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let set = |axis: usize| shown.controller.state().axes[axis].position_set;
    let others = set(1);
    page.does(&json!({ "do": "move", "axis": 0, "to": 0.1, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("0.1", |state| state.axes[0].position_set == 0.1 && state.groups[0].phase == Phase::Holding);
    page.does(&json!({ "do": "move", "axis": 0, "to": -0.05, "relative": true, "velocity": 1.0, "acceleration": 1.0 }));
    let is_there = |state: &takt::Snapshot| (state.axes[0].position_set - 0.05).abs() < 1e-9;
    shown.until("0.05", |state| is_there(state) && state.groups[0].phase == Phase::Holding);
    assert_eq!(set(1), others);

    page.does(&json!({ "do": "reciprocate", "axis": 0, "between": [0.0, 0.1], "velocity": 1.0, "acceleration": 1.0 }));
    for _ in 0..2 {
        shown.until("one end", |state| state.axes[0].position_set < 0.01);
        shown.until("the other end", |state| state.axes[0].position_set > 0.09);
    }
    page.does(&json!({ "do": "release", "axis": 0 }));
    shown.until_phase(Phase::Holding);

    let to: Vec<f64> = (0..6).map(|axis| set(axis) + if axis == 0 { -0.02 } else { 0.0 }).collect();
    page.does(&json!({ "do": "move_group", "group": 0, "to": to, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until("the group", |state| state.axes[0].position_set == to[0]);

    let beyond = json!({ "do": "move", "axis": 0, "to": 9.0, "relative": false, "velocity": 1.0, "acceleration": 1.0 });
    let words = page.is_refused(&beyond, 409, "refused");
    assert!(words.contains("joint1") && words.contains("not within its limits"), "{words}");
    let wrong_group =
        json!({ "do": "move_group", "group": 3, "to": to, "velocity": 1.0, "acceleration": 1.0 });
    assert!(page.is_refused(&wrong_group, 409, "refused").contains("there is no group 3"));
    let too_fast =
        json!({ "do": "move", "axis": 0, "to": 0.0, "relative": true, "velocity": 3.0, "acceleration": 1.0 });
    assert!(page.is_refused(&too_fast, 409, "refused").contains("fraction of the velocity limits"));
    let no_axis = json!({ "do": "release", "axis": 0, "extra": 1 });
    assert!(page.is_refused(&no_axis, 400, "malformed").contains("unknown field"));
}

#[test]
fn a_held_key_moves_the_axis_and_it_comes_to_rest_when_it_is_not_renewed() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let moves = |state: &takt::Snapshot| {
        state.groups[0].phase == Phase::Streaming && (state.axes[0].velocity_set - 0.2).abs() < 0.01
    };
    hold_until(&shown, &mut page, 0.2, moves);
    assert!(shown.controller.state().axes[1].velocity_set.abs() < REST);
    // The page is there, and renews nothing.
    shown.until_phase(Phase::Holding);
    page.is_refused(&json!({ "do": "renew", "axis": 0, "value": 0.2 }), 409, "nothing_to_renew");
    hold_until(&shown, &mut page, -0.2, |state| state.axes[0].velocity_set < -0.19);
    page.does(&json!({ "do": "release", "axis": 0 }));
    // The next one begins when the axis is at rest, without a word.
    hold_until(&shown, &mut page, 0.2, |state| state.axes[0].velocity_set > 0.19);
    page.does(&json!({ "do": "release", "axis": 0 }));
    shown.until_phase(Phase::Holding);
}

#[test]
fn what_a_page_has_let_go_is_not_stopped_any_more_when_the_page_gives_command_back() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    hold_until(&shown, &mut page, 0.2, |state| state.axes[0].velocity_set > 0.19);
    page.does(&json!({ "do": "release", "axis": 0 }));
    shown.until_phase(Phase::Holding);
    assert_eq!(page.control("release").0, 200);
    page.newest_state();
    shown.until("states", |_| {
        page.messages.lock().unwrap().iter().filter(|(kind, _)| kind == "state").count() > 10
    });
    let messages = page.messages.lock().unwrap();
    let stops =
        messages.iter().filter(|(kind, event)| kind == "event" && english(&event["words"]).contains("stop"));
    assert_eq!(stops.collect::<Vec<_>>(), Vec::<&(String, Value)>::new());
}

#[test]
fn the_monitor_has_the_frames_of_a_running_controller_with_their_meaning_while_a_page_asks() {
    let config = config("arm6-erob.toml");
    let feed = Arc::<FrameFeed>::default();
    let decoders = (0..config.buses.len()).map(|bus| BusDecoder::of(&config, bus)).collect();
    let listening = Listening::begin(&options(None)).unwrap();
    let session = SessionOptions { frames: Some(Arc::clone(&feed)), ..SessionOptions::default() };
    let controller = Controller::start(config, session).unwrap();
    let frames = FrameSource { feed, decoders };
    let panel = listening.show(controller.handle(), None, Some(frames)).unwrap();
    let shown = Shown { panel, controller };
    assert_eq!(get(shown.address(), "/api/machine", "X-Takt-Panel: 1\r\n").2["has_frames"], true);
    let frames = |wanted: &Value| {
        let (status, _, value) = post(shown.address(), "/api/frames", "", &wanted.to_string());
        assert_eq!(status, 200, "{value}");
        value
    };
    let find = |filter: &str, parts: &[&str]| {
        shown.until(filter, |_| {
            let found = frames(&json!({ "after": 0, "filter": filter }));
            let line =
                |frame: &Value| format!("{} {} {}", frame["direction"], frame["frame"], frame["words"]);
            found["frames"]
                .as_array()
                .unwrap()
                .iter()
                .map(line)
                .any(|line| parts.iter().all(|part| line.contains(part)))
        });
    };
    find("181#", &["<", "181#", "joint1", "statusword"]);
    find("joint6", &["joint6"]);
    find("SYNC", &[">", "080#"]);
    let last = frames(&json!({ "after": 0, "filter": "there is no such frame" }));
    assert!(last["frames"].as_array().unwrap().is_empty() && last["last"].as_u64().unwrap() > 0, "{last}");
}

#[test]
fn a_page_that_is_killed_or_hangs_leaves_the_arm_at_rest() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    // It goes on until it is ended, so that the loss of the page alone ends it.
    let mut open = jog(0, 0.1);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    page.kill();
    shown.until_phase(Phase::Holding);

    let mut page = shown.commander();
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    // Its connection stands, but nothing is read at its other end.
    page.confirms.store(false, Ordering::Relaxed);
    shown.until_phase(Phase::Holding);
    page.is_refused(&open, 409, "not_present");
    page.confirms.store(true, Ordering::Relaxed);
    page.does_in_the_end(&open);

    let far = json!({ "do": "move", "axis": 0, "to": -1.0, "relative": false, "velocity": 0.1, "acceleration": 0.5 });
    page.does_in_the_end(&far);
    shown.until_phase(Phase::Moving);
    page.kill();
    shown.until_phase(Phase::Holding);
    assert!(shown.controller.state().axes[0].position_set > -0.9, "a move ends with its page as well");
}

#[test]
fn a_stop_of_anyone_ends_what_is_held_and_nothing_renews_it() {
    let shown = Shown::start("erob-modes/erob-pv.toml");
    let mut page = shown.commander();
    let mut open = jog(0, 0.2);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity > 0.15);
    shown.controller.stop(StopCategory::Two).unwrap();
    shown.until_phase(Phase::Holding);
    let state = page.newest_state();
    assert_eq!(state["groups"][0]["stop"]["is_fault"], false, "{state}");
    page.is_refused(&json!({ "do": "renew", "axis": 0, "value": 0.2 }), 409, "nothing_to_renew");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity > 0.15);
    let stop = json!({ "category": 1, "number": page.sequence + 5 }).to_string();
    assert_eq!(post(shown.address(), "/api/stop", &page.headers(), &stop).0, 200);
    shown.until_phase(Phase::Disabled);
    page.is_refused(&open, 409, "overtaken");
    page.sequence += 10;
    page.is_refused(&open, 409, "refused");
}

#[test]
fn what_a_mode_does_not_take_is_refused_by_its_name() {
    let shown = Shown::start("arm-and-gripper.toml");
    let mut page = shown.commander();
    let torque = |axis: usize| json!({ "do": "drive", "axis": axis, "quantity": "torque", "value": 1.0, "while": "held" });
    let words = page.is_refused(&torque(0), 409, "refused");
    assert!(words.contains("base is in cyclic synchronous position, which takes no torque"), "{words}");
    let words = page.is_refused(&jog(3, 0.1), 409, "refused");
    assert!(words.contains("finger is in profile torque, which takes no velocity"), "{words}");
    page.does(&torque(3));
    shown.until("torque", |state| state.axes[3].velocity > 0.01);
    assert_eq!(shown.controller.state().groups[0].phase, Phase::Holding, "the arm stays");
    hold_until(&shown, &mut page, 0.1, |state| state.axes[0].velocity_set > 0.05);
    // The gripper stops with the arm, as its configuration says.
    shown.until("rest", |state| {
        state.groups[0].phase == Phase::Holding && state.groups[1].phase == Phase::Disabled
    });
    let words = page.is_refused(&jog(9, 0.1), 409, "refused");
    assert!(words.contains("there is no axis 9"), "{words}");
    assert!(
        page.is_refused(&json!({ "do": "change_mode", "axis": 0, "mode": 77 }), 409, "refused")
            .contains("no mode 77")
    );
}

#[test]
fn a_fault_is_told_with_its_words_and_is_cleared_by_the_page() {
    let config = config("arm6-erob.toml");
    let alarm =
        "[[fault]]\nkind = \"alarm\"\naxis = \"joint2\"\ncode = 0x4310\nwhen = \"moving\"\nat = \"200 ms\"\n";
    let injector = FaultInjector::new(Scenario::parse("alarm", alarm, &config).unwrap());
    let session = SessionOptions { fault_injector: Some(Arc::new(injector)), ..SessionOptions::default() };
    let shown = Shown::with(config, session, &options(None));
    let mut page = shown.commander();
    page.does(&json!({ "do": "move", "axis": 1, "to": 0.9, "relative": false, "velocity": 1.0, "acceleration": 1.0 }));
    shown.until_phase(Phase::Disabled);
    let stop = page.newest_state()["groups"][0]["stop"].clone();
    assert_eq!(
        (&stop["rule"], &stop["axis"], &stop["is_fault"]),
        (&json!("drive_fault"), &json!(1), &json!(true))
    );
    assert!(english(&stop["words"]).contains("joint2 reports fault"), "{stop}");
    assert!(!english(&stop["cure"]).is_empty(), "{stop}");
    // A page words it in both languages: by the template, and by the name that the error has in Chinese.
    assert_eq!(stop["words"]["text"], "the drive of {axis} reports fault {error}");
    assert_eq!(stop["words"]["fields"]["error"]["fields"]["name"]["zh"], "驱动器温度过高");
    let words = page.is_refused(&json!({ "do": "enable" }), 409, "refused");
    assert!(words.contains("must be reset first"), "{words}");
    page.does(&json!({ "do": "clear_faults" }));
    page.does(&json!({ "do": "enable", "group": 0 }));
    shown.until_phase(Phase::Holding);
    // A page that is opened later is told what has happened.
    let late = shown.open();
    let mut told = std::iter::repeat_with(|| english(&late.next("event")["words"]));
    let stop = told.find(|words| words.starts_with("stop: ") && !words.contains("requested"));
    assert!(stop.unwrap().contains("joint2"));
}

#[test]
fn a_page_brings_drives_up_again_and_is_told_which_does_not_answer() {
    let config = config("arm6-erob.toml");
    let silence = "[[fault]]\nkind = \"silent-node\"\naxis = \"joint2\"\nwhen = \"enabled\"\nat = \"100 ms\"\nfor = \"14 s\"\n";
    let injector = FaultInjector::new(Scenario::parse("silence", silence, &config).unwrap());
    let session = SessionOptions { fault_injector: Some(Arc::new(injector)), ..SessionOptions::default() };
    let shown = Shown::with(config, session, &options(None));
    let mut page = shown.commander();
    shown.until_phase(Phase::Disabled);
    page.does(&json!({ "do": "bring_up", "group": 0 }));
    shown.until_phase(Phase::Passive);
    shown.until_phase(Phase::Disabled);
    let problem = page.next("problem");
    let words = english(&problem["words"]);
    assert!(words.contains("joint2") && !words.contains("joint1"), "{problem}");
    // Until the drive answers again.
    while shown.controller.bring_up(Duration::from_secs(30)).is_err() {}
    page.does(&json!({ "do": "clear_faults" }));
    page.does(&json!({ "do": "enable", "group": 0 }));
    shown.until_phase(Phase::Holding);
}

#[test]
fn pages_are_told_that_the_controller_has_ended() {
    let Shown { panel, controller } = Shown::start("first.toml");
    let page = Page::open(address_of(&panel)).unwrap();
    page.next("state");
    controller.finish().unwrap();
    while page.next("state")["has_ended"] != true {}
    let (status, _, value) = post(address_of(&panel), "/api/stop", "", r#"{"category":2}"#);
    assert_eq!((status, &value["error"]), (409, &json!("ended")));
    drop(panel);
    page.kill();
}

#[test]
fn what_pages_have_moved_comes_to_rest_when_the_panel_ends() {
    let shown = Shown::start("arm6-erob.toml");
    let mut page = shown.commander();
    let mut open = jog(0, 0.1);
    open["while"] = json!("open");
    page.does(&open);
    shown.until("motion", |state| state.axes[0].velocity_set > 0.09);
    let Shown { panel, controller } = shown;
    drop(panel);
    controller.wait_for(Phase::Holding, LONG).unwrap();
}

#[test]
fn a_panel_of_another_process_commands_by_its_client() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("arm").to_str().unwrap().to_owned();
    let controller = Controller::start(config("arm6-erob.toml"), SessionOptions::default()).unwrap();
    let _server =
        takt_remote::serve(controller.handle(), &name, takt_remote::ServeOptions::default()).unwrap();
    let client = takt_remote::connect(&name).unwrap();
    let lease = client.clone();
    let take_lease: takt_panel::TakeLease = Box::new(move || lease.take_over());
    let panel = Listening::begin(&options(None)).unwrap().show(client, Some(take_lease), None).unwrap();
    let shown = Shown { panel, controller };
    let mut page = shown.commander();
    // Another program commands, until the page takes over from it by name.
    let other = takt_remote::connect(&name).unwrap();
    // Before the page asks for it: whoever commands without a pause keeps the lease.
    other.take_lease().unwrap();
    let is_other = AtomicBool::new(true);
    thread::scope(|scope| {
        scope.spawn(|| {
            let begun = Instant::now();
            while is_other.load(Ordering::Relaxed) && begun.elapsed() < 2 * LONG {
                let _ = other.reset_faults();
                thread::sleep(Duration::from_millis(20));
            }
        });
        shown.until("the lease of the other", |_| page.command(&jog(0, 0.2)).1["error"] == "lease");
        assert_eq!(post(page.address, "/api/lease", &page.headers(), "").0, 200);
        is_other.store(false, Ordering::Relaxed);
    });
    hold_until(&shown, &mut page, 0.2, |state| state.axes[0].velocity_set > 0.19);
    page.kill();
    shown.until_rest();
    shown.until_phase(Phase::Holding);
}
