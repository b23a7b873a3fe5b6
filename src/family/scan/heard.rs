//! What devices send by themselves, and what answers.

use std::collections::{BTreeMap, BTreeSet};

use takt_rt::{Frame, FrameKind, Id};
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::nmt::{ErrorControl, NmtState};
use takt_wire::canopen::{function_code, node_of};

use super::own_protocol::{Likeness, OwnProtocol};
use crate::family;

/// Other identifiers that are kept apart. A device that sends under more is counted all the same.
const OTHERS: usize = 32;

/// So many heartbeats make a drive. Fewer may be frames of somebody else that look like one.
const HEARTBEATS: u32 = 3;

/// What was heard of a CANopen node.
#[derive(Clone, Debug, Default)]
pub struct HeardNode {
    /// The NMT state that it has reported last.
    pub state: Option<NmtState>,
    /// Boot-up messages.
    pub boot_ups: u32,
    /// The last emergency message that was not the end of one.
    pub emergency: Option<Emergency>,
    /// True if it has sent process data, under the identifiers of the pre-defined connection set.
    pub has_process_data: bool,
    /// The identifiers of its process data and emergency messages.
    ids: BTreeSet<u32>,
    /// SDO requests of this scan, and SDO responses.
    requests: u32,
    responses: u32,
}

impl HeardNode {
    /// Returns `true` if anything has come from it.
    pub const fn is_there(&self) -> bool {
        self.state.is_some() || self.emergency.is_some() || self.has_process_data || self.has_answered()
    }

    /// Returns `true` if it has answered an SDO request.
    pub const fn has_answered(&self) -> bool {
        self.responses > 0
    }

    /// Returns `true` if more responses have come than requests were sent.
    pub const fn answers_twice(&self) -> bool {
        self.requests > 0 && self.responses > self.requests
    }
}

/// What was heard of a drive with a protocol of its own.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeardDrive {
    requests: u32,
    replies: u32,
    /// Its first reply.
    pub reply: Option<Frame>,
}

impl HeardDrive {
    /// Returns `true` if more replies have come than requests were sent.
    pub const fn answers_twice(&self) -> bool {
        self.requests > 0 && self.replies > self.requests
    }
}

/// Frames by the identifier of a heartbeat.
#[derive(Clone, Copy, Debug)]
struct HeardHeartbeats {
    /// The CANopen node to which the identifier belongs, if there is one.
    node: Option<u8>,
    alike: u32,
    different: u32,
}

impl HeardHeartbeats {
    /// Returns `true` if a drive may be there. By an identifier that CANopen does not have, frames of any bytes show that.
    const fn may_be(&self) -> bool {
        self.alike > 0 || self.node.is_none()
    }

    /// Returns `true` if they are those of a drive, if no CANopen node has this identifier.
    const fn are(&self) -> bool {
        self.alike >= HEARTBEATS && self.different == 0
    }
}

/// What was heard on a bus.
#[derive(Debug)]
pub struct Heard {
    protocols: Vec<&'static dyn OwnProtocol>,
    nodes: BTreeMap<u8, HeardNode>,
    /// By the place of the protocol, and the node ID.
    drives: BTreeMap<(usize, u8), HeardDrive>,
    /// By the place of the protocol, and the node ID.
    heartbeats: BTreeMap<(usize, u8), HeardHeartbeats>,
    /// Frames of a master by their identifiers: SYNC, NMT, requests, set-points.
    master_frames: BTreeMap<u64, (Id, u64)>,
    /// Frames that belong to nothing known, by their identifiers.
    others: BTreeMap<u64, (Id, u64)>,
    frames: u64,
}

impl Heard {
    pub(super) fn new() -> Self {
        let protocols = family::all().into_iter().flat_map(|family| family.own_protocols()).copied();
        let mut protocols: Vec<_> = protocols.collect();
        // Replies to a read are told more surely than those to a command, which have no mark of their own.
        protocols.sort_by_key(|protocol| protocol.consequence().is_some());
        Self {
            protocols,
            nodes: BTreeMap::new(),
            drives: BTreeMap::new(),
            heartbeats: BTreeMap::new(),
            master_frames: BTreeMap::new(),
            others: BTreeMap::new(),
            frames: 0,
        }
    }

    /// The protocols of vendors.
    pub(super) fn protocols(&self) -> &[&'static dyn OwnProtocol] {
        &self.protocols
    }

    /// The CANopen nodes.
    pub fn nodes(&self) -> impl Iterator<Item = (u8, &HeardNode)> {
        self.nodes.iter().map(|(node, heard)| (*node, heard))
    }

    /// A CANopen node.
    pub fn node(&self, node: u8) -> Option<&HeardNode> {
        self.nodes.get(&node)
    }

    /// The drives that have replied in the protocol at this place. What has the identifier of a drive that sends heartbeats is no reply.
    pub(super) fn drives_of(&self, protocol: usize) -> impl Iterator<Item = (u8, HeardDrive)> + '_ {
        let heartbeating = self.heartbeating();
        let of_protocol = self.drives.range((protocol, 0)..=(protocol, u8::MAX));
        let has_replied = move |heard: &HeardDrive| {
            heard.reply.is_some_and(|reply| !self.belongs_to(&heartbeating, reply.id()))
        };
        of_protocol.map(|((_, node), heard)| (*node, *heard)).filter(move |(_, heard)| has_replied(heard))
    }

    /// Frames of a master that is not this one.
    pub fn master_frames(&self) -> u64 {
        let drives = self.heartbeating();
        let of_master = self.master_frames.values().filter(|(id, _)| !self.belongs_to(&drives, *id));
        of_master.map(|(_, frames)| frames).sum()
    }

    /// The drives that are known by their heartbeats: the place of the protocol, and the node ID. Where a CANopen node shows that it is
    /// there, the frames by its identifiers are its own.
    pub(super) fn heartbeating(&self) -> Vec<(usize, u8)> {
        let is_of_node = |heard: &HeardHeartbeats| {
            let node = heard.node.and_then(|node| self.nodes.get(&node));
            node.is_some_and(|node| node.state.is_some() || node.has_answered())
        };
        let drives = self.heartbeats.iter().filter(|(_, heard)| heard.are() && !is_of_node(heard));
        drives.map(|(drive, _)| *drive).collect()
    }

    /// Returns `true` if an identifier belongs to one of these drives.
    fn belongs_to(&self, drives: &[(usize, u8)], id: Id) -> bool {
        drives.iter().any(|(place, node)| {
            self.protocols.get(*place).is_some_and(|protocol| protocol.has_identifier(*node, id))
        })
    }

    /// The protocol of a drive that may be there by its heartbeats, and would take a frame of this identifier for something that is meant
    /// for it.
    pub(super) fn would_take(&self, id: Id) -> Option<&'static dyn OwnProtocol> {
        let mut there = self.heartbeats.iter().filter(|(_, heard)| heard.may_be());
        there.find_map(|((place, node), _)| {
            let protocol = *self.protocols.get(*place)?;
            (protocol.is_harmed_by(id) || protocol.has_identifier(*node, id)).then_some(protocol)
        })
    }

    /// Returns `true` if nothing was heard of a node but frames by identifiers of drives that are known by their heartbeats.
    pub(super) fn is_mistaken(&self, node: &HeardNode) -> bool {
        let drives = self.heartbeating();
        let has_shown_itself = node.state.is_some() || node.has_answered();
        let is_of_drive = |id: &u32| Id::base(*id).is_ok_and(|id| self.belongs_to(&drives, id));
        !has_shown_itself && !node.ids.is_empty() && node.ids.iter().all(is_of_drive)
    }

    /// Returns `true` if another drive that has replied takes frames of this identifier for commands.
    pub(super) fn is_command_to_other(&self, protocol: usize, id: Id) -> bool {
        self.drives.iter().filter(|((place, _), heard)| *place != protocol && heard.reply.is_some()).any(
            |((place, node), _)| {
                self.protocols.get(*place).is_some_and(|protocol| protocol.is_commanded_by(*node, id))
            },
        )
    }

    /// All frames.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// The identifiers that belong to nothing known, with the number of their frames.
    pub fn others(&self) -> impl Iterator<Item = (Id, u64)> + '_ {
        let drives = self.heartbeating();
        self.others.values().copied().filter(move |(id, _)| !self.belongs_to(&drives, *id))
    }

    pub(super) fn sdo_request(&mut self, node: u8) {
        let heard = self.nodes.entry(node).or_default();
        heard.requests = heard.requests.saturating_add(1);
    }

    pub(super) fn own_request(&mut self, protocol: usize, node: u8) {
        let heard = self.drives.entry((protocol, node)).or_default();
        heard.requests = heard.requests.saturating_add(1);
    }

    /// The same, of a protocol by its name.
    pub(super) fn own_request_of(&mut self, name: &str, node: u8) {
        if let Some(place) = self.protocols.iter().position(|protocol| protocol.name() == name) {
            self.own_request(place, node);
        }
    }

    /// Takes a frame.
    pub(super) fn take(&mut self, frame: &Frame) {
        self.frames = self.frames.saturating_add(1);
        if let Some((place, node)) = self.replying(frame) {
            let heard = self.drives.entry((place, node)).or_default();
            heard.replies = heard.replies.saturating_add(1);
            heard.reply.get_or_insert(*frame);
            return;
        }
        self.take_heartbeat(frame);
        if frame.kind() != FrameKind::Data
            || frame.id().is_extended()
            || frame.is_fd()
            || !self.take_canopen(frame)
        {
            self.take_other(frame);
        }
    }

    /// The protocol in which a frame is a reply, and the node that it comes from.
    fn replying(&self, frame: &Frame) -> Option<(usize, u8)> {
        self.protocols
            .iter()
            .enumerate()
            .find_map(|(place, protocol)| Some((place, protocol.replying(frame)?)))
    }

    /// Counts a frame by the identifier of a heartbeat. It may be another frame all the same.
    fn take_heartbeat(&mut self, frame: &Frame) {
        for (place, protocol) in self.protocols.iter().enumerate() {
            let Some((node, likeness)) = protocol.heartbeat(frame) else { continue };
            let unheard = HeardHeartbeats { node: node_by_id(frame), alike: 0, different: 0 };
            let heard = self.heartbeats.entry((place, node)).or_insert(unheard);
            let count = match likeness {
                Likeness::Alike => &mut heard.alike,
                Likeness::Different => &mut heard.different,
            };
            *count = count.saturating_add(1);
        }
    }

    /// Takes a frame of the pre-defined connection set (CiA 301, 7.3.3). Returns whether it is one.
    fn take_canopen(&mut self, frame: &Frame) -> bool {
        if let Some(ErrorControl { node, state }) = ErrorControl::decode(frame) {
            let heard = self.nodes.entry(node).or_default();
            heard.state = Some(state);
            heard.boot_ups = heard.boot_ups.saturating_add(u32::from(state == NmtState::BootUp));
            return true;
        }
        if let Some(node) = node_of(frame, function_code::SDO_RESPONSE) {
            let heard = self.nodes.entry(node).or_default();
            heard.responses = heard.responses.saturating_add(1);
            return true;
        }
        if let Some(emergency) = Emergency::decode(frame) {
            let is_gone = emergency.code.0 & 0xFF00 == 0;
            let heard = self.nodes.entry(emergency.node).or_default();
            heard.emergency = (!is_gone).then_some(emergency);
            heard.ids.insert(frame.id().value());
            return true;
        }
        if let Some(node) = function_code::TPDO.into_iter().find_map(|function| node_of(frame, function)) {
            let heard = self.nodes.entry(node).or_default();
            heard.has_process_data = true;
            heard.ids.insert(frame.id().value());
            return true;
        }
        let is_master = is_of_master(frame);
        if is_master {
            let key = frame.id().arbitration_key();
            let (_, frames) = self.master_frames.entry(key).or_insert((frame.id(), 0));
            *frames = frames.saturating_add(1);
        }
        is_master
    }

    fn take_other(&mut self, frame: &Frame) {
        let key = frame.id().arbitration_key();
        if self.others.len() < OTHERS || self.others.contains_key(&key) {
            let (_, frames) = self.others.entry(key).or_insert((frame.id(), 0));
            *frames = frames.saturating_add(1);
        }
    }
}

/// Requests of an LSS master (CiA 305).
const LSS_REQUEST: u32 = 0x7E5;
/// Replies of LSS devices.
const LSS_RESPONSE: u32 = 0x7E4;

/// The node to which an identifier belongs in the pre-defined connection set.
fn node_by_id(frame: &Frame) -> Option<u8> {
    let one = [function_code::EMERGENCY, function_code::SDO_RESPONSE, function_code::SDO_REQUEST];
    let functions = one.into_iter().chain(function_code::TPDO).chain(function_code::RPDO);
    functions.into_iter().find_map(|function| node_of(frame, function))
}

fn is_of_master(frame: &Frame) -> bool {
    let id = frame.id().value();
    let to_nodes = function_code::RPDO.into_iter().chain([function_code::SDO_REQUEST]);
    matches!(id, 0x000 | 0x080 | 0x100 | LSS_REQUEST | LSS_RESPONSE)
        || to_nodes.into_iter().any(|function| node_of(frame, function).is_some())
}
