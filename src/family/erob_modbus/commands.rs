//! What is done with a drive beside motions: saving, faults, the encoder, the communication time-out.

use std::fmt;

use takt_rt::Nanoseconds;
use takt_wire::modbus::exception::ExceptionCode;

use super::drive::{AccessError, ErobDrive};
use super::fault_code::FaultCode;
use super::register::Register;
use super::registers;
use crate::family::erob::SAVING_NS;

/// From a command to what it has brought.
const ACTING_NS: Nanoseconds = 100_000_000;
/// The shortest communication time-out that procedures keep, ms: they ask every 50 ms, and a USB adapter may hold a reply for 16 ms.
const SHORTEST_TIMEOUT_MS: u16 = 200;

/// Why a command has not done what it is for.
#[derive(Clone, Debug, PartialEq)]
pub enum CommandFailure {
    /// A register could not be read or written.
    Access(AccessError),
    /// The fault stays.
    FaultStays(FaultCode),
    /// The register shows something else than was written to it.
    ReadBack {
        /// The register.
        register: Register,
        /// What was written.
        written: i64,
        /// What is there.
        found: i64,
    },
}

impl From<AccessError> for CommandFailure {
    fn from(error: AccessError) -> Self {
        Self::Access(error)
    }
}

impl std::error::Error for CommandFailure {}

impl fmt::Display for CommandFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Access(error) => error.fmt(f),
            Self::FaultStays(code) => write!(f, "it stays: {code}"),
            Self::ReadBack { register, written, found } => {
                write!(f, "{register} was set to {written} and shows {found}")
            }
        }
    }
}

/// Every register that can be read, with its value; `None` where this drive does not have it.
///
/// # Errors
/// The drive does not reply.
pub async fn read_all(drive: &ErobDrive) -> Result<Vec<(&'static Register, Option<i64>)>, AccessError> {
    drive.session().step("read the registers");
    let mut values = vec![];
    for register in registers::ALL.iter().filter(|register| register.access.can_read()) {
        values.push((
            register,
            match drive.read(register).await {
                Ok(value) => Some(value),
                Err(error) if error.is_refusal(ExceptionCode::ILLEGAL_ADDRESS) => None,
                Err(error) => return Err(error),
            },
        ));
    }
    Ok(values)
}

/// Saves the parameters, and waits until that is done.
///
/// # Errors
/// The drive refuses, or does not reply.
pub async fn save(drive: &ErobDrive) -> Result<(), AccessError> {
    let session = drive.session();
    session.step("save the parameters");
    drive.write(&registers::SAVE, 1).await?;
    session.note("leave the power on: saving takes 3 s");
    let end_ns = session.now_ns().saturating_add(SAVING_NS);
    while session.now_ns() < end_ns {
        // A drive that writes its memory may not reply. Asking keeps its supervision of the master from running out.
        let _ = drive.fault().await;
        session.sleep(ACTING_NS.min(end_ns.saturating_sub(session.now_ns()))).await;
    }
    Ok(())
}

/// Clears a fault, and sees that it is gone. Returns the fault that was there.
///
/// # Errors
/// The fault stays; or the drive refuses, or does not reply.
pub async fn clear_fault(drive: &ErobDrive) -> Result<Option<FaultCode>, CommandFailure> {
    drive.session().step("clear the fault");
    let fault = drive.fault().await?;
    if fault.is_none() {
        return Ok(None);
    }
    drive.write(&registers::CLEAR_FAULT, 1).await?;
    drive.session().sleep(ACTING_NS).await;
    match drive.fault().await? {
        None => Ok(fault),
        Some(code) => Err(CommandFailure::FaultStays(code)),
    }
}

/// Resets the encoder on the load's side, after the battery of a multi-turn model was empty. It **wipes the count of turns**: the
/// joint must be homed again.
///
/// # Errors
/// The drive refuses, or does not reply.
pub async fn reset_encoder(drive: &ErobDrive) -> Result<(), AccessError> {
    drive.session().step("reset the encoder");
    drive.write(&registers::RESET_ENCODER, 1).await?;
    drive.session().note("the count of turns is wiped: home the joint again before it moves");
    Ok(())
}

/// Stops the joint in less than 50 ms, with a shock for its gear. The bus voltage rises, which may end in a fault.
///
/// # Errors
/// The drive refuses, or does not reply.
pub async fn stop_in_an_emergency(drive: &ErobDrive) -> Result<(), AccessError> {
    drive.session().step("emergency stop");
    drive.write(&registers::EMERGENCY_STOP, 1).await
}

/// Sets how long the drive waits for its master (0: for ever; 4000 ms at most), and reads it back.
///
/// What the motor does when the time is over is in no manual: this is no safe stop until it was tried.
///
/// # Errors
/// The drive does not keep the value, refuses, or does not reply.
pub async fn set_communication_timeout(drive: &ErobDrive, milliseconds: u16) -> Result<(), CommandFailure> {
    let session = drive.session();
    session.step("set the communication time-out");
    let register = registers::COMMUNICATION_TIMEOUT;
    drive.write(&register, milliseconds.into()).await?;
    let found = drive.read(&register).await?;
    if found != i64::from(milliseconds) {
        return Err(CommandFailure::ReadBack { register, written: milliseconds.into(), found });
    }
    match milliseconds {
        0 => session.note("the drive goes on when its master is silent"),
        1..SHORTEST_TIMEOUT_MS => session.note(format!(
            "a delay of the line or of its USB adapter may be longer than {milliseconds} ms: {SHORTEST_TIMEOUT_MS} ms is \
             the least that is advised"
        )),
        _ => {}
    }
    Ok(())
}
