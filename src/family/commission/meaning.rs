//! Describes frames in words, for the trace of a procedure.

use takt_rt::{Frame, MappedObject, StoppedHeartbeat};
use takt_wire::canopen::communication_names;
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use takt_wire::canopen::object::{DataType, Object, ObjectAddress};
use takt_wire::canopen::sdo::{SdoRequest, SdoResponse};
use takt_wire::printable::printable;

use super::dictionary::{self, ObjectEntry, UNNAMED};
use super::target::TargetDrive;

/// Describes a frame on the bus of `target`.
pub fn of(target: &TargetDrive, frame: &Frame) -> String {
    if let Some((command, target)) = NmtCommand::decode(frame) {
        return nmt(command, target);
    }
    // Its identifiers are those of the SDO of another node, but SDO frames have eight bytes.
    if let Some(other) = target.family().other_protocol(&target.drive, target.node)
        && frame.payload().len() < 8
    {
        if frame.id() == other.request.id() {
            return format!("request in the {}", other.name);
        }
        if frame.id() == other.answer {
            return format!("reply in the {}", other.name);
        }
    }
    if let Some((node, request)) = SdoRequest::decode(frame) {
        return at_node(target, node, requested(target, &request));
    }
    let whole = Frame::of(frame.id(), frame.first_word().to_le_bytes());
    if let Some((node, response)) = SdoResponse::decode(&whole).filter(|_| !frame.payload().is_empty()) {
        return at_node(target, node, answered(target, &response));
    }
    if let Some(message) = ErrorControl::decode(frame) {
        let words = match message.state {
            NmtState::BootUp => "boot-up".to_owned(),
            NmtState::Stopped
                if target.drive.codec.stopped_heartbeat == StoppedHeartbeat::Alarm
                    && message.node == target.node =>
            {
                "heartbeat: alarm".to_owned()
            }
            state => format!("heartbeat: {state}"),
        };
        return at_node(target, message.node, words);
    }
    if let Some(emergency) = Emergency::decode(frame) {
        return at_node(target, emergency.node, self::emergency(target, &emergency));
    }
    other(target, frame)
}

/// An emergency message, in the words of the family of its sender.
fn emergency(target: &TargetDrive, message: &Emergency) -> String {
    let code = message.code.0;
    let error = if message.node != target.node {
        message.code.to_string()
    } else if code >> 8 == 0 {
        // A code 00xx is that of the standard alone: the error has been reset.
        "error reset".to_owned()
    } else {
        target.error_words(code).to_string()
    };
    let mut words = format!("emergency: {error}, error register: {}", message.register);
    if message.manufacturer != [0; 5] {
        words.push_str(&format!(", manufacturer's bytes {:02X?}", message.manufacturer));
    }
    words
}

fn at_node(target: &TargetDrive, node: u8, words: String) -> String {
    if node == target.node { words } else { format!("node {node}: {words}") }
}

/// A command of the NMT master.
pub fn nmt(command: NmtCommand, target: NmtTarget) -> String {
    let words = match command {
        NmtCommand::Start => "start",
        NmtCommand::Stop => "stop",
        NmtCommand::EnterPreOperational => "enter pre-operational",
        NmtCommand::ResetNode => "reset",
        NmtCommand::ResetCommunication => "reset the communication of",
    };
    match target {
        NmtTarget::All => format!("{words} all nodes"),
        NmtTarget::Node(node) => format!("{words} node {node}"),
    }
}

/// A request of an SDO client to the drive.
pub fn requested(target: &TargetDrive, request: &SdoRequest) -> String {
    match request {
        SdoRequest::Upload { object } => format!("read {}", named(target, *object)),
        SdoRequest::DownloadExpedited { object, data } => {
            format!("set {} to {}", named(target, *object), value(target, *object, data.bytes()))
        }
        SdoRequest::DownloadSegmented { object, size } => {
            format!("set {}{} in segments", named(target, *object), of_size(*size))
        }
        SdoRequest::DownloadSegment { data, is_last, .. } => segment(data.bytes(), *is_last),
        SdoRequest::Abort { object, code } => format!("abort {}: {code}", named(target, *object)),
        SdoRequest::UploadSegment { .. } => "next segment".to_owned(),
        SdoRequest::BlockUpload { object, block_size, .. } => {
            format!("read {} in blocks of {} segments", named(target, *object), block_size.segments())
        }
        SdoRequest::BlockUploadStart => "start the blocks".to_owned(),
        SdoRequest::BlockAcknowledge { last, block_size } => {
            format!("{last} segments received, the next block has {}", block_size.segments())
        }
        SdoRequest::BlockUploadEnd => "end of the blocks confirmed".to_owned(),
        SdoRequest::BlockDownload { object, size, .. } => {
            format!("set {}{} in blocks", named(target, *object), of_size(*size))
        }
        SdoRequest::BlockDownloadEnd { crc, .. } => format!("end of the blocks, CRC 0x{crc:04X}"),
    }
}

/// A response of the SDO server of the drive.
pub fn answered(target: &TargetDrive, response: &SdoResponse) -> String {
    match response {
        SdoResponse::UploadExpedited { object, data } => {
            format!("{} is {}", named(target, *object), value(target, *object, data.bytes()))
        }
        SdoResponse::DownloadAccepted { object } => format!("{} accepted", named(target, *object)),
        SdoResponse::DownloadSegmentAccepted { .. } => "segment accepted".to_owned(),
        SdoResponse::Abort { object, code } => format!("{} refused: {code}", named(target, *object)),
        SdoResponse::UploadSegmented { object, size } => {
            format!("{}{} follows in segments", named(target, *object), of_size(*size))
        }
        SdoResponse::UploadSegment { data, is_last, .. } => segment(data.bytes(), *is_last),
        SdoResponse::BlockUpload { object, size, .. } => {
            format!("{}{} follows in blocks", named(target, *object), of_size(*size))
        }
        SdoResponse::BlockUploadEnd { crc, .. } => format!("end of the blocks, CRC 0x{crc:04X}"),
        SdoResponse::BlockDownload { object, block_size, .. } => {
            format!("{} is taken in blocks of {} segments", named(target, *object), block_size.segments())
        }
        SdoResponse::BlockAcknowledge { last, block_size } => {
            format!("{last} segments received, the next block has {}", block_size.segments())
        }
        SdoResponse::BlockDownloadEnd => "end of the blocks confirmed".to_owned(),
    }
}

fn of_size(size: Option<u32>) -> String {
    size.map_or_else(String::new, |bytes| format!(" ({bytes} bytes)"))
}

fn segment(bytes: &[u8], is_last: bool) -> String {
    format!("{} {bytes:02X?}", if is_last { "last segment" } else { "segment" })
}

/// The entry of an object, which is named as that of the first axis of the node.
fn entry(target: &TargetDrive, address: ObjectAddress) -> Option<ObjectEntry> {
    let own = MappedObject::new(address.index, address.subindex, 0);
    let first = own.as_of_first_axis(target.drive.node_axis);
    dictionary::entry(&target.drive, ObjectAddress::new(first.index, first.subindex))
}

/// An object with its name: that of the family, or else that of the data sheet.
pub fn named(target: &TargetDrive, address: ObjectAddress) -> String {
    match name(target, address) {
        Some(name) => format!("{address} ({name})"),
        None => address.to_string(),
    }
}

/// The name of an object, as the family of the drive has it, or else its data sheet.
pub fn name(target: &TargetDrive, address: ObjectAddress) -> Option<String> {
    let known = entry(target, address).map(|entry| entry.object.name);
    let by_sheet = || target.name_by_sheet(address).map(printable);
    let known = known.filter(|name| *name != UNNAMED).map(str::to_owned);
    known.or_else(|| communication_names::name(address)).or_else(by_sheet)
}

/// A value of an object in words: its number, and its meaning or what it is in the units of the joint.
pub fn value(target: &TargetDrive, address: ObjectAddress, bytes: &[u8]) -> String {
    let entry = entry(target, address);
    let object = entry.map_or_else(|| unnamed_object(address, bytes.len()), |entry| entry.object);
    // A value of another length than in the table is shown as bytes.
    let Some(number) = object.data_type.decode(bytes) else { return format!("{bytes:02X?}") };
    let shown = object.show(number);
    if let Some(meaning) = target.family().meaning(&target.drive, &object, number) {
        return format!("{shown}: {meaning}");
    }
    if let Some(meaning) = pdo_parameter(target, address, number) {
        return format!("{shown}: {meaning}");
    }
    match entry.and_then(|entry| entry.physical(target, number)) {
        Some((_, physical)) => format!("{shown} = {physical}"),
        None => shown,
    }
}

/// What the parameter of a PDO says.
fn pdo_parameter(target: &TargetDrive, address: ObjectAddress, number: i64) -> Option<String> {
    if let Some(mapped) = communication_names::mapped_object(address, number) {
        let object = ObjectAddress::new(mapped.index, mapped.subindex);
        return Some(format!("{}, {} bits", named(target, object), mapped.bits));
    }
    communication_names::cob_id(address, number)
}

/// The number of an object, and what it is in SI units at the joint where it has such a unit.
pub fn numbers(target: &TargetDrive, address: ObjectAddress, bytes: &[u8]) -> Option<(i64, Option<f64>)> {
    let entry = entry(target, address);
    let object = entry.map_or_else(|| unnamed_object(address, bytes.len()), |entry| entry.object);
    let number = object.data_type.decode(bytes)?;
    let physical = entry.and_then(|entry| entry.physical(target, number));
    Some((number, physical.map(|(value, _)| value)))
}

fn unnamed_object(address: ObjectAddress, length: usize) -> Object {
    let data_type = match length {
        1 => DataType::U8,
        2 => DataType::U16,
        _ => DataType::U32,
    };
    Object { address, data_type, name: UNNAMED }
}

fn other(target: &TargetDrive, frame: &Frame) -> String {
    let id = frame.id().value();
    let node = id & 0x7F;
    let kind = match id & 0x780 {
        0x080 if node == 0 => return "SYNC".to_owned(),
        0x100 if node == 0 => return "TIME".to_owned(),
        0x180 => "TPDO1",
        0x280 => "TPDO2",
        0x380 => "TPDO3",
        0x480 => "TPDO4",
        0x200 => "RPDO1",
        0x300 => "RPDO2",
        0x400 => "RPDO3",
        0x500 => "RPDO4",
        _ => "unknown",
    };
    let words = target.family().process_data_words(target, frame).unwrap_or_else(|| kind.to_owned());
    if node == u32::from(target.node) { words } else { format!("node {node}: {kind}") }
}

#[cfg(test)]
mod tests {
    use takt_rt::Id;

    use super::*;

    #[test]
    fn frames_of_the_vendors_own_protocol_are_named_as_such() {
        let target = TargetDrive::unconfigured(2, crate::family::EROB_CANOPEN).unwrap();
        let words = |id: u32, bytes: &[u8]| of(&target, &Frame::data(Id::base(id).unwrap(), bytes).unwrap());
        assert_eq!(words(0x642, &[0, 2]), "request in the vendor's custom CAN protocol");
        assert_eq!(words(0x5C2, &[0, 0, 1, 2, 0x3E]), "reply in the vendor's custom CAN protocol");
        assert!(words(0x642, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]).starts_with("node 66: read"));
    }
}
