//! One frame to its meaning.

use std::collections::BTreeMap;

use takt_rt::{DriveState, Frame, FrameKind, TimeOfDay};
use takt_wire::canopen::function_code;
use takt_wire::canopen::lss::{LssRequest, LssResponse};
use takt_wire::canopen::nmt::{ErrorControl, NmtCommand, NmtState, NmtTarget};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::objects::PdoDirection;
use takt_wire::canopen::pdo_configuration::PdoConfiguration;
use takt_wire::canopen::sdo::{SdoRequest, SdoResponse};

use super::decoded::{Decoded, DecodedValue, Service};
use super::members::{Member, Members, NamedDrive, Spoken};
use super::process_data;
use super::sdo_traffic::{Heard, SdoTraffic};
use takt::config::Config;
use takt::family::commission::{TargetDrive, meaning};

/// The identifiers of LSS (CiA 305).
const LSS_REQUEST: u32 = 0x7E5;
const LSS_RESPONSE: u32 = 0x7E4;

/// Tells what the frames of one bus mean. They come in their order.
pub struct BusDecoder {
    members: Members,
    /// The node ID of the controller by the configuration.
    controller: Option<u8>,
    sdo: BTreeMap<u8, SdoTraffic>,
}

impl BusDecoder {
    /// Of a bus of a configuration, by its number.
    pub fn of(config: &Config, bus: usize) -> Self {
        Self { controller: Some(config.master.node), ..Self::knowing(Members::of(config, bus)) }
    }

    /// Of a bus with these drives, and others.
    pub fn with_drives(drives: &[NamedDrive]) -> Self {
        Self::knowing(Members::named(drives))
    }

    fn knowing(members: Members) -> Self {
        Self { members, controller: None, sdo: BTreeMap::new() }
    }

    /// What a frame means.
    pub fn decode(&mut self, frame: &Frame) -> Decoded {
        if frame.kind() == FrameKind::Remote {
            return self.remote(frame);
        }
        if let Some(decoded) = self.by_members(frame) {
            return decoded;
        }
        // Everything else is of CANopen, whose frames are classic ones with 11 bits.
        if frame.id().is_extended() || frame.is_fd() {
            return Decoded::of(Service::Unknown, "");
        }
        let node = (frame.id().value() & 0x7F) as u8;
        let function = (frame.id().value() & 0x780) as u16;
        match frame.id().value() {
            0x000 => self.nmt(frame),
            0x080 => sync(frame),
            0x100 => time(frame),
            LSS_REQUEST => lss(Service::LssRequest, LssRequest::decode(frame)),
            LSS_RESPONSE => lss(Service::LssResponse, LssResponse::decode(frame)),
            _ => self.pdo(frame).or_else(|| self.of_node(frame, function, node)).unwrap_or_else(|| {
                self.given_away(frame).unwrap_or_else(|| Decoded::of(Service::Unknown, ""))
            }),
        }
    }

    /// A frame that belongs to a drive with other frames than those of CANopen.
    fn by_members(&mut self, frame: &Frame) -> Option<Decoded> {
        self.members.iter_mut().find_map(|member| match &mut member.spoken {
            Spoken::Canopen(_) => None,
            Spoken::Own(_) => own_protocol(member, frame),
            Spoken::Fields(fields) => {
                let found = fields.decode(frame)?;
                let decoded = Decoded { values: found.values, ..Decoded::of(found.service, found.words) };
                Some(Decoded { shows_torque: found.shows_torque, ..decoded.concerning(member) })
            }
        })
    }

    /// A short frame under an identifier of the SDO of another node is one of a protocol of its own: SDO has eight bytes.
    fn given_away(&mut self, frame: &Frame) -> Option<Decoded> {
        own_protocol(self.members.by_own_protocol(frame)?, frame)
    }

    fn remote(&mut self, frame: &Frame) -> Decoded {
        let node = (frame.id().value() & 0x7F) as u8;
        let is_guarding = frame.id().value() & 0x780 == u32::from(function_code::ERROR_CONTROL);
        if frame.id().is_extended() || !is_guarding || node == 0 {
            return Decoded::of(Service::Remote, format!("asks for {} bytes", frame.length()));
        }
        self.at_node(Service::NodeGuarding, node, "asks for the NMT state".to_owned())
    }

    fn nmt(&mut self, frame: &Frame) -> Decoded {
        let Some((command, target)) = NmtCommand::decode(frame) else {
            return Decoded::of(Service::Nmt, "a command that CiA 301 does not know");
        };
        if matches!(command, NmtCommand::ResetNode | NmtCommand::ResetCommunication) {
            // The PDOs are as they were stored, which nobody has told.
            match target {
                NmtTarget::All => self.sdo.clear(),
                NmtTarget::Node(node) => drop(self.sdo.remove(&node)),
            }
        }
        let words = meaning::nmt(command, target);
        let node = match target {
            NmtTarget::All => None,
            NmtTarget::Node(node) => Some(node),
        };
        let axes = self.members.iter().filter(|member| Some(member.target.node) == node);
        let axes = axes.filter_map(|member| member.axis).collect();
        Decoded { node, axes, ..Decoded::of(Service::Nmt, words) }
    }

    /// Process data, by the mapping that was heard, or else by the configuration.
    fn pdo(&mut self, frame: &Frame) -> Option<Decoded> {
        let id = frame.id();
        let has_id = |pdo: &PdoConfiguration| pdo.id == Some(id) && pdo.is_valid && !pdo.objects.is_empty();
        let heard = self.sdo.iter().find_map(|(node, sdo)| {
            sdo.pdos().iter().find(|pdo| has_id(pdo)).map(|pdo| (*node, pdo.clone()))
        });
        if let Some((node, pdo)) = heard {
            return Some(self.pdo_of_node(frame, node, &pdo));
        }
        let mut all: Option<Decoded> = None;
        for member in self.members.iter() {
            let Spoken::Canopen(pdos) = &member.spoken else { continue };
            let Some(pdo) = pdos.iter().find(|pdo| has_id(pdo)) else { continue };
            let one = by_mapping(member, pdo, frame);
            all = Some(match all {
                None => one,
                // Several axes share the command.
                Some(before) => before.and(one),
            });
        }
        all
    }

    fn pdo_of_node(&mut self, frame: &Frame, node: u8, pdo: &PdoConfiguration) -> Decoded {
        let object = pdo.objects.iter().find(|object| object.index >= 0x6000);
        let object = object.map(|object| ObjectAddress::new(object.index, object.subindex));
        match self.members.canopen(node, object) {
            Some(member) => by_mapping(member, pdo, frame),
            None => Decoded { node: Some(node), ..Decoded::of(pdo_service(pdo), "") },
        }
    }

    fn of_node(&mut self, frame: &Frame, function: u16, node: u8) -> Option<Decoded> {
        if node == 0 {
            return None;
        }
        let place =
            |all: [u16; 4]| all.iter().position(|known| *known == function).map(|place| place as u16 + 1);
        match function {
            function_code::EMERGENCY => {
                let member = self.members.canopen(node, None)?;
                let words = meaning::of(&member.target, frame);
                let words = words.strip_prefix("emergency: ").unwrap_or("no emergency message").to_owned();
                Some(Decoded::of(Service::Emergency, words).concerning(member))
            }
            function_code::ERROR_CONTROL => {
                let message = ErrorControl::decode(frame)?;
                if self.controller == Some(node)
                    && !self.members.iter().any(|member| member.target.node == node)
                {
                    let decoded = Decoded::of(Service::ControllerHeartbeat, message.state.to_string());
                    return Some(Decoded { node: Some(node), who: "controller".to_owned(), ..decoded });
                }
                if message.state == NmtState::BootUp {
                    self.sdo.remove(&node);
                }
                let member = self.members.canopen(node, None)?;
                let words = meaning::of(&member.target, frame);
                let words = words.strip_prefix("heartbeat: ").unwrap_or(&words).to_owned();
                Some(Decoded::of(Service::Heartbeat, words).concerning(member))
            }
            function_code::SDO_REQUEST => self.sdo_request(frame, node),
            function_code::SDO_RESPONSE => self.sdo_response(frame, node),
            _ => {
                let (rpdo, tpdo) = (place(function_code::RPDO), place(function_code::TPDO));
                let predefined = self.sdo.get(&node).and_then(|sdo| sdo.predefined(function)).cloned();
                if let Some(pdo) = predefined.filter(|pdo| !pdo.objects.is_empty()) {
                    let pdo = PdoConfiguration { id: Some(frame.id()), is_valid: true, ..pdo };
                    return Some(self.pdo_of_node(frame, node, &pdo));
                }
                let service = rpdo.map(|number| Service::Rpdo(Some(number)));
                let service = service.or(tpdo.map(|number| Service::Tpdo(Some(number))))?;
                let member = self.members.canopen(node, None)?;
                // A family whose mapping never changes has words for it.
                let words = member.target.family().process_data_words(&member.target, frame);
                let words = words.unwrap_or_default();
                let words = words.split_once(": ").map_or(words.as_str(), |(_, words)| words).to_owned();
                let shows_torque = (service == Service::Tpdo(Some(1)) && words.is_empty())
                    .then(|| by_default_mapping(frame))
                    .flatten();
                Some(Decoded { shows_torque, ..Decoded::of(service, words).concerning(member) })
            }
        }
    }

    fn sdo_request(&mut self, frame: &Frame, node: u8) -> Option<Decoded> {
        if frame.payload().len() < 8 {
            return None;
        }
        let heard = self.sdo.entry(node).or_default().request(frame)?;
        let member = self.members.canopen(node, object_of_request(&heard))?;
        let words = sdo_words(member, &heard, meaning::requested);
        Some(Decoded::of(Service::SdoRequest, words).concerning(member))
    }

    fn sdo_response(&mut self, frame: &Frame, node: u8) -> Option<Decoded> {
        // A drive may leave out the bytes that it does not use; a shorter frame yet is one of another protocol.
        let is_own = frame.payload().len() < 8 && self.is_asked_in_own_protocol(frame);
        if is_own {
            return None;
        }
        let heard = self.sdo.entry(node).or_default().response(frame)?;
        let member = self.members.canopen(node, object_of_response(&heard))?;
        let words = sdo_words(member, &heard, meaning::answered);
        Some(Decoded::of(Service::SdoResponse, words).concerning(member))
    }

    /// Returns `true` if a drive has given itself away by its own protocol, and this may be its reply.
    fn is_asked_in_own_protocol(&mut self, frame: &Frame) -> bool {
        self.members.by_own_protocol(frame).is_some()
    }

    fn at_node(&mut self, service: Service, node: u8, words: String) -> Decoded {
        match self.members.canopen(node, None) {
            Some(member) => Decoded::of(service, words).concerning(member),
            None => Decoded { node: Some(node), ..Decoded::of(service, words) },
        }
    }
}

impl Decoded {
    fn concerning(self, member: &Member) -> Self {
        Self {
            node: Some(member.target.node),
            axes: member.axis.into_iter().collect(),
            who: member.target.name.clone(),
            ..self
        }
    }

    /// A frame that concerns the axes of both.
    fn and(mut self, other: Self) -> Self {
        // One that has been merged before has the names in its values.
        let mut values = if self.axes.len() > 1 { self.values } else { with_names(&self.who, self.values) };
        values.extend(with_names(&other.who, other.values));
        self.who = format!("{}, {}", self.who, other.who);
        self.axes.extend(other.axes);
        self.words = process_data::words(&values);
        self.values = values;
        self.node = None;
        self
    }
}

/// Returns `true` if the first TPDO of a drive shows torque, if it has its default mapping: the statusword comes first (CiA 402-2). A bit
/// pattern that is no state of a drive is something else.
fn by_default_mapping(frame: &Frame) -> Option<bool> {
    let word = u16::from_le_bytes(*frame.payload().first_chunk()?);
    let state = DriveState::decode(word);
    (state != DriveState::Undefined).then(|| state.has_torque())
}

/// Values of an axis among those of others.
fn with_names(who: &str, values: Vec<DecodedValue>) -> Vec<DecodedValue> {
    let named = |value: DecodedValue| DecodedValue { name: format!("{who} {}", value.name), ..value };
    values.into_iter().map(named).collect()
}

const fn pdo_service(pdo: &PdoConfiguration) -> Service {
    match pdo.direction {
        PdoDirection::Receive => Service::Rpdo(Some(pdo.number)),
        PdoDirection::Transmit => Service::Tpdo(Some(pdo.number)),
    }
}

fn by_mapping(member: &Member, pdo: &PdoConfiguration, frame: &Frame) -> Decoded {
    let Some(values) = process_data::values(&member.target, pdo, frame) else {
        let words = if frame.payload().len() < pdo.length() {
            format!("{} bytes, the mapping has {}", frame.payload().len(), pdo.length())
        } else {
            String::new()
        };
        return Decoded::of(pdo_service(pdo), words).concerning(member);
    };
    let shows_torque = match pdo.direction {
        PdoDirection::Transmit => process_data::shows_torque(&member.target, &values),
        PdoDirection::Receive => None,
    };
    let words = process_data::words(&values);
    Decoded { values, shows_torque, ..Decoded::of(pdo_service(pdo), words).concerning(member) }
}

fn own_protocol(member: &mut Member, frame: &Frame) -> Option<Decoded> {
    let is_request = member.own_direction(frame)?;
    let Spoken::Own(words) = &mut member.spoken else { return None };
    let words = words(frame);
    let service = if is_request { Service::Command } else { Service::Reply };
    Some(Decoded::of(service, words).concerning(member))
}

fn sync(frame: &Frame) -> Decoded {
    match frame.payload() {
        [counter] => Decoded::of(Service::Sync, format!("counter {counter}")),
        _ => Decoded::of(Service::Sync, ""),
    }
}

fn time(frame: &Frame) -> Decoded {
    let Ok(bytes) = frame.payload().try_into() else { return Decoded::of(Service::Time, "no time of day") };
    let TimeOfDay { days, milliseconds } = TimeOfDay::from_bytes(bytes);
    let (seconds, rest_ms) = (milliseconds / 1000, milliseconds % 1000);
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    let words = format!("{hours:02}:{minutes:02}:{seconds:02}.{rest_ms:03}, {days} days after 1984-01-01");
    Decoded::of(Service::Time, words)
}

fn lss(service: Service, message: Option<impl std::fmt::Display>) -> Decoded {
    let words = message.map_or_else(|| "no message of CiA 305".to_owned(), |message| message.to_string());
    Decoded::of(service, words)
}

fn sdo_words<M>(member: &Member, heard: &Heard<M>, words: impl Fn(&TargetDrive, &M) -> String) -> String {
    match heard {
        Heard::Message(message) => words(&member.target, message),
        Heard::End { message, object, content } => {
            format!(
                "{}; {} is {content}",
                words(&member.target, message),
                meaning::named(&member.target, *object)
            )
        }
        Heard::BlockSegment { object, number, is_last } => {
            let last = if *is_last { ", the last one" } else { "" };
            format!("segment {number} of {}{last}", meaning::named(&member.target, *object))
        }
    }
}

fn object_of_request(heard: &Heard<SdoRequest>) -> Option<ObjectAddress> {
    match heard {
        Heard::BlockSegment { object, .. } | Heard::End { object, .. } => Some(*object),
        Heard::Message(
            SdoRequest::Upload { object }
            | SdoRequest::DownloadExpedited { object, .. }
            | SdoRequest::DownloadSegmented { object, .. }
            | SdoRequest::BlockUpload { object, .. }
            | SdoRequest::BlockDownload { object, .. }
            | SdoRequest::Abort { object, .. },
        ) => Some(*object),
        Heard::Message(_) => None,
    }
}

fn object_of_response(heard: &Heard<SdoResponse>) -> Option<ObjectAddress> {
    match heard {
        Heard::BlockSegment { object, .. } | Heard::End { object, .. } => Some(*object),
        Heard::Message(
            SdoResponse::UploadExpedited { object, .. }
            | SdoResponse::UploadSegmented { object, .. }
            | SdoResponse::DownloadAccepted { object }
            | SdoResponse::BlockUpload { object, .. }
            | SdoResponse::BlockDownload { object, .. }
            | SdoResponse::Abort { object, .. },
        ) => Some(*object),
        Heard::Message(_) => None,
    }
}
