//! The master of one node: one request at a time, matched with its reply by order.

use std::fmt;

use takt_rt::{Frame, Id, Nanoseconds};

use super::entries;
use super::error_code::ErrorCode;
use super::frame::{Reply, Request, replying_node};
use crate::erob_can::parameter::Parameter as _;

/// How long the client waits, and how often it asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestTiming {
    /// Time for a reply. The drives take up to 1 ms (eRunner manual, captures of chapters 4 and 5).
    pub timeout_ns: Nanoseconds,
    /// Silence after a reply that did not come. It would be taken for that of the next request, because it says nothing of its own.
    pub silence_ns: Nanoseconds,
    /// How often a read is repeated that has no reply. Writes and commands are not repeated: they may have been carried out.
    pub read_retries: u8,
}

impl Default for RequestTiming {
    fn default() -> Self {
        Self { timeout_ns: 50_000_000, silence_ns: 20_000_000, read_retries: 2 }
    }
}

/// A request that has not been carried out, or of which that is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestError {
    /// The request.
    pub request: Request,
    /// Why.
    pub failure: RequestFailure,
}

/// Why a request has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestFailure {
    /// No reply came in time.
    NoReply,
    /// The node has refused it: with a code if it was a write or a command.
    Refused(Option<ErrorCode>),
    /// The node has replied something that does not belong to such a request.
    WrongReply(Reply),
}

impl RequestError {
    /// What the manual advises.
    pub const fn cure(&self) -> Option<&'static str> {
        match self.failure {
            RequestFailure::Refused(Some(code)) => code.cure(),
            RequestFailure::NoReply | RequestFailure::Refused(None) | RequestFailure::WrongReply(_) => None,
        }
    }
}

impl std::error::Error for RequestError {}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = entries::describe(self.request.address());
        match self.request {
            Request::Read(_) => write!(f, "reading {name}: ")?,
            Request::Write(address, value) => {
                let shown = entries::find(address)
                    .map_or_else(|| value.to_string(), |entry| entry.show(value.into()));
                write!(f, "writing {shown} to {name}: ")?;
            }
            Request::Command(_) => write!(f, "command {name}: ")?,
        }
        match self.failure {
            RequestFailure::NoReply => write!(f, "no reply"),
            RequestFailure::Refused(None) => write!(f, "refused"),
            RequestFailure::Refused(Some(code)) => write!(f, "{code}"),
            RequestFailure::WrongReply(reply) => write!(f, "the reply {reply:?} does not belong to it"),
        }
    }
}

/// What a request has brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// What was read.
    Value(i32),
    /// A write or a command was carried out.
    Done,
}

/// A request cannot be begun while another one is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("another request is under way")]
pub struct Busy;

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    /// The request is to be sent, not before this time.
    Due {
        request: Request,
        retries: u8,
        from_ns: Nanoseconds,
    },
    Sent {
        request: Request,
        retries: u8,
        at_ns: Nanoseconds,
    },
    Over {
        request: Request,
        outcome: Result<Answer, RequestError>,
    },
}

/// The client of one node.
#[derive(Debug)]
#[expect(missing_copy_implementations, reason = "a copy would be a second client of the same node")]
pub struct RequestClient {
    node: u8,
    timing: RequestTiming,
    state: State,
    /// No request is sent before this time.
    free_ns: Nanoseconds,
    unusable: u32,
    probe: Probe,
}

/// A question to the node in another protocol.
#[derive(Clone, Copy, Debug)]
enum Probe {
    None,
    /// It is to be sent; the answer has this identifier.
    Due {
        question: Frame,
        answer: Id,
    },
    Sent {
        answer: Id,
    },
    Answered,
}

impl RequestClient {
    /// The client for a node ID (1 to 64).
    pub const fn new(node: u8, timing: RequestTiming) -> Self {
        Self { node, timing, state: State::Idle, free_ns: 0, unusable: 0, probe: Probe::None }
    }

    /// Turns to another node, and asks it so often and with such patience. The request that is under way is forgotten.
    pub fn turn_to(&mut self, node: u8, timing: RequestTiming) {
        *self = Self { free_ns: self.free_ns, ..Self::new(node, timing) };
    }

    /// Asks the node in another protocol: it is sent this frame, and answers under this identifier.
    pub const fn probe(&mut self, question: Frame, answer: Id) {
        self.probe = Probe::Due { question, answer };
    }

    /// Returns `true` if the last probe has an answer.
    pub const fn has_probe_answer(&self) -> bool {
        matches!(self.probe, Probe::Answered)
    }

    /// The node ID.
    pub const fn node(&self) -> u8 {
        self.node
    }

    /// Replies that were none, or that nobody waited for.
    pub const fn unusable_replies(&self) -> u32 {
        self.unusable
    }

    /// Begins a request.
    ///
    /// # Errors
    /// Another one is under way, or its outcome has not been taken.
    pub fn start(&mut self, request: Request) -> Result<(), Busy> {
        if !matches!(self.state, State::Idle) {
            return Err(Busy);
        }
        let retries = if matches!(request, Request::Read(_)) { self.timing.read_retries } else { 0 };
        self.state = State::Due { request, retries, from_ns: self.free_ns };
        Ok(())
    }

    /// The frame that is to be sent now, if there is one.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        if let Probe::Due { question, answer } = self.probe {
            self.probe = Probe::Sent { answer };
            return Some(question);
        }
        if let State::Sent { request, retries, at_ns } = self.state
            && now_ns >= at_ns.saturating_add(self.timing.timeout_ns)
        {
            self.time_out(request, retries, now_ns);
        }
        match self.state {
            State::Due { request, retries, from_ns } if now_ns >= from_ns => {
                self.state = State::Sent { request, retries, at_ns: now_ns };
                Some(request.frame(self.node))
            }
            _ => None,
        }
    }

    fn time_out(&mut self, request: Request, retries: u8, now_ns: Nanoseconds) {
        let from_ns = now_ns.saturating_add(self.timing.silence_ns);
        self.free_ns = from_ns;
        self.state = match retries.checked_sub(1) {
            Some(retries) => State::Due { request, retries, from_ns },
            None => {
                let outcome = Err(RequestError { request, failure: RequestFailure::NoReply });
                State::Over { request, outcome }
            }
        };
    }

    /// Takes a received frame. What is no reply of this node is ignored; what cannot be used is counted.
    pub fn receive(&mut self, frame: &Frame) {
        if matches!(self.probe, Probe::Sent { answer } if answer == frame.id()) {
            self.probe = Probe::Answered;
        }
        if replying_node(frame) != Some(self.node) {
            return;
        }
        match (self.state, Reply::decode(frame.payload())) {
            (State::Sent { request, .. }, Some(reply)) => {
                self.state = State::Over { request, outcome: answer(request, reply) };
            }
            _ => self.unusable = self.unusable.saturating_add(1),
        }
    }

    /// Removes and returns the outcome of the request, once it is there.
    pub fn take_outcome(&mut self) -> Option<Result<Answer, RequestError>> {
        self.take_answered().map(|(_, outcome)| outcome)
    }

    /// As [`RequestClient::take_outcome`], with the request.
    pub fn take_answered(&mut self) -> Option<(Request, Result<Answer, RequestError>)> {
        let State::Over { request, outcome } = self.state else { return None };
        self.state = State::Idle;
        Some((request, outcome))
    }

    /// Returns `true` if a request may begin.
    pub const fn is_free(&self) -> bool {
        matches!(self.state, State::Idle)
    }
}

fn answer(request: Request, reply: Reply) -> Result<Answer, RequestError> {
    let failed = |failure| Err(RequestError { request, failure });
    match (request, reply) {
        (_, Reply::Failed(code)) => failed(RequestFailure::Refused(code)),
        (Request::Read(_), Reply::Value(value)) => Ok(Answer::Value(value)),
        (Request::Write(..) | Request::Command(_), Reply::Done) => Ok(Answer::Done),
        (_, reply) => failed(RequestFailure::WrongReply(reply)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::erob_can::frame::EntryAddress;

    const POSITION: EntryAddress = EntryAddress::new(0x0002);
    const MS: Nanoseconds = 1_000_000;

    fn client() -> RequestClient {
        RequestClient::new(1, RequestTiming::default())
    }

    fn refused(request: Request, failure: RequestFailure) -> Option<Result<Answer, RequestError>> {
        Some(Err(RequestError { request, failure }))
    }

    #[test]
    fn a_read_brings_its_value_and_a_second_request_waits_for_the_first() {
        let mut client = client();
        assert_eq!(client.start(Request::Read(POSITION)), Ok(()));
        assert_eq!(client.start(Request::Read(POSITION)), Err(Busy));
        assert_eq!(client.poll(0), Some(Request::Read(POSITION).frame(1)));
        assert_eq!((client.poll(MS), client.take_outcome()), (None, None));
        client.receive(&Reply::Value(-5).frame(2));
        assert_eq!(client.take_outcome(), None, "that was another node");
        client.receive(&Reply::Value(-5).frame(1));
        assert_eq!(client.take_outcome(), Some(Ok(Answer::Value(-5))));
        assert_eq!(client.start(Request::Command(EntryAddress::new(0x0084))), Ok(()));
    }

    #[test]
    fn a_read_without_a_reply_is_repeated_and_a_write_is_not() {
        let mut client = client();
        for (request, frames) in [(Request::Read(POSITION), 3), (Request::Write(POSITION, 1), 1)] {
            client.start(request).unwrap();
            let sent = (0..1000).filter(|ms| client.poll(ms * MS).is_some()).count();
            assert_eq!(sent, frames);
            assert_eq!(client.take_outcome(), refused(request, RequestFailure::NoReply));
            client = self::client();
        }
    }

    #[test]
    fn a_reply_that_comes_after_its_time_is_not_that_of_the_next_request() {
        let mut client = client();
        let enable = Request::Write(EntryAddress::new(0x0100), 1);
        client.start(enable).unwrap();
        client.poll(0);
        client.poll(50 * MS);
        assert_eq!(client.take_outcome(), refused(enable, RequestFailure::NoReply));
        let stop = Request::Command(EntryAddress::new(0x0084));
        client.start(stop).unwrap();
        assert_eq!(client.poll(55 * MS), None, "a late reply may still come");
        client.receive(&Reply::Failed(None).frame(1));
        assert_eq!(client.unusable_replies(), 1);
        assert_eq!(client.poll(70 * MS), Some(stop.frame(1)));
        client.receive(&Reply::Done.frame(1));
        assert_eq!(client.take_outcome(), Some(Ok(Answer::Done)));
    }

    #[test]
    fn what_does_not_belong_to_the_request_is_no_success() {
        let read = Request::Read(POSITION);
        let write = Request::Write(POSITION, 1);
        for (request, reply) in [(read, Reply::Done), (write, Reply::Value(0x3E))] {
            let mut client = client();
            client.start(request).unwrap();
            client.poll(0);
            client.receive(&reply.frame(1));
            assert_eq!(client.take_outcome(), refused(request, RequestFailure::WrongReply(reply)));
        }
    }

    #[test]
    fn a_refusal_names_the_entry_and_the_code_and_has_the_cure() {
        let error = RequestError {
            request: Request::Write(EntryAddress::new(0x0204), 10_000),
            failure: RequestFailure::Refused(Some(ErrorCode::ENABLED)),
        };
        assert_eq!(
            error.to_string(),
            "writing 10000 count/s to torque-mode velocity limit (0x0204): error 0x0016, not allowed while the motor is \
             enabled"
        );
        assert_eq!(error.cure(), Some("disable the motor first"));
    }
}
