//! The state behind a conversation: the present, the SDO client, what is to be sent, what was heard.

use std::collections::VecDeque;

use takt_rt::{Frame, Id, Nanoseconds};

use super::event::Event;
use crate::canopen::emcy::Emergency;
use crate::canopen::function_code;
use crate::canopen::nmt::{ErrorControl, NmtState};
use crate::canopen::sdo::{Client, Timing};

/// How a drive's SDO server wants to be spoken to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Manners {
    /// Waiting and repeating.
    pub timing: Timing,
    /// The pause after an answer before the next request.
    pub gap_ns: Nanoseconds,
    /// Whether its replies may be shorter than eight bytes, without the zeros at their end.
    pub has_short_replies: bool,
}

/// The heartbeat that is sent while a procedure runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnHeartbeat {
    pub node: u8,
    pub period_ns: Nanoseconds,
    pub due_ns: Nanoseconds,
}

#[derive(Debug)]
pub(super) struct Line {
    pub now_ns: Nanoseconds,
    pub node: u8,
    pub manners: Manners,
    pub client: Client,
    pub outgoing: VecDeque<Frame>,
    pub events: VecDeque<Event>,
    /// Frames that were received, while somebody listens to them.
    pub heard: Option<Vec<Frame>>,
    /// The last state that the node has reported.
    pub nmt: Option<NmtState>,
    pub emergency: Option<Emergency>,
    pub heartbeat: Option<OwnHeartbeat>,
    pub step: &'static str,
    /// The step that failed, when others follow it.
    pub failing_step: Option<&'static str>,
    /// How often it was asked to end.
    pub interruptions: u8,
    /// So many requests to end are obeyed later: the axis is being brought to rest.
    pub ignored_interruptions: u8,
    /// No request leaves before this time.
    pub free_ns: Nanoseconds,
}

impl Line {
    pub fn new(node: u8, manners: Manners) -> Self {
        Self {
            now_ns: 0,
            node,
            manners,
            client: Client::new(node, manners.timing),
            outgoing: VecDeque::new(),
            events: VecDeque::new(),
            heard: None,
            nmt: None,
            emergency: None,
            heartbeat: None,
            step: "begin",
            failing_step: None,
            interruptions: 0,
            ignored_interruptions: 0,
            free_ns: 0,
        }
    }

    pub fn is_interrupted(&self) -> bool {
        self.interruptions > self.ignored_interruptions
    }

    pub fn receive(&mut self, frame: &Frame) {
        match self.lengthened(frame) {
            Some(whole) => self.client.receive(&whole),
            None => self.client.receive(frame),
        }
        if let Some(message) = ErrorControl::decode(frame).filter(|message| message.node == self.node) {
            self.nmt = Some(message.state);
        }
        if let Some(emergency) = Emergency::decode(frame).filter(|emergency| emergency.node == self.node) {
            let is_gone = emergency.code.0 & 0xFF00 == 0;
            self.emergency = (!is_gone).then_some(emergency);
        }
        if let Some(heard) = &mut self.heard {
            heard.push(*frame);
        }
    }

    fn lengthened(&self, frame: &Frame) -> Option<Frame> {
        let is_reply = frame.id() == Id::canopen(function_code::SDO_RESPONSE, self.node);
        let is_short = (1..8).contains(&frame.payload().len());
        (self.manners.has_short_replies && is_reply && is_short)
            .then(|| Frame::of(frame.id(), frame.first_word().to_le_bytes()))
    }

    /// The own heartbeat, when it is due.
    pub fn heartbeat(&mut self) -> Option<Frame> {
        let now_ns = self.now_ns;
        let heartbeat = self.heartbeat.as_mut().filter(|heartbeat| heartbeat.due_ns <= now_ns)?;
        heartbeat.due_ns = now_ns.saturating_add(heartbeat.period_ns);
        Some(ErrorControl { node: heartbeat.node, state: NmtState::Operational }.frame())
    }
}
