//! An axis that speaks eRob's own CAN protocol follows its group beside the cycle, in virtual time.

use takt::family::erob_can::follower::Follower;
use takt::family::{OffCycleDrive, OffCycleTarget, OffCycleWish};
use takt::schedule::{self, MessageKind};
use takt::sim::{Defect, DriveFault, SimulatedBus};
use takt::{Config, Outcome, VirtualRun};
use takt_rt::{BusPort, DriveState, Frame, OffCycleReport, ReceiveBatch};
use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::{ReceivedRequest, Reply, replying_node};

const MS: u64 = 1_000_000;
const NODE: u8 = 1;
const CONFIGURATION: &str = r#"
name = "turntable"

[[bus]]
name = "can"
period = "10 ms"

[[axis]]
name = "table"
bus = "can"
node = 1
drive = "erob-can"

[axis.limits]
position = ["-170 deg", "170 deg"]
velocity = "60 deg/s"
acceleration = "120 deg/s^2"
torque = "31 Nm"

[[program.move]]
to = "60 deg"

[[program.move]]
to = "-30 deg"
"#;

fn config() -> Config {
    Config::parse("turntable.toml", CONFIGURATION).unwrap()
}

#[test]
fn an_axis_follows_its_program_beside_the_cycle_and_ends_at_rest_without_torque() {
    let mut run = VirtualRun::simulated(&config()).unwrap().0;
    let (mut farthest, mut error) = (0.0_f64, 0.0_f64);
    let outcome = run.run(60_000, |run| {
        let axis = run.snapshot().axes[0];
        farthest = farthest.max(axis.position);
        if axis.drive_state == DriveState::OperationEnabled {
            error = error.max(axis.following_error.abs());
        }
    });
    assert_eq!(outcome, Some(Outcome::Finished), "{:?}", run.snapshot().groups()[0]);
    let axis = run.snapshot().axes[0];
    assert_eq!(axis.temperature, Some(35.0), "the simulated drive is as warm as that");
    assert!((farthest - 60_f64.to_radians()).abs() < 0.01, "{farthest}");
    assert!((axis.position + 30_f64.to_radians()).abs() < 0.01, "{axis:?}");
    assert!(error < 3_f64.to_radians(), "{}", error.to_degrees());
}

/// A drive on a bus with a follower, which is called every millisecond.
struct Bench {
    bus: SimulatedBus,
    follower: Follower,
    now_ns: u64,
    sent: Vec<Frame>,
    reports: Vec<(u64, OffCycleReport)>,
    /// The most requests without a reply at once.
    outstanding: (usize, usize),
}

impl Bench {
    fn new() -> Self {
        Self::of(&config())
    }

    fn of(config: &Config) -> Self {
        let follower = Follower::new(&config.axes[0], MS).unwrap();
        let bus = takt::simulated_bus(config, 0);
        Self { bus, follower, now_ns: 0, sent: vec![], reports: vec![], outstanding: (0, 0) }
    }

    /// Goes on for a time, with what `target` wants.
    fn run(&mut self, duration_ms: u64, mut target: impl FnMut(u64) -> OffCycleTarget) {
        for _ in 0..duration_ms {
            let mut batch = ReceiveBatch::new();
            self.bus.receive(self.now_ns, &mut batch);
            for received in &batch {
                self.outstanding.0 -= usize::from(replying_node(&received.frame).is_some());
                self.follower.receive(self.now_ns, &received.frame);
            }
            let mut frames = vec![];
            let wanted = target(self.now_ns);
            let report = self.follower.poll(self.now_ns, &wanted, &mut |frame| frames.push(frame));
            self.outstanding.0 += frames.len();
            self.outstanding.1 = self.outstanding.1.max(self.outstanding.0);
            self.bus.send(self.now_ns, &frames);
            self.sent.extend(frames);
            self.reports.extend(report.map(|report| (self.now_ns, report)));
            self.now_ns += MS;
        }
    }

    /// Its group is enabled.
    fn enable(&mut self, duration_ms: u64, position: f64) {
        self.run(duration_ms, |at_ns| {
            let mut target = of_wish(OffCycleWish::Enable, at_ns);
            target.position = position;
            target
        });
    }

    /// Follows a velocity from where the joint is.
    fn follow(&mut self, duration_ms: u64, from: f64, velocity: f64) {
        let began_ns = self.now_ns;
        self.run(duration_ms, |at_ns| {
            wanted(from + velocity * (at_ns - began_ns) as f64 * 1e-9, velocity, at_ns)
        });
    }

    fn last(&self) -> OffCycleReport {
        self.reports.last().unwrap().1
    }

    fn writes(&self, index: u16) -> Vec<Option<i32>> {
        let requests = self.sent.iter().filter_map(ReceivedRequest::decode);
        requests
            .filter(|request| request.address.index == index && request.value.is_some())
            .map(|request| request.value)
            .collect()
    }
}

fn of_wish(wish: OffCycleWish, at_ns: u64) -> OffCycleTarget {
    let mut target = OffCycleTarget::default();
    (target.wish, target.at_ns) = (wish, at_ns);
    target
}

fn wanted(position: f64, velocity: f64, at_ns: u64) -> OffCycleTarget {
    let mut target = of_wish(OffCycleWish::Follow, at_ns);
    (target.position, target.velocity) = (position, velocity);
    target
}

#[test]
fn a_drive_is_prepared_before_it_is_enabled_and_told_nothing_while_it_is_observed() {
    let mut bench = Bench::new();
    bench.run(300, |at_ns| of_wish(OffCycleWish::Observe, at_ns));
    assert!(bench.sent.iter().all(|frame| frame.payload().len() <= 4), "only reads");
    assert_eq!(bench.last().state, DriveState::ReadyToSwitchOn);
    bench.enable(700, 0.0);
    let written = bench.sent.iter().filter_map(ReceivedRequest::decode);
    let written: Vec<_> =
        written.filter_map(|request| Some((request.address.index, request.value?))).collect();
    let ramp = (1.5 * 120.0 / 360.0 * 524_288.0) as i32;
    let expected =
        [(0x0100, 0), (0x004E, 2), (0x01FD, 0), (0x01FE, 0), (0x0088, ramp), (0x0089, ramp), (0x0100, 1)];
    assert_eq!(written[..7], expected);
    assert_eq!(bench.last().state, DriveState::OperationEnabled);
    assert_eq!(bench.outstanding.1, 1, "one request at a time");
}

#[test]
fn the_joint_stays_close_to_its_reference_and_reports_come_in_the_time_of_the_budget() {
    let mut bench = Bench::new();
    bench.enable(1_000, 0.0);
    let began = bench.reports.len();
    bench.follow(2_000, 0.0, 0.5);
    let position = bench.bus.observe(NODE).unwrap().position;
    assert!((position - 1.0).abs() < 0.01, "{position}");
    let moving = &bench.reports[began..];
    let longest_ns = moving.windows(2).map(|pair| pair[1].0 - pair[0].0).max().unwrap();
    // Three requests, each with its reply and a look of the follower.
    assert!(longest_ns <= 9 * MS, "{longest_ns}");
    assert!((bench.last().velocity - 0.5).abs() < 0.05, "{:?}", bench.last());
}

#[test]
fn a_drive_stops_in_control_and_is_disabled_when_its_set_points_are_stale() {
    let mut bench = Bench::new();
    bench.enable(1_000, 0.0);
    bench.follow(1_000, 0.0, 0.5);
    let gone_ns = bench.now_ns;
    let mut fastest_without_torque = 0.0_f64;
    for _ in 0..2_000 {
        bench.run(1, |_| wanted(0.5, 0.5, gone_ns));
        let truth = bench.bus.observe(NODE).unwrap();
        if truth.state != DriveState::OperationEnabled {
            fastest_without_torque = fastest_without_torque.max(truth.velocity.abs());
        }
    }
    assert!(fastest_without_torque < 0.01, "{fastest_without_torque}");
    assert_eq!(bench.bus.observe(NODE).unwrap().state, DriveState::SwitchOnDisabled);
    assert_eq!(bench.last().state, DriveState::ReadyToSwitchOn);
    assert_eq!(bench.writes(0x01FE).last(), Some(&Some(0)));
    // It does not go on by itself when its controller is there again.
    bench.follow(1_000, 0.0, 0.0);
    assert_eq!(bench.last().state, DriveState::ReadyToSwitchOn);
    bench.enable(1_000, 0.6);
    assert_eq!(bench.last().state, DriveState::OperationEnabled);
}

#[test]
fn a_drive_whose_set_points_were_stale_while_it_was_enabled_is_enabled_when_they_come_again() {
    // Before, while and after the drive gets torque.
    for before_ms in [20, 200, 1_000] {
        let mut bench = Bench::new();
        bench.enable(before_ms, 0.0);
        let gone_ns = bench.now_ns;
        bench.run(1_000, |_| of_wish(OffCycleWish::Enable, gone_ns));
        assert_eq!(bench.bus.observe(NODE).unwrap().state, DriveState::SwitchOnDisabled, "{before_ms}");
        bench.enable(1_000, 0.0);
        assert_eq!(bench.last().state, DriveState::OperationEnabled, "{before_ms}");
    }
}

#[test]
fn a_drive_that_was_silent_is_stopped_as_soon_as_it_answers_again() {
    let mut bench = Bench::new();
    bench.enable(1_000, 0.0);
    bench.follow(500, 0.0, 0.5);
    bench.bus.inject_defect(NODE, Defect::SilentSdoServer, true).unwrap();
    let reports = bench.reports.len();
    bench.follow(400, 0.25, 0.5);
    assert!(bench.reports.len() <= reports + 1, "what it does not say is not reported");
    bench.bus.inject_defect(NODE, Defect::SilentSdoServer, false).unwrap();
    bench.outstanding = (0, 0);
    bench.follow(1_500, 0.45, 0.5);
    assert_eq!(bench.last().state, DriveState::ReadyToSwitchOn);
    assert!(bench.bus.observe(NODE).unwrap().velocity.abs() < 0.01);
}

#[test]
fn an_error_of_the_drive_is_reported_and_cleared_when_that_is_wanted() {
    let mut bench = Bench::new();
    bench.enable(1_000, 0.0);
    bench.bus.inject_fault(NODE, DriveFault::OverCurrent).unwrap();
    bench.follow(100, 0.0, 0.0);
    assert_eq!((bench.last().state, bench.last().error_code), (DriveState::Fault, 0x2310));
    bench.run(100, |at_ns| of_wish(OffCycleWish::ClearFaults, at_ns));
    bench.run(100, |at_ns| of_wish(OffCycleWish::Stop, at_ns));
    assert_eq!((bench.last().state, bench.last().error_code), (DriveState::ReadyToSwitchOn, 0));
}

#[test]
fn a_drive_that_seems_to_have_an_error_is_disabled_before_that_counts() {
    let mut bench = Bench::new();
    bench.run(100, |at_ns| of_wish(OffCycleWish::Observe, at_ns));
    bench.enable(1_000, 0.0);
    bench.follow(500, 0.0, 0.5);
    assert_eq!(bench.bus.observe(NODE).unwrap().state, DriveState::OperationEnabled);
    // The reply to the question for its error is the late one to another question.
    let asks_for_error = |frame: &Frame| {
        ReceivedRequest::decode(frame).is_some_and(|request| request.address == entries::ERROR_CODE.address)
    };
    let began_ns = bench.now_ns;
    while !bench.sent.last().is_some_and(asks_for_error) {
        bench.follow(1, 0.25, 0.5);
        assert!(bench.now_ns < began_ns + 1000 * MS);
    }
    bench.follower.receive(bench.now_ns, &Reply::Value(0x1234).frame(NODE));
    bench.reports.clear();
    bench.run(200, |at_ns| wanted(0.25, 0.0, at_ns));
    assert_eq!(bench.bus.observe(NODE).unwrap().state, DriveState::SwitchOnDisabled);
    assert_eq!((bench.last().state, bench.last().error_code), (DriveState::Fault, 0x1234));
}

#[test]
fn a_drive_that_is_not_to_be_enabled_is_told_so_again_and_again() {
    let mut bench = Bench::new();
    bench.run(100, |at_ns| of_wish(OffCycleWish::Observe, at_ns));
    bench.enable(1_000, 0.0);
    bench.sent.clear();
    bench.run(1000, |at_ns| of_wish(OffCycleWish::Stop, at_ns));
    let told = bench.writes(0x0100);
    assert!(told.len() > 5 && told.iter().all(|value| *value == Some(0)), "{told:?}");
}

#[test]
fn an_axis_whose_drive_has_just_been_switched_on_is_waited_for() {
    let mut config = config();
    config.axes[0].power_up_ns = 8_000 * MS;
    let mut run = VirtualRun::simulated(&config).unwrap().0;
    assert_eq!(run.run(60_000, |_| ()), Some(Outcome::Finished), "{:?}", run.snapshot().groups()[0]);
    assert!(run.snapshot().at_ns > 8_000 * MS);
}

#[test]
fn the_budget_is_the_most_that_requests_take_of_the_bus() {
    let losses = config().losses().join("\n");
    assert!(
        losses.contains("at most 1000 requests in a second, 22 % of its bus; a report every 9 ms"),
        "{losses}"
    );
    let words = |text: &str| -> Vec<String> {
        Config::parse("turntable.toml", text).unwrap().warnings().iter().map(ToString::to_string).collect()
    };
    let unwatched = words(CONFIGURATION);
    assert!(unwatched.len() == 1 && unwatched[0].contains("no watchdog"), "{unwatched:?}");
    let hasty = CONFIGURATION.replace("10 ms", "1 ms");
    let warnings = words(&hasty);
    assert!(warnings[1].contains("after 5 ms without a report the group stops"), "{warnings:?}");
}

#[test]
fn requests_beside_the_cycle_count_on_their_bus_while_the_axis_is_enabled() {
    let schedules = schedule::analyse(&config());
    let of = |kind| schedules[0].messages.iter().find(|message| message.kind == kind).unwrap();
    let (request, reply) = (of(MessageKind::OwnRequest), of(MessageKind::OwnReply));
    assert_eq!((request.id, reply.id), (0x641, 0x5C1));
    assert!(request.is_sent_while_enabled && reply.is_sent_while_enabled);
    assert!(schedules[0].load_percent > 22.0, "{}", schedules[0].load_percent);
    let kinds = [MessageKind::SdoRequest, MessageKind::Sync, MessageKind::MasterHeartbeat];
    assert!(schedules[0].messages.iter().all(|message| !kinds.contains(&message.kind)), "no CANopen node");
}

/// The words of what is wrong with a configuration.
fn refused(text: &str) -> String {
    format!("{:?}", Config::parse("turntable.toml", text).unwrap_err())
}

#[test]
fn a_node_id_beyond_the_protocol_and_an_identifier_of_a_canopen_node_are_refused() {
    let error = refused(&CONFIGURATION.replace("node = 1", "node = 65"));
    assert!(error.contains("1 to 64, the node IDs of an eRob with its own CAN protocol"), "{error}");
    let beside = |node: u8| {
        let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
        let program = CONFIGURATION.find("[[program").unwrap();
        format!(
            "{}\n[[axis]]\nname = \"other\"\nbus = \"can\"\nnode = {node}\ndrive = \"erob-canopen\"\n{limits}\n",
            &CONFIGURATION[..program]
        )
    };
    // 0x641 and 0x5C1 are the SDO identifiers of node 65.
    let error = refused(&beside(65));
    assert!(error.contains("node 1 both use 5C1"), "{error}");
    Config::parse("turntable.toml", &beside(2)).unwrap();
}

#[test]
fn firmware_that_takes_the_velocity_limit_while_enabled_is_simulated_by_a_key() {
    let with = |value: &str| {
        CONFIGURATION.replace(
            "[axis.limits]",
            &format!("[axis.simulated]\ntakes_velocity_limit_while_enabled = {value}\n[axis.limits]"),
        )
    };
    for (value, takes) in [("true", true), ("false", false)] {
        let mut bench = Bench::of(&Config::parse("turntable.toml", &with(value)).unwrap());
        bench.enable(1_000, 0.0);
        let write = [0x02, 0x04, 0, 0, 0x27, 0x10];
        let request = Frame::of(bench.sent[0].id(), write);
        bench.bus.receive(bench.now_ns + 5 * MS, &mut ReceiveBatch::new());
        bench.bus.send(bench.now_ns + 5 * MS, &[request]);
        let mut batch = ReceiveBatch::new();
        bench.bus.receive(bench.now_ns + 10 * MS, &mut batch);
        let reply = batch.iter().next().unwrap().frame;
        assert_eq!(reply.payload() == [0x3E], takes, "{reply:?}");
    }
    assert!(refused(&with("\"yes\"")).contains("takes_velocity_limit_while_enabled"));
}
