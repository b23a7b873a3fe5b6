//! Drives on a Modbus line: the motions of the manual on the simulated drive, in virtual time.

use std::num::NonZeroU32;

use takt::internals::family::erob_modbus::commands::{self, CommandFailure};
use takt::internals::family::erob_modbus::drive::{AccessError, AccessFailure, ErobDrive};
use takt::internals::family::erob_modbus::fault_code::FaultCode;
use takt::internals::family::erob_modbus::motion::{
    self, Direction, End, Ended, Motion, MotionFailure, Profile,
};
use takt::internals::family::erob_modbus::registers;
use takt::internals::modbus::exception::ExceptionCode;
use takt::internals::modbus::frame::{ReceivedRequest, Request, SlaveAddress};
use takt::internals::modbus::line_timing::LineTiming;
use takt::internals::modbus::master::{MasterTiming, RequestFailure};
use takt::internals::procedure::{ModbusClient, ModbusSession, Procedure, ProcedureError, ProcedureEvent};
use takt::internals::sim::erob_modbus::{
    ErobModbusDrive, ErobModbusParameters, ModbusDriveFault, SimulatedLine,
};
use takt::internals::sim::serial_line::{DevicesOnLine, LineDisturbance};
use takt::sim::plant::{Encoder, JointParameters};

const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;
const SLAVE: u8 = 2;
const COUNTS_PER_TURN: f64 = 524_288.0;
const LINE: LineTiming = LineTiming::new(115_200);
const PROFILE: Profile = Profile { velocity: 30_000, acceleration: 90_000, deceleration: 90_000 };

fn parameters() -> ErobModbusParameters {
    ErobModbusParameters {
        address: SLAVE,
        bit_rate_code: 4,
        joint: JointParameters {
            inertia: 0.3,
            viscous_friction: 2.0,
            coulomb_friction: 4.0,
            friction_shape: takt::config::FrictionShape::Constant,
            brake_torque: 60.0,
        },
        encoder: Encoder { counts_per_unit: COUNTS_PER_TURN / std::f64::consts::TAU, zero_counts: 0.0 },
        counts_per_turn: COUNTS_PER_TURN,
        initial_position: 0.0,
        peak_torque: 60.0,
        torque_per_ampere: 31.0 / 6.3,
        highest_velocity: 3.0,
        ready_ns: 8 * SECOND,
        reply_ns: 2 * MS,
        has_battery: true,
        has_torque_sensor: false,
    }
}

fn torque(current: i32, velocity_limit: u32) -> Motion {
    Motion::Torque { current, velocity_limit: NonZeroU32::new(velocity_limit).unwrap() }
}

/// A drive on a line, and what went over it.
struct Bench {
    line: SimulatedLine,
    timing: MasterTiming,
    now_ns: u64,
    sent: Vec<Vec<u8>>,
    steps: Vec<&'static str>,
    notes: Vec<String>,
    fastest: f64,
    repeated: u64,
}

type Outcome<T, E> = Result<T, ProcedureError<E>>;

impl Bench {
    fn of(parameters: ErobModbusParameters) -> Self {
        let line = SimulatedLine::new(LINE, vec![ErobModbusDrive::new(parameters)]);
        Self {
            line,
            timing: MasterTiming::new(LINE),
            now_ns: 0,
            sent: vec![],
            steps: vec![],
            notes: vec![],
            fastest: 0.0,
            repeated: 0,
        }
    }

    /// A drive that has been switched on for long enough.
    fn ready() -> Self {
        Self { now_ns: 9 * SECOND, ..Self::of(parameters()) }
    }

    fn drive(&mut self) -> &mut ErobModbusDrive {
        self.line.receive(self.now_ns);
        self.line.module(0).unwrap()
    }

    /// Runs a procedure to its end. `touch` sees the line at every millisecond since its beginning, and says whether to interrupt it.
    fn run<T: Clone, E: Clone, F>(
        &mut self,
        work: impl FnOnce(ErobDrive) -> F,
        mut touch: impl FnMut(&mut SimulatedLine, u64) -> bool,
    ) -> Outcome<T, E>
    where
        F: Future<Output = Result<T, E>> + 'static,
    {
        let slave = SlaveAddress::new(SLAVE).unwrap();
        let session = ModbusSession::new(ModbusClient::new(slave, self.timing));
        let mut procedure = Procedure::new(session.clone(), work(ErobDrive::new(session.clone())));
        let began_ns = self.now_ns;
        self.sent.clear();
        loop {
            let bytes = self.line.receive(self.now_ns);
            procedure.receive(&bytes);
            let mut frames = vec![];
            procedure.poll(self.now_ns, &mut |frame| frames.push(frame));
            for frame in frames {
                self.line.send(self.now_ns, &frame);
                self.sent.push(frame);
            }
            while let Some(event) = procedure.take_event() {
                match event {
                    ProcedureEvent::Step(name) => self.steps.push(name),
                    ProcedureEvent::Note(text) => self.notes.push(text),
                    ProcedureEvent::Progress { .. } => {}
                    ProcedureEvent::Reading(reading) => {
                        self.fastest = self.fastest.max(reading.velocity.abs());
                    }
                }
            }
            if let Some(outcome) = procedure.outcome() {
                self.repeated = session.repeated_requests();
                return outcome.clone();
            }
            let passed_ns = self.now_ns - began_ns;
            assert!(passed_ns < 2 * 3_600 * SECOND, "it does not end: {:?}", self.steps);
            if passed_ns.is_multiple_of(MS) && touch(&mut self.line, passed_ns / MS) {
                procedure.interrupt();
            }
            self.now_ns += MS / 4;
        }
    }

    fn carry_out(&mut self, motion: Motion) -> Outcome<Ended, MotionFailure> {
        self.run(async move |drive| motion::carry_out(&drive, motion).await, |_, _| false)
    }

    fn carry_out_until(&mut self, motion: Motion, end_ms: u64) -> Outcome<Ended, MotionFailure> {
        self.run(async move |drive| motion::carry_out(&drive, motion).await, |_, ms| ms == end_ms)
    }

    /// What was written, in its order: the register and the value.
    fn written(&self) -> Vec<(u16, i64)> {
        let requests = self.sent.iter().filter_map(|frame| ReceivedRequest::decode(frame)?.request.ok());
        requests
            .filter_map(|request| match request {
                Request::Read(_) => None,
                Request::WriteOne { register, value } => Some((register, value.into())),
                Request::WriteSeveral(write) => {
                    let register = registers::find(write.start()).unwrap();
                    Some((write.start(), register.decode(write.values()).unwrap()))
                }
            })
            .collect()
    }

    fn assert_at_rest_and_disabled(&mut self) {
        let drive = self.drive();
        assert!(!drive.is_enabled() && drive.is_braked());
        self.now_ns += SECOND;
        assert_eq!(self.drive().velocity(), 0.0);
    }
}

/// The writes of every motion before its own: the motor is disabled, and the modes are set.
fn beginning(mode: i64) -> Vec<(u16, i64)> {
    vec![(0x00F0, 0), (0x0040, mode), (0x0042, 0)]
}

#[test]
fn an_absolute_move_writes_the_manuals_registers_in_their_order_and_arrives() {
    let mut bench = Bench::ready();
    let ended = bench.carry_out(Motion::To(100_000, PROFILE)).unwrap();
    assert_eq!(ended.end, End::Arrived);
    assert!((ended.position - 100_000).abs() < 60, "{ended:?}");
    let rest = [
        (0x0041, 1),
        (0x0049, 90_000),
        (0x004B, 90_000),
        (0x0047, 30_000),
        (0x0045, 0),
        (0x00F0, 1),
        (0x0043, 100_000),
        (0x00F1, 1),
        (0x00F0, 0),
    ];
    assert_eq!(bench.written(), [beginning(3), rest.to_vec()].concat());
    let fastest = bench.fastest * COUNTS_PER_TURN / std::f64::consts::TAU;
    assert!((29_000.0..31_500.0).contains(&fastest), "{fastest}");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn a_relative_move_goes_on_from_where_the_joint_is_and_leaves_nothing_for_the_next_absolute_one() {
    let mut bench = Bench::ready();
    for (distance, position) in [(50_000, 50_000), (-80_000, -30_000), (0, -30_000)] {
        let ended = bench.carry_out(Motion::By(distance, PROFILE)).unwrap();
        assert_eq!(ended.end, End::Arrived);
        assert!((ended.position - position).abs() < 120, "{distance}: {ended:?}");
        assert_eq!(bench.written().last(), Some(&(0x0045, 0)));
    }
    let ended = bench.carry_out(Motion::To(10_000, PROFILE)).unwrap();
    assert!((ended.position - 10_000).abs() < 60, "{ended:?}");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn motions_without_end_run_until_they_are_interrupted_and_come_to_rest() {
    let motions = [
        (Motion::Continuous(Direction::Forward, PROFILE), 1.0, (0x00F2, 0), (0x0047, 30_000)),
        (Motion::Continuous(Direction::Backward, PROFILE), -1.0, (0x00F2, 0), (0x0047, -30_000)),
        (Motion::Velocity(-30_000, PROFILE), -1.0, (0x0051, 0), (0x0051, -30_000)),
        (torque(1_500, 30_000), 1.0, (0x004F, 0), (0x004F, 1_500)),
    ];
    for (motion, direction, stop, command) in motions {
        let mut bench = Bench::ready();
        let ended = bench.carry_out_until(motion, 3_500).unwrap();
        assert_eq!(ended.end, End::Interrupted);
        let way = direction * f64::from(ended.position);
        assert!((40_000.0..100_000.0).contains(&way), "{motion:?}: {way}");
        let written = bench.written();
        assert!(written.contains(&command), "{motion:?}: {written:?}");
        assert_eq!(written.get(written.len() - 2), Some(&stop), "{motion:?}: {written:?}");
        bench.assert_at_rest_and_disabled();
    }
}

#[test]
fn a_reciprocating_motion_turns_at_its_ends_and_is_ended_at_one_of_them() {
    for interrupted_ms in [8_000, 8_300, 8_600, 9_000, 9_400] {
        let mut bench = Bench::ready();
        let motion = Motion::Reciprocating { target: 20_000, dwell: 4_000, profile: PROFILE };
        let (mut lowest, mut highest, mut turns, mut last) = (0, 0, 0, 0.0);
        let ended: Ended = bench
            .run(
                async move |drive| motion::carry_out(&drive, motion).await,
                |line, ms| {
                    let drive = line.module(0).unwrap();
                    (lowest, highest) = (drive.counts().min(lowest), drive.counts().max(highest));
                    let velocity = drive.velocity();
                    turns += usize::from(velocity * last < 0.0);
                    last = if velocity == 0.0 { last } else { velocity };
                    ms == interrupted_ms
                },
            )
            .unwrap();
        assert_eq!(ended.end, End::Interrupted);
        assert!(turns >= 4, "{turns}");
        assert!(lowest > -300 && (19_700..20_300).contains(&highest), "{lowest} to {highest}");
        let is_at_end = ended.position.abs() < 100 || (ended.position - 20_000).abs() < 100;
        assert!(is_at_end, "{interrupted_ms}: {ended:?}");
        let written = bench.written();
        assert_eq!(written[written.len() - 2..], [(0x00F4, 0), (0x00F0, 0)], "{written:?}");
        assert!(written.contains(&(0x004D, 4_000)), "{written:?}");
        bench.assert_at_rest_and_disabled();
    }
}

#[test]
fn velocity_and_torque_control_are_enabled_with_a_set_point_of_0_and_a_limit() {
    for (motion, register) in [(Motion::Velocity(10_000, PROFILE), 0x0051), (torque(900, 10_000), 0x004F)] {
        let mut bench = Bench::ready();
        bench.carry_out_until(motion, 2_000).unwrap();
        let written = bench.written();
        let at = |wanted| written.iter().position(|write| *write == wanted).unwrap();
        assert!(at((register, 0)) < at((0x00F0, 1)), "{written:?}");
        if register == 0x004F {
            assert!(at((0x00D8, 10_000)) < at((0x00F0, 1)), "{written:?}");
        }
    }
}

#[test]
fn the_wait_of_500_ms_after_enabling_is_kept_and_the_drive_hears_its_master_in_it() {
    let mut bench = Bench::ready();
    let kept: Outcome<(), CommandFailure> =
        bench.run(async |drive| commands::set_communication_timeout(&drive, 200).await, |_, _| false);
    kept.unwrap();
    // The simulated drive ignores a start before that, and shows fault 0x0FA2 after 200 ms of silence.
    let ended = bench.carry_out(Motion::To(50_000, PROFILE)).unwrap();
    assert_eq!(ended.end, End::Arrived);
    assert_eq!(bench.drive().fault(), 0);
}

#[test]
fn a_drive_that_was_just_switched_on_is_waited_for() {
    let mut bench = Bench::of(parameters());
    assert_eq!(bench.carry_out(Motion::By(1_000, PROFILE)).unwrap().end, End::Arrived);
    assert_eq!(bench.notes, ["the drive is busy, as it is for some seconds after power-on"]);
}

#[test]
fn a_silent_master_ends_in_fault_0fa2_which_is_read_and_cleared() {
    let mut bench = Bench::ready();
    let found = bench.run(
        async |drive| {
            commands::set_communication_timeout(&drive, 300).await?;
            drive.write(&registers::MOTOR_ENABLE, 1).await?;
            drive.session().sleep(400 * MS).await;
            commands::clear_fault(&drive).await
        },
        |_, _| false,
    );
    let found: Outcome<_, CommandFailure> = found;
    assert_eq!(found.unwrap(), Some(FaultCode::COMMUNICATION_TIMEOUT));
    let drive = bench.drive();
    assert!(!drive.is_enabled() && drive.fault() == 0);
    // A drive that has never heard a master does not miss it.
    let mut bench = Bench::ready();
    bench.now_ns += 60 * SECOND;
    assert_eq!(bench.drive().fault(), 0);
}

#[test]
fn the_communication_time_out_is_read_back_and_short_ones_are_warned_of() {
    for (milliseconds, note) in [
        (0, Some("the drive goes on when its master is silent")),
        (
            50,
            Some(
                "a delay of the line or of its USB adapter may be longer than 50 ms: 200 ms is the least that is advised",
            ),
        ),
        (500, None),
    ] {
        let mut bench = Bench::ready();
        let set: Outcome<(), CommandFailure> = bench.run(
            async move |drive| commands::set_communication_timeout(&drive, milliseconds).await,
            |_, _| false,
        );
        set.unwrap();
        assert_eq!(bench.written(), [(0x0002, i64::from(milliseconds))]);
        assert_eq!(bench.sent.len(), 2);
        assert_eq!(bench.notes.first().map(String::as_str), note);
    }
    let mut bench = Bench::ready();
    let refused: Outcome<(), CommandFailure> =
        bench.run(async |drive| commands::set_communication_timeout(&drive, 4_001).await, |_, _| false);
    assert!(matches!(
        refused.unwrap_err().failure,
        CommandFailure::Access(AccessError { failure: AccessFailure::Value { .. }, .. })
    ));
    assert!(bench.sent.is_empty());
}

#[test]
fn a_fault_on_the_way_ends_the_motion_with_its_code_and_the_drive_disabled() {
    let mut bench = Bench::ready();
    let outcome: Outcome<Ended, MotionFailure> = bench.run(
        async |drive| motion::carry_out(&drive, Motion::To(500_000, PROFILE)).await,
        |line, ms| {
            if ms == 2_000 {
                line.module(0).unwrap().inject(ModbusDriveFault::Code(0x2310));
            }
            false
        },
    );
    let error = outcome.unwrap_err();
    assert_eq!((error.step, &error.failure), ("move", &MotionFailure::Drive(FaultCode(0x2310))));
    assert!(error.to_string().starts_with("move: fault 0x2310, "), "{error}");
    bench.assert_at_rest_and_disabled();
    // It stays until it is cleared.
    let again = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!((again.step, again.failure), ("read the fault code", MotionFailure::Drive(FaultCode(0x2310))));
    let cleared: Outcome<_, CommandFailure> =
        bench.run(async |drive| commands::clear_fault(&drive).await, |_, _| false);
    assert_eq!(cleared.unwrap(), Some(FaultCode(0x2310)));
    assert_eq!(bench.carry_out(Motion::By(1_000, PROFILE)).unwrap().end, End::Arrived);
}

#[test]
fn a_blocked_joint_is_a_fault_a_motor_without_power_is_told_and_a_silent_drive_is_named() {
    let mut bench = Bench::ready();
    bench.drive().inject(ModbusDriveFault::BlockedJoint(true));
    let blocked = bench.carry_out(Motion::By(100_000, PROFILE)).unwrap_err();
    assert_eq!(blocked.failure, MotionFailure::Drive(FaultCode(0x8611)));

    let mut bench = Bench::ready();
    let off: Outcome<Ended, MotionFailure> = bench.run(
        async |drive| motion::carry_out(&drive, Motion::By(1_000, PROFILE)).await,
        |line, ms| {
            if ms == 400 {
                line.module(0).unwrap().inject(ModbusDriveFault::TorqueOff);
            }
            false
        },
    );
    assert_eq!(off.unwrap_err().failure, MotionFailure::NotEnabled);

    let mut bench = Bench::ready();
    bench.drive().inject(ModbusDriveFault::Silent(true));
    let silent = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!(
        silent.to_string(),
        "read the fault code: fault code (0x0060): slave 2: no reply (check address, bit rate, power, and whether A and \
         B are exchanged)"
    );
}

#[test]
fn a_second_interruption_disables_the_motor_at_once() {
    let mut bench = Bench::ready();
    let slow = Profile { deceleration: 100, ..PROFILE };
    let began_ns = bench.now_ns;
    let ended: Ended = bench
        .run(
            async move |drive| motion::carry_out(&drive, Motion::Continuous(Direction::Forward, slow)).await,
            |_, ms| ms == 3_000 || ms == 3_500,
        )
        .unwrap();
    assert_eq!(ended.end, End::Interrupted);
    assert!(bench.now_ns < began_ns + 5 * SECOND, "300 s by the profile deceleration");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn an_emergency_stop_takes_less_than_50_ms() {
    for (mode, velocity) in [(3, 0x0047), (2, 0x0051)] {
        let mut bench = Bench::ready();
        let (mut told_ms, mut stood_ms) = (None, None);
        let stopped: Outcome<(), AccessError> = bench.run(
            async move |drive| {
                drive.write(&registers::OPERATION_MODE, mode).await?;
                drive.write(&registers::MOTION_MODE, 0).await?;
                drive.write(&registers::PROFILE_ACCELERATION, 400_000).await?;
                drive.write(&registers::MOTOR_ENABLE, 1).await?;
                drive.session().sleep(600 * MS).await;
                drive.write(registers::find(velocity).unwrap(), 30_000).await?;
                if mode == 3 {
                    drive.write(&registers::START_MOTION, 1).await?;
                }
                drive.session().sleep(SECOND).await;
                commands::stop_in_an_emergency(&drive).await?;
                drive.session().sleep(200 * MS).await;
                Ok(())
            },
            |line, ms| {
                let velocity = line.module(0).unwrap().velocity().abs();
                if velocity > 29_000.0 {
                    told_ms = Some(ms);
                } else if velocity < 500.0 && told_ms.is_some() {
                    stood_ms = stood_ms.or(Some(ms));
                }
                false
            },
        );
        stopped.unwrap();
        let took_ms = stood_ms.unwrap() - told_ms.unwrap();
        assert!(took_ms < 50, "mode {mode}: {took_ms} ms");
        assert_eq!(bench.drive().fault(), 0);
    }
}

#[test]
fn saving_takes_three_seconds_and_what_was_not_saved_is_forgotten() {
    let mut bench = Bench::ready();
    for (saves, kept) in [(true, 1_234), (false, 1_234)] {
        let value = if saves { 1_234 } else { 4_321 };
        let began_ns = bench.now_ns;
        let written: Outcome<(), AccessError> = bench.run(
            async move |drive| {
                drive.write(&registers::PROFILE_VELOCITY, value).await?;
                if saves { commands::save(&drive).await } else { Ok(()) }
            },
            |_, _| false,
        );
        written.unwrap();
        assert_eq!(bench.now_ns - began_ns >= 3 * SECOND, saves);
        let now_ns = bench.now_ns;
        bench.drive().power_cycle(now_ns);
        let read: Outcome<i64, AccessError> =
            bench.run(async |drive| drive.read(&registers::PROFILE_VELOCITY).await, |_, _| false);
        assert_eq!(read.unwrap(), kept);
    }
}

#[test]
fn a_new_address_counts_after_saving_and_a_power_cycle() {
    let mut bench = Bench::ready();
    let written: Outcome<(), AccessError> = bench.run(
        async |drive| {
            drive.write(&registers::SLAVE_ADDRESS, 9).await?;
            commands::save(&drive).await
        },
        |_, _| false,
    );
    written.unwrap();
    let fault = |bench: &mut Bench| bench.run(async |drive| drive.fault().await, |_, _| false);
    assert_eq!(fault(&mut bench).unwrap(), None);
    let now_ns = bench.now_ns;
    bench.drive().power_cycle(now_ns);
    let AccessFailure::Request(error) = fault(&mut bench).unwrap_err().failure.failure else { panic!() };
    assert_eq!(error.failure, RequestFailure::NoReply);
}

#[test]
fn resetting_the_encoder_wipes_the_count_of_turns_clears_the_battery_fault_and_says_so() {
    let turned = ErobModbusParameters { initial_position: 3.25 * std::f64::consts::TAU, ..parameters() };
    let mut bench = Bench { now_ns: 9 * SECOND, ..Bench::of(turned) };
    bench.drive().inject(ModbusDriveFault::Battery);
    let stays: Outcome<_, CommandFailure> =
        bench.run(async |drive| commands::clear_fault(&drive).await, |_, _| false);
    assert_eq!(stays.unwrap_err().failure, CommandFailure::FaultStays(FaultCode::MULTI_TURN_BATTERY));
    assert_eq!(bench.drive().counts(), 1_703_936);
    let reset: Outcome<(), AccessError> =
        bench.run(async |drive| commands::reset_encoder(&drive).await, |_, _| false);
    reset.unwrap();
    assert_eq!((bench.drive().counts(), bench.drive().fault()), (131_072, 0));
    assert_eq!(bench.notes, ["the count of turns is wiped: home the joint again before it moves"]);
}

#[test]
fn every_register_can_be_read_and_what_the_model_does_not_have_is_left_out() {
    let mut bench = Bench::ready();
    let values = bench.run(async |drive| commands::read_all(&drive).await, |_, _| false).unwrap();
    assert_eq!(values.len(), 52);
    for (register, value) in values {
        assert_eq!(value.is_none(), *register == registers::TORQUE_SENSOR, "{register}");
    }
}

#[test]
fn the_simulated_drive_refuses_gaps_halves_and_changes_while_enabled() {
    let mut bench = Bench::ready();
    let refusals = bench.run(
        async |drive| {
            use takt::internals::modbus::frame::{RegisterRange, RegisterValues};
            use takt::internals::modbus::master::Repeat;
            let session = drive.session();
            drive.write(&registers::MOTOR_ENABLE, 1).await?;
            let mut refusals = vec![];
            for (start, count) in [(0x0061, 2), (0x006A, 1), (0x00F0, 1), (0x0100, 1)] {
                let read = session.read_registers(RegisterRange::new(start, count).unwrap()).await;
                refusals.push(read.unwrap_err().failure);
            }
            let half = session.write_register(0x0043, 1, Repeat::Allowed).await;
            refusals.push(half.unwrap_err().failure);
            let shown =
                session.write_registers(RegisterValues::new(0x0066, &[1, 2]).unwrap(), Repeat::Allowed);
            refusals.push(shown.await.unwrap_err().failure);
            refusals.push(session.write_register(0x0040, 1, Repeat::Allowed).await.unwrap_err().failure);
            Ok::<_, AccessError>(refusals)
        },
        |_, _| false,
    );
    let codes = [2, 2, 2, 2, 3, 2, 4].map(|code| RequestFailure::Refused(ExceptionCode(code)));
    assert_eq!(refusals.unwrap(), codes);
}

#[test]
fn on_a_noisy_line_a_motion_arrives_or_fails_with_the_motor_off_and_no_wrong_value_is_ever_written() {
    let (mut arrived, mut repeated) = (0, 0);
    for seed in 0..20 {
        let mut bench = Bench::ready();
        // One byte of 500: about every tenth exchange is damaged.
        bench.line.disturb(
            LineDisturbance { wrong_per_million: 1_500, lost_per_million: 500, ..LineDisturbance::default() },
            seed,
        );
        let outcome = bench.carry_out(Motion::To(60_000, PROFILE));
        repeated += bench.repeated;
        match outcome {
            Ok(ended) => {
                assert_eq!(ended.end, End::Arrived, "{seed}");
                assert!((ended.position - 60_000).abs() < 60, "{seed}: {ended:?}");
                arrived += 1;
            }
            Err(error) => assert!(matches!(error.failure, MotionFailure::Access(_)), "{seed}: {error}"),
        }
        assert!((-60..60_060).contains(&bench.drive().counts()), "{seed}");
        bench.assert_at_rest_and_disabled();
    }
    assert!(arrived >= 15, "{arrived} of 20");
    assert!(repeated > 100, "{repeated}");
}

#[test]
fn a_cut_wire_ends_the_motion_and_the_communication_time_out_stops_the_joint() {
    let mut bench = Bench::ready();
    let set: Outcome<(), CommandFailure> =
        bench.run(async |drive| commands::set_communication_timeout(&drive, 500).await, |_, _| false);
    set.unwrap();
    let cut: Outcome<Ended, MotionFailure> = bench.run(
        async |drive| motion::carry_out(&drive, Motion::Continuous(Direction::Forward, PROFILE)).await,
        |line, ms| {
            if ms == 3_000 {
                line.disturb(LineDisturbance { is_cut: true, ..LineDisturbance::default() }, 0);
            }
            false
        },
    );
    let error = cut.unwrap_err();
    let MotionFailure::Access(AccessError { failure: AccessFailure::Request(request), .. }) = error.failure
    else {
        panic!("{error}")
    };
    assert_eq!((error.step, request.failure), ("move", RequestFailure::NoReply));
    assert_eq!(bench.drive().fault(), 0x0FA2);
    bench.assert_at_rest_and_disabled();
}

#[test]
fn an_hour_of_reciprocation_passes_in_seconds_without_a_repeated_request() {
    let mut bench = Bench::ready();
    let motion = Motion::Reciprocating { target: 20_000, dwell: 0, profile: PROFILE };
    let ended: Ended = bench
        .run(async move |drive| motion::carry_out(&drive, motion).await, |_, ms| ms == 3_600_000)
        .unwrap();
    assert_eq!(ended.end, End::Interrupted);
    assert_eq!(bench.repeated, 0);
    assert!(bench.sent.len() > 100_000, "{}", bench.sent.len());
    bench.assert_at_rest_and_disabled();
}

#[test]
fn two_drives_share_a_line() {
    let other = ErobModbusParameters { address: 3, initial_position: 1.0, ..parameters() };
    let mut bench = Bench::ready();
    let drives = [parameters(), other].map(ErobModbusDrive::new).to_vec();
    bench.line = SimulatedLine::new(LINE, drives);
    let ended = bench.carry_out(Motion::To(50_000, PROFILE)).unwrap();
    assert!((ended.position - 50_000).abs() < 60, "{ended:?}");
    assert_eq!(bench.line.module(1).unwrap().counts(), 83_443);
}
