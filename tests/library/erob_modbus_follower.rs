//! The drives of a serial line are led by velocities, one request at a time, beside the cycle: in virtual time.

use std::f64::consts::TAU;

use takt::family::erob_modbus::follower::FollowerParameters;
use takt::family::erob_modbus::line::FollowedLine;
use takt::family::{OffCycleLine, OffCycleTarget, OffCycleWish};
use takt::sim::commanded_module::ModuleParameters;
use takt::sim::erob_modbus::{ErobModbusDrive, ErobModbusParameters, SimulatedLine};
use takt::sim::plant::Encoder;
use takt::sim::{Defect, DevicesOnLine, Drive, LineDisturbance, Observation};
use takt_rt::{DriveState, OffCycleReport};
use takt_wire::modbus::frame::{ReceivedRequest, Request, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::MasterTiming;

type Nanoseconds = u64;

const MS: Nanoseconds = 1_000_000;
const LINE: LineTiming = LineTiming::new(115_200);
const COUNTS_PER_UNIT: f64 = 524_288.0 / TAU;

/// A drive that is led, and what has come of it.
struct Bench {
    line: SimulatedLine,
    follower: FollowedLine,
    now_ns: Nanoseconds,
    target: OffCycleTarget,
    reports: Vec<(Nanoseconds, OffCycleReport)>,
    written: Vec<u16>,
}

impl Bench {
    fn new(ready_ns: Nanoseconds) -> Self {
        let drive = ErobModbusDrive::new(ErobModbusParameters {
            address: 2,
            bit_rate_code: 4,
            module: ModuleParameters {
                encoder: Encoder { counts_per_unit: -COUNTS_PER_UNIT, zero_counts: 1_000.0 },
                initial_position: 0.25,
                ready_ns,
                ..crate::erob_module::module()
            },
            reply_ns: 2 * MS,
            has_torque_sensor: false,
        });
        let parameters = FollowerParameters {
            counts_per_unit: -COUNTS_PER_UNIT,
            zero_counts: 1_000.0,
            velocity_limit: 1.0,
            acceleration: 10.0,
            deceleration: 10.0,
            position_gain: 8.0,
            rated_torque: Some(31.5),
            communication_timeout_ms: 500,
        };
        let timing = MasterTiming {
            retries: 0,
            reply_timeout_ns: 20 * MS,
            late_reply_ns: 20 * MS,
            ..MasterTiming::new(LINE)
        };
        let slave = SlaveAddress::new(2).unwrap();
        let mut target = OffCycleTarget::default();
        target.position = 0.25;
        let line = SimulatedLine::new(LINE, vec![drive]);
        let (reports, written) = (vec![], vec![]);
        Self {
            line,
            follower: FollowedLine::new(timing, [(slave, parameters)]),
            now_ns: 0,
            target,
            reports,
            written,
        }
    }

    /// A drive that follows at 0.25 rad.
    fn following() -> Self {
        let mut bench = Self::new(0);
        bench.run(200, |_| (OffCycleWish::Stop, 0.25, 0.0));
        bench.run(1_500, |_| (OffCycleWish::Enable, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::OperationEnabled);
        bench
    }

    /// One turn of whoever calls the follower, 1 ms after the last one.
    fn turn(&mut self) {
        self.now_ns += MS;
        let bytes = self.line.receive(self.now_ns);
        self.follower.receive(&bytes);
        let (at_ns, reports) = (self.now_ns, &mut self.reports);
        let sent = self.follower.poll(at_ns, &[self.target], &mut |_, report| reports.push((at_ns, report)));
        if let Some(frame) = sent {
            match ReceivedRequest::decode(&frame).unwrap().request.unwrap() {
                Request::Read(_) => {}
                Request::WriteOne { register, .. } => self.written.push(register),
                Request::WriteSeveral(write) => self.written.push(write.start()),
            }
            self.line.send(self.now_ns, &frame);
        }
    }

    /// Goes on for some milliseconds, with new targets in each of them: by the time since the beginning in seconds.
    fn run(&mut self, milliseconds: u64, target: impl Fn(f64) -> (OffCycleWish, f64, f64)) {
        let began_ns = self.now_ns;
        for _ in 0..milliseconds {
            let (wish, position, velocity) = target((self.now_ns - began_ns) as f64 * 1e-9);
            self.target.wish = wish;
            (self.target.position, self.target.velocity, self.target.at_ns) =
                (position, velocity, self.now_ns);
            self.turn();
        }
    }

    fn drive(&mut self) -> &mut dyn Drive {
        self.line.drive(2).unwrap()
    }

    fn observe(&mut self) -> Observation {
        let now_ns = self.now_ns;
        self.drive().observe(now_ns)
    }

    fn is_enabled(&mut self) -> bool {
        self.observe().state == DriveState::OperationEnabled
    }

    /// counts/s
    fn velocity(&mut self) -> f64 {
        self.observe().velocity * COUNTS_PER_UNIT
    }

    fn inject(&mut self, defect: Defect) {
        let now_ns = self.now_ns;
        self.drive().inject_defect(now_ns, defect, true).unwrap();
    }

    fn position(&mut self) -> f64 {
        (f64::from(self.observe().position_counts) - 1_000.0) / -COUNTS_PER_UNIT
    }

    fn state(&self) -> DriveState {
        self.reports.last().unwrap().1.state
    }
}

#[test]
fn what_is_only_observed_is_told_nothing_and_reported() {
    let mut bench = Bench::new(0);
    bench.run(1_000, |_| (OffCycleWish::Observe, 0.0, 0.0));
    assert!(bench.written.is_empty());
    assert!(bench.reports.len() > 30, "{}", bench.reports.len());
    let (_, report) = *bench.reports.last().unwrap();
    assert_eq!(report.state, DriveState::ReadyToSwitchOn);
    assert!((report.position - 0.25).abs() < 1e-4, "{report:?}");
}

#[test]
fn a_sine_is_followed_at_the_rate_of_the_line() {
    let mut bench = Bench::following();
    let sine = |time_s: f64| {
        let phase = TAU * 0.2 * time_s;
        (OffCycleWish::Follow, 0.25 + 0.3 * (1.0 - phase.cos()), 0.3 * TAU * 0.2 * phase.sin())
    };
    let began_ns = bench.now_ns;
    let mut worst: f64 = 0.0;
    for _ in 0..10_000 {
        bench.target.at_ns = bench.now_ns;
        let time_s = (bench.now_ns - began_ns) as f64 * 1e-9;
        let (wish, position, velocity) = sine(time_s);
        bench.target.wish = wish;
        (bench.target.position, bench.target.velocity) = (position, velocity);
        bench.turn();
        worst = worst.max((bench.position() - position).abs());
    }
    assert!(worst < 0.02, "{worst} rad");
    assert_eq!((bench.state(), bench.follower.counts().failures), (DriveState::OperationEnabled, 0));
    let within = bench.reports.iter().filter(|(at_ns, _)| *at_ns > began_ns).count();
    assert!(within > 250, "{within} reports in 10 s");
}

#[test]
fn the_manuals_writes_and_its_wait_come_before_the_first_velocity() {
    let mut bench = Bench::new(0);
    bench.run(200, |_| (OffCycleWish::Stop, 0.25, 0.0));
    assert!(bench.written.is_empty());
    bench.run(400, |_| (OffCycleWish::Enable, 0.25, 0.0));
    assert_eq!(bench.written, [0x0040, 0x0042, 0x0049, 0x004B, 0x0051, 0x0002, 0x00F0]);
    assert!(bench.is_enabled());
    assert_eq!(bench.state(), DriveState::SwitchedOn);
    bench.run(700, |_| (OffCycleWish::Enable, 0.25, 0.0));
    assert_eq!((bench.written[7], bench.state()), (0x0051, DriveState::OperationEnabled));
    bench.run(100, |_| (OffCycleWish::Stop, 0.25, 0.0));
    assert!(!bench.is_enabled());
    // It does not wait for its master any more.
    assert_eq!(bench.written[bench.written.len() - 2..], [0x00F0, 0x0002]);
}

#[test]
fn a_drive_that_was_just_switched_on_is_enabled_as_soon_as_it_can_be() {
    let mut bench = Bench::new(3_000 * MS);
    bench.run(5_000, |_| (OffCycleWish::Enable, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::OperationEnabled);
}

#[test]
fn stale_targets_stop_the_joint_and_disable_it_until_its_group_is_enabled() {
    let mut bench = Bench::following();
    bench.run(1_000, |time_s| (OffCycleWish::Follow, 0.25 + 0.5 * time_s, 0.5));
    assert!(bench.velocity().abs() > 30_000.0);
    let stale_ns = bench.now_ns;
    let mut stood_ns = None;
    while bench.is_enabled() {
        bench.turn();
        if bench.velocity().abs() < 500.0 {
            stood_ns = stood_ns.or(Some(bench.now_ns));
        }
        assert!(bench.now_ns < stale_ns + 1_000 * MS);
    }
    let passed_ms = (stood_ns.unwrap() - stale_ns) / MS;
    assert!((100..350).contains(&passed_ms), "it stands after {passed_ms} ms");
    // It does not follow again by itself.
    bench.run(1_000, |_| (OffCycleWish::Follow, 0.9, 0.0));
    assert!(!bench.is_enabled());
    assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
    let here = bench.position();
    bench.run(1_500, |_| (OffCycleWish::Enable, here, 0.0));
    assert_eq!(bench.state(), DriveState::OperationEnabled);
}

#[test]
fn a_drive_whose_targets_were_stale_while_it_was_enabled_is_enabled_when_they_come_again() {
    // Before, while and after the drive gets torque.
    for before_ms in [50, 400, 1_500] {
        let mut bench = Bench::new(0);
        bench.run(200, |_| (OffCycleWish::Stop, 0.25, 0.0));
        bench.run(before_ms, |_| (OffCycleWish::Enable, 0.25, 0.0));
        (0..1_000).for_each(|_| bench.turn());
        assert!(!bench.is_enabled(), "{before_ms}");
        bench.run(1_500, |_| (OffCycleWish::Enable, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::OperationEnabled, "{before_ms}");
    }
}

#[test]
fn a_fault_is_reported_with_its_code_and_cleared_when_that_is_wished() {
    let mut bench = Bench::following();
    bench.inject(Defect::Alarm { code: 0x2310 });
    bench.run(300, |_| (OffCycleWish::Follow, 0.25, 0.0));
    let (_, report) = *bench.reports.last().unwrap();
    assert_eq!((report.state, report.error_code), (DriveState::Fault, 0x2310));
    bench.run(500, |_| (OffCycleWish::Stop, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::Fault);
    bench.run(500, |_| (OffCycleWish::ClearFaults, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
    assert_eq!(bench.written.iter().filter(|register| **register == 0x00F6).count(), 1);
    bench.run(1_500, |_| (OffCycleWish::Enable, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::OperationEnabled);
}

#[test]
fn a_drive_that_has_lost_its_torque_is_reported_and_not_enabled_again() {
    let mut bench = Bench::following();
    bench.inject(Defect::TorqueOff);
    bench.run(1_000, |_| (OffCycleWish::Follow, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
    assert!(!bench.is_enabled());
}

#[test]
fn a_cut_line_ends_the_reports_and_the_communication_time_out_stops_the_joint() {
    let mut bench = Bench::following();
    bench.line.disturb(LineDisturbance { is_cut: true, ..LineDisturbance::default() }, 0);
    let reports = bench.reports.len();
    bench.run(1_000, |time_s| (OffCycleWish::Follow, 0.25 + 0.5 * time_s, 0.5));
    assert!(bench.reports.len() <= reports + 1);
    assert_eq!(bench.observe().error_code, 0x0FA2);
    assert!(bench.follower.counts().failures > 3);
    bench.line.disturb(LineDisturbance::default(), 0);
    bench.run(500, |_| (OffCycleWish::Stop, 0.25, 0.0));
    assert_eq!(bench.state(), DriveState::Fault);
}

#[test]
fn a_noisy_line_costs_turns_and_no_motion() {
    let mut bench = Bench::following();
    let noise =
        LineDisturbance { wrong_per_million: 1_500, lost_per_million: 500, ..LineDisturbance::default() };
    bench.line.disturb(noise, 7);
    let mut worst: f64 = 0.0;
    for _ in 0..10 {
        bench.run(1_000, |_| (OffCycleWish::Follow, 0.25, 0.0));
        worst = worst.max((bench.position() - 0.25).abs());
    }
    assert!(worst < 0.01, "{worst} rad");
    assert!(bench.follower.counts().failures > 10);
}

#[test]
fn a_target_that_is_no_number_commands_the_velocity_0() {
    let mut bench = Bench::following();
    bench.run(500, |_| (OffCycleWish::Follow, f64::NAN, f64::INFINITY));
    assert_eq!(bench.velocity(), 0.0);
}
