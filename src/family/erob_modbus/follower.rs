//! Leads one drive by velocity control along set-points that come from outside, without input and output.
//!
//! ```text
//! wish to follow ──▶ Preparing ──▶ Enabled (500 ms) ──▶ Following ──┐ stale targets
//!        ▲                                                          ▼
//!      Off ◀── Disabling ◀──────────────────────────────────── Stopping
//! ```
//!
//! One request is under way at a time, and writes and reads take turns: a velocity, what the drive does, the next velocity. The
//! velocity is that of the set-point and a correction of the position. When the set-points are stale, the joint is stopped and disabled;
//! it follows again when that was unwished in between.

use takt_rt::{DriveState, Nanoseconds, OffCycleReport};

use super::drive::ReachedStatus;
use super::registers::{self, Register};
use crate::family::{OffCycleTarget, OffCycleWish};
use crate::modbus::frame::{RegisterRange, RegisterValues, Request, SlaveAddress, Values};
use crate::modbus::master::{Answer, Master, MasterTiming, Repeat};

/// From enabling to the first velocity.
const ENABLED_NS: Nanoseconds = 500_000_000;
/// From one attempt to enable, or to clear a fault, to the next.
const AGAIN_NS: Nanoseconds = 500_000_000;
/// A joint that does not come to rest in this time is disabled all the same.
const STOPPING_NS: Nanoseconds = 2_000_000_000;
/// A joint slower than this stands: counts/s. The readings of a joint at rest are not quite 0.
const STANDING: f64 = 300.0;

/// What a follower is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerParameters {
    /// The address of the drive.
    pub slave: SlaveAddress,
    /// The line. Retries are of no use here: the next turn brings what is new.
    pub timing: MasterTiming,
    /// Counts of the drive for one radian (metre) of the joint; negative when the counts go down.
    pub counts_per_unit: f64,
    /// The counts at the joint's zero.
    pub zero_counts: f64,
    /// The highest velocity that is commanded: rad/s (m/s).
    pub velocity_limit: f64,
    /// How fast the drive changes its velocity: rad/s² (m/s²).
    pub acceleration: f64,
    /// The velocity for a position error of one unit: 1/s. With a turn of 20 ms, 5 to 10 is steady.
    pub position_gain: f64,
    /// The torque of the joint for one ampere: N·m/A (N/A); 0 where it is not known.
    pub torque_per_ampere: f64,
    /// Targets that are older than this are stale.
    pub stale_ns: Nanoseconds,
    /// What is written into register 0x0002: how long (ms) the drive waits for its master; 0 for ever.
    pub communication_timeout_ms: u16,
}

/// How far the drive has been led.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    /// Without torque, and told nothing.
    Off,
    /// The writes before enabling are under way: this one is next, not before a time.
    Preparing { step: usize, from_ns: Nanoseconds },
    /// It was enabled at this time.
    Enabled { since_ns: Nanoseconds },
    /// It gets velocities.
    Following,
    /// It gets the velocity 0, since this time.
    Stopping { since_ns: Nanoseconds },
    /// It is told to disable until it has confirmed.
    Disabling,
}

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Prepare,
    Enable,
    Command,
    Disable,
    ClearFault,
    Read(Reading),
}

/// The registers of one read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    /// Whether it is at its target, and where it is: 0x0063 to 0x0069.
    Place,
    /// Velocity and current: 0x006C to 0x0075.
    Speed,
    /// Fault and motion: 0x0060 and 0x0061.
    Fault,
}

/// The position in every second read: it is what the correction needs.
const READINGS: [Reading; 4] = [Reading::Fault, Reading::Place, Reading::Speed, Reading::Place];

/// What the drive has said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    /// counts
    position: f64,
    at_ns: Nanoseconds,
    /// counts/s
    velocity: f64,
    milliamperes: f64,
    fault: u16,
    is_motor_off: bool,
}

/// Leads one drive.
#[derive(Debug)]
pub struct Follower {
    parameters: FollowerParameters,
    master: Master,
    life: Life,
    /// It follows only after it was unwished: targets were stale, or the drive has lost its torque.
    must_be_unwished: bool,
    under_way: Option<Purpose>,
    /// The next request is a read.
    is_turn_of_reading: bool,
    reading: usize,
    seen: Seen,
    /// The readings that have come since the beginning, or since the drive did not reply: all four before anything is reported.
    known: usize,
    clear_from_ns: Nanoseconds,
    lost: u64,
}

impl Follower {
    /// A follower of a drive of which nothing is known.
    pub const fn new(parameters: FollowerParameters) -> Self {
        Self {
            parameters,
            master: Master::new(parameters.timing),
            life: Life::Off,
            must_be_unwished: false,
            under_way: None,
            is_turn_of_reading: true,
            reading: 0,
            seen: Seen {
                position: 0.0,
                at_ns: 0,
                velocity: 0.0,
                milliamperes: 0.0,
                fault: 0,
                is_motor_off: true,
            },
            known: 0,
            clear_from_ns: 0,
            lost: 0,
        }
    }

    /// Requests that have failed.
    pub const fn lost_requests(&self) -> u64 {
        self.lost
    }

    /// Takes bytes that have come over the line.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.master.receive(bytes);
    }

    /// Goes on: returns the bytes to send, and what the drive has said. `now_ns` and the time of the target are of one clock.
    pub fn poll(
        &mut self,
        now_ns: Nanoseconds,
        target: &OffCycleTarget,
    ) -> (Option<Vec<u8>>, Option<OffCycleReport>) {
        let bytes = self.master.poll(now_ns);
        let report = self.take_outcome(now_ns);
        self.go_on(now_ns, target);
        if bytes.is_some() || self.under_way.is_some() {
            return (bytes, report);
        }
        self.begin_next(now_ns, target);
        (self.master.poll(now_ns), report)
    }

    /// What follows from the wish, from the age of the target, and from what the drive shows.
    fn go_on(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) {
        let wants_to_follow = target.wish == OffCycleWish::Follow;
        let is_stale = now_ns.saturating_sub(target.at_ns) > self.parameters.stale_ns;
        if !wants_to_follow {
            self.must_be_unwished = false;
        }
        let is_told = !matches!(self.life, Life::Off | Life::Disabling);
        if is_told && !wants_to_follow && !is_stale {
            self.life = Life::Disabling;
        }
        match self.life {
            Life::Off
                if wants_to_follow
                    && !is_stale
                    && !self.must_be_unwished
                    && self.known == READINGS.len()
                    && self.seen.fault == 0 =>
            {
                self.life = Life::Preparing { step: 0, from_ns: now_ns };
            }
            Life::Preparing { .. } | Life::Enabled { .. } if is_stale => {
                self.must_be_unwished = true;
                self.life = Life::Disabling;
            }
            Life::Enabled { since_ns } if now_ns.saturating_sub(since_ns) >= ENABLED_NS => {
                self.life = Life::Following;
            }
            Life::Following if self.seen.fault != 0 || self.seen.is_motor_off => {
                self.must_be_unwished = true;
                self.life = Life::Disabling;
            }
            Life::Following if is_stale => {
                self.must_be_unwished = true;
                self.life = Life::Stopping { since_ns: now_ns };
            }
            Life::Stopping { since_ns } => {
                let has_taken_long = now_ns.saturating_sub(since_ns) > STOPPING_NS;
                if has_taken_long || self.seen.at_ns > since_ns && self.seen.velocity.abs() < STANDING {
                    self.life = Life::Disabling;
                }
            }
            Life::Off | Life::Preparing { .. } | Life::Enabled { .. } | Life::Following | Life::Disabling => {
            }
        }
    }

    /// The writes before enabling.
    fn preparation(&self) -> [(Register, i64); 6] {
        let rate = self.counts(self.parameters.acceleration).abs().clamp(1.0, f64::from(u32::MAX)) as i64;
        [
            (registers::OPERATION_MODE, 2),
            (registers::CONTROL_SOURCE, 0),
            (registers::PROFILE_ACCELERATION, rate),
            (registers::PROFILE_DECELERATION, rate),
            // It acts as soon as the motor is enabled.
            (registers::TARGET_VELOCITY, 0),
            (registers::COMMUNICATION_TIMEOUT, self.parameters.communication_timeout_ms.into()),
        ]
    }

    fn begin_next(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) {
        let write = if self.is_turn_of_reading { None } else { self.next_write(now_ns, target) };
        self.is_turn_of_reading = !self.is_turn_of_reading;
        let (purpose, request) = match write {
            Some((purpose, register, value)) => match written(&register, value) {
                Some(request) => (purpose, request),
                None => return,
            },
            None => {
                let reading = READINGS[self.reading % READINGS.len()];
                self.reading = (self.reading + 1) % READINGS.len();
                self.is_turn_of_reading = false;
                let Some(range) = range_of(reading) else { return };
                (Purpose::Read(reading), Request::Read(range))
            }
        };
        if self.master.start(self.parameters.slave, request, Repeat::Allowed).is_ok() {
            self.under_way = Some(purpose);
        }
    }

    fn next_write(
        &mut self,
        now_ns: Nanoseconds,
        target: &OffCycleTarget,
    ) -> Option<(Purpose, Register, i64)> {
        match self.life {
            Life::Preparing { step, from_ns } if now_ns >= from_ns => {
                let next = self.preparation().get(step).copied();
                let (register, value) = next.unwrap_or((registers::MOTOR_ENABLE, 1));
                Some((if next.is_some() { Purpose::Prepare } else { Purpose::Enable }, register, value))
            }
            Life::Following => {
                Some((Purpose::Command, registers::TARGET_VELOCITY, self.velocity(now_ns, target)))
            }
            Life::Stopping { .. } => Some((Purpose::Command, registers::TARGET_VELOCITY, 0)),
            Life::Disabling => Some((Purpose::Disable, registers::MOTOR_ENABLE, 0)),
            Life::Off
                if target.wish == OffCycleWish::ClearFaults
                    && self.seen.fault != 0
                    && now_ns >= self.clear_from_ns =>
            {
                self.clear_from_ns = now_ns.saturating_add(AGAIN_NS);
                Some((Purpose::ClearFault, registers::CLEAR_FAULT, 1))
            }
            Life::Off | Life::Preparing { .. } | Life::Enabled { .. } => None,
        }
    }

    /// The velocity for the drive: counts/s.
    fn velocity(&self, now_ns: Nanoseconds, target: &OffCycleTarget) -> i64 {
        let seconds = |since_ns: Nanoseconds| now_ns.saturating_sub(since_ns) as f64 * 1e-9;
        let wanted = target.position + target.velocity * seconds(target.at_ns);
        let here =
            self.position() + self.seen.velocity / self.parameters.counts_per_unit * seconds(self.seen.at_ns);
        let limit = self.parameters.velocity_limit;
        let velocity = target.velocity + self.parameters.position_gain * (wanted - here);
        // No number: then the joint stands.
        let velocity = if velocity.is_finite() { velocity.clamp(-limit, limit) } else { 0.0 };
        self.counts(velocity).clamp(f64::from(i32::MIN), f64::from(i32::MAX)).round() as i64
    }

    fn counts(&self, units: f64) -> f64 {
        units * self.parameters.counts_per_unit
    }

    /// Where the joint was seen: rad (m).
    fn position(&self) -> f64 {
        (self.seen.position - self.parameters.zero_counts) / self.parameters.counts_per_unit
    }

    fn take_outcome(&mut self, now_ns: Nanoseconds) -> Option<OffCycleReport> {
        let outcome = self.master.take_outcome()?;
        let purpose = self.under_way.take()?;
        match (purpose, outcome) {
            (Purpose::Read(reading), Ok(Answer::Values(values))) => {
                self.known = (self.known + 1).min(READINGS.len());
                return self.take_reading(now_ns, reading, &values);
            }
            (purpose, Ok(_)) => self.confirm(now_ns, purpose),
            (purpose, Err(_)) => {
                self.lost = self.lost.saturating_add(1);
                // A drive that was switched on just now is busy.
                if let (Purpose::Enable, Life::Preparing { step, .. }) = (purpose, self.life) {
                    self.life = Life::Preparing { step, from_ns: now_ns.saturating_add(AGAIN_NS) };
                }
                // What is known of the drive is old.
                if matches!(purpose, Purpose::Read(_)) {
                    self.known = 0;
                }
            }
        }
        None
    }

    fn confirm(&mut self, now_ns: Nanoseconds, purpose: Purpose) {
        self.life = match (purpose, self.life) {
            (Purpose::Prepare, Life::Preparing { step, from_ns }) => {
                Life::Preparing { step: step + 1, from_ns }
            }
            (Purpose::Enable, Life::Preparing { .. }) => {
                // Until it is read anew.
                self.seen.is_motor_off = false;
                Life::Enabled { since_ns: now_ns }
            }
            // The wish has changed while the request was under way.
            (Purpose::Enable, _) => Life::Disabling,
            (Purpose::Disable, Life::Disabling) => Life::Off,
            (_, life) => life,
        };
    }

    fn take_reading(
        &mut self,
        now_ns: Nanoseconds,
        reading: Reading,
        values: &Values,
    ) -> Option<OffCycleReport> {
        let first = range_of(reading)?.start();
        let number = |register: &Register| {
            let at = usize::from(register.address - first);
            let words = values.get(at..at + usize::from(register.number.words()))?;
            register.decode(words).map(|value| value as f64)
        };
        match reading {
            Reading::Fault => self.seen.fault = values.first().copied()?,
            Reading::Speed => {
                self.seen.velocity = number(&registers::ACTUAL_VELOCITY)?;
                self.seen.milliamperes = number(&registers::MOTOR_CURRENT)?;
            }
            Reading::Place => {
                let reached = ReachedStatus::from(values.first().copied()?);
                self.seen.is_motor_off = reached == ReachedStatus::MotorOff;
                self.seen.position = number(&registers::ACTUAL_POSITION)?;
                self.seen.at_ns = now_ns;
                return (self.known == READINGS.len()).then(|| self.report());
            }
        }
        None
    }

    fn report(&self) -> OffCycleReport {
        let Seen { velocity, milliamperes, fault, is_motor_off, .. } = self.seen;
        let state = match self.life {
            _ if fault != 0 => DriveState::Fault,
            Life::Following | Life::Stopping { .. } if !is_motor_off => DriveState::OperationEnabled,
            _ => DriveState::ReadyToSwitchOn,
        };
        let direction = 1f64.copysign(self.parameters.counts_per_unit);
        OffCycleReport {
            state,
            position: self.position(),
            velocity: velocity / self.parameters.counts_per_unit,
            torque: direction * 1e-3 * milliamperes * self.parameters.torque_per_ampere,
            error_code: fault,
        }
    }
}

fn range_of(reading: Reading) -> Option<RegisterRange> {
    let (first, count) = match reading {
        Reading::Fault => (registers::FAULT_CODE, 2),
        Reading::Place => (registers::REACHED_STATUS, 7),
        Reading::Speed => (registers::DEMANDED_VELOCITY, 10),
    };
    RegisterRange::new(first.address, count)
}

fn written(register: &Register, value: i64) -> Option<Request> {
    let words = register.encode(value).ok()?;
    match words.as_slice() {
        [word] => Some(Request::WriteOne { register: register.address, value: *word }),
        words => RegisterValues::new(register.address, words).map(Request::WriteSeveral),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::modbus::frame::ReceivedRequest;
    use crate::modbus::line_timing::LineTiming;
    use crate::sim::erob_modbus::{
        Disturbance, ErobModbusDrive, ErobModbusParameters, ModbusDriveFault, SimulatedLine,
    };
    use crate::sim::plant::{Encoder, JointParameters};
    use crate::sim::serial_line::DevicesOnLine;

    const MS: Nanoseconds = 1_000_000;
    const LINE: LineTiming = LineTiming::new(115_200);
    const COUNTS_PER_UNIT: f64 = 524_288.0 / TAU;
    const STALE_NS: Nanoseconds = 100 * MS;

    /// A drive that is led, and what has come of it.
    struct Bench {
        line: SimulatedLine,
        follower: Follower,
        now_ns: Nanoseconds,
        target: OffCycleTarget,
        reports: Vec<(Nanoseconds, OffCycleReport)>,
        written: Vec<u16>,
    }

    impl Bench {
        fn new(ready_ns: Nanoseconds) -> Self {
            let joint = JointParameters {
                inertia: 0.3,
                viscous_friction: 2.0,
                coulomb_friction: 4.0,
                friction_shape: crate::config::FrictionShape::Constant,
                brake_torque: 60.0,
            };
            let drive = ErobModbusDrive::new(ErobModbusParameters {
                address: 2,
                bit_rate_code: 4,
                joint,
                encoder: Encoder { counts_per_unit: -COUNTS_PER_UNIT, zero_counts: 1_000.0 },
                counts_per_turn: 524_288.0,
                initial_position: 0.25,
                peak_torque: 60.0,
                torque_per_ampere: 5.0,
                highest_velocity: 3.0,
                ready_ns,
                reply_ns: 2 * MS,
                has_battery: true,
                has_torque_sensor: false,
            });
            let parameters = FollowerParameters {
                slave: SlaveAddress::new(2).unwrap(),
                timing: MasterTiming { retries: 0, reply_timeout_ns: 30 * MS, ..MasterTiming::new(LINE) },
                counts_per_unit: -COUNTS_PER_UNIT,
                zero_counts: 1_000.0,
                velocity_limit: 1.0,
                acceleration: 10.0,
                position_gain: 8.0,
                torque_per_ampere: 5.0,
                stale_ns: STALE_NS,
                communication_timeout_ms: 500,
            };
            let target = OffCycleTarget {
                wish: OffCycleWish::Observe,
                position: 0.25,
                velocity: 0.0,
                torque: 0.0,
                at_ns: 0,
            };
            let line = SimulatedLine::new(LINE, vec![drive]);
            let (reports, written) = (vec![], vec![]);
            Self { line, follower: Follower::new(parameters), now_ns: 0, target, reports, written }
        }

        /// A drive that follows at 0.25 rad.
        fn following() -> Self {
            let mut bench = Self::new(0);
            bench.run(200, |_| (OffCycleWish::Stop, 0.25, 0.0));
            bench.run(1_500, |_| (OffCycleWish::Follow, 0.25, 0.0));
            assert_eq!(bench.state(), DriveState::OperationEnabled);
            bench
        }

        /// One turn of whoever calls the follower, 1 ms after the last one.
        fn turn(&mut self) {
            self.now_ns += MS;
            let bytes = self.line.receive(self.now_ns);
            self.follower.receive(&bytes);
            let (sent, report) = self.follower.poll(self.now_ns, &self.target);
            if let Some(frame) = sent {
                match ReceivedRequest::decode(&frame).unwrap().request.unwrap() {
                    Request::Read(_) => {}
                    Request::WriteOne { register, .. } => self.written.push(register),
                    Request::WriteSeveral(write) => self.written.push(write.start()),
                }
                self.line.send(self.now_ns, &frame);
            }
            self.reports.extend(report.map(|report| (self.now_ns, report)));
        }

        /// Goes on for some milliseconds, with new targets in each of them: by the time since the beginning in seconds.
        fn run(&mut self, milliseconds: u64, target: impl Fn(f64) -> (OffCycleWish, f64, f64)) {
            let began_ns = self.now_ns;
            for _ in 0..milliseconds {
                let (wish, position, velocity) = target((self.now_ns - began_ns) as f64 * 1e-9);
                self.target = OffCycleTarget { wish, position, velocity, torque: 0.0, at_ns: self.now_ns };
                self.turn();
            }
        }

        fn drive(&mut self) -> &mut ErobModbusDrive {
            self.line.drive(0).unwrap()
        }

        fn position(&mut self) -> f64 {
            (f64::from(self.drive().counts()) - 1_000.0) / -COUNTS_PER_UNIT
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
            bench.target = OffCycleTarget { wish, position, velocity, torque: 0.0, at_ns: bench.now_ns };
            bench.turn();
            worst = worst.max((bench.position() - position).abs());
        }
        assert!(worst < 0.02, "{worst} rad");
        assert_eq!((bench.state(), bench.follower.lost_requests()), (DriveState::OperationEnabled, 0));
        let within = bench.reports.iter().filter(|(at_ns, _)| *at_ns > began_ns).count();
        assert!(within > 250, "{within} reports in 10 s");
    }

    #[test]
    fn the_manuals_writes_and_its_wait_come_before_the_first_velocity() {
        let mut bench = Bench::new(0);
        bench.run(200, |_| (OffCycleWish::Stop, 0.25, 0.0));
        assert!(bench.written.is_empty());
        bench.run(400, |_| (OffCycleWish::Follow, 0.25, 0.0));
        assert_eq!(bench.written, [0x0040, 0x0042, 0x0049, 0x004B, 0x0051, 0x0002, 0x00F0]);
        assert!(bench.drive().is_enabled());
        assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
        bench.run(700, |_| (OffCycleWish::Follow, 0.25, 0.0));
        assert_eq!((bench.written[7], bench.state()), (0x0051, DriveState::OperationEnabled));
        bench.run(100, |_| (OffCycleWish::Stop, 0.25, 0.0));
        assert!(!bench.drive().is_enabled());
        assert_eq!(bench.written.last(), Some(&0x00F0));
    }

    #[test]
    fn a_drive_that_was_just_switched_on_is_enabled_as_soon_as_it_can_be() {
        let mut bench = Bench::new(3_000 * MS);
        bench.run(5_000, |_| (OffCycleWish::Follow, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::OperationEnabled);
    }

    #[test]
    fn stale_targets_stop_the_joint_and_disable_it_until_following_was_unwished() {
        let mut bench = Bench::following();
        bench.run(1_000, |time_s| (OffCycleWish::Follow, 0.25 + 0.5 * time_s, 0.5));
        assert!(bench.drive().velocity().abs() > 30_000.0);
        let stale_ns = bench.now_ns;
        let mut stood_ns = None;
        while bench.drive().is_enabled() {
            bench.turn();
            if bench.drive().velocity().abs() < 500.0 {
                stood_ns = stood_ns.or(Some(bench.now_ns));
            }
            assert!(bench.now_ns < stale_ns + 1_000 * MS);
        }
        let passed_ms = (stood_ns.unwrap() - stale_ns) / MS;
        assert!((100..350).contains(&passed_ms), "it stands after {passed_ms} ms");
        // It does not follow again by itself.
        bench.run(1_000, |_| (OffCycleWish::Follow, 0.9, 0.0));
        assert!(!bench.drive().is_enabled());
        assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
        let here = bench.position();
        bench.run(100, |_| (OffCycleWish::Stop, here, 0.0));
        bench.run(1_500, |_| (OffCycleWish::Follow, here, 0.0));
        assert_eq!(bench.state(), DriveState::OperationEnabled);
    }

    #[test]
    fn a_fault_is_reported_with_its_code_and_cleared_when_that_is_wished() {
        let mut bench = Bench::following();
        bench.drive().inject(ModbusDriveFault::Code(0x2310));
        bench.run(300, |_| (OffCycleWish::Follow, 0.25, 0.0));
        let (_, report) = *bench.reports.last().unwrap();
        assert_eq!((report.state, report.error_code), (DriveState::Fault, 0x2310));
        bench.run(500, |_| (OffCycleWish::Stop, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::Fault);
        bench.run(500, |_| (OffCycleWish::ClearFaults, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
        assert_eq!(bench.written.iter().filter(|register| **register == 0x00F6).count(), 1);
        bench.run(1_500, |_| (OffCycleWish::Follow, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::OperationEnabled);
    }

    #[test]
    fn a_drive_that_has_lost_its_torque_is_reported_and_not_enabled_again() {
        let mut bench = Bench::following();
        bench.drive().inject(ModbusDriveFault::TorqueOff);
        bench.run(1_000, |_| (OffCycleWish::Follow, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::ReadyToSwitchOn);
        assert!(!bench.drive().is_enabled());
    }

    #[test]
    fn a_cut_line_ends_the_reports_and_the_communication_time_out_stops_the_joint() {
        let mut bench = Bench::following();
        bench.line.disturb(Disturbance { is_cut: true, ..Disturbance::default() }, 0);
        let reports = bench.reports.len();
        bench.run(1_000, |time_s| (OffCycleWish::Follow, 0.25 + 0.5 * time_s, 0.5));
        assert!(bench.reports.len() <= reports + 1);
        assert_eq!(bench.drive().fault(), 0x0FA2);
        assert!(bench.follower.lost_requests() > 5);
        bench.line.disturb(Disturbance::default(), 0);
        bench.run(500, |_| (OffCycleWish::Stop, 0.25, 0.0));
        assert_eq!(bench.state(), DriveState::Fault);
    }

    #[test]
    fn a_noisy_line_costs_turns_and_no_motion() {
        let mut bench = Bench::following();
        let noise = Disturbance { wrong_per_million: 1_500, lost_per_million: 500, is_cut: false };
        bench.line.disturb(noise, 7);
        let mut worst: f64 = 0.0;
        for _ in 0..10 {
            bench.run(1_000, |_| (OffCycleWish::Follow, 0.25, 0.0));
            worst = worst.max((bench.position() - 0.25).abs());
        }
        assert!(worst < 0.01, "{worst} rad");
        assert!(bench.follower.lost_requests() > 10);
    }

    #[test]
    fn a_target_that_is_no_number_commands_the_velocity_0() {
        let mut bench = Bench::following();
        bench.run(500, |_| (OffCycleWish::Follow, f64::NAN, f64::INFINITY));
        assert_eq!(bench.drive().velocity(), 0.0);
    }
}
