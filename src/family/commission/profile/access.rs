//! Objects that a drive may lack: its data sheet tells, or the drive itself.

use takt_wire::canopen::object::Object;

use crate::family::commission::failure::Failure;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// Reads a number from an object that the drive may lack.
pub async fn read_if_there(c: &SdoSession, s: &TargetDrive, object: &Object) -> Result<Option<i64>, Failure> {
    if s.has(object.address) { c.read_optional(object).await } else { Ok(None) }
}

/// Writes a number to an object that the drive may lack, or may not let be written. Returns whether it was written.
pub async fn write_if_writable(
    c: &SdoSession,
    s: &TargetDrive,
    object: &Object,
    value: i64,
) -> Result<bool, Failure> {
    if s.is_writable(object.address) { c.write_optional(object, value).await } else { Ok(false) }
}
