//! What a module tells of itself; and what is done with it beside motions: saving, the brake, the encoder, other node IDs.

use takt_wire::erob_can::client::{RequestError, RequestFailure};
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::module_information::ModuleNumbers;

use crate::family::erob::SAVING_NS;
use crate::family::erob_can::session::ErobCanSession;

/// What a module tells of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleInformation {
    /// The firmware version.
    pub firmware: u32,
    /// Serial number, model and versions; `None` where the firmware is too old for them (before X5061715X).
    pub numbers: Option<ModuleNumbers>,
}

/// Reads what a module tells of itself.
///
/// # Errors
/// The module refuses, or does not reply. A refusal of index 0232 is none: old firmware does not have it.
pub async fn information(session: &ErobCanSession) -> Result<ModuleInformation, RequestError> {
    session.step("read the module information");
    let number = async |entry: &Entry| session.read(entry).await.map(i32::cast_unsigned);
    let firmware = number(&entries::FIRMWARE_VERSION).await?;
    let hardware_version = number(&entries::HARDWARE_VERSION).await?;
    let serial_counter = match number(&entries::SERIAL_COUNTER).await {
        Ok(counter) => counter,
        Err(RequestError { failure: RequestFailure::Refused(_), .. }) => {
            return Ok(ModuleInformation { firmware, numbers: None });
        }
        Err(error) => return Err(error),
    };
    let numbers = ModuleNumbers {
        hardware_version,
        serial_counter,
        model_a: number(&entries::MODEL_A).await?,
        model_b: number(&entries::MODEL_B).await?,
        hardware_change: number(&entries::HARDWARE_CHANGE).await?,
        io_identifier: number(&entries::IO_IDENTIFIER).await?,
        module_version: number(&entries::MODULE_VERSION).await?,
    };
    Ok(ModuleInformation { firmware, numbers: Some(numbers) })
}

/// Saves the parameters, and waits until that is done.
///
/// # Errors
/// The module refuses, or does not reply.
pub async fn save(session: &ErobCanSession) -> Result<(), RequestError> {
    session.step("save the parameters");
    session.command(&entries::SAVE).await?;
    session.note("leave the power on: saving takes 3 s");
    session.sleep(SAVING_NS).await;
    Ok(())
}

/// Releases the brake. Nothing holds the joint then.
///
/// # Errors
/// The module refuses, or does not reply.
pub async fn release_brake(session: &ErobCanSession) -> Result<(), RequestError> {
    session.step("release the brake");
    session.command(&entries::RELEASE_BRAKE).await
}

/// Resets the encoder on the load's side, after the battery of a multi-turn model was empty. It **wipes the count of turns**: the
/// joint must be homed again.
///
/// # Errors
/// The module refuses, or does not reply.
pub async fn reset_encoder(session: &ErobCanSession) -> Result<(), RequestError> {
    session.step("reset the encoder");
    session.write(&entries::RESET_LOAD_ENCODER, 1).await
}
