//! Simulated hollow-shaft motors, frame by frame, as their manual says.

use std::f64::consts::TAU;

use takt::config::{Axis, FrictionShape};
use takt::sim::bit_fields::{FieldSimulation, FieldSimulationParameters};
use takt::sim::plant::JointParameters;
use takt::sim::{Defect, DriveFault, Observation, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, DriveState, Frame, Id, ReceiveBatch, Received};
use takt_wire::bit_fields::FieldDevice;

use crate::bit_fields::machine::{HOLLOW, HOLLOW_FD, axis};

const MICROSECOND_NS: u64 = 1_000;
const MILLISECOND_NS: u64 = 1_000_000;
const START: u8 = 0xFC;
const STOP: u8 = 0xFD;
const ZERO: u8 = 0xFE;
const TORQUE: u8 = 0xF9;
const VELOCITY: u8 = 0xFA;
const POSITION: u8 = 0xFB;
const EXTENDED: [u8; 8] = [0; 8];

/// A motor on a bus that the test commands.
struct Bench {
    bus: SimulatedBus,
    now_ns: u64,
    heard: Vec<Received>,
}

impl Bench {
    /// A motor whose joint is its shaft, at this position.
    fn new(keys: &str, position: f64) -> Self {
        let axis: Axis = axis(&format!("{keys}master_id = 0x64\n"));
        let device: &FieldDevice = axis.drive.description().unwrap();
        let motor = FieldSimulation::new(FieldSimulationParameters {
            device: device.clone(),
            motor_id: 1,
            joint: JointParameters {
                inertia: 0.02,
                viscous_friction: 0.02,
                coulomb_friction: 0.02,
                friction_shape: FrictionShape::Constant,
                brake_torque: 0.0,
            },
            initial_position: position,
            peak_torque: 4.0,
            highest_velocity: 100.0,
            shaft_per_joint: 1.0,
            zero_turns: 0.0,
            power_up_ns: 5 * MILLISECOND_NS,
            bit_rates: None,
        });
        let rates = WireBitRates { nominal: 1_000_000, data: Some(5_000_000) };
        let bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(motor)]);
        let mut bench = Self { bus, now_ns: 0, heard: vec![] };
        bench.run_ns(0);
        bench.run_ns(10 * MILLISECOND_NS);
        bench
    }

    fn run_ns(&mut self, duration_ns: u64) {
        self.now_ns += duration_ns;
        let mut batch = ReceiveBatch::new();
        loop {
            self.bus.receive(self.now_ns, &mut batch);
            if batch.is_empty() {
                return;
            }
            self.heard.extend(batch.drain(..));
        }
    }

    fn send(&mut self, frame: Frame) {
        assert_eq!(self.bus.send(self.now_ns, &[frame]), 1);
    }

    /// The reply to a frame, which must be the only one within a millisecond.
    fn ask(&mut self, frame: Frame) -> Vec<u8> {
        self.heard.clear();
        self.send(frame);
        self.run_ns(MILLISECOND_NS);
        assert_eq!(self.heard.len(), 1, "replies to {frame:?}");
        assert_eq!(self.heard[0].frame.id(), Id::base(0x64).unwrap());
        self.heard[0].frame.payload().to_vec()
    }

    fn order(&mut self, last: u8) -> Vec<u8> {
        self.ask(Frame::of(motor(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last]))
    }

    fn set_up(&mut self, payload: [u8; 8]) -> Vec<u8> {
        self.ask(Frame::of(Id::extended(1).unwrap(), payload))
    }

    /// Asks for the same once in each of so many milliseconds.
    fn repeat(&mut self, frame: Frame, milliseconds: usize) {
        (0..milliseconds).for_each(|_| drop(self.ask(frame)));
    }

    fn seen(&mut self) -> Observation {
        self.bus.observe(1).unwrap()
    }
}

fn motor() -> Id {
    Id::base(1).unwrap()
}

/// A packed command in codes.
fn packed(position: u16, velocity: u16, torque: u16) -> Frame {
    let (kp, kd) = (0x800u16, 0x100u16);
    let [a, b] = position.to_be_bytes();
    Frame::of(
        motor(),
        [
            a,
            b,
            (velocity >> 4) as u8,
            (velocity << 4) as u8 | (kp >> 8) as u8,
            kp as u8,
            (kd >> 4) as u8,
            (kd << 4) as u8 | (torque >> 8) as u8,
            torque as u8,
        ],
    )
}

/// A command of CAN FD in codes.
fn flexible(position: i64, velocity: i32, current: i16, mode: u8, run: u8, zero: u8) -> Frame {
    let mut payload = [0; 16];
    payload[..5].copy_from_slice(&position.to_be_bytes()[3..]);
    payload[5..9].copy_from_slice(&velocity.to_be_bytes());
    payload[9..11].copy_from_slice(&current.to_be_bytes());
    payload[11..].copy_from_slice(&[mode, run, 100, 20, zero]);
    Frame::fd(motor(), &payload, false).unwrap()
}

/// Positions from one to another within a second.
fn smoothly(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..=1_000).map(move |step| {
        let share = f64::from(step) / 1_000.0;
        (from + (to - from) * share * share * (3.0 - 2.0 * share)).round()
    })
}

fn position_of(reply: &[u8]) -> u16 {
    u16::from_be_bytes([reply[1], reply[2]])
}

fn long_position_of(reply: &[u8]) -> i32 {
    i32::from_be_bytes([reply[6], reply[7], reply[1], reply[2]])
}

fn flexible_position_of(reply: &[u8]) -> i64 {
    let mut bytes = [0; 8];
    bytes[..5].copy_from_slice(&reply[..5]);
    i64::from_be_bytes(bytes) >> 24
}

#[test]
fn a_motor_replies_500_us_after_the_end_of_a_request_and_hears_nothing_until_then() {
    let mut bench = Bench::new(HOLLOW, 0.5);
    let began_ns = bench.now_ns;
    bench.send(packed(0x8000, 0x800, 0x800));
    bench.run_ns(300 * MICROSECOND_NS);
    bench.send(Frame::of(motor(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, START]));
    bench.run_ns(2 * MILLISECOND_NS);
    assert_eq!(bench.heard.len(), 1, "the second request came too soon");
    let after_ns = bench.heard[0].at_ns - began_ns;
    // The request takes 108 to 132 µs, the reply 88 to 112 µs.
    assert!((690_000..750_000).contains(&after_ns), "{after_ns}");
    assert_eq!(bench.seen().state, DriveState::SwitchOnDisabled);
}

#[test]
fn a_reported_position_stays_at_the_end_of_its_range_beyond_one_turn() {
    for (turns, code) in [(0.5, 0xC000), (0.9999, 0xFFFD), (1.3, 0xFFFF), (-1.7, 0x0000)] {
        let mut bench = Bench::new(HOLLOW, turns * TAU);
        assert_eq!(position_of(&bench.order(STOP)), code, "{turns}");
    }
}

#[test]
fn a_motor_follows_a_position_a_velocity_and_a_torque_by_its_mode() {
    let mut bench = Bench::new(HOLLOW, 0.0);
    // To a quarter of a turn, within 25 rad/s and 1 N·m.
    bench.repeat(packed(0x8000, 0x900, 0xA00), 1);
    bench.order(POSITION);
    bench.order(START);
    for code in smoothly(32_768.0, 40_960.0) {
        bench.repeat(packed(code as u16, 0x900, 0xA00), 1);
    }
    bench.repeat(packed(0xA000, 0x900, 0xA00), 100);
    let seen = bench.seen();
    assert!((seen.position - TAU / 4.0).abs() < 0.01 && seen.velocity.abs() < 0.05, "{seen:?}");
    bench.order(VELOCITY);
    bench.repeat(packed(0x8000, 0x820, 0xA00), 500);
    assert!((bench.seen().velocity - 200.0 * 32.0 / 2048.0).abs() < 0.1, "{:?}", bench.seen());
    bench.order(TORQUE);
    bench.repeat(packed(0x8000, 0x800, 0x700), 1);
    assert!((bench.seen().torque + 0.5).abs() < 1e-9, "{:?}", bench.seen());
    bench.order(STOP);
    assert_eq!((bench.seen().state, bench.seen().torque), (DriveState::SwitchOnDisabled, 0.0));
}

#[test]
fn the_most_that_a_motor_may_use_is_in_the_command_of_a_position() {
    let mut bench = Bench::new(HOLLOW, 0.0);
    bench.repeat(packed(0x8000, 0x800, 0x800), 1);
    bench.order(START);
    bench.repeat(packed(0xA000, 0x800, 0xA00), 300);
    assert!(bench.seen().position.abs() < 1e-6, "no velocity: {:?}", bench.seen());
    bench.repeat(packed(0xA000, 0x900, 0x800), 300);
    assert!(bench.seen().position.abs() < 1e-6, "no torque: {:?}", bench.seen());
}

#[test]
fn a_motor_without_commands_goes_on_with_the_last_one_for_ever() {
    let mut bench = Bench::new(HOLLOW, 0.0);
    bench.order(VELOCITY);
    bench.repeat(packed(0x8000, 0x820, 0xA00), 1);
    bench.order(START);
    bench.run_ns(60_000 * MILLISECOND_NS);
    let seen = bench.seen();
    assert!((seen.velocity - 3.125).abs() < 0.01 && seen.position > 150.0, "{seen:?}");
}

#[test]
fn zero_is_set_only_while_the_motor_is_stopped_and_lost_with_its_power() {
    let mut bench = Bench::new(HOLLOW, 0.7);
    bench.repeat(packed(0x8000, 0x900, 0xA00), 1);
    let before = position_of(&bench.order(STOP));
    bench.order(TORQUE);
    bench.repeat(packed(0x8000, 0x800, 0x800), 1);
    bench.order(START);
    assert_eq!(position_of(&bench.order(ZERO)), before);
    bench.order(STOP);
    assert_eq!(position_of(&bench.order(ZERO)), 0x8000);
    assert_eq!(position_of(&bench.order(STOP)), 0x8000);
    bench.bus.power_cycle(1).unwrap();
    bench.run_ns(10 * MILLISECOND_NS);
    assert_eq!(position_of(&bench.order(STOP)), before);
}

#[test]
fn extended_mode_is_selected_by_a_frame_shown_by_longer_replies_and_lost_with_the_power() {
    let mut bench = Bench::new(&format!("{HOLLOW}extended = true\n"), 0.25 * TAU);
    assert_eq!(bench.order(STOP).len(), 6);
    // Gains are accepted, and change no mode.
    assert_eq!(bench.set_up([0, 1, 0x3F, 0x80, 0, 0, 0, 0]).len(), 6);
    assert_eq!(bench.set_up(EXTENDED).len(), 8);
    assert_eq!(long_position_of(&bench.order(STOP)), 262_144);
    bench.bus.power_cycle(1).unwrap();
    bench.run_ns(10 * MILLISECOND_NS);
    assert_eq!(bench.order(STOP).len(), 6);
}

#[test]
fn the_gain_frames_change_how_a_motor_follows_and_are_lost_with_the_power() {
    // 10 rad/s of 200, under the whole torque: how fast the joint is after 2 ms.
    let speed = |setup: &[[u8; 8]], loses_power: bool| {
        let mut bench = Bench::new(HOLLOW, 0.0);
        setup.iter().for_each(|frame| drop(bench.set_up(*frame)));
        if loses_power {
            bench.bus.power_cycle(1).unwrap();
            bench.run_ns(10 * MILLISECOND_NS);
        }
        bench.order(STOP);
        bench.order(VELOCITY);
        bench.ask(packed(0x8000, 0x800, 0xFFF));
        bench.order(START);
        bench.repeat(packed(0x8000, 0x800 + 0x66, 0xFFF), 2);
        bench.seen().velocity
    };
    let factor = |index: u8, factor: f32| {
        let [a, b, c, d] = factor.to_be_bytes();
        [0, index, a, b, c, d, 0, 0]
    };
    let preset = speed(&[], false);
    assert!(preset > 0.2, "{preset}");
    // 1.0 leaves a gain as it is.
    assert_eq!(speed(&[[0, 1, 0x3F, 0x80, 0, 0, 0, 0]], false), preset);
    let soft = [factor(1, 0.01), factor(2, 0.0)];
    assert!(speed(&soft, false) < 0.5 * preset, "{}", speed(&soft, false));
    assert_eq!(speed(&soft, true), preset);
    // Without a gain of the current loop there is no torque.
    assert!(speed(&[factor(3, 0.0)], false).abs() < 1e-9);
    // No gain can be this: it is left as it was.
    assert_eq!(speed(&[factor(1, -1.0), factor(1, f32::NAN)], false), preset);
}

#[test]
fn a_command_of_extended_mode_is_the_way_from_the_present_position_and_the_reply_wraps_at_2048_turns() {
    let mut bench = Bench::new(&format!("{HOLLOW}extended = true\n"), 2_047.9 * TAU);
    bench.set_up(EXTENDED);
    bench.repeat(packed(0x8000, 0xA00, 0xC00), 1);
    bench.order(START);
    bench.repeat(packed(0x8000, 0xA00, 0xC00), 50);
    assert!((bench.seen().position / TAU - 2_047.9).abs() < 1e-3, "0x8000 moves nothing: {:?}", bench.seen());
    let goal = 2_048.1;
    for step in 0..600 {
        let target = (2_047.9 + 0.0005 * f64::from(step)).min(goal);
        let way = (target - bench.seen().position / TAU) * 32_768.0;
        bench.repeat(packed((32_768.0 + way).round() as u16, 0xA00, 0xC00), 1);
    }
    assert!((bench.seen().position / TAU - goal).abs() < 2e-3, "{:?}", bench.seen());
    let reported = f64::from(long_position_of(&bench.order(STOP))) / 1_048_576.0;
    assert!((reported + 2_047.9).abs() < 2e-3, "{reported}");
}

#[test]
fn a_motor_of_can_fd_is_led_by_the_fields_of_its_command() {
    let mut bench = Bench::new(HOLLOW_FD, 0.0);
    let reply = bench.ask(flexible(0, 0, 0, 2, 0, 0));
    assert_eq!((reply.len(), reply[11], reply[12], reply[15]), (16, 2, 0, 1));
    // 10 rad/s are 10 / 2π · 14 electrical turns a second; 1 A is 1 N·m.
    let (velocity, current) = ((10.0 / TAU * 14.0 / 1000.0 * 8_388_608.0) as i32, 327);
    bench.repeat(flexible(0, velocity, current, 2, 1, 0), 1);
    for position in smoothly(0.0, 524_288.0) {
        bench.repeat(flexible(position as i64, velocity, current, 2, 1, 0), 1);
    }
    bench.repeat(flexible(524_288, velocity, current, 2, 1, 0), 100);
    let reply = bench.ask(flexible(524_288, velocity, current, 2, 1, 0));
    assert_eq!((reply[12], reply[14]), (1, 30));
    assert!((flexible_position_of(&reply) - 524_288).abs() < 1_000, "{}", flexible_position_of(&reply));
    // Zero is not taken while it runs.
    bench.ask(flexible(524_288, velocity, current, 2, 1, 1));
    let reply = bench.ask(flexible(524_288, 0, 0, 2, 0, 0));
    assert!((flexible_position_of(&reply) - 524_288).abs() < 1_000);
    bench.ask(flexible(0, 0, 0, 2, 0, 1));
    let reply = bench.ask(flexible(0, 0, 0, 2, 0, 0));
    assert!(flexible_position_of(&reply).abs() < 100);
}

#[test]
fn a_motor_of_can_fd_shows_an_error_until_it_is_stopped_and_hears_no_classic_command() {
    let mut bench = Bench::new(HOLLOW_FD, 0.0);
    bench.repeat(flexible(0, 100_000, 300, 2, 1, 0), 2);
    bench.bus.inject_fault(1, DriveFault::OverVoltage).unwrap();
    let reply = bench.ask(flexible(0, 100_000, 300, 2, 1, 0));
    assert_eq!((reply[12] >> 4, reply[12] & 0xF), (3, 0));
    assert_eq!(bench.ask(flexible(0, 0, 0, 2, 0, 0))[12], 0);
    bench.heard.clear();
    bench.send(packed(0x8000, 0x800, 0x800));
    bench.run_ns(2 * MILLISECOND_NS);
    assert!(bench.heard.is_empty());
}

#[test]
fn defects_that_a_motor_cannot_have_are_refused() {
    let mut bench = Bench::new(HOLLOW, 0.0);
    let mode = Defect::OperationModeDisplay { mode: 9 };
    for defect in [Defect::StuckBrake, Defect::SilentSdoServer, Defect::Emergency { code: 1 }, mode] {
        assert!(bench.bus.inject_defect(1, defect, true).is_err(), "{defect:?}");
    }
    bench.bus.inject_defect(1, Defect::EncoderJump { distance: 0.5 * TAU }, true).unwrap();
    assert_eq!(position_of(&bench.order(STOP)), 0xC000);
}

#[test]
fn a_short_reply_has_the_next_length_that_its_kind_of_frame_can_have() {
    let request = flexible(0, 0, 0, 2, 0, 0);
    for (keys, command, whole, short) in
        [(HOLLOW, packed(0x8000, 0x800, 0x800), 6, 5), (HOLLOW_FD, request, 16, 12)]
    {
        let mut bench = Bench::new(keys, 0.0);
        let length = bench.ask(command).len();
        bench.bus.inject_defect(1, Defect::ShortFeedback, true).unwrap();
        assert_eq!((length, bench.ask(command).len()), (whole, short));
        bench.bus.inject_defect(1, Defect::ShortFeedback, false).unwrap();
        assert_eq!(bench.ask(command).len(), whole);
    }
}

#[test]
fn a_motor_of_can_fd_may_show_another_mode_than_its_own() {
    let mut bench = Bench::new(HOLLOW_FD, 0.0);
    let request = flexible(0, 0, 0, 2, 0, 0);
    // By the numbers of object 6061: cyclic torque, cyclic velocity, and one that it does not have.
    for (mode, code) in [(10, 0), (9, 1), (1, 0xFF)] {
        bench.bus.inject_defect(1, Defect::OperationModeDisplay { mode }, true).unwrap();
        assert_eq!(bench.ask(request)[11], code);
        bench.bus.inject_defect(1, Defect::OperationModeDisplay { mode }, false).unwrap();
        assert_eq!(bench.ask(request)[11], 2);
    }
}
