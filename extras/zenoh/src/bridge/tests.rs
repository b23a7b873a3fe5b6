//! Trajectories that wait, with an arm and a gripper that this process serves, and with what another program does meanwhile.

use std::fs;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use takt::{AxisSnapshot, Config, Controller, Phase, SessionOptions};
use takt_remote::{Client, ServeOptions, Server, serve};

use super::*;

const PATIENCE: Duration = Duration::from_secs(60);
/// The wait of a trajectory.
const AHEAD: Duration = Duration::from_millis(1500);
const TOPIC: &str = "/arm/trajectory";

static STAGES: AtomicU32 = AtomicU32::new(0);

/// A served controller and a bridge to it.
struct Stage {
    controller: Controller,
    _server: Server,
    bridge: Bridge,
    folder: std::path::PathBuf,
    said: Mutex<Vec<String>>,
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Stage {
    fn new() -> Self {
        let number = STAGES.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("takt-zenoh-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let controller = Controller::start(config(&folder), SessionOptions::default()).unwrap();
        let name = folder.join("arm").to_str().unwrap().to_owned();
        let server = serve(controller.handle(), &name, ServeOptions::default()).unwrap();
        let options = Options {
            controller: name,
            domain: 0,
            node: "takt".to_owned(),
            states: "/arm/states".to_owned(),
            trajectories: Some(TOPIC.to_owned()),
            rate_hz: 10.0,
            connect: vec![],
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            is_humble: false,
        };
        let bridge = Bridge::open(options, || {}).unwrap();
        Self { controller, _server: server, bridge, folder, said: Mutex::default() }
    }

    fn client(&self) -> Client {
        takt_remote::connect(&self.bridge.options.controller).unwrap()
    }

    fn positions(&self) -> Vec<f64> {
        self.controller.handle().state().axes().iter().map(|axis| axis.position_set).collect()
    }

    /// Waits until the bridge sees what was done before.
    fn wait_until_shown(&self) {
        let slot = self.controller.handle().state().slot;
        self.bridge.controller.cycle_after(slot + 5, PATIENCE).unwrap();
    }

    /// Publishes a trajectory as a node of ROS 2 does.
    fn publish(&self, message: &[u8]) {
        let node = Node {
            domain: 0,
            session: String::new(),
            namespace: "/".to_owned(),
            name: "other".to_owned(),
            is_humble: false,
        };
        self.bridge._session.put(node.topic(TOPIC, &JOINT_TRAJECTORY), message).wait().unwrap();
    }

    /// Runs the bridge, and `body` beside it.
    fn run(&self, body: impl FnOnce()) {
        let is_over = AtomicBool::new(false);
        let say = |words: &str| self.said.lock().unwrap().push(words.to_owned());
        thread::scope(|scope| {
            let running = scope.spawn(|| self.bridge.run(|| is_over.load(Ordering::Acquire), say).unwrap());
            let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(body));
            is_over.store(true, Ordering::Release);
            running.join().unwrap();
            done.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        });
    }

    /// Waits for words that have not been waited for yet.
    fn wait_for(&self, words: &str) {
        let until = Instant::now() + PATIENCE;
        loop {
            let mut said = self.said.lock().unwrap();
            if let Some(place) = said.iter().position(|line| line.contains(words)) {
                said.drain(..=place);
                return;
            }
            assert!(Instant::now() < until, "{words:?} is not in {said:?}");
            drop(said);
            thread::sleep(Duration::from_millis(5));
        }
    }
}

fn config(folder: &std::path::Path) -> Config {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/arm-and-gripper.toml");
    let text = fs::read_to_string(path).unwrap().replace("mode = \"pt\"", "mode = \"csp\"");
    let (axes, _) = text.split_once("# The moves of a group").unwrap();
    let path = folder.join("arm.toml");
    fs::write(&path, axes).unwrap();
    let mut config = Config::load(&path).unwrap();
    config.telemetry.is_recorded = false;
    config.telemetry.black_box_ns = None;
    config
}

/// The message that moves one joint there within 300 ms, `ahead` from now; at once if that is zero.
fn message(joint: &str, position: f64, ahead: Duration) -> Vec<u8> {
    let at_ns = if ahead.is_zero() { 0 } else { time_of_day_ns() + ahead.as_nanos() as i64 };
    let mut encoder = CdrEncoder::default();
    let stamped = encoder.begin().i32((at_ns / 1_000_000_000) as i32).u32((at_ns % 1_000_000_000) as u32);
    stamped
        .string("")
        .u32(1)
        .string(joint)
        .u32(1)
        .u32(1)
        .f64(position)
        .u32(0)
        .u32(0)
        .u32(0)
        .i32(0)
        .u32(300_000_000);
    encoder.bytes().to_vec()
}

/// The message without points.
fn stop() -> Vec<u8> {
    let mut encoder = CdrEncoder::default();
    encoder.begin().i32(0).u32(0).string("").u32(0).u32(0);
    encoder.bytes().to_vec()
}

#[test]
fn a_trajectory_that_waits_is_discarded_by_whatever_stops_its_axes_or_commands_them() {
    let stage = Stage::new();
    let own = stage.controller.handle();
    let holds = || own.wait_for(Phase::Holding, PATIENCE).unwrap();
    let in_turn = |interruption: &dyn Fn(), words: &str| {
        holds();
        stage.wait_until_shown();
        let before = stage.positions();
        stage.publish(&message("finger", 0.02, AHEAD));
        stage.wait_for("begins in");
        interruption();
        stage.wait_for(words);
        thread::sleep(AHEAD + Duration::from_millis(300));
        holds();
        let finger = |positions: Vec<f64>| positions[3];
        assert_eq!(finger(stage.positions()), finger(before), "after: {words}");
    };
    let stopped = "discarded: its axes have stopped";
    stage.run(|| {
        in_turn(&|| stage.client().stop(StopCategory::Two).unwrap(), stopped);
        in_turn(&|| own.group("gripper").unwrap().stop(StopCategory::Two).unwrap(), stopped);
        // It stops with the arm.
        in_turn(&|| own.group("arm").unwrap().stop(StopCategory::Two).unwrap(), stopped);
        let off_and_on = |end: &dyn Fn()| {
            end();
            own.wait_for(Phase::Disabled, PATIENCE).unwrap();
            own.enable().unwrap();
        };
        in_turn(&|| off_and_on(&|| own.stop(StopCategory::One).unwrap()), stopped);
        in_turn(&|| off_and_on(&|| own.disable().unwrap()), stopped);
        let commands = || {
            let other = stage.client();
            other.take_over().unwrap();
            other.release().unwrap();
        };
        in_turn(&commands, "discarded: another client has commanded");
    });
}

#[test]
fn a_trajectory_that_waits_begins_in_spite_of_a_stop_of_another_group_and_of_one_before_it() {
    let stage = Stage::new();
    let own = stage.controller.handle();
    stage.run(|| {
        stage.publish(&stop());
        stage.wait_for("come to rest");
        stage.publish(&message("base", 0.02, AHEAD));
        stage.wait_for("begins in");
        own.group("gripper").unwrap().stop(StopCategory::Two).unwrap();
        stage.wait_until_shown();
        stage.publish(&message("finger", 0.02, Duration::ZERO));
        stage.wait_for("a trajectory of 1 points has begun");
        stage.wait_for("a trajectory of 1 points has begun");
        let is_there = |axis: &AxisSnapshot| (axis.position_set - 0.02).abs() < 1e-6;
        let are_there = |state: &Snapshot| [0, 3].map(|axis| is_there(&state.axes()[axis])) == [true; 2];
        own.wait_until(PATIENCE, |state| are_there(state).then_some(())).unwrap();
    });
}

#[test]
fn nothing_waits_for_axes_that_are_off() {
    let stage = Stage::new();
    let own = stage.controller.handle();
    own.disable().unwrap();
    own.wait_for(Phase::Disabled, PATIENCE).unwrap();
    stage.wait_until_shown();
    stage.run(|| {
        stage.publish(&message("base", 0.02, AHEAD));
        stage.wait_for("refused: its axes were disabled when it came");
    });
}
