//! Evaluates the drive's SDO responses: checks and stores values, verifies writes, and classifies missing answers.

use takt_rt::Nanoseconds;

use super::{AWAIT_PAUSE_NS, AxisRun, StepPhase, StepResult};
use crate::canopen::dcf::Download;
use crate::canopen::object::Object;
use crate::canopen::objects::DEVICE_TYPE;
use crate::canopen::pdo_reader::PdoReader;
use crate::canopen::sdo::{AbortCode, Completed, SdoError, Transfer};
use crate::drive::failure::{Content, FailureCause, ProbeResult};
use crate::drive::process_data::ProcessData;
use crate::drive::step::{Access, Action, Check, Fact, ReadBack};
use crate::family;

impl AxisRun {
    /// Evaluates a finished transfer.
    pub(super) fn transferred(
        &mut self,
        now_ns: Nanoseconds,
        outcome: Result<Completed, SdoError>,
    ) -> StepResult {
        match (self.phase, self.action()) {
            (
                StepPhase::Probe { waited_ns, has_answered },
                Some(Action::Nmt { awaited: Some(awaited), .. }),
            ) => {
                let probe_result = match (outcome, has_answered, self.other_protocol) {
                    (Ok(_) | Err(SdoError::Aborted(_)), _, _) => ProbeResult::Sdo,
                    (_, true, Some(other)) => ProbeResult::OtherProtocol(other.name),
                    _ => ProbeResult::Nothing,
                };
                Err(FailureCause::StateNotReached {
                    awaited,
                    reported: self.reported,
                    waited_ns,
                    probe_result,
                })
            }
            (StepPhase::ReadBack { written }, Some(Action::Write { object, read_back, .. })) => {
                self.read_back(object, written, read_back, outcome)
            }
            (StepPhase::Transfer { .. }, Some(Action::Write { object, value, read_back, is_optional })) => {
                self.written(object, self.value_of(value), read_back, is_optional, outcome)
            }
            (StepPhase::Transfer { .. }, Some(Action::Read { object, check, keep, is_optional })) => {
                self.read(object, check, keep, is_optional, outcome)
            }
            (StepPhase::Transfer { .. }, Some(Action::WakeUp { .. })) => match outcome {
                Ok(_) | Err(SdoError::Aborted(_)) => {
                    self.next_step();
                    Ok(())
                }
                Err(error) => {
                    Err(FailureCause::Transfer { object: DEVICE_TYPE, access: Access::Read, error })
                }
            },
            (StepPhase::Transfer { .. }, Some(Action::ReadText { object, keep })) => {
                match outcome {
                    Ok(Completed::Uploaded(uploaded)) => self.facts.keep_text(keep, uploaded.text()),
                    Ok(Completed::Downloaded) | Err(SdoError::Aborted(_)) => self.facts.absent.push(object),
                    Err(error) => return Err(FailureCause::TextTransfer { object, error }),
                }
                self.next_step();
                Ok(())
            }
            (StepPhase::Transfer { .. }, Some(Action::WriteBytes(download))) => {
                self.bytes_written(&download, outcome)
            }
            (StepPhase::Verify, Some(Action::WriteBytes(download))) => self.verify(&download, outcome),
            (StepPhase::Transfer { began_ns }, Some(Action::Await { object, check, keep, within_ns })) => {
                let received = self.number(object, Access::Read, outcome)?;
                self.keep(keep, received);
                let waited_ns = now_ns.saturating_sub(began_ns);
                if check.passes(received) {
                    self.next_step();
                } else if waited_ns >= within_ns {
                    return Err(FailureCause::Value {
                        object,
                        access: Access::Read,
                        expected: check,
                        received,
                        waited_ns,
                    });
                } else {
                    self.phase =
                        StepPhase::Pause { began_ns, until_ns: now_ns.saturating_add(AWAIT_PAUSE_NS) };
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Takes the PDO configuration that the drive has reported.
    pub(super) fn take_pdo_configuration(&mut self) -> StepResult {
        let Some(outcome) = self.pdo_reader.as_ref().and_then(PdoReader::outcome) else { return Ok(()) };
        self.pdo_reader = None;
        let reported = match outcome {
            Ok(reported) => reported,
            Err(failure) if self.means_absent(failure.error) => {
                self.facts.absent.push(failure.object);
                vec![]
            }
            Err(failure) => return Err(FailureCause::PdoRead(failure)),
        };
        let data = ProcessData::as_reported(&self.axis, &reported).map_err(FailureCause::Mapping)?;
        self.facts.process_data = Some(data);
        self.next_step();
        Ok(())
    }

    /// Whether an error means that the object does not exist. Some SDO servers do not answer then.
    fn means_absent(&self, error: SdoError) -> bool {
        match error {
            SdoError::Aborted(code) => code.means_absent(),
            SdoError::NoReply { .. } => family::of(&self.axis.drive).sdo_quirks().has_short_replies,
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
    ) -> StepResult {
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
            return Err(FailureCause::Value { object, access, expected: check, received, waited_ns: 0 });
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
    ) -> StepResult {
        match outcome {
            Err(error) if is_optional && self.means_absent(error) => {
                self.facts.absent.push(object.address);
                self.next_step();
            }
            Err(error) => return Err(FailureCause::Transfer { object, access: Access::Write(value), error }),
            Ok(_) if read_back == ReadBack::No => self.next_step(),
            Ok(_) => {
                self.start(Transfer::Upload { object: object.address });
                self.phase = StepPhase::ReadBack { written: value };
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
    ) -> StepResult {
        let access = Access::ReadBack(written);
        let received = self.number(object, access, outcome)?;
        let expected = match read_back {
            ReadBack::No => Check::Any,
            ReadBack::EXACT => Check::Equals(written),
            ReadBack::Masked(mask) => Check::Masked { value: written, mask },
        };
        if !expected.passes(received) {
            return Err(FailureCause::Value { object, access, expected, received, waited_ns: 0 });
        }
        self.next_step();
        Ok(())
    }

    fn bytes_written(&mut self, download: &Download, outcome: Result<Completed, SdoError>) -> StepResult {
        let Download { object, data } = download;
        outcome.map_err(|error| FailureCause::ConfigurationTransfer {
            object: *object,
            written: Content::of(data),
            is_reading_back: false,
            error,
            means_absent: self.means_absent(error),
        })?;
        self.start(Transfer::Upload { object: *object });
        self.phase = StepPhase::Verify;
        Ok(())
    }

    fn verify(&mut self, download: &Download, outcome: Result<Completed, SdoError>) -> StepResult {
        let Download { object, data } = download;
        let (object, written) = (*object, Content::of(data));
        let received = match outcome {
            Ok(Completed::Uploaded(uploaded)) => uploaded,
            // The object is write-only.
            Ok(Completed::Downloaded) | Err(SdoError::Aborted(AbortCode::WriteOnly)) => {
                self.next_step();
                return Ok(());
            }
            Err(error) => {
                let means_absent = self.means_absent(error);
                return Err(FailureCause::ConfigurationTransfer {
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
            return Err(FailureCause::ConfigurationDiffers { object, written, received });
        }
        self.next_step();
        Ok(())
    }

    fn number(
        &self,
        object: Object,
        access: Access,
        outcome: Result<Completed, SdoError>,
    ) -> Result<i64, FailureCause> {
        match outcome {
            Ok(Completed::Uploaded(uploaded)) => {
                let received = uploaded.bytes.len();
                // Where a manual gives an object two lengths, that of the response counts.
                let of_other_length = || {
                    let data_type = object.data_type.of_length(received)?;
                    uploaded
                        .number(data_type)
                        .filter(|_| family::of(&self.axis.drive).sdo_quirks().has_short_replies)
                };
                uploaded
                    .number(object.data_type)
                    .or_else(of_other_length)
                    .ok_or(FailureCause::Length { object, received })
            }
            Ok(Completed::Downloaded) => Err(FailureCause::Length { object, received: 0 }),
            Err(error) => Err(FailureCause::Transfer { object, access, error }),
        }
    }

    fn keep(&mut self, fact: Option<Fact>, value: i64) {
        if let Some(fact) = fact {
            self.facts.keep(fact, value);
        }
    }
}
