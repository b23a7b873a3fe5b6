//! The master's side of SDO for one node: one transfer at a time, every wait bounded.
//!
//! A request that is not answered is repeated. A reply that comes after its repetition was sent would leave a second,
//! stale reply under way, which a later transfer of the same object could take for its own: after a repeated transfer
//! the client therefore stays quiet until no reply can be outstanding any more.

use takt_rt::{Frame, Nanoseconds};

use super::abort::AbortCode;
use super::exchange::{Exchange, Step};
use super::request::Request;
use super::transfer::{Completed, SdoError, Transfer};
use crate::canopen::{function_code, node_of};

/// How long to wait, and how often to ask again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From a request to its response.
    pub reply_timeout_ns: Nanoseconds,
    /// How often a transfer is begun again after silence.
    pub retries: u8,
}

impl Default for Timing {
    /// Half a second and two retries: drives answer within about 1 ms, but requests share the bus with process data
    /// and wait their turn.
    fn default() -> Self {
        Self { reply_timeout_ns: 500_000_000, retries: 2 }
    }
}

/// A transfer is under way, or its outcome has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an SDO transfer with this node is under way")]
pub struct Busy;

/// The client of one node's SDO server.
#[derive(Debug)]
pub struct Client {
    node: u8,
    timing: Timing,
    activity: Activity,
    /// What must leave before anything else does: the last word about a transfer that is over.
    parting: Option<Request>,
    /// No request leaves before this time.
    quiet_until_ns: Nanoseconds,
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
    /// How often the transfer was begun.
    number: u8,
    unusable: u16,
    /// When the present request was sent; `None` while there is something to send.
    sent_at_ns: Option<Nanoseconds>,
}

impl Client {
    /// The client for `node` (1 to 127).
    pub const fn new(node: u8, timing: Timing) -> Self {
        Self { node, timing, activity: Activity::Idle, parting: None, quiet_until_ns: 0 }
    }

    /// Begins a transfer. [`Client::poll`] sends, [`Client::receive`] listens, [`Client::take_outcome`] tells.
    pub fn start(&mut self, transfer: Transfer) -> Result<(), Busy> {
        if self.is_busy() {
            return Err(Busy);
        }
        let exchange = Exchange::new(transfer);
        self.activity = Activity::Active(Attempt { exchange, number: 0, unusable: 0, sent_at_ns: None });
        Ok(())
    }

    /// Drops whatever is under way, without a word to the server: for a node that has restarted.
    pub fn reset(&mut self) {
        self.activity = Activity::Idle;
        self.parting = None;
    }

    /// The next frame to send, if one is due. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        self.expire(now_ns);
        if let Some(parting) = self.parting.take() {
            return Some(parting.frame(self.node));
        }
        let Activity::Active(attempt) = &mut self.activity else { return None };
        if attempt.sent_at_ns.is_some() || now_ns < self.quiet_until_ns {
            return None;
        }
        if attempt.exchange.is_initiating() {
            attempt.number = attempt.number.saturating_add(1);
        }
        let (frame, is_answer_due) = attempt.exchange.next_frame(self.node);
        attempt.sent_at_ns = is_answer_due.then_some(now_ns);
        Some(frame)
    }

    /// Takes a frame that was received; frames that are not from this node's SDO server are passed over.
    pub fn receive(&mut self, frame: &Frame) {
        if node_of(frame, function_code::SDO_RESPONSE) != Some(self.node) {
            return;
        }
        let Activity::Active(attempt) = &mut self.activity else { return };
        let Some(sent_at_ns) = attempt.sent_at_ns else { return };
        match attempt.exchange.receive(frame) {
            Step::Unusable => attempt.unusable = attempt.unusable.saturating_add(1),
            Step::Wait => {}
            Step::Send => attempt.sent_at_ns = None,
            Step::BeginSimpler => {
                attempt.exchange.begin_simpler();
                (attempt.number, attempt.sent_at_ns) = (0, None);
            }
            Step::Finish { outcome, parting } => {
                if attempt.number > 1 {
                    self.quiet_until_ns = sent_at_ns.saturating_add(self.timing.reply_timeout_ns);
                }
                self.parting = parting.request(attempt.exchange.object());
                self.activity = Activity::Finished(outcome);
            }
        }
    }

    /// The outcome of the transfer, once it is over. The client is free for the next one then.
    pub fn take_outcome(&mut self) -> Option<Result<Completed, SdoError>> {
        match std::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Finished(outcome) => Some(outcome),
            other => {
                self.activity = other;
                None
            }
        }
    }

    /// Whether a transfer is under way or its outcome has not been taken.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }

    /// Begins again, or gives up, when the present request has been waiting for too long.
    fn expire(&mut self, now_ns: Nanoseconds) {
        let Activity::Active(attempt) = &mut self.activity else { return };
        let Some(sent_at_ns) = attempt.sent_at_ns else { return };
        let reply_timeout_ns = self.timing.reply_timeout_ns;
        if now_ns.saturating_sub(sent_at_ns) < reply_timeout_ns {
            return;
        }
        if attempt.exchange.is_server_in_transfer() {
            let object = attempt.exchange.object();
            self.parting = Some(Request::Abort { object, code: AbortCode::ProtocolTimedOut });
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
