//! The first words with a drive: does it answer, and is it the one that was meant.

use takt_rt::{Frame, Id};

use super::conversation::Conversation;
use super::failure::Failure;
use super::family::Family;
use super::subject::Subject;
use crate::canopen::nmt::NmtCommand;
use crate::canopen::objects::{DEVICE_TYPE, VENDOR_ID};
use crate::canopen::sdo::SdoError;
use crate::drive::Access;

/// How long to listen for the answer in another protocol.
const OTHER_PROTOCOL_NS: u64 = 50_000_000;
/// After a change of its NMT state.
const NMT_PAUSE_NS: u64 = 20_000_000;

/// Waits until the drive answers. A node that is stopped hears no SDO: it is led to pre-operational once.
pub async fn reach(c: &Conversation, subject: &Subject) -> Result<(), Failure> {
    c.step("contact");
    let began_ns = c.now_ns();
    let mut is_woken = false;
    loop {
        match c.upload(DEVICE_TYPE.address).await? {
            Ok(_) | Err(SdoError::Aborted(_)) => return Ok(()),
            Err(SdoError::NoReply { .. }) if c.now_ns().saturating_sub(began_ns) < subject.patience_ns => {}
            Err(SdoError::NoReply { .. }) if !is_woken => {
                is_woken = true;
                c.step("wake from NMT state stopped");
                c.command(NmtCommand::EnterPreOperational);
                c.pause(NMT_PAUSE_NS).await?;
            }
            Err(SdoError::NoReply { .. }) => {
                c.go_on_with("contact");
                let other_protocol = other_protocol(c, subject).await?;
                let reported = c.nmt_state();
                return Err(Failure::Silent { node: subject.node, reported, other_protocol });
            }
            Err(error) => {
                return Err(Failure::Transfer { object: DEVICE_TYPE, access: Access::Read, error });
            }
        }
    }
}

/// As [`reach`], and the vendor must be the family's.
pub async fn reach_family(c: &Conversation, subject: &Subject) -> Result<(), Failure> {
    reach(c, subject).await?;
    c.step("identity");
    let received = c.read(&VENDOR_ID).await? as u32;
    let (family, expected) = (subject.family.word(), subject.family.vendor_id());
    if received == expected { Ok(()) } else { Err(Failure::OtherDrive { family, expected, received }) }
}

/// eRob firmware without CANopen speaks the vendor's own protocol: reading the position (0x0002) harms nobody. From
/// node 64 up its identifiers are those of other nodes' SDO.
async fn other_protocol(c: &Conversation, subject: &Subject) -> Result<Option<&'static str>, Failure> {
    let node = subject.node;
    if subject.family != Family::ErobCanopen || !(1..=63).contains(&node) {
        return Ok(None);
    }
    let id = |base: u32| Id::base(base + u32::from(node));
    let (Ok(question), Ok(answer)) = (id(0x640), id(0x5C0)) else { return Ok(None) };
    c.send(Frame::of(question, [0x00, 0x02]));
    let heard = c.listen(OTHER_PROTOCOL_NS).await?;
    let has_answered = heard.iter().any(|frame| frame.id() == answer);
    Ok(has_answered.then_some("vendor's custom CAN protocol"))
}
