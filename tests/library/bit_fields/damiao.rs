//! Simulated Damiao motors, exchange by exchange, as the maker's register list and the firmware have them.

use takt::sim::SimulatedBus;
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};

use crate::bit_fields::machine::{MIT, one};
use crate::rows::columns;

const VECTORS: &str = include_str!("../../vectors/damiao-vectors.csv");
const AT_ZERO: &str = r#"limits = { position = [-2.5, 2.5], velocity = 2, acceleration = 10, jerk = 200, torque = 3 }
joint = { inertia = 0.03, viscous_friction = 0.05, coulomb_friction = 0.05 }
simulated = { initial_position = 0, peak_torque = 3 }
power_up = "100 ms"
"#;
const MILLISECOND_NS: u64 = 1_000_000;

/// A motor on a bus that the test commands.
pub struct Bench {
    pub bus: SimulatedBus,
    now_ns: u64,
}

impl Bench {
    pub fn new(keys: &str, bus: &str) -> Self {
        let config = one("2 ms", bus, &format!("{keys}{AT_ZERO}"), "to = 0");
        let mut bench = Self { bus: takt::simulated_bus(&config, 0), now_ns: 0 };
        bench.bus.receive(0, &mut ReceiveBatch::new());
        bench.run_ms(1_000);
        bench
    }

    pub fn run_ms(&mut self, milliseconds: u64) -> Vec<Frame> {
        let (mut batch, mut heard) = (ReceiveBatch::new(), vec![]);
        for _ in 0..milliseconds {
            self.now_ns += MILLISECOND_NS;
            self.bus.receive(self.now_ns, &mut batch);
            heard.extend(batch.drain(..).map(|received| received.frame));
        }
        heard
    }

    /// What the motor answers within some milliseconds.
    pub fn ask(&mut self, frame: Frame, milliseconds: u64) -> Vec<Frame> {
        assert_eq!(self.bus.send(self.now_ns, &[frame]), 1);
        self.run_ms(milliseconds)
    }
}

pub fn bytes(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

pub fn frame(id: &str, payload: &str) -> Frame {
    let id = Id::base(u32::from_str_radix(id, 16).unwrap()).unwrap();
    Frame::data(id, &bytes(payload)).unwrap()
}

fn mit() -> String {
    format!("{MIT}description = \"damiao-dm-mit\"\nmaster_id = 0x11\n")
}

#[test]
fn every_exchange_of_the_register_list_and_of_the_firmware_is_answered_so() {
    let mut bench = Bench::new(&mit(), "");
    let mut case = String::new();
    for row in VECTORS.lines().skip(1).map(columns) {
        let [now, meaning, id, payload, reply_id, reply, _] = row.try_into().unwrap();
        if now != case {
            bench = Bench::new(&mit(), "");
            case = now;
        }
        match id.as_str() {
            "wait" => drop(bench.run_ms(payload.parse().unwrap())),
            "power" => {
                bench.bus.power_cycle(1).unwrap();
                bench.run_ms(1_000);
            }
            id => {
                let answers = bench.ask(frame(id, &payload), if payload.contains("AA") { 40 } else { 2 });
                let expected = match reply_id.is_empty() {
                    true => vec![],
                    false => vec![frame(&reply_id, &reply)],
                };
                assert_eq!(answers, expected, "{case}: {meaning}");
            }
        }
    }
}

#[test]
fn frames_that_come_while_a_reply_is_under_way_are_answered_too() {
    let mut bench = Bench::new(&mit(), "");
    let frames = [frame("001", "FF FF FF FF FF FF FF FC"), frame("7FF", "01 00 CC 00 00 00 00 00")];
    assert_eq!(bench.bus.send(bench.now_ns, &frames), 2);
    assert_eq!(bench.run_ms(2).len(), 2);
}

#[test]
fn a_motor_follows_the_commands_of_the_mode_that_its_register_says() {
    let mut bench = Bench::new(&mit(), "");
    let mode = |mode: u8| frame("7FF", &format!("01 00 55 0A {mode:02X} 00 00 00"));
    // Position-velocity: to 0.4 rad with 2 rad/s.
    bench.ask(mode(2), 2);
    bench.ask(frame("001", "FF FF FF FF FF FF FF FC"), 2);
    for _ in 0..500 {
        bench.ask(frame("101", "CD CC CC 3E 00 00 00 40"), 2);
    }
    let seen = bench.bus.observe(1).unwrap();
    assert!((seen.position - 0.4).abs() < 0.02, "{seen:?}");
    // Velocity: 1 rad/s, by a frame of eight bytes.
    bench.ask(mode(3), 2);
    for _ in 0..300 {
        bench.ask(frame("201", "00 00 80 3F 00 00 00 00"), 2);
    }
    let seen = bench.bus.observe(1).unwrap();
    assert!((seen.velocity - 1.0).abs() < 0.05, "{seen:?}");
    // Force-position: to 0 rad with 1 rad/s and a tenth of the current.
    bench.ask(mode(4), 2);
    for _ in 0..1_500 {
        bench.ask(frame("301", "00 00 00 00 64 00 E8 03"), 2);
    }
    let seen = bench.bus.observe(1).unwrap();
    assert!(seen.position.abs() < 0.05, "{seen:?}");
    assert!(seen.torque.abs() < 0.4, "a tenth of 3 N·m: {seen:?}");
}

#[test]
fn a_motor_over_can_fd_takes_classic_frames_and_replies_by_those_of_can_fd_with_bit_rate_switch() {
    let keys = format!("{MIT}description = \"damiao-dm-mit-fd\"\nmaster_id = 0x11\n");
    let mut bench = Bench::new(&keys, "data_bit_rate = \"5 Mbit/s\"");
    let asked = frame("7FF", "01 00 33 23 00 00 00 00");
    let expected = Frame::fd(Id::base(0x11).unwrap(), &bytes("01 00 33 23 09 00 00 00"), true).unwrap();
    assert_eq!(bench.ask(asked, 2), [expected]);
    let asked = Frame::fd(Id::base(0x7FF).unwrap(), &bytes("01 00 33 23 00 00 00 00"), true).unwrap();
    assert_eq!(bench.ask(asked, 2), [expected]);
    let start = Frame::fd(Id::base(1).unwrap(), &bytes("FF FF FF FF FF FF FF FC"), true).unwrap();
    assert_eq!(bench.ask(start, 2)[0].payload()[0], 0x11);
}

#[test]
fn zero_outlives_the_power_of_a_motor() {
    let mut bench = Bench::new(&mit(), "");
    bench.ask(frame("001", "FF FF FF FF FF FF FF FC"), 2);
    // 0.5 rad with 60 N·m/rad and 1.5 N·m·s/rad.
    for _ in 0..500 {
        bench.ask(frame("001", "85 1E 80 01 EB 4C C8 00"), 2);
    }
    let before = bench.bus.observe(1).unwrap().position;
    assert!((before - 0.5).abs() < 0.02, "{before}");
    let zeroed = bench.ask(frame("001", "FF FF FF FF FF FF FF FE"), 2);
    assert_eq!(zeroed[0].payload()[1..3], [0x80, 0x00]);
    // Its target is zero, too: it stays where it is.
    bench.run_ms(200);
    assert!((bench.bus.observe(1).unwrap().position - before).abs() < 0.02);
    bench.bus.power_cycle(1).unwrap();
    bench.run_ms(1_000);
    let status = bench.ask(frame("7FF", "01 00 CC 00 00 00 00 00"), 2);
    let code = u16::from_be_bytes([status[0].payload()[1], status[0].payload()[2]]);
    assert!((i32::from(code) - 0x8000).abs() < 60, "{code:04X}");
}

#[test]
fn old_firmware_is_told_by_the_identifier_of_its_mode() {
    use takt_rt::{LifeCycle, OwnFrames};
    for (more, id) in [("", 0x001), ("old_firmware = true\n", 0x101)] {
        let keys = MIT.replace("kp = 60\nkd = 1.5\n", "");
        let keys = format!("{keys}description = \"damiao-dm-position-velocity\"\nmaster_id = 0x11\n{more}");
        let axis = crate::bit_fields::machine::axis(&keys);
        let compiled = takt::config::bit_fields::compile(axis.drive.description().unwrap(), &axis).unwrap();
        let LifeCycle::ByFrames(OwnFrames { start, stop, zero, clear, .. }) = compiled.life_cycle else {
            panic!("it has frames of their own");
        };
        for frame in [start, stop, zero.unwrap(), clear.unwrap()] {
            assert_eq!(frame.id, Id::base(id).unwrap());
        }
    }
}
