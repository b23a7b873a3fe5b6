//! The master of a line: one request at a time.
//!
//! A reply says nothing of its request but the function, so what is late or damaged must not be taken for the reply of the next
//! request: the master sends only after a silence, and waits longer after a reply that did not come.

use std::fmt;

use takt_rt::Nanoseconds;

use super::exception::ExceptionCode;
use super::frame::{Received, Reply, ReplyError, Request, SlaveAddress, Values, evaluate};
use super::line_timing::LineTiming;

/// How long the master waits, and how often it asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MasterTiming {
    /// The line.
    pub line: LineTiming,
    /// From the end of a request to the end of the silence of a slave that does not reply, without the time that the bytes of the reply
    /// take.
    pub reply_timeout_ns: Nanoseconds,
    /// What is waited after a reply that did not come, or was none. It may still come, and would be taken for another one.
    pub late_reply_ns: Nanoseconds,
    /// How often a request is repeated that may be.
    pub retries: u8,
    /// How long the master waits for a silence before it gives a request up.
    pub longest_noise_ns: Nanoseconds,
}

impl MasterTiming {
    /// The usual times on a line: 100 ms for a reply, which leaves room for a USB adapter that gathers bytes for 16 ms.
    pub const fn new(line: LineTiming) -> Self {
        Self {
            line,
            reply_timeout_ns: 100_000_000,
            late_reply_ns: 50_000_000,
            retries: 2,
            longest_noise_ns: 1_000_000_000,
        }
    }
}

/// Whether a request may be sent again when it is not known whether the slave has carried it out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repeat {
    /// Yes: it makes no difference how often it is carried out.
    Allowed,
    /// No.
    Never,
}

/// A request that has not been carried out, or of which that is not known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestError {
    /// Whom it was sent to.
    pub slave: SlaveAddress,
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
    /// A reply began and was not complete in time.
    IncompleteReply {
        /// The bytes that came.
        bytes: usize,
    },
    /// What came is no reply to it.
    WrongReply(ReplyError),
    /// The slave refuses.
    Refused(ExceptionCode),
    /// The line was never silent, so that the request could not be sent.
    NoSilence,
}

impl std::error::Error for RequestError {}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "slave {}: {}: {}", self.slave, self.request, self.failure)
    }
}

impl fmt::Display for RequestFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReply => {
                write!(f, "no reply (check address, bit rate, power, and whether A and B are exchanged)")
            }
            Self::IncompleteReply { bytes } => {
                write!(f, "the reply ended after {bytes} bytes (check bit rate, wiring and termination)")
            }
            Self::WrongReply(error) => {
                write!(f, "{error} (check bit rate, wiring, termination, and addresses)")
            }
            Self::Refused(code) => code.fmt(f),
            Self::NoSilence => {
                write!(
                    f,
                    "the line is never silent (is there a second master, or noise without a termination?)"
                )
            }
        }
    }
}

/// What a request has brought.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// What was read.
    Values(Values),
    /// What was to be written is written.
    Written,
}

/// A request cannot be begun while another one is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("another request is under way")]
pub struct Busy;

/// A request on its way.
#[derive(Clone, Debug)]
struct Exchange {
    slave: SlaveAddress,
    request: Request,
    /// How often it may still be sent, beyond this time.
    retries: u8,
}

#[derive(Clone, Debug)]
enum State {
    Idle,
    /// The request is to be sent when the line is silent. Time at which that was first wanted.
    Due {
        exchange: Exchange,
        since_ns: Option<Nanoseconds>,
    },
    /// The reply is awaited, with what has come of it.
    Sent {
        exchange: Exchange,
        until_ns: Nanoseconds,
        bytes: Vec<u8>,
    },
    Over(Result<Answer, RequestError>),
}

/// The master of a line.
#[derive(Debug)]
pub struct Master {
    timing: MasterTiming,
    state: State,
    /// Bytes have come since the last poll.
    has_heard: bool,
    /// The line is not free before this time.
    free_ns: Nanoseconds,
    repeated: u64,
}

impl Master {
    /// The master of a line on which nothing is known to have happened.
    pub const fn new(timing: MasterTiming) -> Self {
        let free_ns = timing.line.silence_ns();
        Self { timing, state: State::Idle, has_heard: false, free_ns, repeated: 0 }
    }

    /// Requests that were sent again.
    pub const fn repeated_requests(&self) -> u64 {
        self.repeated
    }

    /// Begins a request.
    ///
    /// # Errors
    /// Another one is under way, or its outcome has not been taken.
    pub fn start(&mut self, slave: SlaveAddress, request: Request, repeat: Repeat) -> Result<(), Busy> {
        if !matches!(self.state, State::Idle) {
            return Err(Busy);
        }
        let retries = if repeat == Repeat::Allowed { self.timing.retries } else { 0 };
        self.state = State::Due { exchange: Exchange { slave, request, retries }, since_ns: None };
        Ok(())
    }

    /// Forgets a request that was given up. A reply to it that still comes is not taken for that of the next one.
    pub fn reset(&mut self, now_ns: Nanoseconds) {
        if matches!(self.state, State::Sent { .. }) {
            self.keep_quiet_until(now_ns.saturating_add(self.timing.late_reply_ns));
        }
        self.state = State::Idle;
    }

    fn keep_quiet_until(&mut self, time_ns: Nanoseconds) {
        self.free_ns = self.free_ns.max(time_ns);
    }

    /// The bytes that are to be sent now, if there are any.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Vec<u8>> {
        if std::mem::take(&mut self.has_heard) {
            self.keep_quiet_until(now_ns.saturating_add(self.timing.line.silence_ns()));
        }
        match std::mem::replace(&mut self.state, State::Idle) {
            State::Sent { exchange, until_ns, bytes } if now_ns >= until_ns => {
                self.keep_quiet_until(now_ns.saturating_add(self.timing.late_reply_ns));
                let failure = match bytes.len() {
                    0 => RequestFailure::NoReply,
                    bytes => RequestFailure::IncompleteReply { bytes },
                };
                self.repeat_or_fail(exchange, failure);
            }
            state => self.state = state,
        }
        self.send_due(now_ns)
    }

    fn send_due(&mut self, now_ns: Nanoseconds) -> Option<Vec<u8>> {
        let State::Due { exchange, since_ns } = &mut self.state else { return None };
        let since_ns = *since_ns.get_or_insert(now_ns);
        if now_ns < self.free_ns {
            if now_ns.saturating_sub(since_ns) > self.timing.longest_noise_ns {
                let Exchange { slave, request, .. } = exchange.clone();
                self.state =
                    State::Over(Err(RequestError { slave, request, failure: RequestFailure::NoSilence }));
            }
            return None;
        }
        let exchange = exchange.clone();
        let frame = exchange.request.frame(exchange.slave);
        let line = self.timing.line;
        let sent_ns = now_ns.saturating_add(line.duration_ns(frame.len()));
        let reply_ns = line.duration_ns(exchange.request.reply_length());
        let until_ns = sent_ns.saturating_add(reply_ns).saturating_add(self.timing.reply_timeout_ns);
        self.keep_quiet_until(sent_ns.saturating_add(line.silence_ns()));
        self.state = State::Sent { exchange, until_ns, bytes: vec![] };
        Some(frame)
    }

    /// Takes bytes that have come over the line, in pieces of any length. What nobody waits for only keeps the line busy.
    pub fn receive(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.has_heard = true;
        let State::Sent { exchange, bytes: received, .. } = &mut self.state else { return };
        // More than a frame would be refused all the same.
        received.extend(bytes.iter().take(LONGEST - received.len().min(LONGEST)));
        let Received::Whole(outcome) = evaluate(&exchange.request, exchange.slave, received) else { return };
        let exchange = exchange.clone();
        let failure = match outcome {
            Ok(Reply::Values(values)) => return self.state = State::Over(Ok(Answer::Values(values))),
            Ok(Reply::Written) => return self.state = State::Over(Ok(Answer::Written)),
            Ok(Reply::Refused(code)) => {
                let Exchange { slave, request, .. } = exchange;
                let failure = RequestFailure::Refused(code);
                return self.state = State::Over(Err(RequestError { slave, request, failure }));
            }
            Err(error) => RequestFailure::WrongReply(error),
        };
        // The rest of it may still come.
        self.repeat_or_fail(exchange, failure);
    }

    fn repeat_or_fail(&mut self, exchange: Exchange, failure: RequestFailure) {
        let Exchange { slave, request, retries } = exchange;
        self.state = match retries.checked_sub(1) {
            Some(retries) => {
                self.repeated = self.repeated.saturating_add(1);
                State::Due { exchange: Exchange { slave, request, retries }, since_ns: None }
            }
            None => State::Over(Err(RequestError { slave, request, failure })),
        };
    }

    /// Removes and returns the outcome of the request, once it is there.
    pub fn take_outcome(&mut self) -> Option<Result<Answer, RequestError>> {
        match std::mem::replace(&mut self.state, State::Idle) {
            State::Over(outcome) => Some(outcome),
            state => {
                self.state = state;
                None
            }
        }
    }
}

/// One byte more than the longest frame.
const LONGEST: usize = 257;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::modbus::frame::{RegisterRange, reply_frame};

    const MS: Nanoseconds = 1_000_000;
    const LINE: LineTiming = LineTiming::new(115_200);

    fn slave(address: u8) -> SlaveAddress {
        SlaveAddress::new(address).unwrap()
    }

    fn read() -> Request {
        Request::Read(RegisterRange::new(0x66, 2).unwrap())
    }

    const ENABLE: Request = Request::WriteOne { register: 0xF0, value: 1 };

    /// A master that has sent this request at 10 ms.
    fn asking(request: &Request, repeat: Repeat) -> Master {
        let mut master = Master::new(MasterTiming::new(LINE));
        master.start(slave(2), request.clone(), repeat).unwrap();
        assert_eq!(master.start(slave(2), ENABLE, repeat), Err(Busy));
        assert_eq!(master.poll(10 * MS), Some(request.frame(slave(2))));
        master
    }

    fn reply(values: &[u16]) -> Vec<u8> {
        reply_frame(&read().frame(slave(2)), Ok(values)).unwrap()
    }

    fn answer(values: &[u16]) -> Option<Result<Answer, RequestError>> {
        Some(Ok(Answer::Values(values.to_vec())))
    }

    fn failed(request: Request, failure: RequestFailure) -> Option<Result<Answer, RequestError>> {
        Some(Err(RequestError { slave: slave(2), request, failure }))
    }

    #[test]
    fn a_reply_is_taken_in_any_pieces() {
        for size in 1..=9 {
            let mut master = asking(&read(), Repeat::Allowed);
            let mut now_ns = 12 * MS;
            for piece in reply(&[7, 0xA11F]).chunks(size) {
                assert_eq!((master.poll(now_ns), master.take_outcome()), (None, None));
                master.receive(piece);
                now_ns += MS;
            }
            assert_eq!(master.take_outcome(), answer(&[7, 0xA11F]));
        }
    }

    #[test]
    fn no_frame_begins_before_the_line_was_silent_for_three_and_a_half_characters() {
        let mut master = asking(&read(), Repeat::Allowed);
        master.receive(&reply(&[1, 2]));
        master.take_outcome();
        master.start(slave(3), read(), Repeat::Allowed).unwrap();
        let heard_ns = 20 * MS;
        let sent = |master: &mut Master, us: u64| master.poll(heard_ns + us * 1_000).is_some();
        assert_eq!([0, 1_749, 1_750].map(|us| sent(&mut master, us)), [false, false, true]);
        // Bytes of somebody else begin the silence anew.
        let mut master = Master::new(MasterTiming::new(LINE));
        master.start(slave(2), read(), Repeat::Allowed).unwrap();
        master.receive(&[1, 2, 3]);
        assert_eq!([0, 1_700].map(|us| sent(&mut master, us)), [false, false]);
        master.receive(&[4]);
        assert_eq!([1_750, 3_499, 3_500].map(|us| sent(&mut master, us)), [false, false, true]);
    }

    #[test]
    fn a_request_that_may_be_repeated_is_and_others_are_not() {
        for (request, repeat, times) in [(read(), Repeat::Allowed, 3), (ENABLE, Repeat::Never, 1)] {
            let mut master = asking(&request, repeat);
            let again = (10_000..1_000_000).filter(|us| master.poll(us * 1_000).is_some()).count();
            assert_eq!(again + 1, times);
            assert_eq!(master.take_outcome(), failed(request, RequestFailure::NoReply));
            assert_eq!(master.repeated_requests(), times as u64 - 1);
        }
    }

    #[test]
    fn a_reply_that_comes_after_its_time_is_not_that_of_the_next_request() {
        let mut master = asking(&ENABLE, Repeat::Never);
        assert_eq!(master.poll(120 * MS), None);
        assert_eq!(master.take_outcome(), failed(ENABLE, RequestFailure::NoReply));
        master.start(slave(2), ENABLE, Repeat::Never).unwrap();
        assert_eq!(master.poll(140 * MS), None);
        master.receive(&reply_frame(&ENABLE.frame(slave(2)), Ok(&[])).unwrap());
        assert_eq!(master.take_outcome(), None);
        assert_eq!(master.poll(169 * MS), None);
        assert!(master.poll(171 * MS).is_some());
    }

    #[test]
    fn a_damaged_reply_and_that_of_another_slave_are_repeated_and_then_named() {
        let mut damaged = reply(&[1, 2]);
        damaged[5] ^= 1;
        let other = reply_frame(&read().frame(slave(3)), Ok(&[1, 2])).unwrap();
        for (bytes, error) in [(damaged, ReplyError::Damaged), (other, ReplyError::OtherSlave(3))] {
            let mut master = asking(&read(), Repeat::Allowed);
            for round in 1..=2 {
                master.receive(&bytes);
                assert_eq!(master.take_outcome(), None);
                assert_eq!(master.poll((10 + 10 * round) * MS), None, "the line must be silent first");
                assert!(master.poll((12 + 10 * round) * MS).is_some());
            }
            master.receive(&bytes);
            assert_eq!(master.take_outcome(), failed(read(), RequestFailure::WrongReply(error)));
        }
    }

    #[test]
    fn a_refusal_ends_the_request_at_once() {
        let mut master = asking(&read(), Repeat::Allowed);
        let code = ExceptionCode::ILLEGAL_ADDRESS;
        master.receive(&reply_frame(&read().frame(slave(2)), Err(code)).unwrap());
        let outcome = master.take_outcome();
        assert_eq!(outcome, failed(read(), RequestFailure::Refused(code)));
        assert_eq!(
            outcome.unwrap().unwrap_err().to_string(),
            "slave 2: reading 2 registers from 0x0066: Modbus exception 02, the slave does not have such a register, or \
             not for this access"
        );
    }

    #[test]
    fn a_line_that_is_never_silent_ends_the_request() {
        let mut master = Master::new(MasterTiming::new(LINE));
        master.start(slave(2), read(), Repeat::Allowed).unwrap();
        for ms in 0..=1_001 {
            assert_eq!(master.poll(ms * MS), None);
            master.receive(&[0]);
        }
        assert_eq!(master.take_outcome(), failed(read(), RequestFailure::NoSilence));
    }

    #[test]
    fn a_request_that_was_given_up_leaves_the_line_to_its_late_reply() {
        let mut master = asking(&read(), Repeat::Allowed);
        master.reset(20 * MS);
        master.start(slave(2), ENABLE, Repeat::Never).unwrap();
        assert_eq!(master.poll(69 * MS), None);
        assert!(master.poll(70 * MS).is_some());
    }

    proptest! {
        #[test]
        fn every_request_ends_whatever_comes_over_the_line(
            pieces in proptest::collection::vec((0u64..30, proptest::collection::vec(any::<u8>(), 0..40)), 0..200),
        ) {
            let mut master = asking(&read(), Repeat::Allowed);
            let mut now_ns = 10 * MS;
            let mut outcome = None;
            for (ms, bytes) in pieces {
                now_ns += ms * MS;
                master.receive(&bytes);
                master.poll(now_ns);
                outcome = outcome.or_else(|| master.take_outcome());
            }
            for _ in 0..2_000 {
                now_ns += MS;
                master.poll(now_ns);
                outcome = outcome.or_else(|| master.take_outcome());
            }
            prop_assert!(outcome.is_some());
        }
    }
}
