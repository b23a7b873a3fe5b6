//! Stores the parameters (1010), and restores those of the factory (1011).

use takt_rt::Nanoseconds;
use takt_wire::canopen::object::Object;

use super::enabling::state;
use super::objects::{LOAD_SIGNATURE, RESTORE, SAVE_SIGNATURE, STORE};
use crate::family::commission::contact;
use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;

/// Time for which the supply must stay on after the store command, where the drive's own is not known.
const STORING_NS: Nanoseconds = 3_000_000_000;

/// `save`: writes "save" to 1010:1, and waits until the drive has stored the parameters.
pub async fn save(c: &SdoSession, s: &TargetDrive) -> Result<Report, Failure> {
    check_has(s, &STORE, "it keeps what is written to it, or is set up with the vendor's tool")?;
    connect_without_torque(c, s).await?;
    c.step("store");
    c.write_once(&STORE, SAVE_SIGNATURE).await?;
    let storing_ns = s.storing_ns().unwrap_or(STORING_NS);
    c.note(format!("do not cut the supply for {} s", storing_ns as f64 * 1e-9));
    let paused = c.pause(storing_ns).await;
    if paused.is_err() {
        c.note("the drive is still storing the parameters: do not cut the supply yet");
    }
    paused?;
    let mut report = Report::new();
    report.add("stored", "stored", true, "the parameters that can be stored");
    Ok(report)
}

/// `restore`: writes "load" to 1011:1. The drive takes the parameters of the factory at its next reset.
pub async fn restore(c: &SdoSession, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    check_has(s, &RESTORE, "restore its parameters with the vendor's tool")?;
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this gives the drive the parameters of the factory at its next reset (1011): what was stored in \
                          it is lost, also gains, limits and the commutation of its motor where it stores them there",
            option: "--yes",
        });
    }
    connect_without_torque(c, s).await?;
    c.step("restore");
    c.write_once(&RESTORE, LOAD_SIGNATURE).await?;
    c.note("the parameters of the factory hold after the next power-cycle of the drive");
    let mut report = Report::new();
    report.add("restored", "restored", true, "the parameters of the factory, from the next reset on");
    Ok(report)
}

fn check_has(s: &TargetDrive, object: &Object, instead: &str) -> Result<(), Failure> {
    if s.is_writable(object.address) {
        return Ok(());
    }
    Err(Failure::Unsupported { what: format!("this drive has no {object}"), instead: instead.to_owned() })
}

async fn connect_without_torque(c: &SdoSession, s: &TargetDrive) -> Result<(), Failure> {
    contact::connect_family(c, s).await?;
    c.step("state");
    if state(c).await?.has_torque() { Err(Failure::Enabled) } else { Ok(()) }
}
