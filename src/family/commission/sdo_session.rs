//! An SDO session with one drive: the interface through which a procedure reads, writes, waits and reports.
//!
//! A procedure is sequential async code. It never blocks: [`Procedure`](crate::procedure::Procedure) polls it with the current
//! time and passes the received frames to it.

use std::ops::Deref;

use takt_rt::{Frame, MappedObject, Nanoseconds};
use takt_wire::canopen::object::{Object, ObjectAddress};
use takt_wire::canopen::sdo::{Completed, SdoError, Transfer, Uploaded};

use super::failure::Failure;
use crate::procedure::{Access, CanopenSession, POLL_NS};

/// An SDO session with one axis of a drive. An interruption ends each wait, and is refused by each new transfer.
///
/// The objects of the drive profile are named as those of the first axis of a node; those of the axis are read and written.
#[derive(Debug)]
pub struct SdoSession {
    session: CanopenSession,
    node_axis: u8,
}

impl Deref for SdoSession {
    type Target = CanopenSession;

    fn deref(&self) -> &CanopenSession {
        &self.session
    }
}

impl SdoSession {
    pub(super) const fn new(session: CanopenSession, node_axis: u8) -> Self {
        Self { session, node_axis }
    }

    /// The object of the axis that corresponds to this one of the first axis of its node.
    fn of_axis(&self, object: &Object) -> Object {
        Object { address: self.address_of_axis(object.address), ..*object }
    }

    fn address_of_axis(&self, address: ObjectAddress) -> ObjectAddress {
        let mapped = MappedObject::new(address.index, address.subindex, 0).of_node_axis(self.node_axis);
        ObjectAddress::new(mapped.index, mapped.subindex)
    }

    /// Waits for a time.
    ///
    /// # Errors
    /// [`Failure::Interrupted`]
    pub async fn pause(&self, duration_ns: Nanoseconds) -> Result<(), Failure> {
        let pause = self.unless_over(|| self.is_interrupted(), self.sleep(duration_ns));
        pause.await.ok_or(Failure::Interrupted)
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

    /// Performs one SDO transfer.
    ///
    /// # Errors
    /// [`Failure::Interrupted`] when it was interrupted before it began. The inner result is that of the transfer.
    pub async fn transfer(&self, transfer: Transfer) -> Result<Result<Completed, SdoError>, Failure> {
        self.gap().await;
        if self.is_interrupted() { Err(Failure::Interrupted) } else { Ok(self.exchange(transfer).await) }
    }

    /// Reads the bytes of an object.
    ///
    /// # Errors
    /// See [`SdoSession::transfer`].
    pub async fn upload(&self, address: ObjectAddress) -> Result<Result<Uploaded, SdoError>, Failure> {
        let address = self.address_of_axis(address);
        self.gap().await;
        if self.is_interrupted() { Err(Failure::Interrupted) } else { Ok(self.read_bytes(address).await) }
    }

    /// Reads a number. The drive decides the length, the object's type the sign.
    ///
    /// # Errors
    /// The transfer failed, or the data is not a number.
    pub async fn read(&self, object: &Object) -> Result<i64, Failure> {
        let object = &self.of_axis(object);
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
        let object = &self.of_axis(object);
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
        self.set_retries(0);
        let written = self.write(object, value).await;
        self.set_retries(self.quirks().timing.retries);
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
        let object = &self.of_axis(object);
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
        let object = &self.of_axis(object);
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

/// Decodes the number in an object's bytes by the object's type, or by the length that the drive sent.
pub(super) fn number(object: &Object, uploaded: &Uploaded) -> Result<i64, Failure> {
    let received = uploaded.bytes.len();
    uploaded.number_of_any_length(object.data_type).ok_or(Failure::Length { object: *object, received })
}
