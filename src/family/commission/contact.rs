//! First contact with a drive: checks that it answers SDO requests, and that its vendor ID is the expected one.

use takt_wire::canopen::nmt::NmtCommand;
use takt_wire::canopen::objects::{DEVICE_TYPE, PRODUCT_CODE, REVISION_NUMBER, VENDOR_ID};
use takt_wire::canopen::sdo::SdoError;

use super::failure::{AnsweredProtocol, Failure};
use super::report::Report;
use super::sdo_session::SdoSession;
use super::target::TargetDrive;
use crate::procedure::Access;

/// How long to wait for an answer in the vendor's own protocol.
const OTHER_PROTOCOL_NS: u64 = 50_000_000;
/// Wait after an NMT command.
const NMT_PAUSE_NS: u64 = 20_000_000;

/// Waits until the drive answers an SDO upload of object 1000. A node in NMT state stopped does not answer SDO, so it
/// is commanded to pre-operational once.
pub async fn connect(c: &SdoSession, target: &TargetDrive) -> Result<(), Failure> {
    c.step("contact");
    let began_ns = c.now_ns();
    let mut is_woken = false;
    loop {
        match c.upload(DEVICE_TYPE.address).await? {
            Ok(_) | Err(SdoError::Aborted(_)) => return Ok(()),
            Err(SdoError::NoReply { .. }) if c.now_ns().saturating_sub(began_ns) < target.patience_ns => {}
            Err(SdoError::NoReply { .. }) if !is_woken => {
                is_woken = true;
                c.step("wake from NMT state stopped");
                c.command(NmtCommand::EnterPreOperational);
                c.pause(NMT_PAUSE_NS).await?;
            }
            Err(SdoError::NoReply { .. }) => {
                c.resume_step("contact");
                let other_protocol = other_protocol(c, target).await?;
                let reported = c.nmt_state();
                return Err(Failure::Silent { node: target.node, reported, other_protocol });
            }
            Err(error) => {
                return Err(Failure::Transfer { object: DEVICE_TYPE, access: Access::Read, error });
            }
        }
    }
}

/// As [`connect`], and checks the vendor ID (object 1018:01), where the expected one is known.
pub async fn connect_family(c: &SdoSession, target: &TargetDrive) -> Result<(), Failure> {
    connect(c, target).await?;
    c.step("identity");
    let Some(expected) = target.drive.identity.vendor else { return Ok(()) };
    let received = c.read(&VENDOR_ID).await? as u32;
    if received == expected {
        return Ok(());
    }
    Err(Failure::OtherDrive { family: target.drive.word, expected, received })
}

/// Reads the identity into a report, and notes when the vendor is not that of the family.
pub async fn report_identity(c: &SdoSession, s: &TargetDrive, report: &mut Report) -> Result<(), Failure> {
    c.step("identity");
    for (key, object) in [
        ("device_type", DEVICE_TYPE),
        ("vendor_id", VENDOR_ID),
        ("product_code", PRODUCT_CODE),
        ("revision_number", REVISION_NUMBER),
    ] {
        let Some(value) = c.read_optional(&object).await? else { continue };
        report.add(key, object.name, value, object.show(value));
        if object == VENDOR_ID && s.drive.identity.vendor.is_some_and(|vendor| value != i64::from(vendor)) {
            c.note(format!(
                "the vendor ID is not that of {}: check that this is the intended drive",
                s.drive.word
            ));
        }
    }
    Ok(())
}

/// Checks for firmware without CANopen, by a request in the vendor's own protocol that changes nothing.
async fn other_protocol(c: &SdoSession, target: &TargetDrive) -> Result<Option<AnsweredProtocol>, Failure> {
    let Some(other) = target.family().other_protocol(&target.drive, target.node) else { return Ok(None) };
    c.send(other.request);
    let collected = c.collect_frames(OTHER_PROTOCOL_NS).await?;
    let has_answered = collected.iter().any(|frame| frame.id() == other.answer);
    Ok(has_answered.then_some(AnsweredProtocol { name: other.name, cure: other.cure }))
}
