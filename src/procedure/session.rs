//! The session of a procedure: the interface through which its code waits, sends and reports.

use std::collections::VecDeque;
use std::fmt;
use std::future::poll_fn;
use std::ops::{Deref, DerefMut};
use std::pin::pin;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::task::Poll;

use takt_rt::Nanoseconds;

use super::event::{AxisReading, ProcedureEvent};

/// A session with one drive. Clones share the same state. A procedure may move to another thread between two polls; its clones are
/// never used by two threads at once, so that no lock is ever waited for.
pub struct ProcedureSession<C>(Arc<RwLock<SessionState<C>>>);

#[derive(Debug)]
struct SessionState<C> {
    client: C,
    /// When the session was polled first: its clock begins there.
    began_ns: Option<Nanoseconds>,
    now_ns: Nanoseconds,
    events: VecDeque<ProcedureEvent>,
    step: &'static str,
    /// The step that failed, when further steps follow it.
    failing_step: Option<&'static str>,
    /// The number of finished accesses, for the progress.
    done: usize,
    /// The number of interruptions so far.
    interruptions: u8,
    /// The number of interruptions that are ignored, because the axis is already being stopped.
    ignored_interruptions: u8,
}

impl<C> Clone for ProcedureSession<C> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<C: fmt::Debug> fmt::Debug for ProcedureSession<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The client in the state of a session.
struct ClientGuard<S>(S);

impl<C, S: Deref<Target = SessionState<C>>> Deref for ClientGuard<S> {
    type Target = C;

    fn deref(&self) -> &C {
        &self.0.client
    }
}

impl<C, S: DerefMut<Target = SessionState<C>>> DerefMut for ClientGuard<S> {
    fn deref_mut(&mut self) -> &mut C {
        &mut self.0.client
    }
}

impl<C> ProcedureSession<C> {
    /// A session that has not begun.
    pub fn new(client: C) -> Self {
        Self(Arc::new(RwLock::new(SessionState {
            client,
            began_ns: None,
            now_ns: 0,
            events: VecDeque::new(),
            step: "begin",
            failing_step: None,
            done: 0,
            interruptions: 0,
            ignored_interruptions: 0,
        })))
    }

    // No guard outlives its statement and none is held across an await, so that these find the lock free.
    fn state(&self) -> RwLockReadGuard<'_, SessionState<C>> {
        self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn state_mut(&self) -> RwLockWriteGuard<'_, SessionState<C>> {
        self.0.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// The client. It must be given up before anything is awaited.
    pub(crate) fn client(&self) -> impl Deref<Target = C> {
        ClientGuard(self.state())
    }

    /// As [`ProcedureSession::client`], to change it.
    pub(crate) fn client_mut(&self) -> impl DerefMut<Target = C> {
        ClientGuard(self.state_mut())
    }

    /// Sets the time. The session's clock begins at the first call.
    pub(super) fn set_time(&self, now_ns: Nanoseconds) {
        let mut state = self.state_mut();
        let began_ns = *state.began_ns.get_or_insert(now_ns);
        state.now_ns = now_ns.saturating_sub(began_ns);
    }

    pub(super) fn take_event(&self) -> Option<ProcedureEvent> {
        self.state_mut().events.pop_front()
    }

    pub(super) fn interrupt(&self) {
        let mut state = self.state_mut();
        state.interruptions = state.interruptions.saturating_add(1);
    }

    /// The current time.
    pub fn now_ns(&self) -> Nanoseconds {
        self.state().now_ns
    }

    /// Begins a step and reports it.
    pub fn step(&self, name: &'static str) {
        let mut state = self.state_mut();
        state.step = name;
        state.events.push_back(ProcedureEvent::Step(name));
    }

    /// Continues an earlier step without reporting it again.
    pub(crate) fn resume_step(&self, name: &'static str) {
        self.state_mut().step = name;
    }

    /// The name of the current step.
    pub(crate) fn step_name(&self) -> &'static str {
        self.state().step
    }

    /// Keeps the current step as the failing one, although further steps follow.
    pub(crate) fn keep_failing_step(&self) {
        let mut state = self.state_mut();
        state.failing_step = state.failing_step.or(Some(state.step));
    }

    /// Returns `true` if a step is kept as the failing one.
    pub(crate) fn has_failed_step(&self) -> bool {
        self.state().failing_step.is_some()
    }

    /// The step in which a failure belongs that ends the procedure now.
    pub(super) fn failing_step(&self) -> &'static str {
        let state = self.state();
        state.failing_step.unwrap_or(state.step)
    }

    /// Reports a note for the operator.
    pub fn note(&self, text: impl Into<String>) {
        self.state_mut().events.push_back(ProcedureEvent::Note(text.into()));
    }

    /// Reports a reading of the axis.
    pub fn show(&self, reading: AxisReading) {
        self.state_mut().events.push_back(ProcedureEvent::Reading(reading));
    }

    /// Reports how much of the work is done.
    pub(crate) fn progress(&self, done: u32, of: u32) {
        self.state_mut().events.push_back(ProcedureEvent::Progress { done, of });
    }

    /// Counts a finished access, for the progress.
    pub(crate) fn count_done(&self) {
        self.state_mut().done += 1;
    }

    /// The number of finished accesses.
    pub(crate) fn done(&self) -> usize {
        self.state().done
    }

    /// Sets the progress back to the beginning.
    pub(crate) fn begin_again(&self) {
        self.state_mut().done = 0;
    }

    /// Returns `true` if an interruption has come that is not ignored.
    pub fn is_interrupted(&self) -> bool {
        let state = self.state();
        state.interruptions > state.ignored_interruptions
    }

    /// Ignores the interruptions so far (at least one); only a further one counts.
    pub fn ignore_interruptions(&self) {
        let mut state = self.state_mut();
        state.ignored_interruptions = state.interruptions.max(state.ignored_interruptions).max(1);
    }

    /// Waits until `check` gives a value. It is called at every poll.
    pub async fn until<T>(&self, mut check: impl FnMut() -> Option<T>) -> T {
        poll_fn(|_| check().map_or(Poll::Pending, Poll::Ready)).await
    }

    /// Waits for a time.
    pub async fn sleep(&self, duration_ns: Nanoseconds) {
        let end_ns = self.now_ns().saturating_add(duration_ns);
        self.until(|| (self.now_ns() >= end_ns).then_some(())).await;
    }

    /// Waits for a time, or until it is interrupted.
    pub async fn pause(&self, duration_ns: Nanoseconds) {
        self.unless_over(|| self.is_interrupted(), self.sleep(duration_ns)).await;
    }

    /// Runs `work` to its end, or until `is_over`: then `work` is dropped where it waits, and the result is `None`.
    pub async fn unless_over<T>(
        &self,
        is_over: impl Fn() -> bool,
        work: impl Future<Output = T>,
    ) -> Option<T> {
        let mut work = pin!(work);
        poll_fn(|context| if is_over() { Poll::Ready(None) } else { work.as_mut().poll(context).map(Some) })
            .await
    }
}
