//! An axis that follows the reference of its group at its own rate: velocity set-points and reads, one request at a time.
//!
//! ```text
//! Off ── Preparing ── Enabling ── Settling ── Following
//!  │                                              │  the wish ends: Disabling
//!  └───────────── Disabling ──── Stopping ────────┘  the set-points are stale, the drive was silent
//! ```
//!
//! The drive knows nothing of its controller, and goes on with the last set-point if it is gone. So the follower stops it in
//! control as soon as the set-points are stale, and disables it at rest; it is enabled only while its group is. A reply says neither what it answers nor whether the drive is
//! enabled: one that is not to be is told so again and again, and one that shows an error is disabled before that counts.

use takt_rt::{DriveState, Frame, Nanoseconds, OffCycleReport};
use takt_wire::erob_can::client::{Answer, RequestClient, RequestError, RequestFailure, RequestTiming};
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::frame::Request;
use takt_wire::frame_time::{FrameShape, worst_case_bits};

use crate::config::Axis;
use crate::family::commission::{CommandValue, TargetDrive};
use crate::family::erob::following::{self, LOST_NS, STALE_NS, STEEPER};
use crate::family::erob::motion::OperatingMode;
use crate::family::erob::{AGAIN_NS, ENABLING_NS, STANDING};
use crate::family::{OffCycleBudget, OffCycleDrive, OffCycleTarget, OffCycleWish};

/// Longest time from a request to its reply at the drive (captures of the eRunner manual).
const REPLY_NS: Nanoseconds = 1_000_000;
/// From one look of the life cycle at the drive to the next.
const LOOK_NS: Nanoseconds = 1_000_000;
/// Silence after a reply that did not come.
const SILENCE_NS: Nanoseconds = 5_000_000;
/// Requests from one report to the next: a set-point, the position, and one other reading.
const REQUESTS_PER_ROUND: u64 = 3;
/// A drive that is to be disabled is told so again after so many of them.
const ROUNDS_TO_REPETITION: usize = 8;
/// The temperature takes the place of the current once in so many of them, a multiple of four.
const ROUNDS_TO_TEMPERATURE: usize = 32;
/// A stop may take so much longer than its ramp.
const PATIENCE_NS: Nanoseconds = 500_000_000;
/// Velocity for one unit of position error: 1/s. An answer takes some 10 ms, so that this is far from where it would swing.
const GAIN: f64 = 12.0;

/// What an axis that follows asks of a bus of this bit rate, whose controller sends a service frame in each of its cycles.
pub fn budget(cycle_ns: Nanoseconds, bit_rate: u32) -> OffCycleBudget {
    // At best a request leaves at once, and its reply is seen at once; at worst each waits for the next cycle and the next look.
    let longest_ns = cycle_ns + REPLY_NS + LOOK_NS;
    let requests_per_s = 1e9 / cycle_ns.max(REPLY_NS) as f64;
    let bits: u32 = [6, 5].map(|length| worst_case_bits(FrameShape::classic(length)).nominal).iter().sum();
    OffCycleBudget {
        requests_per_s,
        report_ns: REQUESTS_PER_ROUND * longest_ns,
        bus_share: requests_per_s * f64::from(bits) / f64::from(bit_rate.max(1)),
    }
}

/// What must be written before the drive is enabled, in this order.
#[derive(Clone, Copy, Debug)]
struct Setting {
    entry: &'static Entry,
    value: i32,
    /// It is read first, and written only if it is another one: it may be locked, and a write may wear out a memory.
    is_compared: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Without torque, and ready to be enabled.
    Off,
    Preparing {
        setting: usize,
        /// True if the value in the drive is another one.
        differs: bool,
    },
    /// It is told to enable, not before this time.
    Enabling {
        from_ns: Nanoseconds,
    },
    Settling {
        until_ns: Nanoseconds,
    },
    Following,
    /// It is told to come to rest, and is waited for until then.
    Stopping {
        is_told: bool,
        until_ns: Nanoseconds,
    },
    Disabling {
        /// What it shows afterwards.
        then: Then,
    },
    /// It shows an error, or has refused to be enabled.
    Fault {
        code: u16,
        /// True if disabling was no cure for it.
        is_tried: bool,
    },
    /// It was disabled after an error, which is read again.
    Judging,
}

impl Stage {
    const fn may_have_torque(self) -> bool {
        match self {
            Self::Enabling { .. }
            | Self::Settling { .. }
            | Self::Following
            | Self::Stopping { .. }
            | Self::Disabling { .. } => true,
            Self::Off | Self::Preparing { .. } | Self::Fault { .. } | Self::Judging => false,
        }
    }
}

/// What comes after the command to disable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Then {
    Off,
    /// Its error is read again: disabling ends one whose cause is gone.
    Judging,
    /// It had this error while it had torque. What was read may be the late or corrupted reply to another request.
    Fault(u16),
}

/// A reading and its time.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    value: f64,
    at_ns: Nanoseconds,
}

/// Speaks to one drive.
#[derive(Debug)]
pub struct Follower {
    drive: TargetDrive,
    velocity_limit: f64,
    deceleration: f64,
    settings: Vec<Setting>,
    client: RequestClient,
    stage: Stage,
    /// What the drive has been told last: counts/s. `None`: that is not known.
    set_point: Option<i32>,
    position: Option<Seen>,
    velocity: Seen,
    torque: f64,
    /// °C
    temperature: Option<f32>,
    continuous_current: Option<i32>,
    /// Which reading is next.
    turn: usize,
    answered_ns: Option<Nanoseconds>,
}

impl Follower {
    /// For the drive of an axis, whose controller has this cycle. `None` if the units of the axis cannot be converted; a checked
    /// configuration always has valid ones.
    pub fn new(axis: &Axis, cycle_ns: Nanoseconds) -> Option<Self> {
        let drive = TargetDrive::of(axis).ok()?;
        let ramp = |limit: f64| {
            i32::try_from(drive.acceleration_raw(CommandValue::Joint(STEEPER * limit))).unwrap_or(i32::MAX)
        };
        let (faster, slower) = (ramp(axis.limits.acceleration), ramp(axis.limits.deceleration));
        let write = |entry, value| Setting { entry, value, is_compared: false };
        let settings = vec![
            write(&entries::MOTOR_ENABLE, 0),
            Setting {
                entry: &entries::OPERATING_MODE,
                value: OperatingMode::Velocity as i32,
                is_compared: true,
            },
            Setting { entry: &entries::CONTROL_SOURCE, value: 0, is_compared: true },
            write(&entries::ANALOGUE_TYPE, 0),
            // The motor turns at once when it is enabled, if this is not 0.
            write(&entries::SET_POINT, 0),
            write(&entries::PROFILE_ACCELERATION, faster),
            write(&entries::PROFILE_DECELERATION, slower),
        ];
        let timing = RequestTiming {
            timeout_ns: 2 * (cycle_ns + REPLY_NS + LOOK_NS),
            silence_ns: SILENCE_NS,
            read_retries: 0,
        };
        Some(Self {
            velocity_limit: axis.limits.velocity,
            deceleration: STEEPER * axis.limits.deceleration,
            settings,
            client: RequestClient::new(axis.node, timing),
            stage: Stage::Off,
            set_point: None,
            position: None,
            velocity: Seen::default(),
            torque: 0.0,
            temperature: None,
            continuous_current: None,
            turn: 0,
            answered_ns: None,
            drive,
        })
    }

    /// Evaluates what a request has brought. Returns a report if it was the position.
    fn take(&mut self, now_ns: Nanoseconds, outcome: Result<(Request, Answer), RequestError>) -> bool {
        match outcome {
            Ok((request, answer)) => {
                let was_lost = self.answered_ns.is_some_and(|at_ns| now_ns.saturating_sub(at_ns) > LOST_NS);
                self.answered_ns = Some(now_ns);
                if was_lost && self.is_leading() {
                    self.stop(now_ns);
                }
                match answer {
                    Answer::Value(value) => self.take_value(now_ns, request, value),
                    Answer::Done => {
                        self.take_done(now_ns, request);
                        false
                    }
                }
            }
            Err(error) => {
                self.take_failure(now_ns, &error);
                false
            }
        }
    }

    fn take_value(&mut self, now_ns: Nanoseconds, request: Request, value: i32) -> bool {
        if let Stage::Preparing { setting, differs: false } = self.stage
            && let Some(own) = self.settings.get(setting)
            && own.entry.address == request.address()
        {
            let differs = own.value != value;
            let setting = if differs { setting } else { setting + 1 };
            self.stage = Stage::Preparing { setting, differs };
            return false;
        }
        let address = request.address();
        let seen = |value| Seen { value, at_ns: now_ns };
        if address == entries::ACTUAL_POSITION.address {
            self.position = Some(seen(self.drive.position(value.into())));
            return true;
        }
        if address == entries::ACTUAL_VELOCITY.address {
            self.velocity = seen(self.drive.velocity(value.into()));
            if matches!(self.stage, Stage::Stopping { is_told: true, .. })
                && value.saturating_abs() <= STANDING
            {
                self.stage = Stage::Disabling { then: Then::Off };
            }
        } else if address == entries::CONTINUOUS_CURRENT.address {
            self.continuous_current = Some(value);
        } else if address == entries::MOTOR_CURRENT.address {
            self.torque = self.torque_of(value);
        } else if address == entries::TEMPERATURE.address {
            self.temperature = Some(value as f32);
        } else if address == entries::ERROR_CODE.address {
            self.take_error(value as u16);
        }
        false
    }

    /// The torque at the joint by the motor current, if the axis says its rated torque: that of the continuous current.
    fn torque_of(&self, current_ma: i32) -> f64 {
        let continuous = f64::from(self.continuous_current.unwrap_or(0));
        let rated = self.drive.rated_torque.filter(|_| continuous > 0.0).unwrap_or(0.0);
        f64::from(current_ma) * rated / continuous.max(1.0) * self.drive.scale.resolution().signum()
    }

    fn take_error(&mut self, code: u16) {
        self.stage = match (self.stage, code) {
            (Stage::Judging | Stage::Fault { is_tried: true, .. }, 0) => Stage::Off,
            (Stage::Judging | Stage::Fault { is_tried: true, .. }, code) => {
                Stage::Fault { code, is_tried: true }
            }
            (stage, 0) => stage,
            (stage, code) if stage.may_have_torque() => Stage::Disabling { then: Then::Fault(code) },
            (_, code) => Stage::Fault { code, is_tried: false },
        };
    }

    fn take_done(&mut self, now_ns: Nanoseconds, request: Request) {
        if request.address() == entries::SET_POINT.address {
            self.set_point = request.value();
        }
        self.stage = match self.stage {
            Stage::Preparing { setting, .. } => Stage::Preparing { setting: setting + 1, differs: false },
            Stage::Enabling { .. } => Stage::Settling { until_ns: now_ns.saturating_add(ENABLING_NS) },
            Stage::Stopping { is_told: false, until_ns } if request.value() == Some(0) => {
                Stage::Stopping { is_told: true, until_ns }
            }
            Stage::Disabling { then } if request.address() == entries::MOTOR_ENABLE.address => match then {
                Then::Off => Stage::Off,
                Then::Judging => Stage::Judging,
                Then::Fault(code) => Stage::Fault { code, is_tried: false },
            },
            stage => stage,
        };
    }

    fn take_failure(&mut self, now_ns: Nanoseconds, error: &RequestError) {
        let RequestFailure::Refused(code) = error.failure else {
            // Whether a write was carried out is not known: the set-point is sent again.
            self.set_point = None;
            return;
        };
        self.answered_ns = Some(now_ns);
        if matches!(error.request, Request::Read(_)) {
            return;
        }
        self.stage = match (self.stage, code) {
            (Stage::Enabling { .. }, Some(code)) if code.is_of_power_up() => {
                Stage::Enabling { from_ns: now_ns.saturating_add(AGAIN_NS) }
            }
            (Stage::Preparing { .. } | Stage::Enabling { .. }, code) => {
                Stage::Disabling { then: Then::Fault(code.map_or(UNKNOWN_REFUSAL, |code| code.0)) }
            }
            (stage, _) => stage,
        };
    }

    /// Stops the drive in control.
    fn stop(&mut self, now_ns: Nanoseconds) {
        let ramp_ns = (1e9 * self.velocity.value.abs() / self.deceleration.max(1e-9)) as Nanoseconds;
        let until_ns = now_ns.saturating_add(ramp_ns).saturating_add(PATIENCE_NS);
        self.stage = Stage::Stopping { is_told: false, until_ns };
    }

    /// Returns `true` if the drive is led to its set-points, or is about to be.
    const fn is_leading(&self) -> bool {
        matches!(self.stage, Stage::Enabling { .. } | Stage::Settling { .. } | Stage::Following)
    }

    /// Goes on to the stage that is wanted.
    fn advance(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) {
        let is_stale = now_ns.saturating_sub(target.at_ns) > STALE_NS;
        let follows = target.wish.grants_torque() && !is_stale;
        let is_enabling = target.wish == OffCycleWish::Enable && !is_stale;
        self.stage = match self.stage {
            Stage::Off if is_enabling && self.position.is_some() => {
                Stage::Preparing { setting: 0, differs: false }
            }
            Stage::Preparing { setting, .. } if follows && setting >= self.settings.len() => {
                Stage::Enabling { from_ns: now_ns }
            }
            Stage::Preparing { .. } if !follows => Stage::Disabling { then: Then::Off },
            Stage::Enabling { .. } | Stage::Settling { .. } | Stage::Following if is_stale => {
                return self.stop(now_ns);
            }
            Stage::Enabling { .. } | Stage::Settling { .. } | Stage::Following if !follows => {
                Stage::Disabling { then: Then::Off }
            }
            Stage::Settling { until_ns } if now_ns >= until_ns => Stage::Following,
            Stage::Stopping { until_ns, .. } if now_ns >= until_ns => Stage::Disabling { then: Then::Off },
            Stage::Fault { is_tried: false, .. } if target.wish == OffCycleWish::ClearFaults => {
                Stage::Disabling { then: Then::Judging }
            }
            Stage::Fault { code, .. } if target.wish != OffCycleWish::ClearFaults => {
                Stage::Fault { code, is_tried: false }
            }
            stage => stage,
        };
    }

    /// The next request.
    fn next(&mut self, now_ns: Nanoseconds, target: &OffCycleTarget) -> Request {
        let write = |entry: &Entry, value| Request::Write(entry.address, value);
        match self.stage {
            Stage::Preparing { setting, differs } => match self.settings.get(setting) {
                Some(own) if own.is_compared && !differs => Request::Read(own.entry.address),
                Some(own) => write(own.entry, own.value),
                None => self.reading(),
            },
            Stage::Enabling { from_ns } if now_ns >= from_ns => write(&entries::MOTOR_ENABLE, 1),
            Stage::Following if self.turn.is_multiple_of(REQUESTS_PER_ROUND as usize) => {
                let set_point = self.set_point_for(now_ns, target);
                if self.set_point == Some(set_point) {
                    return self.reading();
                }
                self.turn += 1;
                write(&entries::SET_POINT, set_point)
            }
            Stage::Stopping { is_told: false, .. } => write(&entries::SET_POINT, 0),
            Stage::Stopping { is_told: true, .. } if !self.turn.is_multiple_of(2) => {
                self.turn += 1;
                Request::Read(entries::ACTUAL_VELOCITY.address)
            }
            Stage::Disabling { .. } => write(&entries::MOTOR_ENABLE, 0),
            // Again and again: nothing in a reply shows that it is one to this command.
            Stage::Off | Stage::Fault { .. }
                if target.wish != OffCycleWish::Observe
                    && self.turn.is_multiple_of(REQUESTS_PER_ROUND as usize * ROUNDS_TO_REPETITION) =>
            {
                self.turn += 1;
                write(&entries::MOTOR_ENABLE, 0)
            }
            Stage::Judging => Request::Read(entries::ERROR_CODE.address),
            _ => self.reading(),
        }
    }

    /// The next reading: the position, and in turn one of the others.
    fn reading(&mut self) -> Request {
        let current = if self.continuous_current.is_some() {
            &entries::MOTOR_CURRENT
        } else {
            &entries::CONTINUOUS_CURRENT
        };
        let place = self.turn % REQUESTS_PER_ROUND as usize;
        // Without a set-point its place in the round is passed over.
        self.turn += if place == 0 { 2 } else { 1 };
        if place < 2 {
            return Request::Read(entries::ACTUAL_POSITION.address);
        }
        let round = self.turn / REQUESTS_PER_ROUND as usize;
        let slow =
            if (round + 1).is_multiple_of(ROUNDS_TO_TEMPERATURE) { &entries::TEMPERATURE } else { current };
        let others = [&entries::ACTUAL_VELOCITY, &entries::ERROR_CODE, &entries::ACTUAL_VELOCITY, slow];
        Request::Read(others[round % others.len()].address)
    }

    /// The velocity that leads the joint to the reference: counts/s.
    fn set_point_for(&self, now_ns: Nanoseconds, target: &OffCycleTarget) -> i32 {
        let Some(seen) = self.position else { return 0 };
        let seen = following::Seen { position: seen.value, velocity: self.velocity.value, at_ns: seen.at_ns };
        let velocity = following::velocity(now_ns, target, seen, GAIN, self.velocity_limit);
        // A float that is too large becomes the largest integer.
        (velocity / self.drive.scale.velocity_from_drive(1)).round() as i32
    }

    fn report(&self) -> Option<OffCycleReport> {
        let (state, error_code) = match self.stage {
            Stage::Following => (DriveState::OperationEnabled, 0),
            Stage::Enabling { .. } | Stage::Settling { .. } | Stage::Disabling { then: Then::Off } => {
                (DriveState::SwitchedOn, 0)
            }
            Stage::Disabling { then: Then::Fault(code) } => (DriveState::FaultReactionActive, code),
            Stage::Stopping { .. } | Stage::Disabling { .. } => (DriveState::QuickStopActive, 0),
            Stage::Fault { code, .. } => (DriveState::Fault, code),
            Stage::Judging => (DriveState::FaultReactionActive, 0),
            Stage::Off | Stage::Preparing { .. } => (DriveState::ReadyToSwitchOn, 0),
        };
        let position = self.position?.value;
        Some(OffCycleReport {
            state,
            position,
            velocity: self.velocity.value,
            torque: self.torque,
            error_code,
            temperature: self.temperature,
        })
    }
}

/// Shown when a drive refuses to be enabled, and says no reason.
pub const UNKNOWN_REFUSAL: u16 = 0xFFFF;

impl OffCycleDrive for Follower {
    fn receive(&mut self, _: Nanoseconds, frame: &Frame) {
        self.client.receive(frame);
    }

    fn poll(
        &mut self,
        now_ns: Nanoseconds,
        target: &OffCycleTarget,
        send: &mut dyn FnMut(Frame),
    ) -> Option<OffCycleReport> {
        let mut report = None;
        loop {
            if let Some(frame) = self.client.poll(now_ns) {
                send(frame);
            }
            let Some((request, outcome)) = self.client.take_answered() else {
                if self.client.is_free() {
                    self.advance(now_ns, target);
                    let request = self.next(now_ns, target);
                    // It is free: one request at a time.
                    let _ = self.client.start(request);
                    continue;
                }
                return report;
            };
            if self.take(now_ns, outcome.map(|answer| (request, answer))) {
                report = self.report();
            }
        }
    }
}
