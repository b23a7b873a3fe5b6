//! How a module is found on a bus.

use std::ops::RangeInclusive;

use takt_rt::{Frame, Id, Nanoseconds};
use takt_wire::erob_can::entries::{self, Entry};
use takt_wire::erob_can::frame::{ReceivedRequest, Reply, Request, reply_id, replying_node};
use takt_wire::erob_can::module_information::ModuleNumbers;

use super::FACTS;
use crate::family::scan::{Answered, FoundDevice, OwnProtocol, Reading, ScanSession};

const NAME: &str = "eRob's own protocol";
/// Who makes it.
pub const MAKER: &str = "ZeroErr";
/// So long a module may take for a reply. It takes 1 ms (captures of chapters 4 and 5 of the manual).
const REPLY_NS: Nanoseconds = 50_000_000;
/// The SDO of this many node IDs above has the identifiers of a module: 640h is 600h and 64.
const SDO_DISTANCE: u8 = 64;

/// The protocol. It asks for the firmware version: a read.
#[derive(Clone, Copy, Debug)]
pub struct OwnScan;

impl OwnProtocol for OwnScan {
    fn name(&self) -> &'static str {
        NAME
    }

    /// Without 64, whose replies would be SDO requests on a bus with CANopen nodes.
    fn nodes(&self) -> RangeInclusive<u8> {
        1..=63
    }

    fn question(&self, node: u8) -> Option<Frame> {
        Some(Request::Read(entries::FIRMWARE_VERSION.address).frame(node))
    }

    fn replying(&self, frame: &Frame) -> Option<u8> {
        let node = replying_node(frame).filter(|node| self.nodes().contains(node))?;
        Reply::decode(frame.payload()).map(|_| node)
    }

    /// A read and a command look alike: the table tells them apart.
    fn reply_to_reading(&self, frame: &Frame) -> Option<Id> {
        let request = ReceivedRequest::decode(frame).filter(|request| request.value.is_none())?;
        let entry = entries::find(request.address)?;
        entry.access.can_read().then(|| reply_id(request.node))
    }

    fn shares_sdo_with(&self, node: u8) -> Option<u8> {
        node.checked_add(SDO_DISTANCE).filter(|node| *node <= 127)
    }

    fn read<'a>(&'a self, session: &'a ScanSession, node: u8, reply: Frame) -> Reading<'a> {
        Box::pin(async move { module(session, node, reply).await })
    }

    fn overheard(&self, node: u8) -> FoundDevice {
        let mut device = FoundDevice::new(Some(node), Answered::Heard(NAME), FACTS.name);
        (device.vendor, device.drive) = (Some(MAKER.to_owned()), Some(FACTS.word));
        device
    }
}

async fn module(session: &ScanSession, node: u8, reply: Frame) -> FoundDevice {
    session.step("read the module information");
    let mut device = FoundDevice::new(Some(node), Answered::Own(NAME), FACTS.name);
    (device.vendor, device.drive) = (Some(MAKER.to_owned()), Some(FACTS.word));
    if let Some(Reply::Value(firmware)) = Reply::decode(reply.payload()) {
        device.firmware = Some(firmware.cast_unsigned().to_string());
    }
    match numbers(session, node).await {
        Some(numbers) => {
            let mut take =
                |name: &str, text: Result<String, takt_wire::erob_can::module_information::UnknownField>| {
                    text.map_err(|unknown| {
                        device.remarks.push(format!("its {name} is not decoded: {unknown}"))
                    })
                    .ok()
                };
            let product = take("model number", numbers.model_number());
            let serial = take("serial number", numbers.serial_number());
            (device.product, device.serial) = (product, serial);
        }
        None if session.is_interrupted() => {}
        None => device.remark("its firmware is too old to tell model and serial number (before X5061715X)"),
    }
    device
}

/// The numbers of a module; `None` where its firmware does not have them.
async fn numbers(session: &ScanSession, node: u8) -> Option<ModuleNumbers> {
    let number = async |entry: &Entry| {
        if session.is_interrupted() {
            return None;
        }
        let is_reply = |frame: &Frame| OwnScan.replying(frame) == Some(node);
        session.count_request_of(NAME, node);
        let reply = session.ask(Request::Read(entry.address).frame(node), is_reply, REPLY_NS).await?;
        match Reply::decode(reply.payload())? {
            Reply::Value(value) => Some(value.cast_unsigned()),
            Reply::Done | Reply::Failed(_) => None,
        }
    };
    Some(ModuleNumbers {
        serial_counter: number(&entries::SERIAL_COUNTER).await?,
        model_a: number(&entries::MODEL_A).await?,
        model_b: number(&entries::MODEL_B).await?,
        // They are not shown.
        hardware_version: 0,
        hardware_change: 0,
        io_identifier: 0,
        module_version: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_question_reads_and_does_not_write() {
        assert_eq!(format!("{:?}", OwnScan.question(2).unwrap()), "642#00010004");
        assert_eq!(OwnScan.replying(&Reply::Value(5).frame(2)), Some(2));
        let sdo_response = Frame::of(reply_id(2), [0x43, 0, 0x10, 0, 0x92, 1, 2, 0]);
        assert_eq!(OwnScan.replying(&sdo_response), None, "it is that of the CANopen node 66");
        assert_eq!(OwnScan.shares_sdo_with(2), Some(66));
    }
}
