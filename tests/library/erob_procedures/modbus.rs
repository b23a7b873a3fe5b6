//! What Modbus-RTU adds.

use takt::family::erob::motion::{Direction, Motion};
use takt::family::erob::procedure::{End, MotionFailure};
use takt::family::erob_modbus::commands::{self, CommandFailure};
use takt::family::erob_modbus::drive::{AccessError, AccessFailure, ErobDrive};
use takt::family::erob_modbus::fault_code::FaultCode;
use takt::family::erob_modbus::registers;
use takt::procedure::{ModbusClient, ModbusSession};
use takt::sim::commanded_module::ModuleParameters;
use takt::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt::sim::serial_line::{DevicesOnLine, LineDisturbance};
use takt::sim::{Defect, Drive, DriveFault, Mailbox, Observation, QueueOrder};
use takt_rt::DriveState;
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{ReceivedRequest, Request, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{MasterTiming, RequestFailure};

use super::bench::{self, Bench, COUNTS_PER_TURN, MS, Outcome, PROFILE, SECOND, Wire};

const SLAVE: u8 = 2;
const LINE: LineTiming = LineTiming::new(115_200);

/// A line with a module.
pub struct Modbus {
    line: SimulatedLine,
    session: ModbusSession,
}

fn session() -> ModbusSession {
    let slave = SlaveAddress::new(SLAVE).unwrap();
    ModbusSession::new(ModbusClient::new(slave, MasterTiming::new(LINE)))
}

fn parameters() -> ErobModbusParameters {
    ErobModbusParameters {
        address: SLAVE,
        bit_rate_code: 4,
        module: bench::module(),
        reply_ns: 2 * MS,
        has_torque_sensor: false,
    }
}

impl Modbus {
    fn with(drives: Vec<ErobModbusDrive>) -> Self {
        Self { line: SimulatedLine::new(LINE, drives), session: session() }
    }

    fn module(&mut self, now_ns: u64) -> &mut dyn Drive {
        self.line.receive(now_ns);
        self.line.drive(SLAVE).unwrap()
    }

    /// Requests that were sent again since the last procedure began.
    fn repeated(&self) -> u64 {
        self.session.repeated_requests()
    }
}

impl Wire for Modbus {
    const FAMILY: &'static str = "erob-modbus";
    type Drive = ErobDrive;
    type Client = ModbusClient;
    type Error = AccessError;

    fn new(module: ModuleParameters) -> Self {
        Self::with(vec![ErobModbusDrive::new(ErobModbusParameters { module, ..parameters() })])
    }

    fn drive(&mut self) -> ErobDrive {
        self.session = session();
        ErobDrive::new(self.session.clone())
    }

    fn send(&mut self, now_ns: u64, frames: &[Vec<u8>]) {
        frames.iter().for_each(|frame| self.line.send(now_ns, frame));
    }

    fn receive(&mut self, now_ns: u64) -> Vec<Vec<u8>> {
        vec![self.line.receive(now_ns)]
    }

    fn observe(&mut self, now_ns: u64) -> Observation {
        // What has come for the master stays on its way.
        self.line.drive(SLAVE).unwrap().observe(now_ns)
    }

    fn inject_fault(&mut self, fault: DriveFault) {
        self.line.drive(SLAVE).unwrap().inject_fault(fault);
    }

    fn inject_defect(&mut self, defect: Defect, is_present: bool) {
        self.line.drive(SLAVE).unwrap().inject_defect(0, defect, is_present).unwrap();
    }

    fn power_cycle(&mut self, now_ns: u64) {
        let mut mailbox = Mailbox::new(QueueOrder::FirstInFirstOut, 1);
        self.module(now_ns).power_cycle(now_ns, &mut mailbox);
    }

    fn written(frame: &Vec<u8>) -> Option<(u16, Option<i64>)> {
        match ReceivedRequest::decode(frame)?.request.ok()? {
            Request::Read(_) => None,
            Request::WriteOne { register, value } => Some((register, Some(value.into()))),
            Request::WriteSeveral(write) => {
                Some((write.start(), registers::find(write.start())?.decode(write.values())))
            }
        }
    }
}

/// The writes of every motion before its own: the motor is disabled, and the modes are set.
fn beginning(mode: i64) -> Vec<(u16, i64)> {
    vec![(0x00F0, 0), (0x0040, mode), (0x0042, 0)]
}

fn with_values(written: Vec<(u16, Option<i64>)>) -> Vec<(u16, i64)> {
    written.into_iter().map(|(register, value)| (register, value.unwrap())).collect()
}

#[test]
fn an_absolute_move_writes_the_manuals_registers_in_their_order_and_arrives() {
    let mut bench = Bench::<Modbus>::ready();
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
    assert_eq!(with_values(bench.written()), [beginning(3), rest.to_vec()].concat());
    let fastest = bench.fastest * COUNTS_PER_TURN / std::f64::consts::TAU;
    assert!((29_000.0..31_500.0).contains(&fastest), "{fastest}");
    bench.assert_at_rest_and_disabled();
}

#[test]
fn a_reciprocating_motion_is_ended_at_one_of_its_ends() {
    for interrupted_ms in [8_000, 8_300, 8_600, 9_000, 9_400] {
        let mut bench = Bench::<Modbus>::ready();
        let motion = Motion::ReciprocatingTo { to: 20_000, dwell_ns: 200 * MS, profile: PROFILE };
        let ended = bench.carry_out_until(motion, interrupted_ms).unwrap();
        assert_eq!(ended.end, End::Interrupted);
        let is_at_end = ended.position.abs() < 100 || (ended.position - 20_000).abs() < 100;
        assert!(is_at_end, "{interrupted_ms}: {ended:?}");
        let written = with_values(bench.written());
        assert_eq!(written[written.len() - 2..], [(0x00F4, 0), (0x00F0, 0)], "{written:?}");
        assert!(written.contains(&(0x004D, 4_000)), "{written:?}");
        bench.assert_at_rest_and_disabled();
    }
}

#[test]
fn who_commands_a_module_without_a_communication_time_out_is_told_what_becomes_of_it() {
    for (milliseconds, is_told) in [(0, true), (500, false)] {
        let mut bench = Bench::<Modbus>::ready();
        let set: Outcome<(), CommandFailure> = bench
            .run_alone(async move |drive| commands::set_communication_timeout(&drive, milliseconds).await);
        set.unwrap();
        bench.notes.clear();
        bench.carry_out(Motion::By(1_000, PROFILE)).unwrap();
        assert_eq!(bench.notes.iter().any(|note| note.contains("time-out is off")), is_told);
    }
}

#[test]
fn a_silent_module_is_named_with_the_register_that_was_asked_for() {
    let mut bench = Bench::<Modbus>::ready();
    bench.wire.inject_defect(Defect::SilentSdoServer, true);
    let silent = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!(
        silent.to_string(),
        "read the fault: fault code (0x0060): slave 2: no reply (check address, bit rate, power, and whether A and B are \
         exchanged)"
    );
}

#[test]
fn a_fault_stays_until_it_is_cleared() {
    let mut bench = Bench::<Modbus>::ready();
    bench.wire.inject_fault(DriveFault::OverCurrent);
    let refused = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
    assert_eq!((refused.step, refused.failure), ("read the fault", MotionFailure::Drive { code: 0x2310 }));
    let cleared: Outcome<_, CommandFailure> =
        bench.run_alone(async |drive| commands::clear_fault(&drive).await);
    assert_eq!(cleared.unwrap(), Some(FaultCode(0x2310)));
    assert_eq!(bench.carry_out(Motion::By(1_000, PROFILE)).unwrap().end, End::Arrived);
}

#[test]
fn the_wait_of_500_ms_after_enabling_is_kept_and_the_drive_hears_its_master_in_it() {
    let mut bench = Bench::<Modbus>::ready();
    let kept: Outcome<(), CommandFailure> =
        bench.run_alone(async |drive| commands::set_communication_timeout(&drive, 200).await);
    kept.unwrap();
    // The simulated drive ignores a start before that, and shows fault 0x0FA2 after 200 ms of silence.
    let ended = bench.carry_out(Motion::To(50_000, PROFILE)).unwrap();
    assert_eq!(ended.end, End::Arrived);
    assert_eq!(bench.observe().error_code, 0);
}

#[test]
fn a_silent_master_ends_in_fault_0fa2_which_is_read_and_cleared() {
    let mut bench = Bench::<Modbus>::ready();
    let found = bench.run_alone(async |drive| {
        commands::set_communication_timeout(&drive, 300).await?;
        drive.write(&registers::MOTOR_ENABLE, 1).await?;
        drive.session().sleep(400 * MS).await;
        commands::clear_fault(&drive).await
    });
    let found: Outcome<_, CommandFailure> = found;
    assert_eq!(found.unwrap(), Some(FaultCode::COMMUNICATION_TIMEOUT));
    let truth = bench.observe();
    assert_eq!((truth.state, truth.error_code), (DriveState::SwitchOnDisabled, 0));
    // A drive that has never heard a master does not miss it.
    let mut bench = Bench::<Modbus>::ready();
    bench.now_ns += 60 * SECOND;
    assert_eq!(bench.observe().error_code, 0);
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
        let mut bench = Bench::<Modbus>::ready();
        let set: Outcome<(), CommandFailure> = bench
            .run_alone(async move |drive| commands::set_communication_timeout(&drive, milliseconds).await);
        set.unwrap();
        assert_eq!(bench.written(), [(0x0002, Some(i64::from(milliseconds)))]);
        assert_eq!(bench.sent.len(), 2);
        assert_eq!(bench.notes.first().map(String::as_str), note);
    }
    let mut bench = Bench::<Modbus>::ready();
    let refused: Outcome<(), CommandFailure> =
        bench.run_alone(async |drive| commands::set_communication_timeout(&drive, 4_001).await);
    assert!(matches!(
        refused.unwrap_err().failure,
        CommandFailure::Access(AccessError { failure: AccessFailure::Value { .. }, .. })
    ));
    assert!(bench.sent.is_empty());
}

#[test]
fn an_emergency_stop_takes_less_than_50_ms() {
    for (mode, velocity) in [(3, 0x0047), (2, 0x0051)] {
        let mut bench = Bench::<Modbus>::ready();
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
            |wire, now_ns, ms| {
                let velocity = wire.observe(now_ns).velocity.abs() * COUNTS_PER_TURN / std::f64::consts::TAU;
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
        assert_eq!(bench.observe().error_code, 0);
    }
}

#[test]
fn saving_takes_three_seconds_and_what_was_not_saved_is_forgotten() {
    let mut bench = Bench::<Modbus>::ready();
    for (saves, kept) in [(true, 1_234), (false, 1_234)] {
        let value = if saves { 1_234 } else { 4_321 };
        let began_ns = bench.now_ns;
        let written: Outcome<(), AccessError> = bench.run_alone(async move |drive| {
            drive.write(&registers::PROFILE_VELOCITY, value).await?;
            if saves { commands::save(&drive).await } else { Ok(()) }
        });
        written.unwrap();
        assert_eq!(bench.now_ns - began_ns >= 3 * SECOND, saves);
        bench.wire.power_cycle(bench.now_ns);
        let read: Outcome<i64, AccessError> =
            bench.run_alone(async |drive| drive.read(&registers::PROFILE_VELOCITY).await);
        assert_eq!(read.unwrap(), kept);
    }
}

#[test]
fn a_new_address_counts_after_saving_and_a_power_cycle() {
    let mut bench = Bench::<Modbus>::ready();
    let written: Outcome<(), AccessError> = bench.run_alone(async |drive| {
        drive.write(&registers::SLAVE_ADDRESS, 9).await?;
        commands::save(&drive).await
    });
    written.unwrap();
    let fault = |bench: &mut Bench<Modbus>| bench.run_alone(async |drive| drive.fault().await);
    assert_eq!(fault(&mut bench).unwrap(), None);
    bench.wire.power_cycle(bench.now_ns);
    let AccessFailure::Request(error) = fault(&mut bench).unwrap_err().failure.failure else { panic!() };
    assert_eq!(error.failure, RequestFailure::NoReply);
}

#[test]
fn resetting_the_encoder_wipes_the_count_of_turns_clears_the_battery_fault_and_says_so() {
    let turned = ModuleParameters { initial_position: 3.25 * std::f64::consts::TAU, ..bench::module() };
    let mut bench = Bench { now_ns: 9 * SECOND, ..Bench::<Modbus>::of(turned) };
    bench.wire.inject_fault(DriveFault::MultiTurnBattery);
    let stays: Outcome<_, CommandFailure> =
        bench.run_alone(async |drive| commands::clear_fault(&drive).await);
    assert_eq!(stays.unwrap_err().failure, CommandFailure::FaultStays(FaultCode::MULTI_TURN_BATTERY));
    assert_eq!(bench.observe().position_counts, 1_703_936);
    let reset: Outcome<(), AccessError> =
        bench.run_alone(async |drive| commands::reset_encoder(&drive).await);
    reset.unwrap();
    assert_eq!((bench.observe().position_counts, bench.observe().error_code), (131_072, 0));
    assert_eq!(bench.notes, ["the count of turns is wiped: home the joint again before it moves"]);
}

#[test]
fn every_register_can_be_read_and_what_the_model_does_not_have_is_left_out() {
    let mut bench = Bench::<Modbus>::ready();
    let values = bench.run_alone(async |drive| commands::read_all(&drive).await).unwrap();
    assert_eq!(values.len(), 52);
    for (register, value) in values {
        assert_eq!(value.is_none(), *register == registers::TORQUE_SENSOR, "{register}");
    }
}

#[test]
fn the_simulated_drive_refuses_gaps_halves_and_changes_while_enabled() {
    let mut bench = Bench::<Modbus>::ready();
    let refusals = bench.run_alone(async |drive| {
        use takt_wire::modbus::frame::{RegisterRange, RegisterValues};
        use takt_wire::modbus::master::Repeat;
        let session = drive.session();
        drive.write(&registers::MOTOR_ENABLE, 1).await?;
        let mut refusals = vec![];
        for (start, count) in [(0x0061, 2), (0x006A, 1), (0x00F0, 1), (0x0100, 1)] {
            let read = session.read_registers(RegisterRange::new(start, count).unwrap()).await;
            refusals.push(read.unwrap_err().failure);
        }
        let half = session.write_register(0x0043, 1, Repeat::Allowed).await;
        refusals.push(half.unwrap_err().failure);
        let shown = session.write_registers(RegisterValues::new(0x0066, &[1, 2]).unwrap(), Repeat::Allowed);
        refusals.push(shown.await.unwrap_err().failure);
        refusals.push(session.write_register(0x0040, 1, Repeat::Allowed).await.unwrap_err().failure);
        Ok::<_, AccessError>(refusals)
    });
    let codes = [2, 2, 2, 2, 3, 2, 4].map(|code| RequestFailure::Refused(ExceptionCode(code)));
    assert_eq!(refusals.unwrap(), codes);
}

#[test]
fn on_a_noisy_line_a_motion_arrives_or_fails_with_the_motor_off_and_no_wrong_value_is_ever_written() {
    let (mut arrived, mut repeated) = (0, 0);
    for seed in 0..20 {
        let mut bench = Bench::<Modbus>::ready();
        // One byte of 500: about every tenth exchange is damaged.
        bench.wire.line.disturb(
            LineDisturbance { wrong_per_million: 1_500, lost_per_million: 500, ..LineDisturbance::default() },
            seed,
        );
        let outcome = bench.carry_out(Motion::To(60_000, PROFILE));
        repeated += bench.wire.repeated();
        match outcome {
            Ok(ended) => {
                assert_eq!(ended.end, End::Arrived, "{seed}");
                assert!((ended.position - 60_000).abs() < 60, "{seed}: {ended:?}");
                arrived += 1;
            }
            Err(error) => assert!(matches!(error.failure, MotionFailure::Request(_)), "{seed}: {error}"),
        }
        assert!((-60..60_060).contains(&bench.observe().position_counts), "{seed}");
        bench.assert_at_rest_and_disabled();
    }
    assert!(arrived >= 15, "{arrived} of 20");
    assert!(repeated > 100, "{repeated}");
}

#[test]
fn a_cut_wire_ends_the_motion_and_the_communication_time_out_stops_the_joint() {
    let mut bench = Bench::<Modbus>::ready();
    let set: Outcome<(), CommandFailure> =
        bench.run_alone(async |drive| commands::set_communication_timeout(&drive, 500).await);
    set.unwrap();
    let cut = |wire: &mut Modbus, _: u64, ms: u64| {
        if ms == 3_000 {
            wire.line.disturb(LineDisturbance { is_cut: true, ..LineDisturbance::default() }, 0);
        }
        false
    };
    let error = bench.carry_out_with(Motion::Continuous(Direction::Forward, PROFILE), cut).unwrap_err();
    let MotionFailure::Request(AccessError { failure: AccessFailure::Request(request), .. }) = error.failure
    else {
        panic!("{error}")
    };
    assert_eq!((error.step, request.failure), ("move", RequestFailure::NoReply));
    assert_eq!(bench.observe().error_code, 0x0FA2);
    bench.assert_at_rest_and_disabled();
}

#[test]
fn an_hour_of_reciprocation_passes_in_seconds_without_a_repeated_request() {
    let mut bench = Bench::<Modbus>::ready();
    let motion = Motion::ReciprocatingTo { to: 20_000, dwell_ns: 0, profile: PROFILE };
    let ended = bench.carry_out_until(motion, 3_600_000).unwrap();
    assert_eq!(ended.end, End::Interrupted);
    assert_eq!(bench.wire.repeated(), 0);
    assert!(bench.sent.len() > 100_000, "{}", bench.sent.len());
    bench.assert_at_rest_and_disabled();
}

#[test]
fn two_drives_share_a_line() {
    let module = ModuleParameters { initial_position: 1.0, ..bench::module() };
    let other = ErobModbusParameters { address: 3, module, ..parameters() };
    let wire = Modbus::with([parameters(), other].map(ErobModbusDrive::new).to_vec());
    let mut bench = Bench { wire, ..Bench::ready() };
    let ended = bench.carry_out(Motion::To(50_000, PROFILE)).unwrap();
    assert!((ended.position - 50_000).abs() < 60, "{ended:?}");
    assert_eq!(bench.wire.line.drive(3).unwrap().observe(bench.now_ns).position_counts, 83_443);
}
