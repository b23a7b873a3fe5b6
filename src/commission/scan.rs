//! Who else is on the bus.

use std::collections::BTreeSet;

use takt_rt::{Frame, Nanoseconds};

use super::conversation::Conversation;
use super::failure::Failure;
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::sdo::Request;

/// Between two questions.
const QUESTION_NS: Nanoseconds = 2_000_000;
/// For answers, and for heartbeats: devices send one in a second, mostly.
const ANSWER_NS: Nanoseconds = 1_200_000_000;
/// The functions under which a node sends: EMCY, TPDO1 to 4, SDO, error control.
const FUNCTIONS: [u32; 7] = [0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700];

/// The other nodes that answer a question for their device type, or that are heard.
pub async fn others(c: &Conversation) -> Result<Vec<u8>, Failure> {
    c.step("scan for other nodes");
    let own = c.node();
    c.begin_listening();
    for node in (1..=127).filter(|node| *node != own) {
        c.send(Request::Upload { object: DEVICE_TYPE.address }.frame(node));
        c.pause(QUESTION_NS).await?;
    }
    c.pause(ANSWER_NS).await?;
    let nodes: BTreeSet<u8> =
        c.end_listening().iter().filter_map(sender).filter(|node| *node != own).collect();
    Ok(nodes.into_iter().collect())
}

fn sender(frame: &Frame) -> Option<u8> {
    let id = frame.id().value();
    let node = u8::try_from(id & 0x7F).ok()?;
    (!frame.id().is_extended() && node > 0 && FUNCTIONS.contains(&(id & 0x780))).then_some(node)
}
