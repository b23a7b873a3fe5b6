//! Clears a fault by a rising edge of controlword bit 7.

use takt_rt::{DriveState, Nanoseconds, controlword};
use takt_wire::canopen::emcy::ErrorCode;
use takt_wire::canopen::objects::*;

use super::enabling::state;
use super::reading::{error_code, summary};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// Controlword bit 7 must stay set for several cycles of the drive.
const EDGE_NS: Nanoseconds = 50_000_000;
/// Longest time from the fault reset until the fault state ends; the fault reaction may still be active.
const CLEARING_NS: Nanoseconds = 1_000_000_000;

/// `clear-fault`. `before` is what this fault needs before the reset.
pub async fn clear(
    c: &SdoSession,
    s: &TargetDrive,
    before: impl AsyncFnOnce(ErrorCode) -> Result<(), Failure>,
) -> Result<Report, Failure> {
    contact::connect_family(c, s).await?;
    c.step("fault");
    let mut report = Report::new();
    if !state(c).await?.is_faulted() {
        report.add("fault", "fault", serde_json::Value::Null, "none, nothing to clear");
        report.append(summary(c, s).await?);
        return Ok(report);
    }
    let code = error_code(c, s).await?;
    report.add("fault", "fault", format!("0x{:04X}", code.0), s.error_words(code.0));
    before(code).await?;
    c.step("fault reset");
    c.write(&CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    c.write(&CONTROLWORD, controlword::FAULT_RESET.into()).await?;
    c.pause(EDGE_NS).await?;
    let is_gone = |word: i64| !DriveState::decode(word as u16).is_faulted();
    let cleared = c.wait_for(&STATUSWORD, "the end of the fault", CLEARING_NS, is_gone).await;
    c.write(&CONTROLWORD, controlword::DISABLE_VOLTAGE.into()).await?;
    match cleared {
        Err(Failure::NotInTime { .. }) => {
            let code = error_code(c, s).await?.0;
            let advice = Some(s.error_cure(code));
            return Err(Failure::FaultPersists { what: s.error_words(code), advice });
        }
        other => other?,
    };
    report.add("cleared", "cleared", true, "yes");
    report.append(summary(c, s).await?);
    Ok(report)
}
