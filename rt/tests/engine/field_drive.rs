//! Drives that are spoken to by bit fields, led through their lives: hollow-shaft motors over CAN FD, and over CAN in both of its modes.

use std::f64::consts::TAU;

use takt_rt::{
    BesideTarget, BitField, BitRange, ByteOrder, CommandValue, DriveState, FieldBits, FieldDrive,
    FieldDriveParameters, FieldFrame, FieldGains, FieldMode, FieldTargets, Frame, FrameFormat, Id, LifeCycle,
    LifeState, LifeWish, LinearScale, ModeCodes, Number, OwnFrame, OwnFrames, PositionReference, ReplyError,
    ReplyValue, RunningMode, SetUpAgain, Setting, StateCodes,
};

const MOTOR: Id = Id::canopen(0, 1);
const MASTER: Id = Id::canopen(0, 0x64);
const COUNTS_PER_TURN: f64 = 1_048_576.0;
const COUNT: f64 = TAU / COUNTS_PER_TURN;
const RUN: LifeWish = LifeWish::Run(FieldMode::Position);
/// The limits for a motor that follows positions.
const VELOCITY: f64 = 10.0;
const TORQUE: f64 = 2.0;

fn field<V>(value: V, bits: FieldBits, number: Number, scale: LinearScale) -> BitField<V> {
    BitField { value, bits, number, scale, codes: None }
}

fn plain<V>(value: V, at: u16) -> BitField<V> {
    field(value, FieldBits::of(at, 8), Number::Unsigned, LinearScale::ONE)
}

fn counts<V>(value: V, bits: FieldBits) -> BitField<V> {
    let scale = LinearScale { codes_per_unit: 1.0 / COUNT, zero_code: 0.0 };
    field(value, bits, Number::Signed, scale)
}

fn flexible() -> FieldDriveParameters {
    let speed = LinearScale { codes_per_unit: 1_000.0, zero_code: 0.0 };
    let command = [
        counts(CommandValue::Position, FieldBits::of(0, 40)),
        field(CommandValue::Velocity, FieldBits::of(40, 32), Number::Signed, speed),
        plain(CommandValue::Mode, 88),
        plain(CommandValue::Run, 96),
        plain(CommandValue::Zero, 120),
    ];
    let reply = [
        counts(ReplyValue::Position, FieldBits::of(0, 40)),
        plain(ReplyValue::Mode, 88),
        plain(ReplyValue::Run, 96),
        field(ReplyValue::Temperature, FieldBits::of(112, 8), Number::Signed, LinearScale::ONE),
        plain(ReplyValue::Sender, 120),
    ];
    let (format, order) = (FrameFormat::FdBitRateSwitch, ByteOrder::BigEndian);
    FieldDriveParameters {
        command: FieldFrame::compile(MOTOR, format, 16, order, &command).unwrap(),
        reply: FieldFrame::compile(MASTER, format, 16, order, &reply).unwrap(),
        life_cycle: LifeCycle::ByFields { modes: ModeCodes { torque: 0, velocity: 1, position: 2 } },
        position_reference: PositionReference::Zero,
        position_span: None,
        set_up_again: None,
        beside_target: BesideTarget::Limits { velocity: VELOCITY, torque: TORQUE },
        gains: FieldGains::default(),
    }
}

fn own(last: u8) -> OwnFrame {
    OwnFrame { id: MOTOR, payload: [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] }
}

/// The packed frames of CAN; in extended mode with a position of 32 bits in the reply, and with increments in the command.
fn packed(is_extended: bool) -> FieldDriveParameters {
    let (turn, velocity) = (LinearScale::centred(16, TAU), LinearScale::centred(12, 20.0));
    let command = [
        field(CommandValue::Position, FieldBits::of(0, 16), Number::Unsigned, turn),
        field(CommandValue::Velocity, FieldBits::of(16, 12), Number::Unsigned, velocity),
    ];
    let (bytes, position) = if is_extended {
        let halves = FieldBits::split(BitRange { at: 48, width: 16 }, BitRange { at: 8, width: 16 });
        (8, counts(ReplyValue::Position, halves))
    } else {
        (6, field(ReplyValue::Position, FieldBits::of(8, 16), Number::Unsigned, turn))
    };
    let reply = [plain(ReplyValue::Sender, 0), position];
    let (format, order) = (FrameFormat::Classic, ByteOrder::BigEndian);
    FieldDriveParameters {
        command: FieldFrame::compile(MOTOR, format, 8, order, &command).unwrap(),
        reply: FieldFrame::compile(MASTER, format, bytes, order, &reply).unwrap(),
        life_cycle: LifeCycle::ByFrames(OwnFrames {
            start: own(0xFC),
            stop: own(0xFD),
            zero: Some(own(0xFE)),
            clear: None,
            torque: Some(own(0xF9)),
            velocity: Some(own(0xFA)),
            position: Some(own(0xFB)),
        }),
        position_reference: if is_extended { PositionReference::Present } else { PositionReference::Zero },
        position_span: is_extended.then_some(4096.0 * TAU),
        set_up_again: None,
        beside_target: BesideTarget::Limits { velocity: VELOCITY, torque: TORQUE },
        gains: FieldGains::default(),
    }
}

/// How a motor is spoken to.
#[derive(Clone, Copy, PartialEq)]
enum Protocol {
    Flexible,
    Normal,
    Extended,
}

/// A motor that goes where it is told at once, and that must never be started anywhere else than where it stands.
struct Motor {
    protocol: Protocol,
    /// Counts since it was switched on.
    position: i64,
    zero: i64,
    runs: bool,
    /// The last command, as a position in counts or as an increment.
    told: Option<i64>,
    velocity_limit: i64,
    zeroed: u32,
}

impl Motor {
    fn new(protocol: Protocol, position: i64) -> Self {
        Self { protocol, position, zero: 0, runs: false, told: None, velocity_limit: 0, zeroed: 0 }
    }

    fn drive(&self) -> Master {
        let by = match self.protocol {
            Protocol::Flexible => flexible(),
            Protocol::Normal => packed(false),
            Protocol::Extended => packed(true),
        };
        Master { by, drive: FieldDrive::default() }
    }

    /// The way that it has still to go.
    fn way(&self) -> i64 {
        let told = self.told.expect("it is started with a command");
        if self.protocol == Protocol::Extended { told } else { told - (self.position - self.zero) }
    }

    fn start(&mut self) {
        // A quantum of the 16-bit position is 32 counts.
        assert!(self.runs || self.way().abs() <= 32, "it would jump by {} counts", self.way());
        self.runs = true;
    }

    fn clear_count(&mut self) {
        assert!(!self.runs, "only while it is stopped");
        self.zero = self.position;
        self.zeroed += 1;
    }

    fn hear(&mut self, frame: &Frame) -> Frame {
        let payload = frame.payload();
        if self.protocol == Protocol::Flexible {
            let high = i64::from_be_bytes(payload[..8].try_into().unwrap());
            self.told = Some(high >> 24);
            self.velocity_limit = i32::from_be_bytes(payload[5..9].try_into().unwrap()).into();
            match payload[12] {
                0 => self.runs = false,
                _ => self.start(),
            }
            if payload[15] == 1 {
                self.clear_count();
            }
        } else {
            match payload {
                [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] => match last {
                    0xFC => self.start(),
                    0xFD => self.runs = false,
                    0xFE => self.clear_count(),
                    0xF9..=0xFB => {}
                    other => panic!("{other:X}"),
                },
                _ => {
                    let code = i64::from(u16::from_be_bytes([payload[0], payload[1]]));
                    self.told = Some((code - 0x8000) * 32);
                    self.velocity_limit =
                        i64::from(u16::from_be_bytes([payload[2], payload[3]]) >> 4) - 0x800;
                }
            }
        }
        let is_own = payload.starts_with(&[0xFF; 7]);
        if self.runs && !is_own && self.velocity_limit > 0 {
            self.position += self.way();
        }
        self.reply()
    }

    fn reply(&self) -> Frame {
        let position = self.position - self.zero;
        match self.protocol {
            Protocol::Flexible => {
                let mut payload = [0; 16];
                payload[..5].copy_from_slice(&position.to_be_bytes()[3..]);
                (payload[11], payload[12], payload[14], payload[15]) = (2, self.runs.into(), 0xE7, 1);
                Frame::fd(MASTER, &payload, false).unwrap()
            }
            Protocol::Normal => {
                let [high, low] = ((position / 32 + 0x8000).clamp(0, 0xFFFF) as u16).to_be_bytes();
                Frame::of(MASTER, [1, high, low, 0x80, 0x08, 0x00])
            }
            Protocol::Extended => {
                let [a, b, c, d] = (position as i32).to_be_bytes();
                Frame::of(MASTER, [1, c, d, 0x80, 0x08, 0x00, a, b])
            }
        }
    }
}

/// A drive with what does not change of it.
struct Master {
    by: FieldDriveParameters,
    drive: FieldDrive,
}

impl Master {
    fn step(&mut self, wish: LifeWish, targets: &FieldTargets) -> Frame {
        self.drive.step(&self.by, wish, targets)
    }

    fn receive(&mut self, reply: &Frame) -> Result<(), ReplyError> {
        self.drive.receive(&self.by, reply)
    }

    fn position(&self) -> Option<f64> {
        self.drive.position(&self.by)
    }

    fn reported(&self, value: ReplyValue) -> Option<f64> {
        self.drive.reported(&self.by, value)
    }

    fn state(&self) -> LifeState {
        self.drive.state()
    }

    fn shown(&self) -> (DriveState, RunningMode) {
        (self.drive.drive_state(&self.by), self.drive.mode(&self.by))
    }
}

fn to(position: f64) -> FieldTargets {
    FieldTargets { position, ..FieldTargets::default() }
}

/// Cycles in which the motor hears everything and is heard.
fn run(drive: &mut Master, motor: &mut Motor, wish: LifeWish, position: f64, cycles: usize) {
    for _ in 0..cycles {
        let reply = motor.hear(&drive.step(wish, &to(position)));
        drive.receive(&reply).unwrap();
    }
}

const PROTOCOLS: [Protocol; 3] = [Protocol::Flexible, Protocol::Normal, Protocol::Extended];

#[test]
fn a_motor_is_started_where_it_stands_follows_its_set_points_and_is_stopped() {
    for protocol in PROTOCOLS {
        let mut motor = Motor::new(protocol, 320_000);
        let mut drive = motor.drive();
        assert!(drive.position().is_none());
        // It stands until it runs, whatever the set-points are.
        while !matches!(drive.state(), LifeState::Running(_)) {
            run(&mut drive, &mut motor, RUN, -3.0, 1);
            assert_eq!(motor.position, 320_000);
        }
        for target in [1.9, 2.0, 0.5, -1.25] {
            run(&mut drive, &mut motor, RUN, target, 2);
            assert!((drive.position().unwrap() - target).abs() <= 32.0 * COUNT, "{target}");
            assert!((motor.position as f64 * COUNT - target).abs() <= 32.0 * COUNT, "{target}");
        }
        run(&mut drive, &mut motor, LifeWish::Stop, 2.0, 10);
        assert_eq!((drive.state(), motor.runs), (LifeState::Stopped, false));
        // Somebody turns it by hand: it is started again where it is then.
        motor.position = -100_000;
        run(&mut drive, &mut motor, RUN, 2.0, 20);
        assert!((motor.position as f64 * COUNT - 2.0).abs() <= 32.0 * COUNT);
    }
}

#[test]
fn the_position_goes_on_where_the_report_of_32_bits_wraps_around() {
    let edge = i64::from(i32::MAX);
    let mut motor = Motor::new(Protocol::Extended, edge - 1_000);
    let mut drive = motor.drive();
    run(&mut drive, &mut motor, RUN, (edge - 1_000) as f64 * COUNT, 20);
    for _ in 0..3 {
        for step in [100_000, 300_000, 200_000, -50_000, -400_000] {
            let target = (edge + step) as f64 * COUNT;
            run(&mut drive, &mut motor, RUN, target, 2);
            assert!((drive.position().unwrap() - target).abs() < 33.0 * COUNT, "{step}");
            assert!((motor.position - edge - step).abs() < 33, "{step}");
        }
    }
}

#[test]
fn a_motor_that_counts_from_where_it_is_is_led_by_the_way_of_each_cycle_while_it_is_not_heard() {
    let mut motor = Motor::new(Protocol::Extended, 0);
    let mut drive = motor.drive();
    run(&mut drive, &mut motor, RUN, 0.5, 20);
    for cycle in 1..=20 {
        let target = 0.5 + 0.01 * f64::from(cycle);
        motor.hear(&drive.step(RUN, &to(target)));
        // A quantum of the increment is 32 counts.
        let most = 32.0 * COUNT * f64::from(cycle + 1);
        assert!((motor.position as f64 * COUNT - target).abs() <= most, "cycle {cycle}: {}", motor.position);
    }
    run(&mut drive, &mut motor, RUN, 0.7, 2);
    assert!((motor.position as f64 * COUNT - 0.7).abs() <= 32.0 * COUNT);
}

#[test]
fn zero_is_set_only_while_the_motor_is_stopped_and_the_count_begins_anew() {
    for protocol in PROTOCOLS {
        let mut motor = Motor::new(protocol, 200_000);
        let mut drive = motor.drive();
        run(&mut drive, &mut motor, RUN, 1.0, 20);
        run(&mut drive, &mut motor, LifeWish::Zero, 1.0, 20);
        assert_eq!((motor.zeroed, drive.state()), (1, LifeState::Told(Setting::Zero)));
        assert!(drive.position().unwrap().abs() < 1e-9);
        run(&mut drive, &mut motor, RUN, 0.25, 20);
        assert!((drive.position().unwrap() - 0.25).abs() <= 32.0 * COUNT);
    }
}

#[test]
fn a_frame_of_another_length_is_no_reply_and_changes_nothing() {
    let mut motor = Motor::new(Protocol::Normal, 0);
    let mut drive = motor.drive();
    run(&mut drive, &mut motor, RUN, 0.0, 20);
    // That of a motor in the other mode.
    let other = Motor::new(Protocol::Extended, 77_777).reply();
    assert_eq!(drive.receive(&other), Err(ReplyError::Length { expected: 6, received: 8 }));
    assert!(drive.position().unwrap().abs() < 1e-9);
}

#[test]
fn the_life_of_a_motor_shows_as_states_of_cia_402() {
    for protocol in PROTOCOLS {
        let mut motor = Motor::new(protocol, 0);
        let mut drive = motor.drive();
        assert_eq!(drive.shown(), (DriveState::QuickStopActive, RunningMode::None), "it may have torque");
        let mut shown = vec![];
        for (wish, cycles) in [(LifeWish::Stop, 9), (RUN, 8), (LifeWish::Stop, 10)] {
            for _ in 0..cycles {
                run(&mut drive, &mut motor, wish, 0.0, 1);
                shown.push(drive.shown().0);
            }
        }
        shown.dedup();
        let up = [DriveState::ReadyToSwitchOn, DriveState::SwitchedOn, DriveState::OperationEnabled];
        let down = [DriveState::QuickStopActive, DriveState::ReadyToSwitchOn];
        assert_eq!(shown, [&[DriveState::QuickStopActive][..], &up, &down].concat());
    }
}

#[test]
fn a_motor_shows_what_its_replies_carry_and_nothing_else() {
    let mut motor = Motor::new(Protocol::Flexible, 0);
    let mut drive = motor.drive();
    assert_eq!(drive.reported(ReplyValue::Temperature), None);
    run(&mut drive, &mut motor, LifeWish::Stop, 0.0, 1);
    let shown =
        [ReplyValue::Temperature, ReplyValue::Sender, ReplyValue::Torque].map(|value| drive.reported(value));
    assert_eq!(shown, [Some(-25.0), Some(1.0), None]);
    // It takes its torque away by itself: it gets no further set-point.
    run(&mut drive, &mut motor, RUN, 1.0, 20);
    motor.runs = false;
    drive.receive(&motor.reply()).unwrap();
    assert_eq!(drive.state(), LifeState::Stopping);
    let frame = drive.step(LifeWish::Stop, &to(2.0));
    assert_eq!(frame.payload()[12], 0);
}

/// The frame that switches a motor to extended mode.
fn extended_mode() -> OwnFrame {
    OwnFrame { id: Id::extended(1).unwrap(), payload: [0; 8] }
}

#[test]
fn a_drive_that_replies_as_before_its_set_up_is_set_up_again_while_it_is_told_to_stop_and_never_while_it_runs()
 {
    let again = SetUpAgain { reply_bytes: 6, frames: [extended_mode()].into_iter().collect() };
    let by = FieldDriveParameters { set_up_again: Some(again), ..packed(true) };
    let short = Frame::data(MASTER, &[1, 0x80, 0, 0, 0, 0]).unwrap();
    let long = Frame::data(MASTER, &[1, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let (mut drive, targets) = (FieldDrive::default(), FieldTargets::default());
    let is_set_up = |frame: &Frame| frame.id().is_extended();
    // It has been switched on just now.
    assert!(!is_set_up(&drive.step(&by, RUN, &targets)));
    assert_eq!(drive.receive(&by, &short), Err(ReplyError::Length { expected: 8, received: 6 }));
    assert!(is_set_up(&drive.step(&by, RUN, &targets)));
    // Once for each short reply: the next frame tells it to stop as before.
    assert!(!is_set_up(&drive.step(&by, RUN, &targets)));
    for _ in 0..40 {
        drive.receive(&by, &long).unwrap();
        drive.step(&by, RUN, &targets);
    }
    assert_eq!(drive.state(), LifeState::Running(FieldMode::Position));
    // It loses its power while it runs.
    for _ in 0..5 {
        drive.receive(&by, &short).unwrap_err();
        assert!(!is_set_up(&drive.step(&by, RUN, &targets)));
    }
    let stopped: Vec<bool> = (0..3).map(|_| is_set_up(&drive.step(&by, LifeWish::Stop, &targets))).collect();
    assert_eq!(stopped.iter().filter(|is_set_up| **is_set_up).count(), 1, "{stopped:?}");
}

#[test]
fn a_reply_of_any_other_length_sets_nothing_up() {
    let again = SetUpAgain { reply_bytes: 6, frames: [extended_mode()].into_iter().collect() };
    let by = FieldDriveParameters { set_up_again: Some(again), ..packed(true) };
    let (mut drive, targets) = (FieldDrive::default(), FieldTargets::default());
    drive.receive(&by, &Frame::data(MASTER, &[1, 0x80]).unwrap()).unwrap_err();
    assert!((0..5).all(|_| !drive.step(&by, LifeWish::Stop, &targets).id().is_extended()));
}

#[test]
fn one_reply_that_shows_an_error_does_not_show_that_a_motor_has_stopped() {
    let fields = [plain(ReplyValue::State, 0), counts(ReplyValue::Position, FieldBits::of(8, 40))];
    let (format, order) = (FrameFormat::Fd, ByteOrder::BigEndian);
    let reply = FieldFrame::compile(MASTER, format, 6, order, &fields).unwrap();
    let by = FieldDriveParameters {
        reply: reply.with_states(StateCodes { stopped: 0, running: 1 }),
        ..flexible()
    };
    let mut master = Master { by, drive: FieldDrive::default() };
    let mut answered = |wish: LifeWish, state: Option<u8>| {
        let command = master.step(wish, &to(0.0));
        let state = state.unwrap_or(command.payload()[12]);
        master.receive(&Frame::fd(MASTER, &[state, 0, 0, 0, 0, 0], false).unwrap()).unwrap();
        master.shown().0
    };
    let shown = (0..20).map(|_| answered(RUN, None)).last();
    assert_eq!(shown, Some(DriveState::OperationEnabled));
    let shown: Vec<DriveState> = (0..9).map(|_| answered(LifeWish::Stop, Some(9))).collect();
    assert_eq!(shown[..7], [DriveState::FaultReactionActive; 7]);
    assert_eq!(shown[8], DriveState::Fault);
}
