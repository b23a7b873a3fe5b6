//! An SDO session with one drive: the interface through which a procedure reads, writes, waits and reports.
//!
//! A procedure is sequential async code. It never blocks: [`Procedure`](super::Procedure) polls it with the current
//! time and passes the received frames to it.

use std::cell::{Ref, RefCell, RefMut};
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use takt_rt::{Frame, Nanoseconds};

use super::event::{AxisReading, ProcedureEvent};
use super::failure::Failure;
use super::session_state::{OwnHeartbeat, SdoQuirks, SessionState};
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{NmtCommand, NmtState, NmtTarget};
use crate::canopen::object::{Object, ObjectAddress};
use crate::canopen::sdo::{Completed, SdoClient, SdoError, SdoTiming, Transfer, Uploaded};
use crate::drive::Access;

/// An SDO session with one drive. Clones share the same state.
#[derive(Clone, Debug)]
pub struct SdoSession(Rc<RefCell<SessionState>>);

impl SdoSession {
    pub(super) fn new(node: u8, sdo_quirks: SdoQuirks) -> Self {
        Self(Rc::new(RefCell::new(SessionState::new(node, sdo_quirks))))
    }

    // No borrow outlives its statement and none is held across an await, so these cannot panic.
    pub(super) fn state(&self) -> Ref<'_, SessionState> {
        self.0.borrow()
    }

    pub(super) fn state_mut(&self) -> RefMut<'_, SessionState> {
        self.0.borrow_mut()
    }

    /// Begins a step and reports it.
    pub fn step(&self, name: &'static str) {
        let mut state = self.state_mut();
        state.step = name;
        state.events.push_back(ProcedureEvent::Step(name));
    }

    /// Continues an earlier step without reporting it again.
    pub fn resume_step(&self, name: &'static str) {
        self.state_mut().step = name;
    }

    /// Keeps the current step as the failing one, although clean-up steps follow.
    pub fn keep_failing_step(&self) {
        let mut state = self.state_mut();
        state.failing_step = state.failing_step.or(Some(state.step));
    }

    /// Reports a note for the operator.
    pub fn note(&self, text: impl Into<String>) {
        self.state_mut().events.push_back(ProcedureEvent::Note(text.into()));
    }

    /// Reports a reading of the axis.
    pub fn show(&self, reading: AxisReading) {
        self.state_mut().events.push_back(ProcedureEvent::Reading(reading));
    }

    /// The node ID.
    pub fn node(&self) -> u8 {
        self.state().node
    }

    /// The current time.
    pub fn now_ns(&self) -> Nanoseconds {
        self.state().now_ns
    }

    /// The NMT state in the node's last heartbeat, if one was received.
    pub fn nmt_state(&self) -> Option<NmtState> {
        self.state().nmt
    }

    /// The drive's last emergency message, unless an "error reset" message (code 00xx) followed.
    pub fn emergency(&self) -> Option<Emergency> {
        self.state().emergency
    }

    /// Ignores the interruptions so far (at least one); only a further one counts.
    pub fn ignore_interruptions(&self) {
        let mut state = self.state_mut();
        state.ignored_interruptions = state.interruptions.max(state.ignored_interruptions).max(1);
    }

    /// Sends a frame.
    pub fn send(&self, frame: Frame) {
        self.state_mut().outgoing.push_back(frame);
    }

    /// Sends an NMT command to the node.
    pub fn command(&self, command: NmtCommand) {
        let node = self.node();
        self.send(command.frame(NmtTarget::Node(node)));
    }

    /// Starts the heartbeat of this program under the node ID `node`, or stops it (`None`).
    pub fn set_heartbeat(&self, node: u8, period_ns: Option<Nanoseconds>) {
        let mut state = self.state_mut();
        let due_ns = state.now_ns;
        state.heartbeat = period_ns.map(|period_ns| OwnHeartbeat { node, period_ns, due_ns });
    }

    async fn until<T>(&self, mut check: impl FnMut(&mut SessionState) -> Option<T>) -> T {
        poll_fn(|_| match check(&mut self.state_mut()) {
            Some(value) => Poll::Ready(value),
            None => Poll::Pending,
        })
        .await
    }

    /// Waits for a time.
    ///
    /// # Errors
    /// [`Failure::Interrupted`]
    pub async fn pause(&self, duration_ns: Nanoseconds) -> Result<(), Failure> {
        let end_ns = self.now_ns().saturating_add(duration_ns);
        let is_interrupted = self.until(|state| {
            (state.is_interrupted() || state.now_ns >= end_ns).then_some(state.is_interrupted())
        });
        if is_interrupted.await { Err(Failure::Interrupted) } else { Ok(()) }
    }

    /// Collects all frames on the bus for a time.
    ///
    /// # Errors
    /// [`Failure::Interrupted`]
    pub async fn collect_frames(&self, duration_ns: Nanoseconds) -> Result<Vec<Frame>, Failure> {
        self.begin_collecting();
        let paused = self.pause(duration_ns).await;
        let collected = self.end_collecting();
        paused.map(|()| collected)
    }

    /// Starts to collect all frames on the bus.
    pub fn begin_collecting(&self) {
        self.state_mut().collected = Some(vec![]);
    }

    /// Stops collecting and returns the frames.
    pub fn end_collecting(&self) -> Vec<Frame> {
        self.state_mut().collected.take().unwrap_or_default()
    }

    /// Performs one SDO transfer.
    ///
    /// # Errors
    /// [`Failure::Interrupted`] when it was interrupted before it began. The inner result is that of the transfer.
    pub async fn transfer(&self, transfer: Transfer) -> Result<Result<Completed, SdoError>, Failure> {
        self.until(|state| (state.now_ns >= state.free_ns).then_some(())).await;
        if self.state().is_interrupted() {
            return Err(Failure::Interrupted);
        }
        // The client is free, because every transfer is awaited to its end here.
        let started = self.state_mut().client.start(transfer);
        debug_assert!(started.is_ok());
        let outcome = self.until(|state| state.client.take_outcome()).await;
        let mut state = self.state_mut();
        state.free_ns = state.now_ns.saturating_add(state.sdo_quirks.gap_ns);
        Ok(outcome)
    }

    /// Reads the bytes of an object.
    ///
    /// # Errors
    /// See [`SdoSession::transfer`].
    pub async fn upload(&self, address: ObjectAddress) -> Result<Result<Uploaded, SdoError>, Failure> {
        let completed = self.transfer(Transfer::Upload { object: address }).await?;
        Ok(completed.map(|completed| match completed {
            Completed::Uploaded(uploaded) => uploaded,
            Completed::Downloaded => Uploaded { bytes: vec![], is_size_known: true },
        }))
    }

    /// Reads a number. The drive decides the length, the object's type the sign.
    ///
    /// # Errors
    /// The transfer failed, or the data is not a number.
    pub async fn read(&self, object: &Object) -> Result<i64, Failure> {
        let failed = |error| Failure::Transfer { object: *object, access: Access::Read, error };
        let uploaded = self.upload(object.address).await?.map_err(failed)?;
        number(object, &uploaded)
    }

    /// Reads a number from an object that may not exist; `None` when the drive says so.
    ///
    /// # Errors
    /// As [`SdoSession::read`].
    pub async fn read_optional(&self, object: &Object) -> Result<Option<i64>, Failure> {
        match self.read(object).await {
            Ok(value) => Ok(Some(value)),
            Err(failure) if failure.means_absent() => Ok(None),
            Err(failure) => Err(failure),
        }
    }

    /// Reads a text from an object that may not exist.
    ///
    /// # Errors
    /// The drive did not answer.
    pub async fn read_text(&self, address: ObjectAddress) -> Result<Option<String>, Failure> {
        match self.upload(address).await? {
            Ok(uploaded) => Ok(Some(uploaded.text())),
            Err(SdoError::Aborted(_)) => Ok(None),
            Err(error) => Err(Failure::TextTransfer { object: address, error }),
        }
    }

    /// Writes a number.
    ///
    /// # Errors
    /// The number does not fit, or the transfer failed.
    pub async fn write(&self, object: &Object, value: i64) -> Result<(), Failure> {
        let data = object.data_type.encode(value).ok_or(Failure::DoesNotFit { object: *object, value })?;
        let outcome = self.transfer(Transfer::Download { object: object.address, data }).await?;
        match outcome {
            Ok(_) => Ok(()),
            Err(error) => Err(Failure::Transfer { object: *object, access: Access::Write(value), error }),
        }
    }

    /// Writes a number without a retry, for commands that must not be executed twice. When no answer comes, it is
    /// unknown whether the drive took the value.
    ///
    /// # Errors
    /// As [`SdoSession::write`].
    pub async fn write_once(&self, object: &Object, value: i64) -> Result<(), Failure> {
        let (node, timing) = (self.node(), self.state().sdo_quirks.timing);
        self.state_mut().client = SdoClient::new(node, SdoTiming { retries: 0, ..timing });
        let written = self.write(object, value).await;
        self.state_mut().client = SdoClient::new(node, timing);
        written
    }

    /// Writes a number to an object that may not exist; returns whether the drive accepted it.
    ///
    /// # Errors
    /// As [`SdoSession::write`].
    pub async fn write_optional(&self, object: &Object, value: i64) -> Result<bool, Failure> {
        match self.write(object, value).await {
            Ok(()) => Ok(true),
            Err(failure) if failure.means_absent() => Ok(false),
            Err(failure) => Err(failure),
        }
    }

    /// Writes a number and reads it back.
    ///
    /// # Errors
    /// As [`SdoSession::write`], and [`Failure::NotKept`].
    pub async fn write_and_check(&self, object: &Object, value: i64) -> Result<(), Failure> {
        self.write(object, value).await?;
        let received = self.read(object).await?;
        if received == value {
            return Ok(());
        }
        Err(Failure::NotKept { object: *object, written: value, received })
    }

    /// Polls an object until its value is as wanted.
    ///
    /// # Errors
    /// [`Failure::NotInTime`], and those of [`SdoSession::read`].
    pub async fn wait_for(
        &self,
        object: &Object,
        what: &'static str,
        within_ns: Nanoseconds,
        is_wanted: impl Fn(i64) -> bool,
    ) -> Result<i64, Failure> {
        let began_ns = self.now_ns();
        loop {
            let value = self.read(object).await?;
            if is_wanted(value) {
                return Ok(value);
            }
            let waited_ns = self.now_ns().saturating_sub(began_ns);
            if waited_ns >= within_ns {
                return Err(Failure::NotInTime { object: *object, what, last: value, waited_ns });
            }
            self.pause(POLL_NS).await?;
        }
    }
}

/// Interval between two reads of a polled object.
const POLL_NS: Nanoseconds = 5_000_000;

/// Decodes the number in an object's bytes by the object's type, or by the length that the drive sent.
pub(super) fn number(object: &Object, uploaded: &Uploaded) -> Result<i64, Failure> {
    let of_other_length = || uploaded.number(object.data_type.of_length(uploaded.bytes.len())?);
    let received = uploaded.bytes.len();
    uploaded
        .number(object.data_type)
        .or_else(of_other_length)
        .ok_or(Failure::Length { object: *object, received })
}
