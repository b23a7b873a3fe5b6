//! The state of an SDO session: time, SDO client, outgoing frames, received messages.

use std::collections::VecDeque;

use takt_rt::{Frame, Id, Nanoseconds};

use super::event::ProcedureEvent;
use crate::canopen::emcy::Emergency;
use crate::canopen::function_code;
use crate::canopen::nmt::{ErrorControl, NmtState};
use crate::canopen::sdo::{SdoClient, SdoTiming};

/// Timing and deviations of a drive's SDO server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoQuirks {
    /// Reply timeout and retries.
    pub timing: SdoTiming,
    /// Minimum pause between a reply and the next request.
    pub gap_ns: Nanoseconds,
    /// Whether replies may be shorter than eight bytes, with trailing zeros left out.
    pub has_short_replies: bool,
}

impl SdoQuirks {
    /// A server that keeps to CiA 301.
    pub const fn standard() -> Self {
        let timing = SdoTiming { reply_timeout_ns: 100_000_000, retries: 2 };
        Self { timing, gap_ns: 0, has_short_replies: false }
    }
}

/// The heartbeat that this program sends while a procedure runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnHeartbeat {
    pub node: u8,
    pub period_ns: Nanoseconds,
    pub due_ns: Nanoseconds,
}

#[derive(Debug)]
pub(super) struct SessionState {
    pub now_ns: Nanoseconds,
    pub node: u8,
    pub sdo_quirks: SdoQuirks,
    pub client: SdoClient,
    pub outgoing: VecDeque<Frame>,
    pub events: VecDeque<ProcedureEvent>,
    /// The frames received since collecting began; `None` while nothing is collected.
    pub collected: Option<Vec<Frame>>,
    /// The NMT state in the node's last heartbeat.
    pub nmt: Option<NmtState>,
    pub emergency: Option<Emergency>,
    pub heartbeat: Option<OwnHeartbeat>,
    pub step: &'static str,
    /// The step that failed, when clean-up steps follow it.
    pub failing_step: Option<&'static str>,
    /// Number of interruptions so far.
    pub interruptions: u8,
    /// Number of interruptions that are ignored, because the axis is already being stopped.
    pub ignored_interruptions: u8,
    /// No SDO request is sent before this time.
    pub free_ns: Nanoseconds,
}

impl SessionState {
    pub fn new(node: u8, sdo_quirks: SdoQuirks) -> Self {
        Self {
            now_ns: 0,
            node,
            sdo_quirks,
            client: SdoClient::new(node, sdo_quirks.timing),
            outgoing: VecDeque::new(),
            events: VecDeque::new(),
            collected: None,
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
        match self.padded(frame) {
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
        if let Some(collected) = &mut self.collected {
            collected.push(*frame);
        }
    }

    fn padded(&self, frame: &Frame) -> Option<Frame> {
        let is_reply = frame.id() == Id::canopen(function_code::SDO_RESPONSE, self.node);
        let is_short = (1..8).contains(&frame.payload().len());
        (self.sdo_quirks.has_short_replies && is_reply && is_short)
            .then(|| Frame::of(frame.id(), frame.first_word().to_le_bytes()))
    }

    /// The own heartbeat frame, when it is due.
    pub fn heartbeat(&mut self) -> Option<Frame> {
        let now_ns = self.now_ns;
        let heartbeat = self.heartbeat.as_mut().filter(|heartbeat| heartbeat.due_ns <= now_ns)?;
        heartbeat.due_ns = now_ns.saturating_add(heartbeat.period_ns);
        Some(ErrorControl { node: heartbeat.node, state: NmtState::Operational }.frame())
    }
}
