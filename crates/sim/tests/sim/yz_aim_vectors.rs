//! The frames of the YZ-AIM manual and those that its rules make: sent to a simulated servo in the state that they were
//! printed for, they get the printed answers. Misprints are taken in their corrected form.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use takt::sim::plant::JointParameters;
use takt::sim::yz_aim::{Gearing, Model, Quirks, YzAimJoint, YzAimParameters};
use takt::sim::{Drive, DriveFault, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, Id, ReceiveBatch};
use takt_wire::canopen::eds::DataTypeCode;

use super::yz_aim::description;

const VECTORS: &str = include_str!("../../../../tests/vectors/yz-aim-vectors.csv");
const DICTIONARY: &str = include_str!("../../../../tests/vectors/yz-aim-objects.csv");

const MILLISECOND_NS: u64 = 1_000_000;
/// An SDO or PDO is answered within this time.
const ANSWER_MS: u64 = 2;
/// A question is repeated for so long until its answer is the printed one.
const PATIENCE_MS: u64 = 5_000;

#[derive(Clone, Debug)]
struct Row {
    id: String,
    is_request: bool,
    frame: Frame,
}

/// Every row, as the frame that goes over the wire.
fn rows() -> Vec<Row> {
    VECTORS.lines().skip(1).map(row).collect()
}

fn row(line: &str) -> Row {
    let (_, wire) = line.split_once("WIRE=").unwrap();
    let (id, data) = wire.trim_end_matches('"').split_once('#').unwrap();
    let digits: Vec<char> = data.chars().collect();
    let bytes =
        digits.chunks(2).map(|pair| u8::from_str_radix(&pair.iter().collect::<String>(), 16).unwrap());
    let frame =
        Frame::data(Id::base(u32::from_str_radix(id, 16).unwrap()).unwrap(), &bytes.collect::<Vec<u8>>());
    Row {
        id: line.split(',').next().unwrap().into(),
        is_request: line.contains(",host->drive,"),
        frame: frame.unwrap(),
    }
}

/// A servo without gear that stands at these counts and has no quirks.
fn servo(node: u8, counts: f64) -> YzAimParameters {
    let gearing = Gearing { ratio: 1.0, travel_per_turn: TAU, is_reversed: false, zero_counts: 0.0 };
    let joint = JointParameters {
        inertia: 2e-4,
        viscous_friction: 1e-3,
        coulomb_friction: 0.01,
        friction_shape: takt::config::FrictionShape::Constant,
        brake_torque: 0.0,
    };
    let (sheet, mut device) = description();
    device.is_silent_if_absent = false;
    YzAimParameters {
        initial_position: counts / 32_768.0 * TAU,
        power_up_ns: 5 * MILLISECOND_NS,
        quirks: Quirks::none(),
        ..YzAimParameters::new((sheet, device), node, Model::Aim57x15C, gearing, joint)
    }
}

struct Conversation {
    bus: SimulatedBus,
    now_ns: u64,
    heard: Vec<Frame>,
    /// The rows that have been gone through.
    passed: Vec<String>,
}

impl Conversation {
    fn with(servos: &[YzAimParameters]) -> Self {
        let mut drives: Vec<Box<dyn Drive>> = vec![];
        for servo in servos {
            drives.push(Box::new(YzAimJoint::new(servo.clone())));
        }
        let rates = WireBitRates { nominal: 1_000_000, data: None };
        let bus = SimulatedBus::with_drives(rates, u64::MAX, drives);
        let mut conversation = Self { bus, now_ns: 0, heard: vec![], passed: vec![] };
        conversation.run_ms(0);
        conversation.run_ms(10);
        conversation
    }

    fn run_ms(&mut self, milliseconds: u64) {
        let mut batch = ReceiveBatch::new();
        self.now_ns += milliseconds * MILLISECOND_NS;
        loop {
            batch.clear();
            self.bus.receive(self.now_ns, &mut batch);
            self.heard.extend(batch.iter().map(|received| received.frame));
            if !batch.is_full() {
                return;
            }
        }
    }

    /// Sends a frame and gathers what comes for a while.
    fn send(&mut self, frame: Frame) {
        self.heard.clear();
        assert_eq!(self.bus.send(self.now_ns, &[frame]), 1);
        self.run_ms(ANSWER_MS);
    }

    fn write(&mut self, node: u8, request: [u8; 8]) {
        self.send(Frame::of(Id::canopen(0x600, node), request));
        assert_eq!(self.heard[0].payload()[..4], [0x60, request[1], request[2], request[3]]);
    }

    fn start(&mut self) {
        self.send(Frame::of(Id::base(0).unwrap(), [1, 0]));
    }

    /// Goes through these rows: an answer comes to the request before it, or to the question that it answers.
    fn go_through(&mut self, rows: &[Row]) {
        let mut request = None;
        for row in rows {
            if row.is_request {
                self.acknowledge(request.replace(row));
            } else {
                let asked = request.take().map_or_else(|| question(&row.frame), |request| request.frame);
                self.ask(asked, row);
            }
            self.passed.push(row.id.clone());
        }
        self.acknowledge(request);
    }

    /// Sends a request whose answer is not printed; SDO is acknowledged all the same.
    fn acknowledge(&mut self, request: Option<&Row>) {
        let Some(Row { id, frame, .. }) = request else { return };
        self.send(*frame);
        if frame.id().value() & 0x780 == 0x600 {
            let [_, low, high, subindex, ..] = *frame.payload() else { panic!("{id}") };
            let answer = self.heard[0].payload();
            let is_read = frame.payload()[0] == 0x40;
            assert_eq!(answer[0] & 0xF0, if is_read { 0x40 } else { 0x60 }, "{id}");
            assert_eq!(answer[1..4], [low, high, subindex], "{id}");
        }
    }

    fn ask(&mut self, frame: Frame, answer: &Row) {
        let is_write = frame.id().value() & 0x780 == 0x600 && frame.payload()[0] != 0x40;
        let deadline_ns = self.now_ns + PATIENCE_MS * MILLISECOND_NS;
        loop {
            self.send(frame);
            if self.heard.contains(&answer.frame) {
                return;
            }
            assert!(!is_write && self.now_ns < deadline_ns, "{}: {:02X?}", answer.id, self.heard);
        }
    }

    /// Waits for a frame that nobody asks for.
    fn wait_for(&mut self, row: &Row) {
        let deadline_ns = self.now_ns + PATIENCE_MS * MILLISECOND_NS;
        while !self.heard.contains(&row.frame) {
            assert!(self.now_ns < deadline_ns, "{}: {:02X?}", row.id, self.heard);
            self.run_ms(10);
        }
        self.heard.clear();
        self.passed.push(row.id.clone());
    }
}

/// The SDO question to an answer that is printed without one.
fn question(answer: &Frame) -> Frame {
    let [_, low, high, subindex, ..] = *answer.payload() else { panic!("{answer:?}") };
    let id = Id::base(answer.id().value() + 0x80).unwrap();
    Frame::of(id, [0x40, low, high, subindex, 0, 0, 0, 0])
}

/// Rows by their first and last name.
fn between(first: &str, last: &str) -> Vec<Row> {
    rows().into_iter().filter(|row| (first..=last).contains(&row.id.as_str())).collect()
}

fn one(id: &str) -> Row {
    between(id, id).remove(0)
}

/// Positioning and velocity by SDO, and homing.
fn sdo_conversations() -> Vec<String> {
    let mut passed = vec![];
    let by_servo = |servo: YzAimParameters, first, last| {
        let mut conversation = Conversation::with(&[servo]);
        conversation.go_through(&between(first, last));
        conversation.passed
    };
    passed.extend(by_servo(servo(1, 195.0), "V001", "V016"));
    passed.extend(by_servo(servo(1, 0.0), "V017", "V032"));
    passed.extend(by_servo(servo(1, 0.0), "V033", "V044"));
    let mut with_switch = servo(1, 0.0);
    with_switch.switches.dir = Some(takt::sim::homing_switches::Switch::below(-3.0));
    passed.extend(by_servo(with_switch, "V046", "V053"));
    passed
}

/// Positioning and velocity by PDO.
fn pdo_conversations() -> Vec<String> {
    let mut passed = vec![];
    for (counts, first, last) in
        [(17_175.0, "V054", "V055"), (17_237.0, "V056", "V063"), (943.0, "V064", "V065")]
    {
        let mut conversation = Conversation::with(&[servo(1, counts)]);
        conversation.start();
        conversation.go_through(&between(first, last));
        passed.extend(conversation.passed);
    }
    // The position is printed in full flight: what a run shows from one start, it shows that much further from another.
    let request = one("V066").frame;
    let answer = one("V067");
    let in_flight = |counts: f64| {
        let mut conversation = Conversation::with(&[servo(1, counts)]);
        conversation.start();
        for _ in 0..500 {
            conversation.send(request);
        }
        *conversation.heard.iter().find(|frame| frame.id() == answer.frame.id()).unwrap()
    };
    let position = |frame: &Frame| i32::from_le_bytes(frame.payload()[..4].try_into().unwrap());
    let shown = position(&in_flight(0.0));
    assert_eq!(in_flight(f64::from(position(&answer.frame) - shown)), answer.frame);
    passed.extend([one("V066").id, answer.id]);
    passed
}

/// Interpolated position of three axes.
fn interpolation_conversations() -> Vec<String> {
    let servos = [(1, 3448.0), (2, 6221.0), (3, 10_600.0)]
        .map(|(node, counts)| YzAimParameters { special_function: 7, ..servo(node, counts) });
    let mut conversation = Conversation::with(&servos);
    conversation.start();
    for node in 1..=3 {
        conversation.write(node, [0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]);
        conversation.write(node, [0x2B, 0x40, 0x60, 0, 0x0F, 0, 0, 0]);
    }
    conversation.go_through(&between("V068", "V074"));
    // All of them act on the target together.
    let before = [3448, 6221, 10_600];
    for (node, before) in (1..).zip(before) {
        assert!(conversation.bus.observe(node).unwrap().position_counts > before);
    }
    conversation.run_ms(1_000);
    for node in 1..=3 {
        assert_eq!(conversation.bus.observe(node).unwrap().position_counts, 50_000);
    }
    conversation.go_through(&between("V045", "V045"));
    // The target of a move without speed is never reached.
    let mut other = Conversation::with(&[servo(2, -1000.0)]);
    other.start();
    other.write(2, [0x23, 0x81, 0x60, 0, 0, 0, 0, 0]);
    other.write(2, [0x2B, 0x40, 0x60, 0, 0x2F, 0, 0, 0]);
    other.write(2, [0x23, 0x7A, 0x60, 0, 0xD0, 0x07, 0, 0]);
    other.go_through(&between("D037", "D038"));
    [conversation.passed, other.passed].concat()
}

/// NMT and heartbeat.
fn network_conversations() -> Vec<String> {
    let mut conversation = Conversation::with(&[servo(1, 0.0)]);
    let (running, alarm, boot_up, pre_operational) = (one("D007"), one("D008"), one("D009"), one("D010"));
    for (request, answer) in [
        ("D001", &running),
        ("D004", &pre_operational),
        ("D002", &running),
        ("D005", &boot_up),
        ("D006", &boot_up),
    ] {
        conversation.go_through(&[one(request)]);
        conversation.wait_for(answer);
    }
    conversation.go_through(&[one("D011"), one("D002")]);
    conversation.wait_for(&alarm);
    conversation.go_through(&[one("D011")]);
    conversation.wait_for(&running);
    conversation.go_through(&[one("D003")]);
    conversation.heard.clear();
    conversation.run_ms(5_000);
    assert!(conversation.heard.is_empty());
    conversation.passed
}

/// Set-up and alarms.
fn set_up_conversations() -> Vec<String> {
    let mut conversation = Conversation::with(&[servo(1, 777.0)]);
    conversation.go_through(&between("D012", "D018"));
    assert!((0..10).contains(&conversation.bus.observe(1).unwrap().position_counts));
    conversation.go_through(&between("D019", "D026"));
    for reset in ["D027", "D028"] {
        conversation.bus.inject_fault(1, DriveFault::Stall).unwrap();
        conversation.run_ms(10);
        assert_eq!(conversation.bus.observe(1).unwrap().error_code, 0x14);
        conversation.go_through(&[one(reset)]);
        assert_eq!(conversation.bus.observe(1).unwrap().error_code, 0);
    }
    conversation.go_through(&between("D029", "D036"));
    conversation.passed
}

#[test]
fn every_row_of_the_vectors_is_taken_and_answered_by_the_simulated_servo() {
    let passed: BTreeSet<String> = [
        sdo_conversations(),
        pdo_conversations(),
        interpolation_conversations(),
        network_conversations(),
        set_up_conversations(),
    ]
    .concat()
    .into_iter()
    .collect();
    let all: BTreeSet<String> = rows().into_iter().map(|row| row.id).collect();
    assert_eq!(all.len(), 112);
    assert_eq!(all.difference(&passed).collect::<Vec<_>>(), Vec::<&String>::new());
}

#[test]
fn the_data_sheet_is_that_of_the_manual() {
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => i128::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    // Where the manual's text goes beyond the range that its table prints.
    let wider = [0x2600, 0x2615, 0x2619, 0x6098];
    let sheet = description().0;
    let lines = DICTIONARY.lines().skip(1);
    assert_eq!(lines.clone().count(), sheet.entries().count());
    for (line, entry) in lines.zip(sheet.entries()) {
        let columns: Vec<&str> = line.split(',').collect();
        let [index, subindex, bits, access, _, _, lowest, highest, default, ..] = columns[..] else {
            panic!("{line}");
        };
        assert_eq!(u16::from_str_radix(index, 16), Ok(entry.address.index), "{line}");
        assert_eq!(u8::from_str_radix(subindex, 16), Ok(entry.address.subindex), "{line}");
        // TPDO3 has 32 bits of the velocity, the table 16.
        let by_sheet = entry.data_type.and_then(DataTypeCode::bits).map(i128::from);
        assert!(number(bits) == by_sheet || entry.address.index == 0x606C, "{line}");
        assert!(access == "unspecified" || (access == "rw") == entry.access.is_writable(), "{line}");
        // The sheet has no range of 1016:1.
        if !wider.contains(&entry.address.index) && entry.address.index != 0x1016 {
            let (low, high) = entry.data_type.and_then(DataTypeCode::range).unwrap();
            for (printed, limit, of_type) in [(lowest, &entry.low, low), (highest, &entry.high, high)] {
                let limit = limit.as_ref().and_then(|limit| limit.number(None)).unwrap_or(of_type);
                assert!(number(printed).is_none_or(|printed| limit == printed), "{line}");
            }
        }
        let value = |node| entry.value().and_then(|value| value.number(Some(node)));
        let from_node = default.strip_prefix("$NODEID+");
        assert_eq!(from_node.is_some(), value(1) != value(2), "{line}");
        let printed = number(from_node.unwrap_or(default));
        assert!(printed.is_none_or(|printed| value(0) == Some(printed)), "{line}");
    }
}
