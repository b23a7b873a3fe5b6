//! The session of a bring-up or shutdown with the drive of one axis: reads, compares, writes, and keeps facts.
//!
//! Each access has a name in the failure that it may cause: what was expected, and what was received. An access to an
//! object that a drive may lack is an optional one: it returns `false` then, and notes the object in
//! [`AxisFacts::absent`].
//!
//! In a dry run there is no drive: each read gives what is expected, and each write is accepted and listed.

use std::ops::Deref;
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock};

use takt_rt::{Frame, MappedObject, Nanoseconds};

use super::check::Check;
use super::facts::AxisFacts;
use super::failure::{Content, FailureCause};
use super::stages::BringUpTiming;
use crate::canopen::dcf::Download;
use crate::canopen::object::{Object, ObjectAddress};
use crate::canopen::sdo::{AbortCode, SdoError, Transfer};
use crate::config::{Axis, Config};
use crate::procedure::{Access, CanopenSession, POLL_NS};

/// The result of a step of bring-up or shutdown.
pub type StepResult<T = ()> = Result<T, FailureCause>;

/// What happens when an access fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OnFailure {
    /// The procedure ends.
    End,
    /// The procedure goes on, unless the drive no longer answers. The first failure is reported at the end.
    GoOn,
}

/// A failure with the remedy of its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepFailure {
    pub cause: FailureCause,
    pub advice: &'static str,
}

/// A session with the drive of one axis. Objects of the drive profile are named as those of the first axis of a node, and those of
/// this axis are meant.
pub struct AxisSession<'a> {
    /// The whole configuration.
    pub config: &'a Config,
    /// The axis.
    pub axis: &'a Axis,
    /// The timeouts.
    pub timing: BringUpTiming,
    pub(super) bus: CanopenSession,
    /// Whether the drive has been brought up before, in the same run.
    pub(super) is_again: bool,
    on_failure: OnFailure,
    facts: RwLock<AxisFacts>,
    /// The remedy of the current step.
    advice: Mutex<&'static str>,
    first_failure: Mutex<Option<StepFailure>>,
    /// In a dry run: every number that was written, in order.
    dry_writes: Option<Mutex<Vec<(ObjectAddress, i64)>>>,
}

/// The object of an axis that corresponds to an object of the first axis of a node.
pub(super) fn object_of(axis: &Axis, object: Object) -> Object {
    let ObjectAddress { index, subindex } = object.address;
    let own = MappedObject::new(index, subindex, 0).of_node_axis(axis.drive.node_axis);
    Object { address: ObjectAddress::new(own.index, own.subindex), ..object }
}

impl<'a> AxisSession<'a> {
    /// A session with the drive that `bus` leads to. `facts` is what is known of it.
    pub(super) fn new(
        bus: CanopenSession,
        config: &'a Config,
        axis: &'a Axis,
        timing: BringUpTiming,
        on_failure: OnFailure,
        facts: AxisFacts,
    ) -> Self {
        Self {
            config,
            axis,
            timing,
            bus,
            is_again: false,
            on_failure,
            facts: RwLock::new(facts),
            advice: Mutex::default(),
            first_failure: Mutex::default(),
            dry_writes: None,
        }
    }

    /// The same procedure with a drive that has been brought up before, or not.
    pub(super) fn again(self, is_again: bool) -> Self {
        Self { is_again, ..self }
    }

    /// The same procedure without a drive.
    pub(super) fn dry_run(self) -> Self {
        Self { dry_writes: Some(Mutex::default()), ..self }
    }

    pub(super) fn is_dry_run(&self) -> bool {
        self.dry_writes.is_some()
    }

    /// Every number that was written in a dry run, in order.
    pub(super) fn dry_writes(self) -> Vec<(ObjectAddress, i64)> {
        self.dry_writes.map(|writes| std::mem::take(&mut *lock(&writes))).unwrap_or_default()
    }

    /// The facts, or the first failure.
    pub(super) fn end(self, result: StepResult) -> Result<AxisFacts, StepFailure> {
        let failure = result.err().map(|cause| StepFailure { cause, advice: *lock(&self.advice) });
        let first = *lock(&self.first_failure);
        match first.or(failure) {
            Some(failure) => Err(failure),
            None => Ok(AxisFacts {
                emergency: self.bus.emergency(),
                ..self.facts.into_inner().unwrap_or_else(PoisonError::into_inner)
            }),
        }
    }

    /// The axes of the same node, in the order of the configuration.
    pub(super) fn siblings(&self) -> impl Iterator<Item = &Axis> {
        let is_of_node = |axis: &&Axis| (axis.bus, axis.node) == (self.axis.bus, self.axis.node);
        self.config.axes.iter().filter(is_of_node)
    }

    /// Whether this is the first axis of its node that is brought up or shut down: what belongs to the node as a whole is begun with
    /// it.
    pub fn is_first_of_node(&self) -> bool {
        self.siblings().next().is_none_or(|first| first.drive.node_axis == self.axis.drive.node_axis)
    }

    /// Whether this is the last axis of its node: what belongs to the node as a whole is ended with it.
    pub fn is_last_of_node(&self) -> bool {
        self.siblings().last().is_none_or(|last| last.drive.node_axis == self.axis.drive.node_axis)
    }

    /// Whether the configuration has this axis of the node.
    pub fn has_node_axis(&self, node_axis: u8) -> bool {
        self.siblings().any(|axis| axis.drive.node_axis == node_axis)
    }

    /// The object of this axis that corresponds to an object of the first axis of a node.
    pub(super) fn of_axis(&self, object: Object) -> Object {
        object_of(self.axis, object)
    }

    /// Begins a step: its name and its remedy, for progress and failures.
    pub fn step(&self, name: &'static str, advice: &'static str) {
        self.bus.step(name);
        *lock(&self.advice) = advice;
    }

    /// What the drive has reported so far.
    pub fn facts(&self) -> impl Deref<Target = AxisFacts> {
        self.facts.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a fact.
    pub fn keep(&self, keep: impl FnOnce(&mut AxisFacts)) {
        keep(&mut self.facts.write().unwrap_or_else(PoisonError::into_inner));
    }

    /// Reads a number, keeps it as a fact, and compares it.
    pub async fn read(
        &self,
        object: Object,
        expected: Check,
        keep: impl FnOnce(&mut AxisFacts, i64),
    ) -> StepResult {
        let object = self.of_axis(object);
        let compared = self.number(object, Access::Read, expected).await.and_then(|received| {
            self.keep(|facts| keep(facts, received));
            compared(object, Access::Read, expected, received)
        });
        self.settled(compared)
    }

    /// Reads a number from an object that the drive may lack or refuse.
    pub async fn read_optional(
        &self,
        object: Object,
        keep: impl FnOnce(&mut AxisFacts, i64),
    ) -> StepResult<bool> {
        let object = self.of_axis(object);
        let read = match self.number(object, Access::Read, Check::Any).await {
            Ok(received) => {
                self.keep(|facts| keep(facts, received));
                Ok(true)
            }
            Err(FailureCause::Transfer { error, .. }) if self.may_refuse(error) => {
                self.note_absent(object.address);
                Ok(false)
            }
            Err(cause) => Err(cause),
        };
        self.settled(read)
    }

    /// Reads a number from an object that the drive may lack or refuse, and compares it.
    pub async fn compare_optional(&self, object: Object, expected: Check) -> StepResult {
        let object = self.of_axis(object);
        let read = match self.number(object, Access::Read, expected).await {
            Ok(received) => compared(object, Access::Read, expected, received),
            Err(FailureCause::Transfer { error, .. }) if self.may_refuse(error) => {
                self.note_absent(object.address);
                Ok(())
            }
            Err(cause) => Err(cause),
        };
        self.settled(read)
    }

    /// Reads a text from an object that the drive may lack or refuse.
    pub async fn read_text(
        &self,
        object: ObjectAddress,
        keep: impl FnOnce(&mut AxisFacts, String),
    ) -> StepResult<bool> {
        if self.is_dry_run() {
            return self.settled(Ok(false));
        }
        let read = match self.bus.read_bytes(object).await {
            Ok(uploaded) => {
                self.keep(|facts| keep(facts, uploaded.text()));
                Ok(true)
            }
            Err(SdoError::Aborted(_)) => {
                self.note_absent(object);
                Ok(false)
            }
            Err(error) => Err(FailureCause::TextTransfer { object, error }),
        };
        self.settled(read)
    }

    /// Reads a number again and again until it is as expected. Each is kept as a fact.
    pub async fn wait_for(
        &self,
        object: Object,
        expected: Check,
        within_ns: Nanoseconds,
        mut keep: impl FnMut(&mut AxisFacts, i64),
    ) -> StepResult {
        let object = self.of_axis(object);
        let began_ns = self.bus.now_ns();
        let awaited = loop {
            let received = match self.number(object, Access::Read, expected).await {
                Ok(received) => received,
                Err(cause) => break Err(cause),
            };
            self.keep(|facts| keep(facts, received));
            let waited_ns = self.bus.now_ns().saturating_sub(began_ns);
            if expected.passes(received) {
                break Ok(());
            } else if waited_ns >= within_ns {
                let access = Access::Read;
                break Err(FailureCause::Value { object, access, expected, received, waited_ns });
            }
            self.bus.sleep(POLL_NS).await;
        };
        self.settled(awaited)
    }

    /// Sends a frame; not in a dry run.
    pub fn send(&self, frame: Frame) {
        if !self.is_dry_run() {
            self.bus.send(frame);
        }
    }

    /// Waits for a time; not in a dry run.
    pub async fn pause(&self, duration_ns: Nanoseconds) {
        if !self.is_dry_run() {
            self.bus.sleep(duration_ns).await;
        }
    }

    /// Writes a number.
    pub async fn write(&self, object: Object, value: i64) -> StepResult {
        let written = self.written(self.of_axis(object), value).await;
        self.settled(written)
    }

    /// Writes a number to an object that the drive may lack.
    pub async fn write_optional(&self, object: Object, value: i64) -> StepResult<bool> {
        let object = self.of_axis(object);
        let written = match self.written(object, value).await {
            Ok(()) => Ok(true),
            Err(FailureCause::Transfer { error, .. }) if self.bus.quirks().means_absent(error) => {
                self.note_absent(object.address);
                Ok(false)
            }
            Err(cause) => Err(cause),
        };
        self.settled(written)
    }

    /// Writes a number and reads it back.
    pub async fn write_and_read_back(&self, object: Object, value: i64) -> StepResult {
        self.write_and_compare(object, value, Check::Equals(value)).await
    }

    /// Writes a number, reads it back, and compares it.
    pub async fn write_and_compare(&self, object: Object, value: i64, expected: Check) -> StepResult {
        let object = self.of_axis(object);
        let written = async {
            self.written(object, value).await?;
            let access = Access::ReadBack(value);
            let received = self.number(object, access, expected).await?;
            compared(object, access, expected, received)
        };
        let written = written.await;
        self.settled(written)
    }

    /// Writes a value of a configuration file, and reads it back unless the object is write-only.
    pub async fn write_download(&self, download: &Download) -> StepResult {
        let written = self.written_download(download).await;
        self.settled(written)
    }

    async fn written_download(&self, download: &Download) -> StepResult {
        if self.is_dry_run() {
            return Ok(());
        }
        let Download { object, data } = download;
        let (object, written) = (*object, Content::of(data));
        let failed = |is_reading_back| {
            move |error| FailureCause::ConfigurationTransfer {
                object,
                written,
                is_reading_back,
                error,
                means_absent: self.bus.quirks().means_absent(error),
            }
        };
        let transfer = Transfer::Download { object, data: data.clone() };
        self.bus.exchange(transfer).await.map_err(failed(false))?;
        match self.bus.read_bytes(object).await {
            Err(SdoError::Aborted(AbortCode::WriteOnly)) => Ok(()),
            Err(error) => Err(failed(true)(error)),
            Ok(received) if download.is_held_by(&received) => Ok(()),
            Ok(received) => {
                let received = Content::of(&received.bytes);
                Err(FailureCause::ConfigurationDiffers { object, written, received })
            }
        }
    }

    async fn written(&self, object: Object, value: i64) -> StepResult {
        let data = object.data_type.encode(value).ok_or(FailureCause::DoesNotFit { object, value })?;
        if let Some(writes) = &self.dry_writes {
            lock(writes).push((object.address, value));
            return Ok(());
        }
        let failed = |error| FailureCause::Transfer { object, access: Access::Write(value), error };
        let transfer = Transfer::Download { object: object.address, data };
        self.bus.exchange(transfer).await.map(|_| ()).map_err(failed)
    }

    async fn number(&self, object: Object, access: Access, expected: Check) -> StepResult<i64> {
        if self.is_dry_run() {
            return Ok(expected.example());
        }
        let failed = |error| FailureCause::Transfer { object, access, error };
        let uploaded = self.bus.read_bytes(object.address).await.map_err(failed)?;
        let number = if self.bus.quirks().has_other_lengths {
            uploaded.number_of_any_length(object.data_type)
        } else {
            uploaded.number(object.data_type)
        };
        number.ok_or(FailureCause::Length { object, received: uploaded.bytes.len() })
    }

    /// Whether an object that may be absent is so by this error. Some drives abort with a code that has another meaning.
    fn may_refuse(&self, error: SdoError) -> bool {
        matches!(error, SdoError::Aborted(_)) || self.bus.quirks().means_absent(error)
    }

    /// Notes that the drive does not have the object.
    pub fn note_absent(&self, object: ObjectAddress) {
        self.keep(|facts| facts.absent.push(object));
    }

    /// Ends an access: counts it, and decides whether the procedure goes on after its failure.
    pub(super) fn settled<T: Default>(&self, result: StepResult<T>) -> StepResult<T> {
        match result {
            Err(cause) if self.on_failure == OnFailure::GoOn && !cause.is_silence() => {
                let mut first = lock(&self.first_failure);
                if first.is_none() {
                    self.bus.keep_failing_step();
                    *first = Some(StepFailure { cause, advice: *lock(&self.advice) });
                }
                self.bus.count_done();
                Ok(T::default())
            }
            Err(cause) => Err(cause),
            Ok(value) => {
                self.bus.count_done();
                Ok(value)
            }
        }
    }
}

/// A procedure may move to another thread between two polls, but runs in one at a time: nobody waits for a lock.
fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn compared(object: Object, access: Access, expected: Check, received: i64) -> StepResult {
    if expected.passes(received) {
        return Ok(());
    }
    Err(FailureCause::Value { object, access, expected, received, waited_ns: 0 })
}
