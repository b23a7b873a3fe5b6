//! A procedure on one drive: it takes time and frames, and returns frames, events and an outcome.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use takt_rt::{Frame, Nanoseconds};

use super::event::ProcedureEvent;
use super::failure::Failure;
use super::report::Report;
use super::sdo_session::SdoSession;
use super::session_state::SdoQuirks;

/// Why a procedure failed, and in which step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{step}: {failure}")]
pub struct ProcedureError {
    /// The failed step.
    pub step: &'static str,
    /// The reason.
    pub failure: Failure,
}

/// A running procedure.
pub struct Procedure {
    session: SdoSession,
    work: Pin<Box<dyn Future<Output = Result<Report, Failure>>>>,
    outcome: Option<Result<Report, ProcedureError>>,
    began_ns: Option<Nanoseconds>,
}

impl fmt::Debug for Procedure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Procedure").field("outcome", &self.outcome).finish_non_exhaustive()
    }
}

impl Procedure {
    /// A procedure that has not begun, for the drive with this node ID.
    pub fn new<W>(node: u8, sdo_quirks: SdoQuirks, work: impl FnOnce(SdoSession) -> W) -> Self
    where
        W: Future<Output = Result<Report, Failure>> + 'static,
    {
        let session = SdoSession::new(node, sdo_quirks);
        let work = Box::pin(work(session.clone()));
        Self { session, work, outcome: None, began_ns: None }
    }

    /// Advances the procedure to `now_ns` and sends its frames. The procedure's clock begins at the first call.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(Frame)) {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        self.session.state_mut().now_ns = now_ns.saturating_sub(began_ns);
        self.send_requests(send);
        if self.outcome.is_none() {
            let mut context = Context::from_waker(Waker::noop());
            if let Poll::Ready(outcome) = self.work.as_mut().poll(&mut context) {
                let step = self.session.state().failing_step.unwrap_or(self.session.state().step);
                self.outcome = Some(outcome.map_err(|failure| ProcedureError { step, failure }));
            }
        }
        self.send_requests(send);
        let mut state = self.session.state_mut();
        if let Some(heartbeat) = state.heartbeat() {
            send(heartbeat);
        }
    }

    fn send_requests(&self, send: &mut impl FnMut(Frame)) {
        let mut state = self.session.state_mut();
        while let Some(frame) = state.outgoing.pop_front() {
            send(frame);
        }
        let now_ns = state.now_ns;
        while let Some(frame) = state.client.poll(now_ns) {
            send(frame);
        }
    }

    /// Passes a frame received on the drive's bus.
    pub fn receive(&mut self, frame: &Frame) {
        self.session.state_mut().receive(frame);
    }

    /// Interrupts the procedure: a moving axis is stopped, then disabled. A second call disables it at once.
    pub fn interrupt(&mut self) {
        let mut state = self.session.state_mut();
        state.interruptions = state.interruptions.saturating_add(1);
    }

    /// Removes and returns the oldest event.
    pub fn take_event(&mut self) -> Option<ProcedureEvent> {
        self.session.state_mut().events.pop_front()
    }

    /// The result; `None` while the procedure runs.
    pub fn outcome(&self) -> Option<&Result<Report, ProcedureError>> {
        self.outcome.as_ref()
    }
}
