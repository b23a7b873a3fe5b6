//! Describes frames in words, for the trace of a procedure.

use takt_rt::{Frame, MappedObject, StoppedHeartbeat};

use super::dictionary::{self, ObjectEntry};
use super::target::TargetDrive;
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use crate::canopen::object::{DataType, Object, ObjectAddress};
use crate::canopen::sdo::{SdoRequest, SdoResponse};

/// Describes a frame on the bus of `target`.
pub fn of(target: &TargetDrive, frame: &Frame) -> String {
    if let Some((command, target)) = NmtCommand::decode(frame) {
        return nmt(command, target);
    }
    // Its identifiers are those of the SDO of another node, but SDO frames have eight bytes.
    if let Some(other) = target.family().other_protocol(target.node)
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
        return at_node(target, emergency.node, format!("emergency: {emergency}"));
    }
    other(target, frame)
}

fn at_node(target: &TargetDrive, node: u8, words: String) -> String {
    if node == target.node { words } else { format!("node {node}: {words}") }
}

fn nmt(command: NmtCommand, target: NmtTarget) -> String {
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

fn requested(target: &TargetDrive, request: &SdoRequest) -> String {
    match request {
        SdoRequest::Upload { object } => format!("read {}", named(target, *object)),
        SdoRequest::DownloadExpedited { object, data } => {
            format!("set {} to {}", named(target, *object), value(target, *object, data.bytes()))
        }
        SdoRequest::Abort { object, code } => format!("abort {}: {code}", named(target, *object)),
        SdoRequest::UploadSegment { .. } => "next segment".to_owned(),
        other => format!("{other:?}"),
    }
}

fn answered(target: &TargetDrive, response: &SdoResponse) -> String {
    match response {
        SdoResponse::UploadExpedited { object, data } => {
            format!("{} is {}", named(target, *object), value(target, *object, data.bytes()))
        }
        SdoResponse::DownloadAccepted { object } => format!("{} accepted", named(target, *object)),
        SdoResponse::Abort { object, code } => format!("{} refused: {code}", named(target, *object)),
        SdoResponse::UploadSegmented { object, .. } => {
            format!("{} follows in segments", named(target, *object))
        }
        SdoResponse::UploadSegment { data, .. } => format!("segment {:02X?}", data.bytes()),
        other => format!("{other:?}"),
    }
}

/// The entry of an object, which is named as that of the first axis of the node.
fn entry(target: &TargetDrive, address: ObjectAddress) -> Option<ObjectEntry> {
    let own = MappedObject::new(address.index, address.subindex, 0);
    let first = own.as_of_first_axis(target.drive.node_axis);
    dictionary::entry(&target.drive, ObjectAddress::new(first.index, first.subindex))
}

fn named(target: &TargetDrive, address: ObjectAddress) -> String {
    let name = |entry: ObjectEntry| Object { address, ..entry.object }.to_string();
    entry(target, address).map_or_else(|| address.to_string(), name)
}

fn value(target: &TargetDrive, address: ObjectAddress, bytes: &[u8]) -> String {
    let entry = entry(target, address);
    let object = entry.map_or_else(|| unnamed_object(address, bytes.len()), |entry| entry.object);
    // A value of another length than in the table is shown as bytes.
    let Some(number) = object.data_type.decode(bytes) else { return format!("{bytes:02X?}") };
    let shown = object.show(number);
    if let Some(meaning) = target.family().meaning(&target.drive, &object, number) {
        return format!("{shown}: {meaning}");
    }
    match entry.and_then(|entry| entry.physical(target, number)) {
        Some((_, physical)) => format!("{shown} = {physical}"),
        None => shown,
    }
}

fn unnamed_object(address: ObjectAddress, length: usize) -> Object {
    let data_type = match length {
        1 => DataType::U8,
        2 => DataType::U16,
        _ => DataType::U32,
    };
    Object { address, data_type, name: "object" }
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
