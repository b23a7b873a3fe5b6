//! A module that commands move, as a session with it sees it. Each protocol says it in its own way: its addresses, the writes of its
//! manual's sequences in their order, its errors.

use std::fmt;

use takt_rt::Nanoseconds;
use takt_wire::erob_can::parameter::Parameter;

use super::motion::{Motion, Stop};
use crate::family::commission::{Failure, TargetDrive};
use crate::procedure::{AxisReading, Client, ProcedureSession};

/// A session with such a module.
pub trait CommandedModule {
    /// The client of the protocol.
    type Client: Client;
    /// What its table lists.
    type Parameter: Parameter;
    /// A request that has failed.
    type Error: fmt::Display + Into<Failure>;

    /// The fault, or error: 0 for none.
    const FAULT_CODE: Self::Parameter;
    /// 1 torque, 2 velocity, 3 position.
    const OPERATING_MODE: Self::Parameter;
    /// counts; what is not 0 makes a move a relative one
    const RELATIVE_POSITION: Self::Parameter;
    /// counts/s
    const PROFILE_VELOCITY: Self::Parameter;
    /// counts/s²
    const PROFILE_ACCELERATION: Self::Parameter;
    /// counts/s²
    const PROFILE_DECELERATION: Self::Parameter;
    /// mA
    const CONTINUOUS_CURRENT: Self::Parameter;
    /// mA
    const PEAK_CURRENT: Self::Parameter;

    /// What to do about a joint that does not come to rest.
    const EMERGENCY: &'static str;

    /// The session.
    fn session(&self) -> &ProcedureSession<Self::Client>;

    /// Waits until the module answers. It reads, which changes nothing.
    fn connect(&self, target: &TargetDrive) -> impl Future<Output = Result<(), Failure>>;

    /// Reads a parameter.
    fn read(&self, parameter: &Self::Parameter) -> impl Future<Output = Result<i64, Self::Error>>;

    /// Writes a parameter, or gives a command its argument.
    fn write(&self, parameter: &Self::Parameter, value: i64)
    -> impl Future<Output = Result<(), Self::Error>>;

    /// What the module does.
    fn status(&self) -> impl Future<Output = Result<Status, Self::Error>>;

    /// Writes what the manual writes before the motor is enabled, in its order. A set-point is 0 then: the motor turns at once, if it is not.
    fn prepare(&self, motion: Motion) -> impl Future<Output = Result<(), Self::Error>>;

    /// Enables or disables the motor.
    fn set_enabled(&self, is_enabled: bool) -> impl Future<Output = Result<(), Self::Error>>;

    /// Returns `true` if the motor could not be enabled because the module has just been switched on.
    fn is_starting(error: &Self::Error) -> bool;

    /// What the user should know while the motor is enabled: what becomes of it without its master.
    fn remark(&self) -> impl Future<Output = Result<Option<&'static str>, Self::Error>>;

    /// Starts the motion of an enabled motor: writes its target and starts it, or writes its set-point.
    fn start(&self, motion: Motion) -> impl Future<Output = Result<(), Self::Error>>;

    /// Tells the joint to come to rest.
    fn stop(&self, stop: Stop) -> impl Future<Output = Result<(), Self::Error>>;
}

/// What a module does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// The fault, or error: 0 for none.
    pub fault: u16,
    /// Whether it moves.
    pub motion: MotionStatus,
    /// Whether it is at its target.
    pub reached: ReachedStatus,
    /// counts
    pub position: i32,
    /// counts/s
    pub velocity: i32,
    /// mA
    pub current_ma: i32,
    /// °C
    pub temperature_c: i32,
}

/// The motion status of Modbus-RTU, and the running state of the own CAN protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionStatus {
    /// No motion.
    Stopped,
    /// A motion.
    Moving,
    /// A reciprocating motion was stopped.
    ReciprocationStopped,
    /// A number that the manuals do not explain.
    Unknown(u16),
}

impl From<u16> for MotionStatus {
    fn from(number: u16) -> Self {
        match number {
            0 => Self::Stopped,
            1 => Self::Moving,
            3 => Self::ReciprocationStopped,
            number => Self::Unknown(number),
        }
    }
}

/// The position reached status of Modbus-RTU, and the target-reached state of the own CAN protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReachedStatus {
    /// Disabled; the brake is engaged.
    MotorOff,
    /// Enabled; the brake is released.
    MotorOn,
    /// On the way.
    Running,
    /// In the window of the target, for less than the time that is asked for.
    Settling,
    /// At the target.
    Reached,
    /// A number that the manuals do not explain.
    Unknown(u16),
}

impl From<u16> for ReachedStatus {
    fn from(number: u16) -> Self {
        match number {
            0 => Self::MotorOff,
            1 => Self::MotorOn,
            2 => Self::Running,
            3 => Self::Settling,
            4 => Self::Reached,
            number => Self::Unknown(number),
        }
    }
}

impl Status {
    /// Returns `true` if the joint stands.
    pub const fn stands(&self) -> bool {
        self.velocity.saturating_abs() <= super::STANDING
    }

    /// Returns `true` if a move has come to its target, and the joint stands there.
    pub fn has_arrived(&self) -> bool {
        self.reached == ReachedStatus::Reached && self.motion == MotionStatus::Stopped && self.stands()
    }

    /// Returns `true` if the motor has no power, and the joint stands: settings that need it may be made.
    pub fn is_off(&self) -> bool {
        self.reached == ReachedStatus::MotorOff && self.stands()
    }

    /// In words.
    pub const fn name(&self) -> &'static str {
        match (self.fault, self.reached, self.motion) {
            (1.., ..) => "fault",
            (0, ReachedStatus::MotorOff, _) => "motor off",
            (0, ReachedStatus::Reached, _) => "target reached",
            (0, ReachedStatus::Settling, _) => "settling",
            (0, ReachedStatus::Running, _) | (0, _, MotionStatus::Moving) => "moving",
            (0, ..) => "motor on",
        }
    }

    /// As a reading of the joint.
    pub fn reading(&self, at_ns: Nanoseconds, target: &TargetDrive) -> AxisReading {
        AxisReading {
            at_ns,
            position: target.position(self.position.into()),
            position_counts: self.position.into(),
            velocity: target.velocity(self.velocity.into()),
            torque: None,
            current_a: Some(f64::from(self.current_ma) / 1000.0),
            temperature_c: Some(self.temperature_c.into()),
            statusword: None,
            state: self.name(),
        }
    }
}
