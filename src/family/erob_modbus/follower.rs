//! Leads one drive by velocity control along set-points that come from outside: which request is next, and what follows from its
//! outcome. The line of the drive carries the requests, see [`line`](super::line).
//!
//! ```text
//! group enables ──▶ Preparing ──▶ Enabled (500 ms) ──▶ Following ──┐ stale set-points, a drive that was silent
//!        ▲                                                         ▼
//!       Off ◀── Disarming ◀── Disabling ◀────────────────────── Stopping
//! ```
//!
//! A round has three requests: the set-point of the velocity, a read of the position, and another read. The velocity is that of the
//! reference and a correction of the position. When the set-points are stale, the joint is stopped and disabled. The drive is enabled only
//! while its group is. It watches its master (register 0x0002) from before it is enabled until it is disabled.

mod seen;

use takt_rt::{DriveState, Nanoseconds, OffCycleReport};

use super::fault_code::FaultCode;
use super::register::Register;
use super::registers;
use crate::family::erob::following::{self, LOST_NS, STALE_NS};
use crate::family::erob::{AGAIN_NS, ENABLING_NS, STANDING};
use crate::family::{OffCycleTarget, OffCycleWish};
use seen::{Reading, Seen};
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{RegisterRange, RegisterValues, Request, Values};
use takt_wire::modbus::master::{Answer, RequestError, RequestFailure};

/// A joint that does not come to rest in this time is disabled all the same.
const STOPPING_NS: Nanoseconds = 2_000_000_000;
/// Once in so many readings beside the position, the temperature is read.
const OTHERS_TO_TEMPERATURE: usize = 32;
/// A drive that is away, and did not reply so often in a row, is asked less often, so that the other ones of its line have their turns. One
/// that has replied lately is not: noise may cost three replies in a row, and the drive itself waits for its master.
const SILENT_AFTER: u32 = 3;
/// From one request to a silent drive to the next.
const SILENT_NS: Nanoseconds = 500_000_000;

/// What a follower is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowerParameters {
    /// Counts of the drive for one radian (metre) of the joint; negative when the counts go down.
    pub counts_per_unit: f64,
    /// The counts at the joint's zero.
    pub zero_counts: f64,
    /// The highest velocity that is commanded: rad/s (m/s).
    pub velocity_limit: f64,
    /// How fast the drive becomes faster: rad/s² (m/s²).
    pub acceleration: f64,
    /// How fast the drive becomes slower: rad/s² (m/s²).
    pub deceleration: f64,
    /// The velocity for a position error of one unit: 1/s. With a round of 20 ms, 5 to 10 is steady.
    pub position_gain: f64,
    /// The torque of the joint at the continuous current of the drive: N·m (N); `None` where it is not known.
    pub rated_torque: Option<f64>,
    /// What is written into register 0x0002 before enabling: how long (ms) the drive waits for its master; 0 for ever.
    pub communication_timeout_ms: u16,
}

/// How far the drive has been led.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    /// Without torque, and told nothing.
    Off,
    /// The requests before enabling are under way: this one is next, not before a time.
    Preparing { step: usize, from_ns: Nanoseconds },
    /// It was enabled at this time.
    Enabled { since_ns: Nanoseconds },
    /// It gets velocities.
    Following,
    /// It gets the velocity 0, since this time.
    Stopping { since_ns: Nanoseconds },
    /// It is told to disable until it has confirmed.
    Disabling,
    /// It is told that it need not watch its master any more.
    Disarming,
}

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Prepare,
    /// Whether the drive has kept the communication time-out.
    ReadBack,
    Enable,
    Command,
    Disable,
    Disarm,
    ClearFault,
    Read(Reading),
}

/// The requests of a round, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Turn {
    /// A set-point or a command, if there is one.
    #[default]
    Write,
    Place,
    /// Another reading than the position.
    Other,
}

/// Leads one drive.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    parameters: FollowerParameters,
    life: Life,
    /// What the drive has refused before it was enabled. It is shown as a fault until it is cleared.
    refusal: Option<FaultCode>,
    under_way: Option<Purpose>,
    turn: Turn,
    /// Counts the readings other than that of the position.
    others: usize,
    seen: Seen,
    /// The drive has lost its torque, and has not said why: that is read before it is reported.
    asks_why: bool,
    is_clearing_wished: bool,
    clear_from_ns: Nanoseconds,
    answered_ns: Option<Nanoseconds>,
    /// Requests without a reply in a row, and when the drive is asked again.
    silent: u32,
    ask_from_ns: Nanoseconds,
}

impl Follower {
    /// A follower of a drive of which nothing is known.
    pub const fn new(parameters: FollowerParameters) -> Self {
        Self {
            parameters,
            life: Life::Off,
            refusal: None,
            under_way: None,
            turn: Turn::Write,
            others: 0,
            seen: Seen::NOTHING,
            asks_why: false,
            is_clearing_wished: false,
            clear_from_ns: 0,
            answered_ns: None,
            silent: 0,
            ask_from_ns: 0,
        }
    }

    /// Returns `true` if the drive has no torque, and does not watch for its master, as far as this side knows.
    pub const fn is_settled(&self) -> bool {
        matches!(self.life, Life::Off)
    }

    /// The next request, whose outcome is to be given to [`Follower::take`]; `None` if the drive is not to be asked now.
    pub fn next(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) -> Option<Request> {
        self.go_on(now_ns, target);
        if now_ns < self.ask_from_ns {
            return None;
        }
        let turn = self.turn;
        self.turn = match turn {
            Turn::Write => Turn::Place,
            Turn::Place => Turn::Other,
            Turn::Other => Turn::Write,
        };
        let (purpose, request) = match turn {
            Turn::Write => match self.write(now_ns, target) {
                Some(write) => write,
                None => return self.next(now_ns, target),
            },
            Turn::Place => read(Reading::Place)?,
            Turn::Other => {
                let other = self.other_reading();
                read(other)?
            }
        };
        self.under_way = Some(purpose);
        Some(request)
    }

    fn other_reading(&mut self) -> Reading {
        let needs_rating =
            self.parameters.rated_torque.is_some() && self.seen.continuous_milliamperes.is_none();
        self.others = self.others.wrapping_add(1);
        if self.asks_why || !self.seen.is_fault_known {
            Reading::Fault
        } else if !self.seen.is_speed_known {
            Reading::Speed
        } else if needs_rating && self.others.is_multiple_of(8) {
            Reading::Rating
        } else if self.others.is_multiple_of(OTHERS_TO_TEMPERATURE) {
            Reading::Temperature
        } else if self.others.is_multiple_of(2) {
            Reading::Fault
        } else {
            Reading::Speed
        }
    }

    /// What follows from the wish, from the age of the target, and from what the drive shows.
    fn go_on(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) {
        let is_stale = now_ns.saturating_sub(target.at_ns) > STALE_NS;
        let is_lost = self.silent > 0 && self.answered_ns.is_some() && self.is_away(now_ns);
        let before = self.life;
        if target.wish == OffCycleWish::ClearFaults {
            // It may not be wished any more when there is room for the request.
            self.is_clearing_wished = self.seen.fault != 0;
            self.refusal = None;
        }
        let is_told = !matches!(self.life, Life::Off | Life::Disabling | Life::Disarming);
        if is_told && !target.wish.grants_torque() && !is_stale {
            self.life = Life::Disabling;
        }
        match self.life {
            Life::Off
                if target.wish == OffCycleWish::Enable
                    && !is_stale
                    && self.seen.is_whole()
                    && self.seen.fault == 0
                    && self.refusal.is_none() =>
            {
                self.life = Life::Preparing { step: 0, from_ns: now_ns };
            }
            Life::Preparing { .. } | Life::Enabled { .. }
                if is_stale || is_lost || self.seen.fault != 0 || self.refusal.is_some() =>
            {
                self.life = Life::Disabling;
            }
            Life::Enabled { since_ns } if now_ns.saturating_sub(since_ns) >= ENABLING_NS => {
                self.life = Life::Following;
            }
            Life::Following if self.seen.fault != 0 || self.seen.is_motor_off => {
                self.life = Life::Disabling;
            }
            Life::Following if is_stale || is_lost => {
                self.life = Life::Stopping { since_ns: now_ns };
            }
            Life::Stopping { since_ns } => {
                let has_taken_long = now_ns.saturating_sub(since_ns) > STOPPING_NS;
                let stands =
                    self.seen.speed_at_ns > since_ns && self.seen.velocity.abs() <= f64::from(STANDING);
                if has_taken_long || stands {
                    self.life = Life::Disabling;
                }
            }
            Life::Off
            | Life::Preparing { .. }
            | Life::Enabled { .. }
            | Life::Following
            | Life::Disabling
            | Life::Disarming => {}
        }
        if self.life != before && matches!(self.life, Life::Stopping { .. } | Life::Disabling) {
            // It does not wait for the rest of the round.
            self.turn = Turn::Write;
        }
    }

    /// The writes before enabling. The one that the drive watches its master by is the last.
    fn preparation(&self) -> [(Register, i64); 6] {
        let rate = |rate: f64| self.counts(rate).abs().clamp(1.0, f64::from(u32::MAX)) as i64;
        [
            (registers::OPERATION_MODE, 2),
            (registers::CONTROL_SOURCE, 0),
            (registers::PROFILE_ACCELERATION, rate(self.parameters.acceleration)),
            (registers::PROFILE_DECELERATION, rate(self.parameters.deceleration)),
            // It acts as soon as the motor is enabled.
            (registers::TARGET_VELOCITY, 0),
            (registers::COMMUNICATION_TIMEOUT, self.parameters.communication_timeout_ms.into()),
        ]
    }

    fn write(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) -> Option<(Purpose, Request)> {
        let (purpose, register, value) = match self.life {
            Life::Preparing { step, from_ns } if now_ns >= from_ns => {
                let preparation = self.preparation();
                match preparation.get(step) {
                    Some((register, value)) => (Purpose::Prepare, *register, *value),
                    None if step == preparation.len() => {
                        let timeout = RegisterRange::new(registers::COMMUNICATION_TIMEOUT.address, 1)?;
                        return Some((Purpose::ReadBack, Request::Read(timeout)));
                    }
                    None => (Purpose::Enable, registers::MOTOR_ENABLE, 1),
                }
            }
            Life::Following => (Purpose::Command, registers::TARGET_VELOCITY, self.velocity(now_ns, target)),
            Life::Stopping { .. } => (Purpose::Command, registers::TARGET_VELOCITY, 0),
            Life::Disabling => (Purpose::Disable, registers::MOTOR_ENABLE, 0),
            Life::Disarming => (Purpose::Disarm, registers::COMMUNICATION_TIMEOUT, 0),
            Life::Off if self.is_clearing_wished && self.seen.fault != 0 && now_ns >= self.clear_from_ns => {
                self.is_clearing_wished = false;
                self.clear_from_ns = now_ns.saturating_add(AGAIN_NS);
                (Purpose::ClearFault, registers::CLEAR_FAULT, 1)
            }
            Life::Off | Life::Preparing { .. } | Life::Enabled { .. } => return None,
        };
        let words = register.encode(value).ok()?;
        let request = match words.as_slice() {
            [word] => Request::WriteOne { register: register.address, value: *word },
            words => Request::WriteSeveral(RegisterValues::new(register.address, words)?),
        };
        Some((purpose, request))
    }

    /// The velocity for the drive: counts/s.
    fn velocity(&self, now_ns: Nanoseconds, target: &OffCycleTarget) -> i64 {
        let seen = following::Seen {
            position: self.position(),
            velocity: self.seen.velocity / self.parameters.counts_per_unit,
            at_ns: self.seen.at_ns,
        };
        let FollowerParameters { position_gain, velocity_limit, .. } = self.parameters;
        let velocity = following::velocity(now_ns, target, seen, position_gain, velocity_limit);
        self.counts(velocity).clamp(f64::from(i32::MIN), f64::from(i32::MAX)).round() as i64
    }

    fn counts(&self, units: f64) -> f64 {
        units * self.parameters.counts_per_unit
    }

    /// Where the joint was seen: rad (m).
    fn position(&self) -> f64 {
        (self.seen.position - self.parameters.zero_counts) / self.parameters.counts_per_unit
    }

    /// Takes the outcome of the last request. Returns what the drive has said, if that is news.
    pub fn take(
        &mut self,
        now_ns: Nanoseconds,
        outcome: Result<Answer, RequestError>,
    ) -> Option<OffCycleReport> {
        let purpose = self.under_way.take()?;
        match outcome {
            Ok(answer) => {
                self.note_answer(now_ns);
                match (purpose, answer) {
                    (Purpose::Read(reading), Answer::Values(values)) => {
                        return self.take_reading(now_ns, reading, &values);
                    }
                    (Purpose::ReadBack, Answer::Values(values)) => self.take_timeout(&values),
                    (purpose, _) => self.confirm(now_ns, purpose),
                }
            }
            Err(RequestError { failure: RequestFailure::Refused(code), .. }) => {
                self.note_answer(now_ns);
                self.take_refusal(now_ns, purpose, code);
            }
            Err(_) => {
                self.silent = self.silent.saturating_add(1);
                if self.silent >= SILENT_AFTER && self.is_away(now_ns) {
                    self.ask_from_ns = now_ns.saturating_add(SILENT_NS);
                }
            }
        }
        None
    }

    /// Returns true if the drive has not replied yet, or not within [`LOST_NS`].
    fn is_away(&self, now_ns: Nanoseconds) -> bool {
        self.answered_ns.is_none_or(|at_ns| now_ns.saturating_sub(at_ns) > LOST_NS)
    }

    fn note_answer(&mut self, now_ns: Nanoseconds) {
        (self.answered_ns, self.silent) = (Some(now_ns), 0);
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
            (Purpose::Disable, Life::Disabling) => Life::Disarming,
            (Purpose::Disarm, Life::Disarming) => Life::Off,
            (_, life) => life,
        };
    }

    /// Returns `true` if the drive has kept the communication time-out decides whether it is enabled.
    fn take_timeout(&mut self, values: &Values) {
        let Life::Preparing { step, from_ns } = self.life else { return };
        if values.as_slice() == [self.parameters.communication_timeout_ms] {
            self.life = Life::Preparing { step: step + 1, from_ns };
        } else {
            self.refusal = Some(FaultCode::TIMEOUT_NOT_KEPT);
        }
    }

    fn take_refusal(&mut self, now_ns: Nanoseconds, purpose: Purpose, code: ExceptionCode) {
        match (purpose, self.life) {
            // A drive that was switched on just now is busy.
            (Purpose::Enable | Purpose::Prepare, Life::Preparing { step, .. })
                if code == ExceptionCode::BUSY =>
            {
                self.life = Life::Preparing { step, from_ns: now_ns.saturating_add(AGAIN_NS) };
            }
            (Purpose::Enable | Purpose::Prepare | Purpose::ReadBack, Life::Preparing { .. }) => {
                // If it shows a fault, that is the reason.
                self.refusal = Some(FaultCode::REFUSED).filter(|_| self.seen.fault == 0);
                self.asks_why = true;
            }
            // A drive without this register cannot be disarmed, and was never armed.
            (Purpose::Disarm, Life::Disarming) => self.life = Life::Off,
            _ => {}
        }
    }

    fn take_reading(
        &mut self,
        now_ns: Nanoseconds,
        reading: Reading,
        values: &Values,
    ) -> Option<OffCycleReport> {
        self.seen.take(now_ns, reading, values)?;
        match reading {
            Reading::Fault => std::mem::take(&mut self.asks_why).then(|| self.report()),
            Reading::Place => {
                let has_torque = matches!(self.life, Life::Following | Life::Stopping { .. });
                self.asks_why |= has_torque && self.seen.is_motor_off && self.seen.fault == 0;
                (self.seen.is_whole() && !self.asks_why).then(|| self.report())
            }
            Reading::Speed | Reading::Rating | Reading::Temperature => None,
        }
    }

    fn report(&self) -> OffCycleReport {
        let Seen { velocity, milliamperes, continuous_milliamperes, fault, is_motor_off, .. } = self.seen;
        let shown = if fault == 0 { self.refusal.map_or(0, |refusal| refusal.0) } else { fault };
        let state = match self.life {
            _ if shown != 0 => DriveState::Fault,
            Life::Following if !is_motor_off => DriveState::OperationEnabled,
            Life::Stopping { .. } if !is_motor_off => DriveState::QuickStopActive,
            // The request that enables it is under way, or the next one, or the one that disables it is not confirmed.
            Life::Enabled { .. } | Life::Disabling => DriveState::SwitchedOn,
            Life::Preparing { step, .. } if step > self.preparation().len() => DriveState::SwitchedOn,
            Life::Off
            | Life::Preparing { .. }
            | Life::Following
            | Life::Stopping { .. }
            | Life::Disarming => DriveState::ReadyToSwitchOn,
        };
        let direction = 1f64.copysign(self.parameters.counts_per_unit);
        let per_milliampere = match (self.parameters.rated_torque, continuous_milliamperes) {
            (Some(rated), Some(continuous)) if continuous > 0.0 => rated / continuous,
            _ => 0.0,
        };
        OffCycleReport {
            state,
            position: self.position(),
            velocity: velocity / self.parameters.counts_per_unit,
            torque: direction * milliamperes * per_milliampere,
            error_code: shown,
            temperature: self.seen.temperature,
        }
    }
}

fn read(reading: Reading) -> Option<(Purpose, Request)> {
    Some((Purpose::Read(reading), Request::Read(reading.range()?)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_wire::modbus::frame::SlaveAddress;

    const MS: Nanoseconds = 1_000_000;
    const PARAMETERS: FollowerParameters = FollowerParameters {
        counts_per_unit: 1_000.0,
        zero_counts: 0.0,
        velocity_limit: 1.0,
        acceleration: 1.0,
        deceleration: 1.0,
        position_gain: 8.0,
        rated_torque: None,
        communication_timeout_ms: 500,
    };

    /// A drive that replies to every request at once, without a fault. `refuses` and `kept_ms` are what is wrong with it.
    struct Drive {
        follower: Follower,
        now_ns: Nanoseconds,
        wish: OffCycleWish,
        kept_ms: u16,
        refuses: Option<(u16, ExceptionCode)>,
        written: Vec<u16>,
        was_enabled: bool,
        last: Option<OffCycleReport>,
    }

    impl Drive {
        fn new() -> Self {
            let follower = Follower::new(PARAMETERS);
            let (written, last) = (vec![], None);
            let (now_ns, wish) = (MS, OffCycleWish::Enable);
            Self { follower, now_ns, wish, kept_ms: 500, refuses: None, written, was_enabled: false, last }
        }

        fn reply(&mut self, request: Request) -> Result<Answer, RequestError> {
            let register = match &request {
                Request::Read(range) if range.start() == registers::COMMUNICATION_TIMEOUT.address => {
                    return Ok(Answer::Values(vec![self.kept_ms]));
                }
                Request::Read(range) => return Ok(Answer::Values(vec![0; range.count().into()])),
                Request::WriteOne { register, .. } => *register,
                Request::WriteSeveral(write) => write.start(),
            };
            self.was_enabled |= request == Request::WriteOne { register: 0x00F0, value: 1 };
            self.written.push(register);
            match self.refuses.filter(|(refused, _)| *refused == register) {
                Some((_, code)) => {
                    let slave = SlaveAddress::new(1).unwrap();
                    Err(RequestError { slave, request, failure: RequestFailure::Refused(code) })
                }
                None => Ok(Answer::Written),
            }
        }

        /// So many requests, one every 5 ms.
        fn run(&mut self, requests: usize) -> OffCycleReport {
            for _ in 0..requests {
                self.now_ns += 5 * MS;
                let target =
                    OffCycleTarget { wish: self.wish, at_ns: self.now_ns, ..OffCycleTarget::default() };
                let Some(request) = self.follower.next(self.now_ns, &target) else { continue };
                let outcome = self.reply(request);
                self.last = self.follower.take(self.now_ns, outcome).or(self.last);
            }
            self.last.unwrap()
        }
    }

    #[test]
    fn a_drive_that_does_not_keep_its_communication_time_out_is_not_enabled_and_says_so_until_that_is_cleared()
     {
        let mut drive = Drive { kept_ms: 0, ..Drive::new() };
        let report = drive.run(100);
        assert_eq!((report.state, report.error_code), (DriveState::Fault, FaultCode::TIMEOUT_NOT_KEPT.0));
        assert!(!drive.was_enabled, "{:?}", drive.written);
        (drive.wish, drive.kept_ms) = (OffCycleWish::ClearFaults, 500);
        assert_eq!(drive.run(20).state, DriveState::ReadyToSwitchOn);
        drive.wish = OffCycleWish::Enable;
        drive.run(60);
        assert!(drive.written.ends_with(&[0x0051, 0x0002, 0x00F0]), "{:?}", drive.written);
    }

    #[test]
    fn a_drive_that_refuses_a_setting_shows_that_as_its_fault_and_one_that_is_busy_is_asked_again() {
        let refused = Some((0x0040, ExceptionCode::ILLEGAL_VALUE));
        let mut drive = Drive { refuses: refused, ..Drive::new() };
        let report = drive.run(100);
        assert_eq!((report.state, report.error_code), (DriveState::Fault, FaultCode::REFUSED.0));
        let mut drive = Drive { refuses: Some((0x00F0, ExceptionCode::BUSY)), ..Drive::new() };
        assert_eq!(drive.run(300).state, DriveState::SwitchedOn);
        assert!(
            drive.written.iter().filter(|register| **register == 0x00F0).count() >= 3,
            "{:?}",
            drive.written
        );
    }

    #[test]
    fn a_drive_is_not_shown_without_torque_from_its_enabling_until_it_has_confirmed_that_it_is_disabled() {
        let mut drive = Drive::new();
        let mut report = drive.run(10);
        while !drive.was_enabled {
            report = drive.run(1);
        }
        drive.wish = OffCycleWish::Stop;
        let enabled = drive.written.len();
        while drive.written[enabled..] != [registers::MOTOR_ENABLE.address] {
            assert_eq!(report.state, DriveState::SwitchedOn);
            report = drive.run(1);
        }
        assert_eq!(drive.run(10).state, DriveState::ReadyToSwitchOn);
    }
}
