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

/// The code of a procedure that stays in its thread.
pub type Work<T, E> = dyn Future<Output = Result<T, E>>;
/// The code of a procedure that may move to another thread between two polls.
pub type MovableWork<T, E> = dyn Future<Output = Result<T, E>> + Send;

/// A running procedure.
pub struct Procedure<C: Client, T, E, W: ?Sized = Work<T, E>> {
    session: ProcedureSession<C>,
    work: Pin<Box<W>>,
    outcome: Option<Result<T, ProcedureError<E>>>,
}

impl<C: Client, T: fmt::Debug, E: fmt::Debug, W: ?Sized> fmt::Debug for Procedure<C, T, E, W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Procedure").field("outcome", &self.outcome).finish_non_exhaustive()
    }
}

impl<C: Client, T, E> Procedure<C, T, E> {
    /// A procedure that has not begun. `work` is its code, which holds a clone of `session`.
    pub fn new(session: ProcedureSession<C>, work: impl Future<Output = Result<T, E>> + 'static) -> Self {
        Self { session, work: Box::pin(work), outcome: None }
    }
}

impl<C: Client, T, E> Procedure<C, T, E, MovableWork<T, E>> {
    /// As [`Procedure::new`], one that may move to another thread between two polls.
    pub fn movable(
        session: ProcedureSession<C>,
        work: impl Future<Output = Result<T, E>> + Send + 'static,
    ) -> Self {
        Self { session, work: Box::pin(work), outcome: None }
    }
}

impl<C: Client, T, E, W: Future<Output = Result<T, E>> + ?Sized> Procedure<C, T, E, W> {
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

    /// Passes a received message. It is ignored after a failure; after a success, another procedure may follow in the same
    /// session, and must know of it.
    pub fn receive(&mut self, message: &C::Message) {
        if !matches!(self.outcome, Some(Err(_))) {
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
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    /// The master's side of a serial line: one byte asks, and the answer is two bytes.
    #[derive(Default)]
    struct Line {
        outgoing: VecDeque<Vec<u8>>,
        answer: Option<Vec<u8>>,
    }

    impl Client for Line {
        type Message = Vec<u8>;

        fn poll(&mut self, _: Nanoseconds) -> Option<Vec<u8>> {
            self.outgoing.pop_front()
        }

        fn receive(&mut self, bytes: &Vec<u8>) {
            self.answer = Some(bytes.clone());
        }
    }

    type LineSession = ProcedureSession<Line>;

    /// Asks until an answer comes, three times at most, 10 ns apart.
    async fn ask(session: LineSession, question: u8) -> Result<Vec<u8>, &'static str> {
        session.step("question");
        for _ in 0..3 {
            session.client_mut().outgoing.push_back(vec![question]);
            let answer = session.until(|| session.client_mut().answer.take());
            let end_ns = session.now_ns() + 10;
            if let Some(answer) = session.unless_over(|| session.now_ns() >= end_ns, answer).await {
                return Ok(answer);
            }
        }
        Err("silence")
    }

    fn asking(question: u8) -> Procedure<Line, Vec<u8>, &'static str> {
        let session = LineSession::new(Line::default());
        Procedure::new(session.clone(), ask(session, question))
    }

    fn sent(procedure: &mut Procedure<Line, Vec<u8>, &'static str>, now_ns: Nanoseconds) -> Vec<Vec<u8>> {
        let mut sent = vec![];
        procedure.poll(now_ns, &mut |bytes| sent.push(bytes));
        sent
    }

    #[test]
    fn a_procedure_exchanges_bytes_as_well_as_frames() {
        let mut procedure = asking(7);
        assert_eq!(sent(&mut procedure, 1_000), [vec![7]]);
        procedure.receive(&vec![1, 2]);
        assert!(sent(&mut procedure, 1_005).is_empty());
        assert_eq!(procedure.outcome(), Some(&Ok(vec![1, 2])));
        assert_eq!(procedure.take_event(), Some(ProcedureEvent::Step("question")));
    }

    #[test]
    fn a_wait_is_given_up_at_its_end_and_the_failure_names_its_step() {
        let mut procedure = asking(7);
        assert_eq!(
            [0, 5, 10, 19, 20, 30].map(|now_ns| sent(&mut procedure, now_ns).len()),
            [1, 0, 1, 0, 1, 0]
        );
        let error = procedure.outcome().unwrap().as_ref().unwrap_err();
        assert_eq!(error.to_string(), "question: silence");
    }

    #[test]
    fn procedures_run_side_by_side_each_on_its_own_bus() {
        let asking = |question| {
            let session = LineSession::new(Line::default());
            Procedure::movable(session.clone(), ask(session, question))
        };
        let mut parallel = crate::procedure::Parallel::new([(0, asking(7)), (1, asking(8))]);
        let mut sent = vec![];
        parallel.poll(0, &mut |bus, bytes| sent.push((bus, bytes)));
        assert_eq!(sent, [(0, vec![7]), (1, vec![8])]);
        parallel.receive(1, &vec![9]);
        parallel.poll(1, &mut |_, _| ());
        let are_over: Vec<bool> = parallel.procedures().map(|one| one.outcome().is_some()).collect();
        assert_eq!(are_over, [false, true]);
    }
}
