//! The registers of one drive: what procedures read and write.

use std::fmt;

use takt_wire::erob_can::parameter::ValueError;
use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{RegisterRange, RegisterValues, Values};
use takt_wire::modbus::master::{Repeat, RequestError, RequestFailure};

use super::fault_code::FaultCode;
use super::register::Register;
use super::registers;
use crate::family::erob::module::Status;
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
    /// Returns `true` if the drive refuses with this code.
    pub fn is_refusal(&self, code: ExceptionCode) -> bool {
        matches!(&self.failure, AccessFailure::Request(error) if error.failure == RequestFailure::Refused(code))
    }
}

impl std::error::Error for AccessError {}

impl fmt::Display for AccessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.failure {
            AccessFailure::Value { value } => ValueError { parameter: self.register, value: *value }.fmt(f),
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

    /// What the drive does, read in three requests.
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
            fault: word(&status, 0),
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
}

fn fault_of(code: u16) -> Option<FaultCode> {
    (code != 0).then_some(FaultCode(code))
}
