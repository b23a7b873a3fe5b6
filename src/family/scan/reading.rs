//! Which frames only read from a device, so that they may be sent beside a running controller.

use takt_rt::{Frame, FrameKind, Id};
use takt_wire::canopen::function_code;
use takt_wire::canopen::sdo::SdoRequest;

use crate::family;

/// The identifier of the reply to a frame that only reads: an upload of an object from a CANopen node, or a read in the protocol of a
/// vendor. `None` of every other frame.
pub fn reply_to_reading(frame: &Frame) -> Option<Id> {
    if frame.kind() != FrameKind::Data {
        return None;
    }
    let own = || family::all().into_iter().flat_map(|family| family.own_protocols());
    sdo_reply(frame).or_else(|| own().find_map(|protocol| protocol.reply_to_reading(frame)))
}

/// An upload, by segments too. An abort ends a transfer of the one who sends it.
fn sdo_reply(frame: &Frame) -> Option<Id> {
    match SdoRequest::decode(frame)? {
        (node, SdoRequest::Upload { .. } | SdoRequest::UploadSegment { .. } | SdoRequest::Abort { .. }) => {
            Some(Id::canopen(function_code::SDO_RESPONSE, node))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_wire::erob_can::entries;
    use takt_wire::erob_can::frame::Request;

    #[test]
    fn uploads_and_reads_are_readings_and_nothing_else_is() {
        let sdo = |bytes: [u8; 8]| Frame::of(Id::canopen(0x600, 9), bytes);
        let of_nine = Some(Id::canopen(0x580, 9));
        for reading in [
            [0x40, 0x18, 0x10, 1, 0, 0, 0, 0],
            [0x60, 0, 0, 0, 0, 0, 0, 0],
            [0x70, 0, 0, 0, 0, 0, 0, 0],
            [0x80, 0x18, 0x10, 1, 0, 0, 4, 5],
        ] {
            assert_eq!(reply_to_reading(&sdo(reading)), of_nine, "{reading:02X?}");
        }
        for writing in [
            [0x23, 0x40, 0x60, 0, 0xF, 0, 0, 0],
            [0x2B, 0x40, 0x60, 0, 0xF, 0, 0, 0],
            [0x21, 0x10, 0x10, 1, 4, 0, 0, 0],
            [0x00, 1, 2, 3, 4, 5, 6, 7],
            [0xC0, 0x10, 0x10, 1, 4, 0, 0, 0],
            [0xA0, 0x18, 0x10, 1, 4, 0, 0, 0],
        ] {
            assert_eq!(reply_to_reading(&sdo(writing)), None, "{writing:02X?}");
        }
        let start = Frame::of(Id::canopen(0, 0), [1, 9]);
        let sync = Frame::of(Id::canopen(0x80, 0), []);
        let set_point = Frame::of(Id::canopen(0x200, 9), [0; 8]);
        for frame in [start, sync, set_point] {
            assert_eq!(reply_to_reading(&frame), None, "{frame:?}");
        }
    }

    #[test]
    fn a_read_in_the_vendors_protocol_is_a_reading_and_a_command_that_looks_like_one_is_not() {
        let read = Request::Read(entries::FIRMWARE_VERSION.address).frame(9);
        assert_eq!(reply_to_reading(&read), Some(Id::base(0x5C9).unwrap()));
        let commands = entries::ALL.iter().filter(|entry| !entry.access.can_read());
        for entry in commands {
            let frame = Request::Command(entry.address).frame(9);
            assert_eq!(reply_to_reading(&frame), None, "{}", entry.name);
        }
        let unknown = Frame::of(Id::base(0x649).unwrap(), [0xEE, 0xEE]);
        assert_eq!(reply_to_reading(&unknown), None);
    }
}
