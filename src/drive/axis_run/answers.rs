//! What becomes of a step once the drive has answered: values judged and kept, writes read back, silence understood.

use takt_rt::{Dialect, Nanoseconds};

use super::{AWAIT_PAUSE_NS, AxisRun, Phase, Progress};
use crate::canopen::dcf::Download;
use crate::canopen::object::Object;
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::pdo_inquiry::PdoInquiry;
use crate::canopen::sdo::{AbortCode, Completed, SdoError, Transfer};
use crate::drive::failure::{Answered, Cause, Content};
use crate::drive::process_data::ProcessData;
use crate::drive::step::{Access, Action, Check, Fact, ReadBack};

impl AxisRun {
    /// A transfer is over.
    pub(super) fn transferred(
        &mut self,
        now_ns: Nanoseconds,
        outcome: Result<Completed, SdoError>,
    ) -> Progress {
        match (self.phase, self.action()) {
            (
                Phase::Inquire { waited_ns, has_answered },
                Some(Action::Nmt { awaited: Some(awaited), .. }),
            ) => {
                let answered = match (outcome, has_answered, self.other_protocol) {
                    (Ok(_) | Err(SdoError::Aborted(_)), _, _) => Answered::Sdo,
                    (_, true, Some(other)) => Answered::OtherProtocol(other.name),
                    _ => Answered::Nothing,
                };
                Err(Cause::StateNotReached { awaited, reported: self.reported, waited_ns, answered })
            }
            (Phase::ReadBack { written }, Some(Action::Write { object, read_back, .. })) => {
                self.read_back(object, written, read_back, outcome)
            }
            (Phase::Transfer { .. }, Some(Action::Write { object, value, read_back, is_optional })) => {
                self.written(object, self.value_of(value), read_back, is_optional, outcome)
            }
            (Phase::Transfer { .. }, Some(Action::Read { object, check, keep, is_optional })) => {
                self.read(object, check, keep, is_optional, outcome)
            }
            (Phase::Transfer { .. }, Some(Action::Reach { .. })) => match outcome {
                Ok(_) | Err(SdoError::Aborted(_)) => {
                    self.next_step();
                    Ok(())
                }
                Err(error) => Err(Cause::Transfer { object: DEVICE_TYPE, access: Access::Read, error }),
            },
            (Phase::Transfer { .. }, Some(Action::ReadText { object, keep })) => {
                match outcome {
                    Ok(Completed::Uploaded(uploaded)) => self.facts.keep_text(keep, uploaded.text()),
                    Ok(Completed::Downloaded) | Err(SdoError::Aborted(_)) => self.facts.absent.push(object),
                    Err(error) => return Err(Cause::TextTransfer { object, error }),
                }
                self.next_step();
                Ok(())
            }
            (Phase::Transfer { .. }, Some(Action::WriteBytes(download))) => {
                self.bytes_written(&download, outcome)
            }
            (Phase::Verify, Some(Action::WriteBytes(download))) => self.verify(&download, outcome),
            (Phase::Transfer { began_ns }, Some(Action::Await { object, check, keep, within_ns })) => {
                let received = self.number(object, Access::Read, outcome)?;
                self.keep(keep, received);
                let waited_ns = now_ns.saturating_sub(began_ns);
                if check.passes(received) {
                    self.next_step();
                } else if waited_ns >= within_ns {
                    return Err(Cause::Value {
                        object,
                        access: Access::Read,
                        expected: check,
                        received,
                        waited_ns,
                    });
                } else {
                    self.phase = Phase::Pause { began_ns, until_ns: now_ns.saturating_add(AWAIT_PAUSE_NS) };
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Settles the process data once the drive has told of it.
    pub(super) fn inquired(&mut self) -> Progress {
        let Some(outcome) = self.inquiry.as_ref().and_then(PdoInquiry::outcome) else { return Ok(()) };
        self.inquiry = None;
        let reported = match outcome {
            Ok(reported) => reported,
            Err(failure) if self.means_absent(failure.error) => {
                self.facts.absent.push(failure.object);
                vec![]
            }
            Err(failure) => return Err(Cause::Inquiry(failure)),
        };
        let data = ProcessData::as_reported(&self.axis, &reported).map_err(Cause::Mapping)?;
        self.facts.process_data = Some(data);
        self.next_step();
        Ok(())
    }

    /// Whether an error says that the drive has no such object. A YZ-AIM says so by silence.
    fn means_absent(&self, error: SdoError) -> bool {
        match error {
            SdoError::Aborted(code) => code.means_absent(),
            SdoError::NoReply { .. } => self.facts.dialect == Dialect::YzAim,
            _ => false,
        }
    }

    fn read(
        &mut self,
        object: Object,
        check: Check,
        keep: Option<Fact>,
        is_optional: bool,
        outcome: Result<Completed, SdoError>,
    ) -> Progress {
        let is_absent = match outcome {
            Err(SdoError::Aborted(_)) => true,
            Err(error) => self.means_absent(error),
            Ok(_) => false,
        };
        if is_optional && is_absent {
            self.facts.absent.push(object.address);
            self.next_step();
            return Ok(());
        }
        let received = self.number(object, Access::Read, outcome)?;
        self.keep(keep, received);
        if !check.passes(received) {
            let access = Access::Read;
            return Err(Cause::Value { object, access, expected: check, received, waited_ns: 0 });
        }
        self.next_step();
        Ok(())
    }

    fn written(
        &mut self,
        object: Object,
        value: i64,
        read_back: ReadBack,
        is_optional: bool,
        outcome: Result<Completed, SdoError>,
    ) -> Progress {
        match outcome {
            Err(error) if is_optional && self.means_absent(error) => {
                self.facts.absent.push(object.address);
                self.next_step();
            }
            Err(error) => return Err(Cause::Transfer { object, access: Access::Write(value), error }),
            Ok(_) if read_back == ReadBack::No => self.next_step(),
            Ok(_) => {
                self.start(Transfer::Upload { object: object.address });
                self.phase = Phase::ReadBack { written: value };
            }
        }
        Ok(())
    }

    fn read_back(
        &mut self,
        object: Object,
        written: i64,
        read_back: ReadBack,
        outcome: Result<Completed, SdoError>,
    ) -> Progress {
        let access = Access::ReadBack(written);
        let received = self.number(object, access, outcome)?;
        let expected = match read_back {
            ReadBack::No => Check::Any,
            ReadBack::EXACT => Check::Equals(written),
            ReadBack::Masked(mask) => Check::Masked { value: written, mask },
        };
        if !expected.passes(received) {
            return Err(Cause::Value { object, access, expected, received, waited_ns: 0 });
        }
        self.next_step();
        Ok(())
    }

    fn bytes_written(&mut self, download: &Download, outcome: Result<Completed, SdoError>) -> Progress {
        let Download { object, data } = download;
        outcome.map_err(|error| Cause::ConfigurationTransfer {
            object: *object,
            written: Content::of(data),
            is_reading_back: false,
            error,
            means_absent: self.means_absent(error),
        })?;
        self.start(Transfer::Upload { object: *object });
        self.phase = Phase::Verify;
        Ok(())
    }

    fn verify(&mut self, download: &Download, outcome: Result<Completed, SdoError>) -> Progress {
        let Download { object, data } = download;
        let (object, written) = (*object, Content::of(data));
        let received = match outcome {
            Ok(Completed::Uploaded(uploaded)) => uploaded,
            // It cannot be read.
            Ok(Completed::Downloaded) | Err(SdoError::Aborted(AbortCode::WriteOnly)) => {
                self.next_step();
                return Ok(());
            }
            Err(error) => {
                let means_absent = self.means_absent(error);
                return Err(Cause::ConfigurationTransfer {
                    object,
                    written,
                    is_reading_back: true,
                    error,
                    means_absent,
                });
            }
        };
        if !download.is_held_by(&received) {
            let received = Content::of(&received.bytes);
            return Err(Cause::ConfigurationDiffers { object, written, received });
        }
        self.next_step();
        Ok(())
    }

    fn number(
        &self,
        object: Object,
        access: Access,
        outcome: Result<Completed, SdoError>,
    ) -> Result<i64, Cause> {
        match outcome {
            Ok(Completed::Uploaded(uploaded)) => {
                let received = uploaded.bytes.len();
                // The manual of a YZ-AIM gives 606C two lengths (A27): its answer says which is right.
                let of_other_length = || {
                    let data_type = object.data_type.of_length(received)?;
                    uploaded.number(data_type).filter(|_| self.facts.dialect == Dialect::YzAim)
                };
                uploaded
                    .number(object.data_type)
                    .or_else(of_other_length)
                    .ok_or(Cause::Length { object, received })
            }
            Ok(Completed::Downloaded) => Err(Cause::Length { object, received: 0 }),
            Err(error) => Err(Cause::Transfer { object, access, error }),
        }
    }

    fn keep(&mut self, fact: Option<Fact>, value: i64) {
        if let Some(fact) = fact {
            self.facts.keep(fact, value);
        }
    }
}
