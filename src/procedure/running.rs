//! A procedure on one drive: it takes time and messages, and returns messages, events and an outcome.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use takt_rt::Nanoseconds;

use super::client::Client;
use super::event::ProcedureEvent;
use super::session::ProcedureSession;

/// Why a procedure failed, and in which step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{step}: {failure}")]
pub struct ProcedureError<E> {
    /// The failed step.
    pub step: &'static str,
    /// The reason.
    pub failure: E,
}

/// A running procedure.
pub struct Procedure<C: Client, T, E> {
    session: ProcedureSession<C>,
    work: Pin<Box<dyn Future<Output = Result<T, E>>>>,
    outcome: Option<Result<T, ProcedureError<E>>>,
}

impl<C: Client, T: fmt::Debug, E: fmt::Debug> fmt::Debug for Procedure<C, T, E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Procedure").field("outcome", &self.outcome).finish_non_exhaustive()
    }
}

impl<C: Client, T, E> Procedure<C, T, E> {
    /// A procedure that has not begun. `work` is its code, which holds a clone of `session`.
    pub fn new(session: ProcedureSession<C>, work: impl Future<Output = Result<T, E>> + 'static) -> Self {
        Self { session, work: Box::pin(work), outcome: None }
    }

    /// Advances the procedure to `now_ns` and sends its messages.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(C::Message)) {
        self.session.set_time(now_ns);
        // Twice: the code may give up what its client would send, and a time-out of the client lets the code go on.
        for _ in 0..2 {
            self.advance();
            self.send_due(send);
        }
    }

    /// Runs the code until it waits.
    fn advance(&mut self) {
        if self.outcome.is_some() {
            return;
        }
        let mut context = Context::from_waker(Waker::noop());
        if let Poll::Ready(outcome) = self.work.as_mut().poll(&mut context) {
            let step = self.session.failing_step();
            self.outcome = Some(outcome.map_err(|failure| ProcedureError { step, failure }));
        }
    }

    fn send_due(&self, send: &mut impl FnMut(C::Message)) {
        let now_ns = self.session.now_ns();
        let next = || self.session.client_mut().poll(now_ns);
        while let Some(message) = next() {
            send(message);
        }
    }

    /// Passes a received message. It is ignored when the procedure has ended.
    pub fn receive(&mut self, message: &C::Message) {
        if self.outcome.is_none() {
            self.session.client_mut().receive(message);
        }
    }

    /// Interrupts the procedure: a moving axis is stopped, then disabled. A second call disables it at once.
    pub fn interrupt(&mut self) {
        self.session.interrupt();
    }

    /// Removes and returns the oldest event.
    pub fn take_event(&mut self) -> Option<ProcedureEvent> {
        self.session.take_event()
    }

    /// The result; `None` while the procedure runs.
    pub fn outcome(&self) -> Option<&Result<T, ProcedureError<E>>> {
        self.outcome.as_ref()
    }

    /// Its session.
    pub fn session(&self) -> &ProcedureSession<C> {
        &self.session
    }
}
