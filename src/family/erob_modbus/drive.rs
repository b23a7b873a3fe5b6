//! The registers of one drive: what procedures read and write.

use std::fmt;

use takt_rt::Nanoseconds;

use super::fault_code::FaultCode;
use super::registers::{self, Register, ValueError};
use crate::modbus::exception::ExceptionCode;
use crate::modbus::frame::{RegisterRange, RegisterValues, Values};
use crate::modbus::master::{Repeat, RequestError, RequestFailure};
use crate::procedure::ModbusSession;

/// A register that could not be read or written.
#[derive(Clone, Debug, PartialEq)]
pub struct AccessError {
    /// The register.
    pub register: Register,
    /// Why.
    pub failure: AccessFailure,
}

/// Why a register could not be read or written.
#[derive(Clone, Debug, PartialEq)]
pub enum AccessFailure {
    /// The register does not take the value. Nothing was sent.
    Value {
        /// The value.
        value: i64,
    },
    /// The register cannot be read.
    NotReadable,
    /// The register cannot be written.
    NotWritable,
    /// The request has failed.
    Request(Box<RequestError>),
}

impl AccessError {
    /// Whether the drive refuses with this code.
    pub fn is_refusal(&self, code: ExceptionCode) -> bool {
        matches!(&self.failure, AccessFailure::Request(error) if error.failure == RequestFailure::Refused(code))
    }
}

impl std::error::Error for AccessError {}

impl fmt::Display for AccessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.failure {
            AccessFailure::Value { value } => ValueError { register: self.register, value: *value }.fmt(f),
            AccessFailure::NotReadable => {
                write!(f, "{} cannot be read: a write to it is a command", self.register)
            }
            AccessFailure::NotWritable => write!(f, "{} cannot be written", self.register),
            AccessFailure::Request(error) => {
                write!(f, "{}: slave {}: {}", self.register, error.slave, error.failure)
            }
        }
    }
}

/// What a drive does, read in three requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// The fault, if there is one.
    pub fault: Option<FaultCode>,
    /// Register 0x0061.
    pub motion: MotionStatus,
    /// Register 0x0063.
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

/// Register 0x0061.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionStatus {
    /// No motion.
    Stopped,
    /// A motion.
    Moving,
    /// A reciprocating motion was stopped.
    ReciprocationStopped,
    /// A number that the manual does not explain.
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

/// Register 0x0063.
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
    /// A number that the manual does not explain.
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

/// A drive, by the session with it.
#[derive(Clone, Debug)]
pub struct ErobDrive {
    session: ModbusSession,
}

impl ErobDrive {
    /// The drive of a session.
    pub const fn new(session: ModbusSession) -> Self {
        Self { session }
    }

    /// The session.
    pub const fn session(&self) -> &ModbusSession {
        &self.session
    }

    /// Reads a register.
    ///
    /// # Errors
    /// It cannot be read, or the drive refuses, or does not reply.
    pub async fn read(&self, register: &Register) -> Result<i64, AccessError> {
        let failed = |failure| AccessError { register: *register, failure };
        let range = RegisterRange::new(register.address, register.number.words());
        let Some(range) = range.filter(|_| register.access.can_read()) else {
            return Err(failed(AccessFailure::NotReadable));
        };
        let words = self.session.read_registers(range).await;
        let words = words.map_err(|error| failed(AccessFailure::Request(Box::new(error))))?;
        register.decode(&words).ok_or(failed(AccessFailure::NotReadable))
    }

    /// Writes a register, or gives a command. A number of 32 bits is written at once.
    ///
    /// # Errors
    /// It cannot be written, does not take the value, or the drive refuses, or does not reply.
    pub async fn write(&self, register: &Register, value: i64) -> Result<(), AccessError> {
        let failed = |failure| AccessError { register: *register, failure };
        if !register.access.can_write() {
            return Err(failed(AccessFailure::NotWritable));
        }
        let words = register.encode(value).map_err(|_| failed(AccessFailure::Value { value }))?;
        let repeat = if register.may_be_repeated() { Repeat::Allowed } else { Repeat::Never };
        let written = match (words.as_slice(), RegisterValues::new(register.address, &words)) {
            ([word], _) => self.session.write_register(register.address, *word, repeat).await,
            (_, Some(values)) => self.session.write_registers(values, repeat).await,
            (_, None) => return Err(failed(AccessFailure::NotWritable)),
        };
        written.map_err(|error| failed(AccessFailure::Request(Box::new(error))))
    }

    /// The fault, if there is one.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn fault(&self) -> Result<Option<FaultCode>, AccessError> {
        let code = self.read(&registers::FAULT_CODE).await?;
        Ok(fault_of(code as u16))
    }

    /// What the drive does.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn status(&self) -> Result<Status, AccessError> {
        let status = self.block(&registers::FAULT_CODE, 2).await?;
        let place = self.block(&registers::REACHED_STATUS, 7).await?;
        // The manual reads velocities, currents, voltage and temperature in one request.
        let speed = self.block(&registers::DEMANDED_VELOCITY, 13).await?;
        let double = |words: &Values, from: &Register, register: &Register| {
            let at = usize::from(register.address - from.address);
            words.get(at..at + 2).and_then(|words| register.decode(words)).unwrap_or(0) as i32
        };
        let word = |words: &Values, at: usize| words.get(at).copied().unwrap_or(0);
        Ok(Status {
            fault: fault_of(word(&status, 0)),
            motion: word(&status, 1).into(),
            reached: word(&place, 0).into(),
            position: double(&place, &registers::REACHED_STATUS, &registers::ACTUAL_POSITION),
            velocity: double(&speed, &registers::DEMANDED_VELOCITY, &registers::ACTUAL_VELOCITY),
            current_ma: double(&speed, &registers::DEMANDED_VELOCITY, &registers::MOTOR_CURRENT),
            temperature_c: i32::from(word(&speed, 12) as i16),
        })
    }

    /// Reads registers that follow each other, without a gap between them.
    async fn block(&self, first: &Register, count: u16) -> Result<Values, AccessError> {
        let failed = |failure| AccessError { register: *first, failure };
        let Some(range) = RegisterRange::new(first.address, count) else {
            return Err(failed(AccessFailure::NotReadable));
        };
        self.session
            .read_registers(range)
            .await
            .map_err(|error| failed(AccessFailure::Request(Box::new(error))))
    }

    /// Waits for a time, in which the drive still hears its master: silence could end in fault 0x0FA2. Ends early when the session is
    /// interrupted. Returns the fault that has come up.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn wait(&self, duration_ns: Nanoseconds) -> Result<Option<FaultCode>, AccessError> {
        let end_ns = self.session.now_ns().saturating_add(duration_ns);
        loop {
            let fault = self.fault().await?;
            let left_ns = end_ns.saturating_sub(self.session.now_ns());
            if fault.is_some() || left_ns == 0 || self.session.is_interrupted() {
                return Ok(fault);
            }
            self.session.sleep(left_ns.min(SIGN_OF_LIFE_NS)).await;
        }
    }
}

/// From one request to the next in a wait: four in the shortest communication time-out that is advised.
const SIGN_OF_LIFE_NS: Nanoseconds = 50_000_000;

fn fault_of(code: u16) -> Option<FaultCode> {
    (code != 0).then_some(FaultCode(code))
}
