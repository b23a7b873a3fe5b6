//! Drives that speak eRob's own CAN protocol: the motions of the manual on the simulated drive, in virtual time.

use takt::family;
use takt::family::commission::TargetDrive;
use takt::internals::erob_can::client::{RequestClient, RequestError, RequestFailure, RequestTiming};
use takt::internals::erob_can::entries;
use takt::internals::erob_can::error_code::ErrorCode;
use takt::internals::erob_can::frame::{ReceivedRequest, Request};
use takt::internals::family::erob_can::module;
use takt::internals::family::erob_can::motion::{
    self, Direction, End, Ended, Motion, MotionFailure, Profile, Run,
};
use takt::internals::family::erob_can::session::ErobCanSession;
use takt::internals::procedure::{Procedure, ProcedureError, ProcedureEvent};
use takt::internals::sim::erob_can::{ErobCanDrive, ErobCanParameters, ErrorForm};
use takt::sim::plant::{Encoder, JointParameters};
use takt::sim::{Defect, DriveFault, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, DriveState, Frame, ReceiveBatch};

const MS: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MS;
const NODE: u8 = 1;
const COUNTS_PER_TURN: f64 = 524_288.0;
const PROFILE: Profile = Profile { velocity: 30_000, acceleration: 90_000, deceleration: 90_000 };

fn parameters() -> ErobCanParameters {
    ErobCanParameters {
        node: NODE,
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
        reply_ns: MS / 2,
        has_battery: true,
        has_brake: true,
        error_form: ErrorForm::Printed,
        has_free_velocity_limit: false,
    }
}

fn target() -> TargetDrive {
    let family = family::all().into_iter().find(|family| family.word() == "erob-can").unwrap();
    TargetDrive::unconfigured(NODE, family.unconfigured().unwrap()).unwrap()
}

/// A motion without an end of its own lasts until it is interrupted.
async fn carry_out(session: &ErobCanSession, motion: Motion) -> Result<Ended, MotionFailure> {
    let run = Run { motion, duration_ns: None, keeps_enabled: false, target: &target() };
    motion::carry_out(session, run).await
}

/// A drive on a bus, and what went over it.
struct Bench {
    bus: SimulatedBus,
    now_ns: u64,
    sent: Vec<Frame>,
    steps: Vec<&'static str>,
    notes: Vec<String>,
    fastest: f64,
}

type Outcome<T, E> = Result<T, ProcedureError<E>>;

impl Bench {
    fn of(parameters: ErobCanParameters) -> Self {
        let rates = WireBitRates { nominal: 1_000_000, data: None };
        let drive = ErobCanDrive::new(parameters);
        let mut bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive)]);
        bus.send(0, &[]); // the supply is switched on
        let (sent, steps, notes) = (vec![], vec![], vec![]);
        Self { bus, now_ns: 0, sent, steps, notes, fastest: 0.0 }
    }

    /// A drive that has been switched on for long enough.
    fn ready() -> Self {
        Self { now_ns: 9 * SECOND, ..Self::of(parameters()) }
    }

    /// Runs a procedure to its end. `touch` sees the bus at every millisecond since its beginning, and says whether to interrupt it.
    fn run<T: Clone, E: Clone, F>(
        &mut self,
        work: impl FnOnce(ErobCanSession) -> F,
        mut touch: impl FnMut(&mut SimulatedBus, u64) -> bool,
    ) -> Outcome<T, E>
    where
        F: Future<Output = Result<T, E>> + 'static,
    {
        let session = ErobCanSession::new(RequestClient::new(NODE, RequestTiming::default()));
        let mut procedure = Procedure::new(session.clone(), work(session));
        let began_ns = self.now_ns;
        self.sent.clear();
        loop {
            let mut batch = ReceiveBatch::new();
            self.bus.receive(self.now_ns, &mut batch);
            batch.iter().for_each(|received| procedure.receive(&received.frame));
            let mut frames = vec![];
            procedure.poll(self.now_ns, &mut |frame| frames.push(frame));
            self.bus.send(self.now_ns, &frames);
            self.sent.extend(frames);
            while let Some(event) = procedure.take_event() {
                match event {
                    ProcedureEvent::Step(name) => self.steps.push(name),
                    ProcedureEvent::Note(text) => self.notes.push(text),
                    ProcedureEvent::Progress { .. } => {}
                    ProcedureEvent::Reading(reading) => {
                        self.fastest = self.fastest.max(reading.velocity.abs())
                    }
                }
            }
            if let Some(outcome) = procedure.outcome() {
                return outcome.clone();
            }
            let passed_ns = self.now_ns - began_ns;
            assert!(passed_ns < 600 * SECOND, "it does not end: {:?}", self.steps);
            if passed_ns.is_multiple_of(MS) && touch(&mut self.bus, passed_ns / MS) {
                procedure.interrupt();
            }
            self.now_ns += MS / 4;
        }
    }

    fn carry_out(&mut self, motion: Motion) -> Outcome<Ended, MotionFailure> {
        self.run(async move |session| carry_out(&session, motion).await, |_, _| false)
    }

    fn carry_out_until(&mut self, motion: Motion, end_ms: u64) -> Outcome<Ended, MotionFailure> {
        self.run(async move |session| carry_out(&session, motion).await, |_, ms| ms == end_ms)
    }

    /// The requests that were sent.
    fn requests(&self) -> Vec<ReceivedRequest> {
        self.sent.iter().filter_map(ReceivedRequest::decode).collect()
    }

    /// What was written, in its order, without reads.
    fn written(&self) -> Vec<(u16, Option<i32>)> {
        let is_read =
            |index: u16| matches!(index, 0x0002 | 0x0005 | 0x0008 | 0x001F | 0x0020 | 0x004E | 0x0204);
        let requests = self.requests();
        let written =
            requests.iter().filter(|request| request.value.is_some() || !is_read(request.address.index));
        written.map(|request| (request.address.index, request.value)).collect()
    }

    fn assert_at_rest_and_disabled(&mut self) {
        let truth = self.bus.observe(NODE).unwrap();
        assert_eq!((truth.state, truth.is_braked), (DriveState::SwitchOnDisabled, true));
        let mut batch = ReceiveBatch::new();
        self.now_ns += SECOND;
        self.bus.receive(self.now_ns, &mut batch);
        assert_eq!(self.bus.observe(NODE).unwrap().velocity, 0.0);
    }
}

#[test]
fn an_absolute_move_sends_the_manuals_requests_in_their_order_and_arrives() {
    let mut bench = Bench::ready();
    let ended = bench.carry_out(Motion::To(100_000, PROFILE)).unwrap();
    assert_eq!(ended.end, End::Arrived);
    assert!((ended.position - 100_000).abs() < 60, "{ended:?}");
    let expected = [
        (0x0100, Some(0)),
        (0x0088, Some(90_000)),
        (0x0089, Some(90_000)),
        (0x008A, Some(30_000)),
        (0x008D, Some(1)),
        (0x0100, Some(1)),
        (0x0087, Some(0)),
        (0x0086, Some(100_000)),
        (0x0083, None),
        (0x0100, Some(0)),
    ];
    assert_eq!(bench.written(), expected);
    let fastest = bench.fastest * COUNTS_PER_TURN / std::f64::consts::TAU;
    assert!((29_000.0..31_500.0).contains(&fastest), "{fastest}");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn a_relative_move_goes_on_from_where_the_joint_is_in_both_directions() {
    let mut bench = Bench::ready();
    for (distance, position) in [(50_000, 50_000), (-80_000, -30_000), (0, -30_000)] {
        let ended = bench.carry_out(Motion::By(distance, PROFILE)).unwrap();
        assert_eq!(ended.end, End::Arrived);
        assert!((ended.position - position).abs() < 120, "{distance}: {ended:?}");
    }
    bench.assert_at_rest_and_disabled();
}

#[test]
fn motions_without_end_run_until_they_are_interrupted_and_come_to_rest() {
    let motions = [
        (Motion::Continuous(Direction::Forward, PROFILE), 1.0, Some((0x0084, None))),
        (Motion::Continuous(Direction::Backward, PROFILE), -1.0, Some((0x0084, None))),
        (Motion::Velocity(-30_000, PROFILE), -1.0, Some((0x01FE, Some(0)))),
        (Motion::Torque { current: 1_500, velocity_limit: 30_000 }, 1.0, Some((0x01FE, Some(0)))),
    ];
    for (motion, direction, stop) in motions {
        let mut bench = Bench::ready();
        let ended = bench.carry_out_until(motion, 3_000).unwrap();
        assert_eq!(ended.end, End::Interrupted);
        let way = direction * f64::from(ended.position);
        assert!((40_000.0..100_000.0).contains(&way), "{motion:?}: {way}");
        let written = bench.written();
        assert_eq!(written.get(written.len() - 2).copied(), stop, "{motion:?}: {written:?}");
        bench.assert_at_rest_and_disabled();
    }
}

#[test]
fn a_reciprocating_motion_turns_at_its_ends_until_it_is_interrupted() {
    for dwell_ns in [0, 200 * MS] {
        let motion = Motion::ReciprocatingTo { to: 20_000, dwell_ns, profile: PROFILE };
        let mut bench = Bench::ready();
        let (mut lowest, mut highest, mut turns, mut last) = (0, 0, 0, 0.0);
        let ended: Ended = bench
            .run(
                async move |session| carry_out(&session, motion).await,
                |bus, ms| {
                    let truth = bus.observe(NODE).unwrap();
                    (lowest, highest) =
                        (truth.position_counts.min(lowest), truth.position_counts.max(highest));
                    turns += usize::from(truth.velocity * last < 0.0);
                    last = if truth.velocity == 0.0 { last } else { truth.velocity };
                    ms == 10_000
                },
            )
            .unwrap();
        assert_eq!(ended.end, End::Interrupted);
        assert!(turns >= 6, "{turns}");
        assert!(lowest > -300 && (19_700..20_300).contains(&highest), "{lowest} to {highest}");
        bench.assert_at_rest_and_disabled();
    }
}

#[test]
fn velocity_and_torque_control_are_enabled_with_a_set_point_of_0() {
    for motion in [Motion::Velocity(10_000, PROFILE), Motion::Torque { current: 900, velocity_limit: 10_000 }]
    {
        let mut bench = Bench::ready();
        bench.carry_out_until(motion, 2_000).unwrap();
        let written = bench.written();
        let at = |wanted| written.iter().position(|(index, value)| (*index, *value) == wanted).unwrap();
        assert!(at((0x01FE, Some(0))) < at((0x0100, Some(1))), "{written:?}");
    }
}

#[test]
fn the_velocity_limit_of_torque_control_is_written_while_disabled_and_only_if_it_is_another_one() {
    let mut bench = Bench::ready();
    let motion = Motion::Torque { current: 900, velocity_limit: 10_000 };
    for times in [1, 0] {
        bench.carry_out_until(motion, 2_000).unwrap();
        let written = bench.written();
        let limits = written.iter().filter(|(index, _)| *index == 0x0204).count();
        assert_eq!(limits, times, "{written:?}");
        let order = written.iter().position(|written| *written == (0x0204, Some(10_000)));
        let enabled = written.iter().position(|written| *written == (0x0100, Some(1)));
        assert!(order < enabled);
    }
}

#[test]
fn a_drive_that_was_just_switched_on_is_waited_for() {
    let mut bench = Bench::of(parameters());
    assert_eq!(bench.carry_out(Motion::By(1_000, PROFILE)).unwrap().end, End::Arrived);
    assert_eq!(bench.notes[0], "the drive has just been switched on: it can be enabled 8 s after that");
}

#[test]
fn one_request_is_outstanding_at_a_time() {
    let mut bench = Bench::ready();
    // The simulated drive loses a request that comes before its reply to the last one: then this would not arrive.
    let slow = ErobCanParameters { reply_ns: 40 * MS, ..parameters() };
    bench.bus = Bench::of(slow).bus;
    assert_eq!(bench.carry_out(Motion::By(10_000, PROFILE)).unwrap().end, End::Arrived);
}

#[test]
fn a_refused_request_ends_the_motion_with_its_words_and_the_drive_disabled_in_both_forms_of_errors() {
    for error_form in [ErrorForm::Printed, ErrorForm::Observed] {
        let mut bench =
            Bench { now_ns: 9 * SECOND, ..Bench::of(ErobCanParameters { error_form, ..parameters() }) };
        let refused: Outcome<(), RequestError> = bench.run(
            async |session| {
                session.write(&entries::MOTOR_ENABLE, 1).await?;
                session.write(&entries::OPERATING_MODE, 2).await
            },
            |_, _| false,
        );
        let failure = RequestFailure::Refused(Some(ErrorCode::ENABLED));
        let request = Request::Write(entries::OPERATING_MODE.address, 2);
        assert_eq!(refused.unwrap_err().failure, RequestError { request, failure });
    }
}

#[test]
fn a_fault_on_the_way_ends_the_motion_with_the_error_code_and_the_drive_disabled() {
    let mut bench = Bench::ready();
    let outcome: Outcome<Ended, MotionFailure> = bench.run(
        async |session| carry_out(&session, Motion::To(500_000, PROFILE)).await,
        |bus, ms| {
            if ms == 2_000 {
                bus.inject_fault(NODE, DriveFault::OverCurrent).unwrap();
            }
            false
        },
    );
    let error = outcome.unwrap_err();
    assert_eq!((error.step, error.failure), ("move", MotionFailure::Drive { code: 0x2310 }));
    bench.assert_at_rest_and_disabled();
}

#[test]
fn a_blocked_joint_is_a_fault_and_a_silent_drive_is_named() {
    let mut bench = Bench::ready();
    let blocked: Outcome<Ended, MotionFailure> = bench.run(
        async |session| carry_out(&session, Motion::By(100_000, PROFILE)).await,
        |bus, ms| {
            if ms == 1 {
                bus.inject_defect(NODE, Defect::BlockedJoint, true).unwrap();
            }
            false
        },
    );
    assert_eq!(blocked.unwrap_err().failure, MotionFailure::Drive { code: 0x8611 });
    let mut bench = Bench::ready();
    bench.bus.inject_defect(NODE, Defect::SilentSdoServer, true).unwrap();
    let silent = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!(silent.to_string(), "read the error code: reading error code (0x001F): no reply");
}

#[test]
fn a_second_interruption_disables_the_motor_at_once() {
    let mut bench = Bench::ready();
    let slow = Profile { deceleration: 100, ..PROFILE };
    let ended: Ended = bench
        .run(
            async move |session| carry_out(&session, Motion::Continuous(Direction::Forward, slow)).await,
            |_, ms| ms == 3_000 || ms == 3_500,
        )
        .unwrap();
    assert_eq!(ended.end, End::Interrupted);
    assert!(bench.now_ns < 14 * SECOND, "300 s by the profile deceleration");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn a_module_tells_of_itself_saves_in_three_seconds_and_forgets_what_was_not_saved() {
    let mut bench = Bench::ready();
    let information = bench.run(async |session| module::information(&session).await, |_, _| false).unwrap();
    let numbers = information.numbers.unwrap();
    assert_eq!(information.firmware, 520_212_171);
    assert_eq!(numbers.model_number().as_deref(), Ok("eRob80H120I-BM-18CN"));
    assert_eq!(numbers.serial_number().as_deref(), Ok("08000001001"));
    for (saves, kept) in [(true, 1_234), (false, 1_234)] {
        let value = if saves { 1_234 } else { 4_321 };
        let written: Outcome<(), RequestError> = bench.run(
            async move |session| {
                session.write(&entries::PROFILE_VELOCITY, value).await?;
                if saves { module::save(&session).await } else { Ok(()) }
            },
            |_, _| false,
        );
        written.unwrap();
        bench.bus.power_cycle(NODE).unwrap();
        let read = bench.run(async |session| session.read(&entries::PROFILE_VELOCITY).await, |_, _| false);
        assert_eq!(read.unwrap(), kept);
    }
}

#[test]
fn resetting_the_encoder_wipes_the_count_of_turns() {
    let turned = ErobCanParameters { initial_position: 3.25 * std::f64::consts::TAU, ..parameters() };
    let mut bench = Bench { now_ns: 9 * SECOND, ..Bench::of(turned) };
    let position = |bench: &mut Bench| {
        bench.run(async |session| session.read(&entries::ACTUAL_POSITION).await, |_, _| false)
    };
    assert_eq!(position(&mut bench).unwrap(), 1_703_936);
    bench.run(async |session| module::reset_encoder(&session).await, |_, _| false).unwrap();
    assert_eq!(position(&mut bench).unwrap(), 131_072);
}

#[test]
fn firmware_that_takes_the_velocity_limit_while_enabled_is_an_option_of_the_simulation() {
    for has_free_velocity_limit in [false, true] {
        let parameters = ErobCanParameters { has_free_velocity_limit, ..parameters() };
        let mut bench = Bench { now_ns: 9 * SECOND, ..Bench::of(parameters) };
        let written: Outcome<(), RequestError> = bench.run(
            async |session| {
                session.write(&entries::MOTOR_ENABLE, 1).await?;
                session.write(&entries::TORQUE_VELOCITY_LIMIT, 10_000).await
            },
            |_, _| false,
        );
        let refusal = written.err().map(|error| error.failure.failure);
        let expected = RequestFailure::Refused(Some(ErrorCode::ENABLED));
        assert_eq!(refusal, (!has_free_velocity_limit).then_some(expected));
    }
}
