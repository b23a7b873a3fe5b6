//! The session of a scan: frames to the whole bus, and from it.

use std::collections::VecDeque;

use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::function_code;
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{Completed, SdoClient, SdoError, SdoTiming, Transfer, Uploaded};

use super::heard::Heard;
use crate::procedure::{Client, ProcedureSession};

/// Frames that wait for the procedure. More come in one poll only from a device that floods the bus; the oldest go.
const INBOX: usize = 1024;
/// The pause between a reply and the next request: some drives drop a request that follows at once.
const GAP_NS: Nanoseconds = 2_500_000;

/// The client of a whole bus.
#[derive(Debug)]
pub struct ScanClient {
    outgoing: VecDeque<Frame>,
    inbox: VecDeque<Frame>,
    heard: Heard,
}

impl ScanClient {
    /// A client that has heard nothing.
    pub(super) fn new() -> Self {
        Self { outgoing: VecDeque::new(), inbox: VecDeque::new(), heard: Heard::new() }
    }
}

impl Client for ScanClient {
    type Message = Frame;

    fn poll(&mut self, _: Nanoseconds) -> Option<Frame> {
        self.outgoing.pop_front()
    }

    fn receive(&mut self, frame: &Frame) {
        self.heard.take(frame);
        if self.inbox.len() == INBOX {
            self.inbox.pop_front();
        }
        self.inbox.push_back(*frame);
    }
}

/// A session with a whole bus.
pub type ScanSession = ProcedureSession<ScanClient>;

impl ScanSession {
    /// Sends a frame.
    pub fn send_frame(&self, frame: Frame) {
        self.client_mut().outgoing.push_back(frame);
    }

    /// Removes and returns the oldest frame that has come.
    pub fn take_frame(&self) -> Option<Frame> {
        self.client_mut().inbox.pop_front()
    }

    /// Forgets the frames that have come.
    pub fn forget_frames(&self) {
        self.client_mut().inbox.clear();
    }

    /// What was heard so far.
    pub(super) fn heard<T>(&self, look: impl FnOnce(&Heard) -> T) -> T {
        look(&self.client().heard)
    }

    /// Tells what is heard that a request was sent, for which one reply may come.
    pub(super) fn count_request(&self, count: impl FnOnce(&mut Heard)) {
        count(&mut self.client_mut().heard);
    }

    /// Counts a request in the protocol of this name, for which one reply may come.
    pub fn count_request_of(&self, protocol: &str, node: u8) {
        self.count_request(|heard| heard.own_request_of(protocol, node));
    }

    /// Sends a request and returns the first frame that is its reply; `None` if none came in this time.
    pub async fn ask(
        &self,
        question: Frame,
        mut is_reply: impl FnMut(&Frame) -> bool,
        within_ns: Nanoseconds,
    ) -> Option<Frame> {
        self.forget_frames();
        self.send_frame(question);
        let end_ns = self.now_ns().saturating_add(within_ns);
        let reply = self.until(|| {
            while let Some(frame) = self.take_frame() {
                if is_reply(&frame) {
                    return Some(frame);
                }
            }
            None
        });
        self.unless_over(|| self.now_ns() >= end_ns, reply).await
    }

    /// Reads an object of a node. Nothing is repeated.
    ///
    /// # Errors
    /// The node refuses, or does not reply in time.
    pub async fn upload(
        &self,
        node: u8,
        object: ObjectAddress,
        within_ns: Nanoseconds,
    ) -> Result<Uploaded, SdoError> {
        self.sleep(GAP_NS).await;
        self.forget_frames();
        let mut client = SdoClient::new(node, SdoTiming { reply_timeout_ns: within_ns, retries: 0 });
        // It is new, and so it is free.
        let started = client.start(Transfer::Upload { object });
        debug_assert!(started.is_ok());
        let reply = takt_rt::Id::canopen(function_code::SDO_RESPONSE, node);
        let completed = self
            .until(|| {
                while let Some(frame) = self.take_frame() {
                    // Some drives leave out the zeros at the end.
                    let is_short = frame.id() == reply && (1..8).contains(&frame.payload().len());
                    client.receive(&match is_short {
                        true => Frame::of(frame.id(), frame.first_word().to_le_bytes()),
                        false => frame,
                    });
                }
                while let Some(frame) = client.poll(self.now_ns()) {
                    self.count_request(|heard| heard.sdo_request(node));
                    self.send_frame(frame);
                }
                client.take_outcome()
            })
            .await?;
        Ok(match completed {
            Completed::Uploaded(uploaded) => uploaded,
            Completed::Downloaded => Uploaded { bytes: vec![], is_size_known: true },
        })
    }
}
