//! The SDO client for one node: one transfer at a time, with a timeout for every wait.
//!
//! A request without a response is repeated. A response that arrives after the repetition leaves a second, stale
//! response under way, which a later transfer of the same object could mistake for its own. So after a repeated
//! transfer, the client sends nothing until no response can be outstanding.

use takt_rt::{Frame, Nanoseconds};

use super::abort::AbortCode;
use super::exchange::Exchange;
use super::exchange_step::ExchangeStep;
use super::request::SdoRequest;
use super::transfer::{Completed, SdoError, Transfer};
use crate::canopen::{function_code, node_of};

/// Reply timeout and retries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoTiming {
    /// Timeout from a request to its response.
    pub reply_timeout_ns: Nanoseconds,
    /// How many times a transfer is restarted after a timeout.
    pub retries: u8,
}

impl Default for SdoTiming {
    /// 0.5 s and two retries: drives answer within about 1 ms, but requests share the bus with process data and may
    /// have to wait.
    fn default() -> Self {
        Self { reply_timeout_ns: 500_000_000, retries: 2 }
    }
}

/// A transfer is running, or its outcome has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an SDO transfer with this node is running")]
pub struct SdoBusy;

/// The client of one node's SDO server.
#[derive(Debug)]
pub struct SdoClient {
    node: u8,
    timing: SdoTiming,
    activity: Activity,
    /// The final request of a finished transfer; it is sent before anything else.
    final_request: Option<SdoRequest>,
    /// No request is sent before this time.
    blocked_until_ns: Nanoseconds,
}

#[derive(Debug)]
enum Activity {
    Idle,
    Active(Attempt),
    Finished(Result<Completed, SdoError>),
}

#[derive(Debug)]
struct Attempt {
    exchange: Exchange,
    /// How many times the transfer was started.
    number: u8,
    unusable: u16,
    /// When the current request was sent; `None` while a frame is due.
    sent_at_ns: Option<Nanoseconds>,
}

impl SdoClient {
    /// The client for a node ID (1 to 127).
    pub const fn new(node: u8, timing: SdoTiming) -> Self {
        Self { node, timing, activity: Activity::Idle, final_request: None, blocked_until_ns: 0 }
    }

    /// Begins a transfer. Then call [`SdoClient::poll`], [`SdoClient::receive`] and [`SdoClient::take_outcome`].
    pub fn start(&mut self, transfer: Transfer) -> Result<(), SdoBusy> {
        if self.is_busy() {
            return Err(SdoBusy);
        }
        let exchange = Exchange::new(transfer);
        self.activity = Activity::Active(Attempt { exchange, number: 0, unusable: 0, sent_at_ns: None });
        Ok(())
    }

    /// Discards a running transfer without an abort, for a node that has restarted.
    pub fn reset(&mut self) {
        self.activity = Activity::Idle;
        self.final_request = None;
    }

    /// The next frame to send, if one is due. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        self.expire(now_ns);
        if let Some(final_request) = self.final_request.take() {
            return Some(final_request.frame(self.node));
        }
        let Activity::Active(attempt) = &mut self.activity else { return None };
        if attempt.sent_at_ns.is_some() || now_ns < self.blocked_until_ns {
            return None;
        }
        if attempt.exchange.is_initiating() {
            attempt.number = attempt.number.saturating_add(1);
        }
        let (frame, is_response_due) = attempt.exchange.next_frame(self.node);
        attempt.sent_at_ns = is_response_due.then_some(now_ns);
        Some(frame)
    }

    /// Receives a frame; frames from other nodes are ignored.
    pub fn receive(&mut self, frame: &Frame) {
        if node_of(frame, function_code::SDO_RESPONSE) != Some(self.node) {
            return;
        }
        let Activity::Active(attempt) = &mut self.activity else { return };
        let Some(sent_at_ns) = attempt.sent_at_ns else { return };
        match attempt.exchange.receive(frame) {
            ExchangeStep::Unusable => attempt.unusable = attempt.unusable.saturating_add(1),
            ExchangeStep::Wait => {}
            ExchangeStep::Send => attempt.sent_at_ns = None,
            ExchangeStep::FallBack => {
                attempt.exchange.fall_back();
                (attempt.number, attempt.sent_at_ns) = (0, None);
            }
            ExchangeStep::Finish { outcome, final_request } => {
                if attempt.number > 1 {
                    self.blocked_until_ns = sent_at_ns.saturating_add(self.timing.reply_timeout_ns);
                }
                self.final_request = final_request.request(attempt.exchange.object());
                self.activity = Activity::Finished(outcome);
            }
        }
    }

    /// The outcome of the transfer when it is finished. The client is then free for the next transfer.
    pub fn take_outcome(&mut self) -> Option<Result<Completed, SdoError>> {
        match std::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Finished(outcome) => Some(outcome),
            other => {
                self.activity = other;
                None
            }
        }
    }

    /// Returns `true` if a transfer is running or its outcome has not been taken.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }

    /// Restarts the transfer, or fails, when the reply timeout has passed.
    fn expire(&mut self, now_ns: Nanoseconds) {
        let Activity::Active(attempt) = &mut self.activity else { return };
        let Some(sent_at_ns) = attempt.sent_at_ns else { return };
        let reply_timeout_ns = self.timing.reply_timeout_ns;
        if now_ns.saturating_sub(sent_at_ns) < reply_timeout_ns {
            return;
        }
        if attempt.exchange.is_server_in_transfer() {
            let object = attempt.exchange.object();
            self.final_request = Some(SdoRequest::Abort { object, code: AbortCode::ProtocolTimedOut });
        }
        if attempt.number > self.timing.retries {
            let (attempts, unusable) = (attempt.number, attempt.unusable);
            let error = SdoError::NoReply { attempts, reply_timeout_ns, unusable };
            self.activity = Activity::Finished(Err(error));
        } else {
            attempt.exchange.begin_again();
            attempt.sent_at_ns = None;
        }
    }
}
