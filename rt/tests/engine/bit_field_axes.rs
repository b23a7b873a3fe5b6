//! Axes whose drives are spoken to by bit fields, led by the engine: hollow-shaft motors over CAN FD, and a drive that closes the loop of
//! an impedance itself.

use crate::fixture::{LIMITS, PERIOD_NS, PERIOD_S, axis_in};
use crate::plain_host::{PlainHost, cycle, one_bus, slow_move};
use takt_rt::{
    AxisParameters, BesideTarget, BitField, ByteOrder, CommandValue, ControlLaw, Deadline, DriveState,
    Engine, Exchange, FeedbackSince, FieldBits, FieldDriveParameters, FieldFrame, FieldGains, Frame,
    FrameFormat, Heartbeat, Id, LifeCycle, LinearScale, ModeCodes, Number, OwnFrame, OwnFrames, Phase,
    PositionReference, Received, ReplyValue, Request, SenderByte, StopCause,
};

const MASTER: Id = Id::canopen(0, 0x64);
/// Codes of a radian, of a rad/s and of a N·m: nothing here depends on a finer one.
const FINE: LinearScale = LinearScale { codes_per_unit: 1e5, zero_code: 0.0 };
const TORQUE_LIMIT: f64 = 30.0;

fn field<V>(value: V, at: u16, width: u8, scale: LinearScale) -> BitField<V> {
    let number = if width == 8 { Number::Unsigned } else { Number::Signed };
    BitField { value, bits: FieldBits::of(at, width), number, scale, codes: None }
}

const ONE: LinearScale = LinearScale::ONE;

/// A hollow-shaft motor over CAN FD, as far as its fields go.
fn hollow(motor: u8) -> FieldDriveParameters {
    let command = [
        field(CommandValue::Position, 0, 40, FINE),
        field(CommandValue::Velocity, 40, 32, FINE),
        field(CommandValue::Torque, 72, 16, LinearScale { codes_per_unit: 100.0, zero_code: 0.0 }),
        field(CommandValue::Mode, 88, 8, ONE),
        field(CommandValue::Run, 96, 8, ONE),
    ];
    let reply = [
        field(ReplyValue::Position, 0, 40, FINE),
        field(ReplyValue::Velocity, 40, 32, FINE),
        field(ReplyValue::Mode, 88, 8, ONE),
        field(ReplyValue::Run, 96, 8, ONE),
        field(ReplyValue::Error, 104, 8, ONE),
        field(ReplyValue::Sender, 120, 8, ONE),
    ];
    let (format, order) = (FrameFormat::Fd, ByteOrder::BigEndian);
    let own = Id::canopen(0, motor);
    FieldDriveParameters {
        command: FieldFrame::compile(own, format, 16, order, &command).unwrap(),
        reply: FieldFrame::compile(MASTER, format, 16, order, &reply)
            .unwrap()
            .sent_by(SenderByte::whole(15, motor)),
        life_cycle: LifeCycle::ByFields { modes: ModeCodes { torque: 0, velocity: 1, position: 2 } },
        position_reference: PositionReference::Zero,
        beside_target: BesideTarget::Limits { velocity: LIMITS.velocity, torque: TORQUE_LIMIT },
        gains: FieldGains::default(),
        position_span: None,
        set_up_again: None,
    }
}

/// A drive that closes the loop of an impedance, and is started and stopped by frames of its own.
fn impedance(motor: u8) -> FieldDriveParameters {
    let coarse = LinearScale { codes_per_unit: 10.0, zero_code: 0.0 };
    let command = [
        field(CommandValue::Position, 0, 32, FINE),
        field(CommandValue::Velocity, 32, 32, FINE),
        field(CommandValue::Stiffness, 64, 16, coarse),
        field(CommandValue::Damping, 80, 16, coarse),
        field(CommandValue::Torque, 96, 32, FINE),
    ];
    let reply = [
        field(ReplyValue::Sender, 0, 8, ONE),
        field(ReplyValue::Position, 8, 32, FINE),
        field(ReplyValue::Velocity, 40, 32, FINE),
    ];
    let id = Id::canopen(0, motor);
    let own = |last| OwnFrame { id, payload: [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last] };
    let (format, order) = (FrameFormat::Fd, ByteOrder::BigEndian);
    FieldDriveParameters {
        command: FieldFrame::compile(id, format, 16, order, &command).unwrap(),
        reply: FieldFrame::compile(MASTER, format, 12, order, &reply)
            .unwrap()
            .sent_by(SenderByte::whole(0, motor)),
        life_cycle: LifeCycle::ByFrames(OwnFrames {
            start: own(0xFC),
            stop: own(0xFD),
            zero: None,
            clear: None,
            torque: None,
            velocity: None,
            position: None,
        }),
        position_reference: PositionReference::Zero,
        beside_target: BesideTarget::FeedForward,
        gains: FieldGains::Commanded,
        position_span: None,
        set_up_again: None,
    }
}

fn axis(fields: FieldDriveParameters, law: ControlLaw, node: u8) -> AxisParameters {
    AxisParameters {
        exchange: Exchange::BitFields(fields),
        feedback_since: FeedbackSince::SetPoint,
        stops_by_itself_cycles: None,
        ..axis_in(law, 0, node)
    }
}

fn number(payload: &[u8], at: usize, bytes: usize) -> f64 {
    let value = payload[at..at + bytes].iter().fold(0_i64, |value, byte| value << 8 | i64::from(*byte));
    let unused = 64 - 8 * bytes as u32;
    (value << unused >> unused) as f64
}

/// A motor, its joint, and what it was told last.
#[derive(Clone, Copy, Debug, Default)]
struct Motor {
    position: f64,
    velocity: f64,
    mode: u8,
    runs: bool,
    error: u8,
    /// It has no torque any more, whatever it is told.
    has_cut_out: bool,
    /// Where it was when it got torque, and where it was told to be then.
    started: Option<(f64, f64)>,
    is_silent: bool,
    /// It neither hears nor replies.
    is_deaf: bool,
}

const INERTIA: f64 = 0.3;
/// The load on the joint: N·m.
const LOAD: f64 = 5.0;

impl Motor {
    fn start(&mut self, target: f64) {
        if !self.runs {
            self.started = Some((self.position, target));
        }
        self.runs = !self.has_cut_out;
    }

    /// A motor over CAN FD: it follows positions at once, within its limit of velocity, or velocities.
    fn hear_hollow(&mut self, payload: &[u8]) {
        let (target, velocity) = (number(payload, 0, 5) / 1e5, number(payload, 5, 4) / 1e5);
        self.mode = payload[11];
        match payload[12] {
            0 => self.runs = false,
            _ => self.start(target),
        }
        let limit = velocity.abs() * PERIOD_S;
        let way = match (self.runs, self.mode) {
            (true, 2) => (target - self.position).clamp(-limit, limit),
            (true, 1) => velocity * PERIOD_S,
            _ => 0.0,
        };
        (self.position, self.velocity) = (self.position + way, way / PERIOD_S);
    }

    /// A drive with a spring and a damper, on a joint with a load.
    fn hear_impedance(&mut self, payload: &[u8]) {
        if payload.len() == 8 {
            match payload[7] {
                0xFC => self.runs = true,
                _ => self.runs = false,
            }
            return;
        }
        let (target, speed) = (number(payload, 0, 4) / 1e5, number(payload, 4, 4) / 1e5);
        let (stiffness, damping) = (number(payload, 8, 2) / 10.0, number(payload, 10, 2) / 10.0);
        if self.runs {
            self.started.get_or_insert((self.position, target));
            const STEPS: usize = 10;
            for _ in 0..STEPS {
                let torque = stiffness * (target - self.position)
                    + damping * (speed - self.velocity)
                    + number(payload, 12, 4) / 1e5
                    - LOAD;
                self.velocity += torque / INERTIA * PERIOD_S / STEPS as f64;
                self.position += self.velocity * PERIOD_S / STEPS as f64;
            }
        } else {
            self.velocity = 0.0;
        }
    }

    fn reply(&self, number: u8, is_hollow: bool) -> Frame {
        let (position, velocity) =
            ((self.position * 1e5).round() as i64, (self.velocity * 1e5).round() as i32);
        let mut payload = [0; 16];
        if !is_hollow {
            payload[0] = number;
            payload[1..5].copy_from_slice(&(position as i32).to_be_bytes());
            payload[5..9].copy_from_slice(&velocity.to_be_bytes());
            return Frame::fd(MASTER, &payload[..12], false).unwrap();
        }
        payload[..5].copy_from_slice(&position.to_be_bytes()[3..]);
        payload[5..9].copy_from_slice(&velocity.to_be_bytes());
        (payload[11], payload[12], payload[13], payload[15]) =
            (self.mode, self.runs.into(), self.error, number);
        Frame::fd(MASTER, &payload, false).unwrap()
    }
}

struct Rig {
    engine: Engine<2, 1>,
    host: PlainHost<2>,
    motors: [Motor; 2],
    is_hollow: bool,
    /// True if every cycle misses its deadline.
    is_late: bool,
    slot: u64,
    /// The frames of the last cycle.
    sent: Vec<Frame>,
}

impl Rig {
    fn of(axes: [AxisParameters; 2], is_hollow: bool) -> Self {
        let heartbeat = Heartbeat { node: 127, cycles: 20 };
        let parameters = one_bus(axes, 1, Some(heartbeat), 200);
        let motor = |position| Motor { position, ..Motor::default() };
        Self {
            engine: Engine::new(parameters).unwrap(),
            host: PlainHost::default(),
            motors: [motor(0.7), motor(-0.4)],
            is_hollow,
            is_late: false,
            slot: 0,
            sent: vec![],
        }
    }

    fn hollow() -> Self {
        Self::hollow_in(ControlLaw::Position)
    }

    fn hollow_in(law: ControlLaw) -> Self {
        Self::of([1, 2].map(|motor| axis(hollow(motor), law, motor)), true)
    }

    fn impedance() -> Self {
        let law = ControlLaw::Torque {
            stiffness: 1600.0 * INERTIA,
            damping: 80.0 * INERTIA,
            inertia: INERTIA,
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
        };
        Self::of([1, 2].map(|motor| axis(impedance(motor), law, motor)), false)
    }

    /// A slot: what came back of the last cycle, the cycle, and what the motors make of its frames.
    fn step(&mut self) {
        let now_ns = self.slot * PERIOD_NS;
        for frame in core::mem::take(&mut self.sent) {
            let number = frame.id().value() as u8;
            let motor = &mut self.motors[usize::from(number - 1)];
            if motor.is_deaf {
                continue;
            }
            if self.is_hollow {
                motor.hear_hollow(frame.payload());
            } else {
                motor.hear_impedance(frame.payload());
            }
            if !motor.is_silent {
                let frame = motor.reply(number, self.is_hollow);
                // 500 µs after the request of the cycle before.
                self.engine.receive(0, &Received { frame, at_ns: now_ns - PERIOD_NS / 10 });
            }
        }
        let deadline = if self.is_late { Deadline::Missed } else { Deadline::Met };
        self.sent = cycle(&mut self.engine, &mut self.host, self.slot, deadline).to_vec();
        self.slot += 1;
    }

    fn run(&mut self, cycles: usize) {
        (0..cycles).for_each(|_| self.step());
    }

    fn run_until(&mut self, phase: Phase) {
        for _ in 0..5_000 {
            if self.host.phase == phase {
                return;
            }
            self.step();
        }
        panic!("{phase:?} is not reached: {:?}, {:?}, {:?}", self.host.phase, self.motors, self.host.stops);
    }

    fn enable(mut self) -> Self {
        self.slot = 1;
        self.host.requests.push_back(Request::Activate);
        self.run(20);
        self.host.requests.push_back(Request::Enable);
        self.run_until(Phase::Holding);
        self
    }

    fn move_to(&mut self, target: [f64; 2]) {
        self.host.requests.push_back(Request::Move(slow_move(target, 1.0)));
        self.run(2);
        self.run_until(Phase::Holding);
    }

    fn states(&self) -> [DriveState; 2] {
        self.host.axes.map(|axis| axis.drive_state)
    }
}

#[test]
fn motors_with_one_reply_identifier_are_enabled_where_they_stand_moved_and_disabled() {
    for law in [ControlLaw::Position, ControlLaw::Velocity { position_gain: 20.0 }] {
        enabled_moved_and_disabled(law);
    }
}

fn enabled_moved_and_disabled(law: ControlLaw) {
    let mut rig = Rig::hollow_in(law).enable();
    for (motor, place) in rig.motors.iter().zip([0.7, -0.4]) {
        let (at, target) = motor.started.unwrap();
        assert!((at - place).abs() < 1e-4 && (target - at).abs() < 1e-4, "{motor:?}");
    }
    rig.move_to([1.5, -1.0]);
    rig.run(20);
    assert!((rig.motors[0].position - 1.5).abs() < 1e-3 && (rig.motors[1].position + 1.0).abs() < 1e-3);
    assert_eq!(rig.states(), [DriveState::OperationEnabled; 2]);
    rig.host.requests.push_back(Request::Disable);
    rig.run(2);
    rig.run_until(Phase::Disabled);
    rig.run(10);
    assert_eq!(rig.motors.map(|motor| motor.runs), [false; 2]);
    assert_eq!(rig.states(), [DriveState::ReadyToSwitchOn; 2]);
    assert!(rig.host.stops.iter().all(|stop| stop.cause == StopCause::Requested), "{:?}", rig.host.stops);
}

#[test]
fn each_motor_gets_exactly_one_frame_a_cycle_from_activation_on() {
    let mut rig = Rig::hollow();
    rig.slot = 1;
    rig.run(20);
    assert_eq!(rig.sent, [], "nothing is sent before");
    rig.host.requests.extend([Request::Activate]);
    rig.run(2);
    for cycle in 0..500 {
        if cycle == 30 {
            rig.host.requests.push_back(Request::Enable);
        }
        rig.step();
        let ids: Vec<u32> = rig.sent.iter().map(|frame| frame.id().value()).collect();
        assert_eq!(ids, [1, 2], "cycle {cycle}");
    }
    assert_eq!(rig.host.phase, Phase::Holding);
}

#[test]
fn a_motor_that_falls_silent_stops_the_group_with_one_reason_and_both_are_told_to_stop() {
    let mut rig = Rig::hollow().enable();
    rig.host.requests.push_back(Request::Move(slow_move([2.0, -2.0], 1.0)));
    rig.run(300);
    rig.motors[1].is_silent = true;
    rig.run_until(Phase::Disabled);
    assert_eq!(rig.host.stops.len(), 1, "{:?}", rig.host.stops);
    rig.run(20);
    assert_eq!(rig.motors.map(|motor| motor.runs), [false; 2]);
    assert!(rig.host.axes[1].feedback_age > 3);
}

#[test]
fn a_motor_without_a_watchdog_that_does_not_reply_is_told_to_stop_for_seconds_before_it_is_given_up() {
    let mut rig = Rig::hollow().enable();
    rig.motors[0].is_deaf = true;
    rig.run_until(Phase::Disabling);
    assert_eq!(rig.host.stops.len(), 1, "{:?}", rig.host.stops);
    // Longer than any heartbeat is waited for.
    rig.run(150);
    assert_eq!((rig.host.phase, rig.motors[0].runs), (Phase::Disabling, true));
    rig.motors[0].is_deaf = false;
    rig.run(20);
    assert_eq!((rig.host.phase, rig.motors.map(|motor| motor.runs)), (Phase::Disabled, [false; 2]));
}

#[test]
fn a_motor_whose_reply_to_its_start_is_lost_is_told_to_stop_before_its_group_counts_as_disabled() {
    for is_hollow in [true, false] {
        let mut rig = if is_hollow { Rig::hollow() } else { Rig::impedance() };
        rig.slot = 1;
        rig.host.requests.push_back(Request::Activate);
        rig.run(20);
        rig.host.requests.push_back(Request::Enable);
        let is_start = |frame: &Frame| match is_hollow {
            true => frame.payload()[12] == 1,
            false => frame.payload().len() == 8 && frame.payload()[7] == 0xFC,
        };
        let started = (0..500).find(|_| {
            rig.step();
            rig.sent.iter().any(is_start)
        });
        assert!(started.is_some());
        rig.motors.iter_mut().for_each(|motor| motor.is_silent = true);
        rig.step();
        assert_eq!(rig.motors.map(|motor| motor.runs), [true; 2]);
        rig.motors.iter_mut().for_each(|motor| motor.is_deaf = true);
        rig.host.requests.push_back(Request::Disable);
        rig.run(60);
        assert_eq!(rig.host.phase, Phase::Disabling);
        rig.motors.iter_mut().for_each(|motor| (motor.is_silent, motor.is_deaf) = (false, false));
        rig.run(30);
        assert_eq!((rig.host.phase, rig.motors.map(|motor| motor.runs)), (Phase::Disabled, [false; 2]));
    }
}

#[test]
fn a_motor_that_is_sent_nothing_because_the_controller_is_late_has_missed_no_reply() {
    for is_hollow in [true, false] {
        let mut rig = if is_hollow { Rig::hollow() } else { Rig::impedance() }.enable();
        rig.run(10);
        rig.is_late = true;
        rig.run(30);
        assert_eq!((rig.host.phase, rig.host.stops.clone()), (Phase::Holding, vec![]));
        rig.is_late = false;
        rig.run(30);
        assert_eq!((rig.host.phase, rig.host.stops.clone()), (Phase::Holding, vec![]));
        assert_eq!(rig.motors.map(|motor| motor.runs), [true; 2]);
        assert_eq!(rig.host.axes.map(|axis| axis.feedback_age), [0; 2]);
    }
}

#[test]
fn motors_are_told_to_stop_by_a_controller_that_is_always_late() {
    for is_hollow in [true, false] {
        let mut rig = if is_hollow { Rig::hollow() } else { Rig::impedance() }.enable();
        rig.run(10);
        assert_eq!(rig.motors.map(|motor| motor.runs), [true; 2]);
        rig.is_late = true;
        rig.run(1_500);
        assert_eq!((rig.motors.map(|motor| motor.runs), rig.host.stops.len()), ([false; 2], 1));
        assert_eq!(rig.host.phase, Phase::Disabled);
    }
}

#[test]
fn a_motor_that_takes_its_torque_away_or_shows_an_error_stops_the_group() {
    let faults: [fn(&mut Motor); 2] = [|motor| motor.has_cut_out = true, |motor| motor.error = 3];
    for fault in faults {
        let mut rig = Rig::hollow().enable();
        fault(&mut rig.motors[0]);
        rig.run_until(Phase::Disabled);
        rig.run(20);
        assert_eq!((rig.host.phase, rig.host.stops.len()), (Phase::Disabled, 1), "{:?}", rig.host.stops);
        let shown = rig.host.axes[0];
        assert_eq!(shown.error_code, rig.motors[0].error.into());
        assert_eq!(shown.drive_state.is_faulted(), rig.motors[0].error != 0);
        assert_eq!(rig.motors.map(|motor| motor.runs), [false; 2]);
    }
}

#[test]
fn a_drive_that_closes_the_loop_of_an_impedance_holds_its_load_as_one_whose_loop_is_closed_here() {
    let mut rig = Rig::impedance().enable();
    rig.run(2);
    for motor in &rig.motors {
        let (at, target) = motor.started.unwrap();
        assert!((target - at).abs() < 1e-4, "{motor:?}");
    }
    rig.run(2_000);
    // The spring of the law gives way by what the load asks of it.
    let sag = LOAD / (1600.0 * INERTIA);
    for (motor, start) in rig.motors.iter().zip([0.7, -0.4]) {
        assert!((start - motor.position - sag).abs() < 2e-3, "{motor:?}");
    }
    rig.move_to([1.2, 0.3]);
    rig.run(1_000);
    assert!((rig.motors[0].position - 1.2 + sag).abs() < 2e-3, "{:?}", rig.motors);
    assert_eq!(rig.host.stops, []);
    // What the drive makes is shown as what is commanded, as far as feedback tells.
    assert!((rig.host.axes[0].torque_set - LOAD).abs() < 0.2, "{}", rig.host.axes[0].torque_set);
}
