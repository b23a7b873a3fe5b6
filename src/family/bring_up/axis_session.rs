//! The session of a bring-up or shutdown with the drive of one axis: reads, compares, writes, and keeps facts.
//!
//! Each access has a name in the failure that it may cause: what was expected, and what was received. An access to an
//! object that a drive may lack is an optional one: it returns `false` then, and notes the object in
//! [`AxisFacts::absent`].
//!
//! In a dry run there is no drive: each read gives what is expected, and each write is accepted and listed. What a configuration file
//! has for an object is in it as in a drive, until it is written; a value of a file that is not as expected is listed.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock};

use takt_rt::{Frame, MappedObject, Nanoseconds};
use takt_wire::canopen::dcf::{DeviceConfiguration, Download};
use takt_wire::canopen::object::{Object, ObjectAddress};
use takt_wire::canopen::sdo::{AbortCode, SdoError, Transfer};

use super::axis_units::SiUnit;
use super::check::Check;
use super::facts::AxisFacts;
use super::failure::{Content, FailureCause};
use super::timing::BringUpTiming;
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
    /// True if the drive has been brought up before, in the same run.
    pub(super) is_again: bool,
    on_failure: OnFailure,
    facts: RwLock<AxisFacts>,
    /// The remedy of the current step.
    advice: Mutex<&'static str>,
    first_failure: Mutex<Option<StepFailure>>,
    /// In a dry run: what has happened.
    dry_run: Option<Mutex<DryRun>>,
}

/// The result of a dry run.
#[derive(Default)]
pub(super) struct DryRun {
    /// Every number that was written, in order. Values of a configuration file are not listed.
    pub writes: Vec<(ObjectAddress, i64)>,
    /// The values of configuration files that are not as expected.
    pub refused: Vec<RefusedValue>,
    /// The values that the drive has from configuration files.
    in_drive: Vec<FileValue>,
    /// Those that it will have from the files of later axes of its node.
    later: Vec<FileValue>,
}

/// A value of a configuration file with which bring-up refuses a drive.
pub(super) struct RefusedValue {
    /// The file.
    pub file: PathBuf,
    /// Object, received and expected value.
    pub cause: FailureCause,
    /// The remedy of the step that reads it.
    pub advice: &'static str,
}

/// A value of a configuration file.
#[derive(Clone)]
struct FileValue {
    file: PathBuf,
    download: Download,
}

impl FileValue {
    fn all_of(file: &DeviceConfiguration) -> impl Iterator<Item = Self> {
        let of = |download: &Download| Self { file: file.path.clone(), download: download.clone() };
        file.downloads.iter().map(of)
    }
}

impl DryRun {
    fn file_value(&self, object: ObjectAddress) -> Option<&FileValue> {
        let mut values = self.in_drive.iter().chain(&self.later).rev();
        values.find(|value| value.download.object == object)
    }
}

fn values_of<'a>(axes: impl Iterator<Item = &'a Axis>) -> Vec<FileValue> {
    axes.filter_map(|axis| axis.dcf.as_ref()).flat_map(FileValue::all_of).collect()
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
            dry_run: None,
        }
    }

    /// The same procedure with a drive that has been brought up before, or not.
    pub(super) fn again(self, is_again: bool) -> Self {
        Self { is_again, ..self }
    }

    /// The same procedure without a drive.
    pub(super) fn dry_run(self) -> Self {
        let is_own = |axis: &&Axis| axis.drive.node_axis == self.axis.drive.node_axis;
        let in_drive = values_of(self.siblings().take_while(|axis| !is_own(axis)));
        let later = values_of(self.siblings().skip_while(|axis| !is_own(axis)).skip(1));
        Self { dry_run: Some(Mutex::new(DryRun { in_drive, later, ..DryRun::default() })), ..self }
    }

    pub(super) fn is_dry_run(&self) -> bool {
        self.dry_run.is_some()
    }

    /// Ends a dry run and returns its result.
    pub(super) fn end_dry_run(self) -> DryRun {
        self.dry_run.map(|dry_run| std::mem::take(&mut *lock(&dry_run))).unwrap_or_default()
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

    /// Returns `true` if an access to the node, for any of its axes, has failed and the procedure goes on.
    pub fn has_failed(&self) -> bool {
        self.bus.has_failed_step()
    }

    /// The axes of the same node, in the order of the configuration.
    pub(super) fn siblings(&self) -> impl Iterator<Item = &Axis> {
        let is_of_node = |axis: &&Axis| (axis.bus, axis.node) == (self.axis.bus, self.axis.node);
        self.config.axes.iter().filter(is_of_node)
    }

    /// Returns `true` if this is the first axis of its node that is brought up or shut down: what belongs to the node as a whole is begun
    /// with it.
    pub fn is_first_of_node(&self) -> bool {
        self.siblings().next().is_none_or(|first| first.drive.node_axis == self.axis.drive.node_axis)
    }

    /// Returns `true` if this is the last axis of its node: what belongs to the node as a whole is ended with it.
    pub fn is_last_of_node(&self) -> bool {
        self.siblings().last().is_none_or(|last| last.drive.node_axis == self.axis.drive.node_axis)
    }

    /// Returns `true` if the configuration has this axis of the node.
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
            self.compared(object, Access::Read, expected, received, None)
        });
        self.settled(compared)
    }

    /// Reads a number from an object that the drive may lack or refuse.
    pub async fn read_optional(
        &self,
        object: Object,
        keep: impl FnOnce(&mut AxisFacts, i64),
    ) -> StepResult<bool> {
        let received = self.number_optional(self.of_axis(object), Check::Any).await;
        if let Ok(Some(received)) = received {
            self.keep(|facts| keep(facts, received));
        }
        self.settled(received.map(|received| received.is_some()))
    }

    /// Reads a number from an object that the drive may lack or refuse, and compares it.
    pub async fn compare_optional(
        &self,
        object: Object,
        expected: Check,
        unit: Option<SiUnit>,
    ) -> StepResult {
        let object = self.of_axis(object);
        let read = self.number_optional(object, expected).await.and_then(|received| match received {
            Some(received) => self.compared(object, Access::Read, expected, received, unit),
            None => Ok(()),
        });
        self.settled(read)
    }

    /// Reads two bounds from objects that the drive may lack or refuse, and compares each unless `are_off` says that they bound nothing.
    pub async fn compare_bounds(
        &self,
        bounds: [(Object, Check); 2],
        unit: SiUnit,
        are_off: impl FnOnce(i64, i64) -> bool,
    ) -> StepResult {
        let compared = async {
            let [lowest, highest] = bounds.map(|(object, expected)| (self.of_axis(object), expected));
            let received = [
                self.number_optional(lowest.0, lowest.1).await?,
                self.number_optional(highest.0, highest.1).await?,
            ];
            if let [Some(lowest), Some(highest)] = received
                && are_off(lowest, highest)
            {
                return Ok(());
            }
            for ((object, expected), received) in [lowest, highest].into_iter().zip(received) {
                if let Some(received) = received {
                    self.compared(object, Access::Read, expected, received, Some(unit))?;
                }
            }
            Ok(())
        };
        let compared = compared.await;
        self.settled(compared)
    }

    /// Reads a number from an object that the drive may lack or refuse; `None` if it does.
    async fn number_optional(&self, object: Object, expected: Check) -> StepResult<Option<i64>> {
        match self.number(object, Access::Read, expected).await {
            Ok(received) => Ok(Some(received)),
            Err(FailureCause::Transfer { error, .. }) if self.may_refuse(error) => {
                self.note_absent(object.address);
                Ok(None)
            }
            Err(cause) => Err(cause),
        }
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
            } else if waited_ns >= within_ns || self.is_dry_run() {
                let access = Access::Read;
                let cause = FailureCause::Value { object, access, expected, received, unit: None, waited_ns };
                break self.refused(object.address, cause);
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
            self.compared(object, access, expected, received, None)
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
        if let Some(dry_run) = &self.dry_run {
            let file = self.axis.dcf.as_ref().map(|file| file.path.clone()).unwrap_or_default();
            lock(dry_run).in_drive.push(FileValue { file, download: download.clone() });
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
        if let Some(dry_run) = &self.dry_run {
            let mut dry_run = lock(dry_run);
            dry_run.writes.push((object.address, value));
            dry_run.in_drive.retain(|value| value.download.object != object.address);
            return Ok(());
        }
        let failed = |error| FailureCause::Transfer { object, access: Access::Write(value), error };
        let transfer = Transfer::Download { object: object.address, data };
        self.bus.exchange(transfer).await.map(|_| ()).map_err(failed)
    }

    async fn number(&self, object: Object, access: Access, expected: Check) -> StepResult<i64> {
        if let Some(dry_run) = &self.dry_run {
            let dry_run = lock(dry_run);
            let in_file = dry_run.file_value(object.address);
            let number = in_file.and_then(|value| object.data_type.decode(&value.download.data));
            return Ok(number.unwrap_or_else(|| expected.example()));
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

    fn compared(
        &self,
        object: Object,
        access: Access,
        expected: Check,
        received: i64,
        unit: Option<SiUnit>,
    ) -> StepResult {
        if expected.passes(received) {
            return Ok(());
        }
        let cause = FailureCause::Value { object, access, expected, received, unit, waited_ns: 0 };
        self.refused(object.address, cause)
    }

    /// The failure by a value that is not as expected. A dry run lists it, and goes on.
    fn refused(&self, object: ObjectAddress, cause: FailureCause) -> StepResult {
        let Some(dry_run) = &self.dry_run else { return Err(cause) };
        let mut dry_run = lock(dry_run);
        if let Some(file) = dry_run.file_value(object).map(|value| value.file.clone()) {
            dry_run.refused.push(RefusedValue { file, cause, advice: *lock(&self.advice) });
        }
        Ok(())
    }

    /// Returns `true` if an object that may be absent is so by this error. Some drives abort with a code that has another meaning.
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
