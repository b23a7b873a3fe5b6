//! Fuzzes whoever speaks to an eRob outside of the cycle, on a bus that loses, delays, repeats and corrupts what both of them say.

use std::collections::VecDeque;
use std::sync::OnceLock;

use takt::config::Config;
use takt::family::erob_can::follower::Follower;
use takt::family::{OffCycleDrive, OffCycleTarget, OffCycleWish};
use takt::sim::SimulatedBus;
use takt_rt::{BusPort, DriveState, Frame, ReceiveBatch};
use takt_wire::erob_can::entries;
use takt_wire::erob_can::frame::ReceivedRequest;

use super::input::Input;

const MS: u64 = 1_000_000;
const NODE: u8 = 1;
const TURNTABLE: &str = "name = \"fuzz\"\n[[bus]]\nname = \"can\"\nperiod = \"10 ms\"\n[[axis]]\nname = \"table\"\nbus = \"can\"\n\
    node = 1\ndrive = \"erob-can\"\n[axis.limits]\nposition = [-2, 2]\nvelocity = 1\nacceleration = 2\ntorque = 31\n";
/// The longest storm.
const STORM_MS: usize = 3_000;
/// The time in which a drive is disabled, and stands, when the bus is sound again.
const CALM_MS: usize = 3_000;

/// No set-point is beyond the limit of the velocity, no request leaves before the one before is answered or given up, every report is of
/// numbers, and in the end the drive is without torque and stands.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut bench = Bench::new();
    for _ in 0..STORM_MS {
        if input.is_empty() {
            break;
        }
        bench.step(&mut input);
    }
    let mut calm = Input::new(&[]);
    bench.target = OffCycleTarget::default();
    bench.target.wish = OffCycleWish::Stop;
    for _ in 0..CALM_MS {
        bench.step(&mut calm);
    }
    let truth = bench.bus.observe(NODE).expect("the drive is there");
    assert!(truth.state != DriveState::OperationEnabled, "{truth:?}");
    assert!(truth.velocity.abs() < 0.01, "{truth:?}");
}

struct Bench {
    bus: SimulatedBus,
    follower: Follower,
    now_ns: u64,
    target: OffCycleTarget,
    /// Frames that are late, each with the time at which it arrives: to the drive, and to the follower.
    to_drive: VecDeque<(u64, Frame)>,
    to_follower: VecDeque<(u64, Frame)>,
    highest: f64,
}

fn config() -> &'static Config {
    static CONFIG: OnceLock<Config> = OnceLock::new();
    CONFIG.get_or_init(|| Config::parse("fuzz", TURNTABLE).expect("a valid configuration"))
}

/// What becomes of a frame: nothing, itself, or a few others, each so many milliseconds later.
fn disturbed(frame: Frame, input: &mut Input<'_>, mut arrive: impl FnMut(u64, Frame)) {
    match input.byte() {
        0..160 => arrive(0, frame),
        160..190 => {}
        190..210 => arrive(u64::from(input.byte()), frame),
        210..225 => (0..2).for_each(|_| arrive(0, frame)),
        _ => {
            let mut payload = frame.payload().to_vec();
            if let Some(byte) = payload.get_mut(usize::from(input.byte()) % frame.payload().len().max(1)) {
                *byte ^= input.byte();
            }
            arrive(0, Frame::data(frame.id(), &payload).expect("it is as long as before"));
        }
    }
}

impl Bench {
    fn new() -> Self {
        let axis = config().axes.first().expect("the configuration has an axis");
        let counts = axis.scale().expect("it has units").velocity_from_drive(1).abs();
        Self {
            bus: takt::simulated_bus(config(), 0),
            follower: Follower::new(axis, MS).expect("it has units"),
            now_ns: 0,
            target: OffCycleTarget::default(),
            to_drive: VecDeque::new(),
            to_follower: VecDeque::new(),
            highest: axis.limits.velocity / counts,
        }
    }

    /// One millisecond.
    fn step(&mut self, input: &mut Input<'_>) {
        self.turn(input);
        let mut batch = ReceiveBatch::new();
        self.bus.receive(self.now_ns, &mut batch);
        for received in &batch {
            let queue = &mut self.to_follower;
            disturbed(received.frame, input, |late_ms, frame| {
                queue.push_back((self.now_ns + late_ms * MS, frame))
            });
        }
        for frame in due(&mut self.to_follower, self.now_ns) {
            self.follower.receive(self.now_ns, &frame);
        }
        let mut sent = vec![];
        let report = self.follower.poll(self.now_ns, &self.target, &mut |frame| sent.push(frame));
        if let Some(report) = report {
            let numbers = [report.position, report.velocity, report.torque];
            assert!(numbers.iter().all(|number| number.is_finite()), "{report:?}");
        }
        assert!(sent.len() <= 1, "{sent:?}");
        for frame in sent {
            let request = ReceivedRequest::decode(&frame).expect("it sends requests");
            assert_eq!(request.node, NODE);
            let velocity = request.value.filter(|_| request.address == entries::SET_POINT.address);
            assert!(
                velocity.is_none_or(|velocity| f64::from(velocity).abs() <= self.highest + 1.0),
                "{velocity:?}"
            );
            let queue = &mut self.to_drive;
            disturbed(frame, input, |late_ms, frame| queue.push_back((self.now_ns + late_ms * MS, frame)));
        }
        let frames = due(&mut self.to_drive, self.now_ns);
        self.bus.send(self.now_ns, &frames);
        self.now_ns += MS;
    }

    /// What is wanted of the drive.
    fn turn(&mut self, input: &mut Input<'_>) {
        if input.is_empty() {
            self.target.at_ns = self.now_ns;
            return;
        }
        match input.byte() {
            0 => self.target.wish = OffCycleWish::Stop,
            1 => self.target.wish = OffCycleWish::ClearFaults,
            2..11 => self.target.wish = OffCycleWish::Enable,
            11..20 => self.target.wish = OffCycleWish::Follow,
            20 => (self.target.position, self.target.velocity) = (input.number(), input.number()),
            // The controller is held up.
            21..30 => return,
            _ => {}
        }
        self.target.at_ns = self.now_ns;
    }
}

/// The frames that have arrived by now.
fn due(queue: &mut VecDeque<(u64, Frame)>, now_ns: u64) -> Vec<Frame> {
    let arrived = queue.iter().filter(|(at_ns, _)| *at_ns <= now_ns).map(|(_, frame)| *frame).collect();
    queue.retain(|(at_ns, _)| *at_ns > now_ns);
    arrived
}
