//! What the vendor's own CAN protocol adds.

use takt::family::erob::motion::Motion;
use takt::family::erob::procedure::End;
use takt::family::erob_can::module;
use takt::family::erob_can::session::ErobCanSession;
use takt::sim::commanded_module::ModuleParameters;
use takt::sim::erob_can::{ErobCanDrive, ErobCanParameters, ErrorForm};
use takt::sim::{Defect, DriveFault, Observation, SimulatedBus, WireBitRates};
use takt_rt::{BusPort, Frame, ReceiveBatch};
use takt_wire::erob_can::client::{RequestClient, RequestError, RequestFailure, RequestTiming};
use takt_wire::erob_can::entries;
use takt_wire::erob_can::error_code::ErrorCode;
use takt_wire::erob_can::frame::{ReceivedRequest, Request};
use takt_wire::erob_can::parameter::Access;

use super::bench::{self, Bench, COUNTS_PER_TURN, MS, Outcome, PROFILE, SECOND, Wire};

const NODE: u8 = 1;

/// A bus with a module.
pub struct Own {
    bus: SimulatedBus,
}

impl Own {
    fn with(parameters: ErobCanParameters) -> Self {
        let rates = WireBitRates { nominal: 1_000_000, data: None };
        let drive = ErobCanDrive::new(parameters);
        let mut bus = SimulatedBus::with_drives(rates, u64::MAX, vec![Box::new(drive)]);
        bus.send(0, &[]); // the supply is switched on
        Self { bus }
    }
}

fn parameters() -> ErobCanParameters {
    ErobCanParameters {
        node: NODE,
        module: bench::module(),
        reply_ns: MS / 2,
        has_brake: true,
        error_form: ErrorForm::Printed,
        has_free_velocity_limit: false,
    }
}

/// A module that has been switched on for long enough.
fn ready(parameters: ErobCanParameters) -> Bench<Own> {
    Bench { wire: Own::with(parameters), ..Bench::ready() }
}

impl Wire for Own {
    const FAMILY: &'static str = "erob-can";
    type Drive = ErobCanSession;
    type Client = RequestClient;
    type Error = RequestError;

    fn new(module: ModuleParameters) -> Self {
        Self::with(ErobCanParameters { module, ..parameters() })
    }

    fn drive(&mut self) -> ErobCanSession {
        ErobCanSession::new(RequestClient::new(NODE, RequestTiming::default()))
    }

    fn send(&mut self, now_ns: u64, frames: &[Frame]) {
        self.bus.send(now_ns, frames);
    }

    fn receive(&mut self, now_ns: u64) -> Vec<Frame> {
        let mut batch = ReceiveBatch::new();
        self.bus.receive(now_ns, &mut batch);
        batch.iter().map(|received| received.frame).collect()
    }

    fn observe(&mut self, now_ns: u64) -> Observation {
        self.bus.receive(now_ns, &mut ReceiveBatch::new());
        self.bus.observe(NODE).unwrap()
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.bus.inject_fault(NODE, fault).unwrap();
    }

    fn inject_defect(&mut self, defect: Defect, is_present: bool) {
        self.bus.inject_defect(NODE, defect, is_present).unwrap();
    }

    fn power_cycle(&mut self, _: u64) {
        self.bus.power_cycle(NODE).unwrap();
    }

    /// A read and a command look alike: the table tells them apart.
    fn written(frame: &Frame) -> Option<(u16, Option<i64>)> {
        let request = ReceivedRequest::decode(frame)?;
        let is_command = entries::find(request.address).is_some_and(|entry| entry.access == Access::Command);
        let is_write = request.value.is_some() || is_command;
        is_write.then_some((request.address.index, request.value.map(i64::from)))
    }
}

#[test]
fn an_absolute_move_sends_the_manuals_requests_in_their_order_and_arrives() {
    let mut bench = Bench::<Own>::ready();
    let ended = bench.carry_out(Motion::To(100_000, PROFILE)).unwrap();
    assert_eq!(ended.end, End::Arrived);
    assert!((ended.position - 100_000).abs() < 60, "{ended:?}");
    let expected = [
        (0x0100, Some(0)),
        (0x008D, Some(1)),
        (0x0088, Some(90_000)),
        (0x0089, Some(90_000)),
        (0x008A, Some(30_000)),
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
fn velocity_and_torque_control_send_the_manuals_requests_in_their_order_with_a_set_point_of_0_before_enabling()
 {
    let sequences = [
        (
            Motion::Velocity(10_000, PROFILE),
            vec![(0x004E, 2), (0x0112, 0), (0x01FD, 0), (0x0088, 90_000), (0x0089, 90_000), (0x01FE, 0)],
            10_000,
        ),
        (torque(900), vec![(0x004E, 1), (0x0112, 0), (0x01FD, 0), (0x01FE, 0), (0x0204, 10_000)], 900),
    ];
    for (motion, before, set_point) in sequences {
        let mut bench = Bench::<Own>::ready();
        bench.carry_out_until(motion, 2_000).unwrap();
        let around =
            [vec![(0x0100, 0)], before, vec![(0x0100, 1), (0x01FE, set_point), (0x01FE, 0), (0x0100, 0)]];
        let expected: Vec<_> =
            around.concat().into_iter().map(|(index, value)| (index, Some(value))).collect();
        assert_eq!(bench.written(), expected);
    }
}

fn torque(current: i32) -> Motion {
    Motion::Torque { current, velocity_limit: std::num::NonZeroU32::new(10_000).unwrap() }
}

#[test]
fn the_velocity_limit_of_torque_control_is_written_while_disabled_and_only_if_it_is_another_one() {
    let mut bench = Bench::<Own>::ready();
    for times in [1, 0] {
        bench.carry_out_until(torque(900), 2_000).unwrap();
        let written = bench.written();
        let limits = written.iter().filter(|(index, _)| *index == 0x0204).count();
        assert_eq!(limits, times, "{written:?}");
        let order = written.iter().position(|written| *written == (0x0204, Some(10_000)));
        assert!(order < Some(bench.place_of(0x0100, 1)));
    }
}

#[test]
fn one_request_is_outstanding_at_a_time() {
    // The simulated module loses a request that comes before its reply to the last one: then this would not arrive.
    let mut bench = ready(ErobCanParameters { reply_ns: 40 * MS, ..parameters() });
    assert_eq!(bench.carry_out(Motion::By(10_000, PROFILE)).unwrap().end, End::Arrived);
}

#[test]
fn a_refused_request_has_its_code_in_both_forms_of_errors() {
    for error_form in [ErrorForm::Printed, ErrorForm::Observed] {
        let mut bench = ready(ErobCanParameters { error_form, ..parameters() });
        let refused: Outcome<(), RequestError> = bench.run_alone(async |session| {
            session.write(&entries::MOTOR_ENABLE, 1).await?;
            session.write(&entries::OPERATING_MODE, 2).await
        });
        let failure = RequestFailure::Refused(Some(ErrorCode::ENABLED));
        let request = Request::Write(entries::OPERATING_MODE.address, 2);
        assert_eq!(refused.unwrap_err().failure, RequestError { request, failure });
    }
}

#[test]
fn a_silent_module_is_named_with_the_entry_that_was_asked_for() {
    let mut bench = Bench::<Own>::ready();
    bench.wire.inject_defect(Defect::SilentSdoServer, true);
    let silent = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!(silent.to_string(), "read the fault: reading error code (0x001F): no reply");
}

#[test]
fn a_module_tells_of_itself_saves_in_three_seconds_and_forgets_what_was_not_saved() {
    let mut bench = Bench::<Own>::ready();
    let information = bench.run_alone(async |session| module::information(&session).await).unwrap();
    let numbers = information.numbers.unwrap();
    assert_eq!(information.firmware, 520_212_171);
    assert_eq!(numbers.model_number().as_deref(), Ok("eRob80H120I-BM-18CN"));
    assert_eq!(numbers.serial_number().as_deref(), Ok("08000001001"));
    for (saves, kept) in [(true, 1_234), (false, 1_234)] {
        let value = if saves { 1_234 } else { 4_321 };
        let began_ns = bench.now_ns;
        let written: Outcome<(), RequestError> = bench.run_alone(async move |session| {
            session.write(&entries::PROFILE_VELOCITY, value).await?;
            if saves { module::save(&session).await } else { Ok(()) }
        });
        written.unwrap();
        assert_eq!(bench.now_ns - began_ns >= 3 * SECOND, saves);
        bench.wire.power_cycle(bench.now_ns);
        let read = bench.run_alone(async |session| session.read(&entries::PROFILE_VELOCITY).await);
        assert_eq!(read.unwrap(), kept);
    }
}

#[test]
fn resetting_the_encoder_wipes_the_count_of_turns() {
    let turned = ModuleParameters { initial_position: 3.25 * std::f64::consts::TAU, ..bench::module() };
    let mut bench = ready(ErobCanParameters { module: turned, ..parameters() });
    let position = |bench: &mut Bench<Own>| {
        bench.run_alone(async |session| session.read(&entries::ACTUAL_POSITION).await)
    };
    assert_eq!(position(&mut bench).unwrap(), 1_703_936);
    bench.run_alone(async |session| module::reset_encoder(&session).await).unwrap();
    assert_eq!(position(&mut bench).unwrap(), 131_072);
}

#[test]
fn firmware_that_takes_the_velocity_limit_while_enabled_is_an_option_of_the_simulation() {
    for has_free_velocity_limit in [false, true] {
        let mut bench = ready(ErobCanParameters { has_free_velocity_limit, ..parameters() });
        let written: Outcome<(), RequestError> = bench.run_alone(async |session| {
            session.write(&entries::MOTOR_ENABLE, 1).await?;
            session.write(&entries::TORQUE_VELOCITY_LIMIT, 10_000).await
        });
        let refusal = written.err().map(|error| error.failure.failure);
        let expected = RequestFailure::Refused(Some(ErrorCode::ENABLED));
        assert_eq!(refusal, (!has_free_velocity_limit).then_some(expected));
    }
}
