//! A procedure on one drive: time and frames go in, frames and events come out, and in the end an outcome.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use takt_rt::{Frame, Nanoseconds};

use super::conversation::Conversation;
use super::event::Event;
use super::failure::Failure;
use super::line::Manners;
use super::report::Report;

/// Why a procedure has ended before its end, and in which step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{step}: {failure}")]
pub struct Failed {
    /// The step.
    pub step: &'static str,
    /// Why.
    pub failure: Failure,
}

/// A procedure under way.
pub struct Procedure {
    conversation: Conversation,
    work: Pin<Box<dyn Future<Output = Result<Report, Failure>>>>,
    outcome: Option<Result<Report, Failed>>,
    began_ns: Option<Nanoseconds>,
}

impl fmt::Debug for Procedure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Procedure").field("outcome", &self.outcome).finish_non_exhaustive()
    }
}

impl Procedure {
    /// A procedure on the node that has not begun.
    pub fn new<W>(node: u8, manners: Manners, work: impl FnOnce(Conversation) -> W) -> Self
    where
        W: Future<Output = Result<Report, Failure>> + 'static,
    {
        let conversation = Conversation::new(node, manners);
        let work = Box::pin(work(conversation.clone()));
        Self { conversation, work, outcome: None, began_ns: None }
    }

    /// Lets time pass and hands out what is to be sent. The procedure's own clock begins at the first call.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        self.conversation.line_mut().now_ns = now_ns.saturating_sub(began_ns);
        self.send_requests(send);
        if self.outcome.is_none() {
            let mut context = Context::from_waker(Waker::noop());
            if let Poll::Ready(outcome) = self.work.as_mut().poll(&mut context) {
                let step = self.conversation.line().failing_step.unwrap_or(self.conversation.line().step);
                self.outcome = Some(outcome.map_err(|failure| Failed { step, failure }));
            }
        }
        self.send_requests(send);
        let mut line = self.conversation.line_mut();
        if let Some(heartbeat) = line.heartbeat() {
            send(heartbeat);
        }
    }

    fn send_requests(&self, send: &mut impl FnMut(Frame)) {
        let mut line = self.conversation.line_mut();
        while let Some(frame) = line.outgoing.pop_front() {
            send(frame);
        }
        let now_ns = line.now_ns;
        while let Some(frame) = line.client.poll(now_ns) {
            send(frame);
        }
    }

    /// Takes a frame that was received on the drive's bus.
    pub fn receive(&mut self, frame: &Frame) {
        self.conversation.line_mut().receive(frame);
    }

    /// Asks it to end: an axis that moves is stopped in control and disabled. RequestEnvelope again, it is disabled at once.
    pub fn interrupt(&mut self) {
        let mut line = self.conversation.line_mut();
        line.interruptions = line.interruptions.saturating_add(1);
    }

    /// The oldest event that was not taken.
    pub fn take_event(&mut self) -> Option<Event> {
        self.conversation.line_mut().events.pop_front()
    }

    /// How it has ended; `None` while it is under way.
    pub fn outcome(&self) -> Option<&Result<Report, Failed>> {
        self.outcome.as_ref()
    }
}
