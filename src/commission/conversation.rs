//! What a procedure and the one who runs it share: the present, the SDO client, what is to be sent, what was heard.
//!
//! A procedure is written as sequential code that awaits: transfers, pauses, conditions. Nothing of it blocks and
//! nothing runs by itself: [`Procedure`](super::Procedure) is polled with the present and fed with frames.

use std::cell::{Ref, RefCell, RefMut};
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use takt_rt::{Frame, Nanoseconds};

use super::event::{Event, Reading};
use super::failure::Failure;
use super::line::{Line, Manners, OwnHeartbeat};
use crate::canopen::emcy::Emergency;
use crate::canopen::nmt::{NmtCommand, NmtState, NmtTarget};
use crate::canopen::object::{Object, ObjectAddress};
use crate::canopen::sdo::{Client, Completed, SdoError, Timing, Transfer, Uploaded};
use crate::drive::Access;

/// A conversation with one drive.
#[derive(Clone, Debug)]
pub struct Conversation(Rc<RefCell<Line>>);

impl Conversation {
    pub(super) fn new(node: u8, manners: Manners) -> Self {
        Self(Rc::new(RefCell::new(Line::new(node, manners))))
    }

    // No borrow outlives the statement that it is made in, and none is held across an await: these cannot panic.
    pub(super) fn line(&self) -> Ref<'_, Line> {
        self.0.borrow()
    }

    pub(super) fn line_mut(&self) -> RefMut<'_, Line> {
        self.0.borrow_mut()
    }

    /// Says what is being done now.
    pub fn step(&self, name: &'static str) {
        let mut line = self.line_mut();
        line.step = name;
        line.events.push_back(Event::Step(name));
    }

    /// What follows belongs to an earlier step again.
    pub fn go_on_with(&self, name: &'static str) {
        self.line_mut().step = name;
    }

    /// The present step is the one that failed, whatever is done afterwards.
    pub fn keep_failing_step(&self) {
        let mut line = self.line_mut();
        line.failing_step = line.failing_step.or(Some(line.step));
    }

    /// Says something that people should know.
    pub fn note(&self, text: impl Into<String>) {
        self.line_mut().events.push_back(Event::Note(text.into()));
    }

    /// Shows where the axis is.
    pub fn show(&self, reading: Reading) {
        self.line_mut().events.push_back(Event::Reading(reading));
    }

    /// The node's number.
    pub fn node(&self) -> u8 {
        self.line().node
    }

    /// The present.
    pub fn now_ns(&self) -> Nanoseconds {
        self.line().now_ns
    }

    /// The state that the node has reported last, if it has reported any.
    pub fn nmt_state(&self) -> Option<NmtState> {
        self.line().nmt
    }

    /// The drive's last emergency message, unless it told that the error has gone.
    pub fn emergency(&self) -> Option<Emergency> {
        self.line().emergency
    }

    /// Requests to end are not obeyed any more, until there is one more than now.
    pub fn ignore_interruptions(&self) {
        let mut line = self.line_mut();
        line.ignored_interruptions = line.interruptions.max(line.ignored_interruptions).max(1);
    }

    /// Sends a frame.
    pub fn send(&self, frame: Frame) {
        self.line_mut().outgoing.push_back(frame);
    }

    /// Commands the node's state.
    pub fn command(&self, command: NmtCommand) {
        let node = self.node();
        self.send(command.frame(NmtTarget::Node(node)));
    }

    /// Sends a heartbeat from now on, or none any more.
    pub fn beat(&self, node: u8, period_ns: Option<Nanoseconds>) {
        let mut line = self.line_mut();
        let due_ns = line.now_ns;
        line.heartbeat = period_ns.map(|period_ns| OwnHeartbeat { node, period_ns, due_ns });
    }

    async fn until<T>(&self, mut look: impl FnMut(&mut Line) -> Option<T>) -> T {
        poll_fn(|_| match look(&mut self.line_mut()) {
            Some(value) => Poll::Ready(value),
            None => Poll::Pending,
        })
        .await
    }

    /// Waits.
    ///
    /// # Errors
    /// [`Failure::Interrupted`]
    pub async fn pause(&self, duration_ns: Nanoseconds) -> Result<(), Failure> {
        let end_ns = self.now_ns().saturating_add(duration_ns);
        let is_interrupted = self
            .until(|line| (line.is_interrupted() || line.now_ns >= end_ns).then_some(line.is_interrupted()));
        if is_interrupted.await { Err(Failure::Interrupted) } else { Ok(()) }
    }

    /// Collects every frame of the bus for a while.
    ///
    /// # Errors
    /// [`Failure::Interrupted`]
    pub async fn listen(&self, duration_ns: Nanoseconds) -> Result<Vec<Frame>, Failure> {
        self.begin_listening();
        let paused = self.pause(duration_ns).await;
        let heard = self.end_listening();
        paused.map(|()| heard)
    }

    /// Collects every frame of the bus from now on.
    pub fn begin_listening(&self) {
        self.line_mut().heard = Some(vec![]);
    }

    /// What was collected.
    pub fn end_listening(&self) -> Vec<Frame> {
        self.line_mut().heard.take().unwrap_or_default()
    }

    /// Moves one object.
    ///
    /// # Errors
    /// [`Failure::Interrupted`] before it has begun. What comes of the transfer itself is inside.
    pub async fn transfer(&self, transfer: Transfer) -> Result<Result<Completed, SdoError>, Failure> {
        self.until(|line| (line.now_ns >= line.free_ns).then_some(())).await;
        if self.line().is_interrupted() {
            return Err(Failure::Interrupted);
        }
        // The client is free: every transfer is awaited to its end here.
        let started = self.line_mut().client.start(transfer);
        debug_assert!(started.is_ok());
        let outcome = self.until(|line| line.client.take_outcome()).await;
        let mut line = self.line_mut();
        line.free_ns = line.now_ns.saturating_add(line.manners.gap_ns);
        Ok(outcome)
    }

    /// Reads the bytes of an object.
    ///
    /// # Errors
    /// See [`Conversation::transfer`].
    pub async fn upload(&self, address: ObjectAddress) -> Result<Result<Uploaded, SdoError>, Failure> {
        let completed = self.transfer(Transfer::Upload { object: address }).await?;
        Ok(completed.map(|completed| match completed {
            Completed::Uploaded(uploaded) => uploaded,
            Completed::Downloaded => Uploaded { bytes: vec![], is_size_known: true },
        }))
    }

    /// Reads a number. Its length is what the drive says, its sign that of the object's type.
    ///
    /// # Errors
    /// The transfer failed, or brought no number.
    pub async fn read(&self, object: &Object) -> Result<i64, Failure> {
        let failed = |error| Failure::Transfer { object: *object, access: Access::Read, error };
        let uploaded = self.upload(object.address).await?.map_err(failed)?;
        number(object, &uploaded)
    }

    /// Reads a number that the drive may lack: `None` when it says so.
    ///
    /// # Errors
    /// As [`Conversation::read`].
    pub async fn read_optional(&self, object: &Object) -> Result<Option<i64>, Failure> {
        match self.read(object).await {
            Ok(value) => Ok(Some(value)),
            Err(failure) if failure.means_absent() => Ok(None),
            Err(failure) => Err(failure),
        }
    }

    /// Reads a text that the drive may lack.
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

    /// Writes a number once: when no answer comes, nobody knows whether it was taken. For what must not be done twice.
    ///
    /// # Errors
    /// As [`Conversation::write`].
    pub async fn write_once(&self, object: &Object, value: i64) -> Result<(), Failure> {
        let (node, timing) = (self.node(), self.line().manners.timing);
        self.line_mut().client = Client::new(node, Timing { retries: 0, ..timing });
        let written = self.write(object, value).await;
        self.line_mut().client = Client::new(node, timing);
        written
    }

    /// Writes a number to an object that the drive may lack; tells whether it was taken.
    ///
    /// # Errors
    /// As [`Conversation::write`].
    pub async fn write_optional(&self, object: &Object, value: i64) -> Result<bool, Failure> {
        match self.write(object, value).await {
            Ok(()) => Ok(true),
            Err(failure) if failure.means_absent() => Ok(false),
            Err(failure) => Err(failure),
        }
    }

    /// Writes a number and reads it again.
    ///
    /// # Errors
    /// As [`Conversation::write`], and [`Failure::NotKept`].
    pub async fn write_and_check(&self, object: &Object, value: i64) -> Result<(), Failure> {
        self.write(object, value).await?;
        let received = self.read(object).await?;
        if received == value {
            return Ok(());
        }
        Err(Failure::NotKept { object: *object, written: value, received })
    }

    /// Reads an object again and again until it is as wanted.
    ///
    /// # Errors
    /// [`Failure::NotInTime`], and those of [`Conversation::read`].
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

/// Between two readings of an object that is waited for.
const POLL_NS: Nanoseconds = 5_000_000;

/// The number in the bytes of an object: as its type says, or as many bytes as the drive has sent.
pub(super) fn number(object: &Object, uploaded: &Uploaded) -> Result<i64, Failure> {
    let of_other_length = || uploaded.number(object.data_type.of_length(uploaded.bytes.len())?);
    let received = uploaded.bytes.len();
    uploaded
        .number(object.data_type)
        .or_else(of_other_length)
        .ok_or(Failure::Length { object: *object, received })
}
