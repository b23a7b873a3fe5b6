//! The CANopen client of a procedure: the SDO client of one node, and what the node reports by itself.

use std::collections::VecDeque;

use takt_rt::{Frame, Id, Nanoseconds};
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::function_code;
use takt_wire::canopen::nmt::{ErrorControl, NmtState};
use takt_wire::canopen::sdo::SdoClient;

use super::client::Client;
use super::sdo_quirks::SdoQuirks;

/// The client of one node.
#[derive(Debug)]
pub struct CanopenClient {
    pub(super) node: u8,
    pub(super) quirks: SdoQuirks,
    pub(super) sdo: SdoClient,
    /// No SDO transfer begins before this time.
    pub(super) free_ns: Nanoseconds,
    /// Sent before each SDO request, if it is set.
    pub(super) before_request: Option<Frame>,
    pub(super) outgoing: VecDeque<Frame>,
    /// The frames received since collecting began; `None` while nothing is collected.
    pub(super) collected: Option<Vec<Frame>>,
    /// The NMT state that the node has reported last.
    pub(super) nmt_state: Option<NmtState>,
    /// Each NMT state that the node has reported since the last NMT command, once.
    pub(super) reported_states: Vec<NmtState>,
    /// The number of boot-up messages of the node.
    pub(super) boot_ups: u32,
    /// How many of them do not count as a restart; `None` before the node has obeyed its master.
    pub(super) expected_boot_ups: Option<u32>,
    /// The last emergency message, unless an "error reset" message (code 00xx) followed.
    pub(super) emergency: Option<Emergency>,
    pub(super) heartbeat: Option<OwnHeartbeat>,
}

/// The heartbeat that this program sends while a procedure runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnHeartbeat {
    pub node: u8,
    pub period_ns: Nanoseconds,
    pub due_ns: Nanoseconds,
}

impl CanopenClient {
    /// The client for a node ID (1 to 127).
    pub fn new(node: u8, quirks: SdoQuirks) -> Self {
        Self {
            node,
            quirks,
            sdo: SdoClient::new(node, quirks.timing),
            free_ns: 0,
            before_request: None,
            outgoing: VecDeque::new(),
            collected: None,
            nmt_state: None,
            reported_states: vec![],
            boot_ups: 0,
            expected_boot_ups: None,
            emergency: None,
            heartbeat: None,
        }
    }

    fn sdo_request(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let request = self.sdo.poll(now_ns)?;
        let Some(before) = self.before_request else { return Some(request) };
        self.outgoing.push_back(request);
        Some(before)
    }

    /// The own heartbeat frame, when it is due.
    fn heartbeat_frame(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let heartbeat = self.heartbeat.as_mut().filter(|heartbeat| heartbeat.due_ns <= now_ns)?;
        heartbeat.due_ns = now_ns.saturating_add(heartbeat.period_ns);
        Some(ErrorControl { node: heartbeat.node, state: NmtState::Operational }.frame())
    }

    /// A reply that is shorter than eight bytes, with the zeros that the drive has left out.
    fn completed_reply(&self, frame: &Frame) -> Option<Frame> {
        let is_reply = frame.id() == Id::canopen(function_code::SDO_RESPONSE, self.node);
        let is_short = (1..8).contains(&frame.payload().len());
        (self.quirks.has_short_replies && is_reply && is_short)
            .then(|| Frame::of(frame.id(), frame.first_word().to_le_bytes()))
    }

    fn take_nmt_state(&mut self, state: NmtState) {
        self.nmt_state = Some(state);
        if !self.reported_states.contains(&state) {
            self.reported_states.push(state);
        }
        if state == NmtState::BootUp {
            self.boot_ups = self.boot_ups.saturating_add(1);
        }
    }
}

impl Client for CanopenClient {
    type Message = Frame;

    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let outgoing = self.outgoing.pop_front();
        outgoing.or_else(|| self.sdo_request(now_ns)).or_else(|| self.heartbeat_frame(now_ns))
    }

    fn receive(&mut self, frame: &Frame) {
        self.sdo.receive(&self.completed_reply(frame).unwrap_or(*frame));
        if let Some(message) = ErrorControl::decode(frame).filter(|message| message.node == self.node) {
            self.take_nmt_state(message.state);
        }
        if let Some(emergency) = Emergency::decode(frame).filter(|emergency| emergency.node == self.node) {
            let is_gone = emergency.code.0 & 0xFF00 == 0;
            self.emergency = (!is_gone).then_some(emergency);
        }
        if let Some(collected) = &mut self.collected {
            collected.push(*frame);
        }
    }
}
