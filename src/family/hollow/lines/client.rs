//! Bytes to a line and from it, for the code of a procedure.

use std::collections::VecDeque;

use takt_rt::Nanoseconds;

use crate::procedure::{Client, ProcedureSession};

/// The master's side of a serial line with one device.
#[derive(Debug, Default)]
pub struct LineClient {
    outgoing: VecDeque<Vec<u8>>,
    received: VecDeque<u8>,
    now_ns: Nanoseconds,
    heard_ns: Nanoseconds,
}

/// Bytes that are kept until the code takes them. A device that sends without end loses the older ones.
const KEPT_BYTES: usize = 8_192;

/// A session with a device.
pub type LineSession = ProcedureSession<LineClient>;

impl Client for LineClient {
    type Message = Vec<u8>;

    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Vec<u8>> {
        self.now_ns = now_ns;
        self.outgoing.pop_front()
    }

    fn receive(&mut self, bytes: &Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        self.heard_ns = self.now_ns;
        self.received.extend(bytes);
        let surplus = self.received.len().saturating_sub(KEPT_BYTES);
        self.received.drain(..surplus);
    }
}

impl LineSession {
    /// Says something, and forgets what was heard before.
    pub fn say(&self, bytes: impl Into<Vec<u8>>) {
        let mut client = self.client_mut();
        client.received.clear();
        client.outgoing.push_back(bytes.into());
    }

    /// The next byte that was heard.
    pub fn hear(&self) -> Option<u8> {
        self.client_mut().received.pop_front()
    }

    /// How long nothing has been heard.
    pub fn silent_ns(&self) -> Nanoseconds {
        let client = self.client();
        client.now_ns.saturating_sub(client.heard_ns)
    }

    /// Returns `true` if bytes wait to be taken.
    pub fn has_heard(&self) -> bool {
        !self.client().received.is_empty()
    }
}
