//! What a frame means, in words: for whoever watches a procedure at work.

use takt_rt::Frame;

use super::dictionary::Entry;
use super::family::Family;
use super::subject::Subject;
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use crate::canopen::object::{DataType, Object, ObjectAddress};
use crate::canopen::sdo::{Request, Response};

/// The meaning of a frame on the bus of `subject`.
pub fn of(subject: &Subject, frame: &Frame) -> String {
    if let Some((command, target)) = NmtCommand::decode(frame) {
        return nmt(command, target);
    }
    if let Some((node, request)) = Request::decode(frame) {
        return at_node(subject, node, requested(subject, &request));
    }
    let whole = Frame::of(frame.id(), frame.first_word().to_le_bytes());
    if let Some((node, response)) = Response::decode(&whole).filter(|_| !frame.payload().is_empty()) {
        return at_node(subject, node, answered(subject, &response));
    }
    if let Some(message) = ErrorControl::decode(frame) {
        let words = match message.state {
            NmtState::BootUp => "boot-up".to_owned(),
            // This drive's heartbeat says so when it has an alarm.
            NmtState::Stopped if subject.family == Family::YzAim && message.node == subject.node => {
                "heartbeat: alarm".to_owned()
            }
            state => format!("heartbeat: {state}"),
        };
        return at_node(subject, message.node, words);
    }
    if let Some(emergency) = Emergency::decode(frame) {
        return at_node(subject, emergency.node, format!("emergency: {emergency}"));
    }
    other(subject, frame)
}

fn at_node(subject: &Subject, node: u8, words: String) -> String {
    if node == subject.node { words } else { format!("node {node}: {words}") }
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

fn requested(subject: &Subject, request: &Request) -> String {
    match request {
        Request::Upload { object } => format!("read {}", named(subject, *object)),
        Request::DownloadExpedited { object, data } => {
            format!("set {} to {}", named(subject, *object), value(subject, *object, data.bytes()))
        }
        Request::Abort { object, code } => format!("give up {}: {code}", named(subject, *object)),
        Request::UploadSegment { .. } => "next segment".to_owned(),
        other => format!("{other:?}"),
    }
}

fn answered(subject: &Subject, response: &Response) -> String {
    match response {
        Response::UploadExpedited { object, data } => {
            format!("{} is {}", named(subject, *object), value(subject, *object, data.bytes()))
        }
        Response::DownloadAccepted { object } => format!("{} accepted", named(subject, *object)),
        Response::Abort { object, code } => format!("{} refused: {code}", named(subject, *object)),
        Response::UploadSegmented { object, .. } => {
            format!("{} follows in segments", named(subject, *object))
        }
        Response::UploadSegment { data, .. } => format!("segment {:02X?}", data.bytes()),
        other => format!("{other:?}"),
    }
}

fn entry(subject: &Subject, address: ObjectAddress) -> Option<&'static Entry> {
    subject.family.objects().iter().find(|entry| entry.object.address == address)
}

fn named(subject: &Subject, address: ObjectAddress) -> String {
    entry(subject, address).map_or_else(|| address.to_string(), |entry| entry.object.to_string())
}

fn value(subject: &Subject, address: ObjectAddress, bytes: &[u8]) -> String {
    let entry = entry(subject, address);
    let object = entry.map_or_else(|| untold(address, bytes.len()), |entry| entry.object);
    // What the drive calls otherwise than the table is shown by its bytes.
    let Some(number) = object.data_type.decode(bytes) else { return format!("{bytes:02X?}") };
    let shown = object.show(number);
    if let Some(meaning) = subject.family.meaning(&object, number) {
        return format!("{shown}: {meaning}");
    }
    match entry.and_then(|entry| entry.physical(subject, number)) {
        Some((_, physical)) => format!("{shown} = {physical}"),
        None => shown,
    }
}

fn untold(address: ObjectAddress, length: usize) -> Object {
    let data_type = match length {
        1 => DataType::U8,
        2 => DataType::U16,
        _ => DataType::U32,
    };
    Object { address, data_type, name: "object" }
}

fn other(subject: &Subject, frame: &Frame) -> String {
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
        0x580 if node < 64 && frame.payload().len() < 8 => "answer in the vendor's own protocol",
        0x640..=0x67F => "question in the vendor's own protocol",
        _ => "not known",
    };
    let words = subject.family.process_data_words(subject, frame).unwrap_or_else(|| kind.to_owned());
    if node == u32::from(subject.node) { words } else { format!("node {node}: {kind}") }
}
