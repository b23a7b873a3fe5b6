//! What devices send by themselves, and what answers.

use std::collections::BTreeMap;

use takt_rt::{Frame, FrameKind, Id};

use super::own_protocol::OwnProtocol;
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{ErrorControl, NmtState};
use crate::canopen::{function_code, node_of};
use crate::family;

/// Other identifiers that are kept apart. A device that sends under more is counted all the same.
const OTHERS: usize = 32;

/// What was heard of a CANopen node.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeardNode {
    /// The NMT state that it has reported last.
    pub state: Option<NmtState>,
    /// Boot-up messages.
    pub boot_ups: u32,
    /// The last emergency message that was not the end of one.
    pub emergency: Option<Emergency>,
    /// Whether it has sent process data, under the identifiers of the pre-defined connection set.
    pub has_process_data: bool,
    /// SDO requests of this scan, and SDO responses.
    requests: u32,
    responses: u32,
}

impl HeardNode {
    /// Whether anything has come from it.
    pub const fn is_there(&self) -> bool {
        self.state.is_some() || self.emergency.is_some() || self.has_process_data || self.has_answered()
    }

    /// Whether it has answered an SDO request.
    pub const fn has_answered(&self) -> bool {
        self.responses > 0
    }

    /// Whether more responses have come than requests were sent.
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
    /// Whether more replies have come than requests were sent.
    pub const fn answers_twice(&self) -> bool {
        self.requests > 0 && self.replies > self.requests
    }
}

/// What was heard on a bus.
#[derive(Debug)]
pub struct Heard {
    protocols: Vec<&'static dyn OwnProtocol>,
    nodes: BTreeMap<u8, HeardNode>,
    /// By the place of the protocol, and the node ID.
    drives: BTreeMap<(usize, u8), HeardDrive>,
    /// Frames of a master: SYNC, NMT, requests, set-points.
    master_frames: u64,
    /// Frames that belong to nothing known, by their identifiers.
    others: BTreeMap<u64, (Id, u64)>,
    frames: u64,
}

impl Heard {
    pub(super) fn new() -> Self {
        Self {
            protocols: family::all().into_iter().flat_map(|family| family.own_protocols()).copied().collect(),
            nodes: BTreeMap::new(),
            drives: BTreeMap::new(),
            master_frames: 0,
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

    /// The drives that have replied in the protocol at this place.
    pub(super) fn drives_of(&self, protocol: usize) -> impl Iterator<Item = (u8, HeardDrive)> + '_ {
        let of_protocol = self.drives.range((protocol, 0)..=(protocol, u8::MAX));
        of_protocol.map(|((_, node), heard)| (*node, *heard)).filter(|(_, heard)| heard.reply.is_some())
    }

    /// Frames of a master that is not this one.
    pub const fn master_frames(&self) -> u64 {
        self.master_frames
    }

    /// All frames.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// The identifiers that belong to nothing known, with the number of their frames.
    pub fn others(&self) -> impl Iterator<Item = (Id, u64)> + '_ {
        self.others.values().copied()
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
            self.nodes.entry(emergency.node).or_default().emergency = (!is_gone).then_some(emergency);
            return true;
        }
        if let Some(node) = function_code::TPDO.into_iter().find_map(|function| node_of(frame, function)) {
            self.nodes.entry(node).or_default().has_process_data = true;
            return true;
        }
        let is_master = is_of_master(frame);
        self.master_frames = self.master_frames.saturating_add(u64::from(is_master));
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

fn is_of_master(frame: &Frame) -> bool {
    let id = frame.id().value();
    let to_nodes = function_code::RPDO.into_iter().chain([function_code::SDO_REQUEST]);
    matches!(id, 0x000 | 0x080 | 0x100 | LSS_REQUEST | LSS_RESPONSE)
        || to_nodes.into_iter().any(|function| node_of(frame, function).is_some())
}
