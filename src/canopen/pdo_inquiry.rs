//! Asks a device over SDO how its PDOs are configured, so that process data can be decoded by what the device says
//! rather than by what a manual says.
//!
//! Sub-index 0 of each parameter is read first: it tells which others there are, so that a device that never answers for
//! an object it does not have is not asked for one. No input and output, as with [`sdo::Client`](super::sdo::Client).

use std::collections::{BTreeMap, VecDeque};

use takt_rt::{Frame, Nanoseconds};

use super::object::ObjectAddress;
use super::objects::{PdoDirection, PdoParameters};
use super::pdo_configuration::PdoConfiguration;
use super::sdo::{Client, Completed, SdoError, Timing, Transfer, Uploaded};

/// Sub-indices of a communication parameter that are asked for: not 4, which is reserved.
const COMMUNICATION: [u8; 4] = [1, 2, 3, 5];
/// The most objects that a mapping has; beyond are the marks of multiplexed PDOs.
const MOST_MAPPED: u8 = 64;

/// What could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("reading {object}: {error}")]
pub struct PdoInquiryError {
    /// The object.
    pub object: ObjectAddress,
    /// Why.
    pub error: SdoError,
}

/// Reads the configuration of some PDOs of one device.
#[derive(Debug)]
pub struct PdoInquiry {
    client: Client,
    pdos: Vec<(PdoDirection, u16)>,
    /// What is still to be read, the next one first.
    questions: VecDeque<ObjectAddress>,
    answers: BTreeMap<ObjectAddress, u32>,
    failure: Option<PdoInquiryError>,
}

impl PdoInquiry {
    /// Reads these PDOs (numbers counted from 1) of `node`. Those that the device does not have are left out of the
    /// outcome.
    pub fn new(node: u8, timing: Timing, pdos: impl IntoIterator<Item = (PdoDirection, u16)>) -> Self {
        let pdos: Vec<(PdoDirection, u16)> = pdos.into_iter().collect();
        let parameters = pdos.iter().map(|(direction, number)| PdoParameters::at(*direction, *number));
        let questions = parameters.flat_map(|parameters| {
            let communication = parameters.cob_id().address.index;
            [ObjectAddress::new(communication, 0), parameters.mapped_count().address]
        });
        let questions = questions.collect();
        Self { client: Client::new(node, timing), pdos, questions, answers: BTreeMap::new(), failure: None }
    }

    /// The first four PDOs of each direction, which every device may have.
    pub fn of_first_four(node: u8, timing: Timing) -> Self {
        let directions = [PdoDirection::Receive, PdoDirection::Transmit];
        let pdos =
            directions.into_iter().flat_map(|direction| (1..=4).map(move |number| (direction, number)));
        Self::new(node, timing, pdos)
    }

    /// The next frame to send, if one is due. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        loop {
            if let Some(frame) = self.client.poll(now_ns) {
                return Some(frame);
            }
            if let Some(outcome) = self.client.take_outcome() {
                self.answered(outcome);
            }
            if self.client.is_busy() || self.failure.is_some() {
                return None;
            }
            let object = *self.questions.front()?;
            self.client.start(Transfer::Upload { object }).ok()?;
        }
    }

    /// Takes a frame that was received; frames that are not from this node's SDO server are passed over.
    pub fn receive(&mut self, frame: &Frame) {
        self.client.receive(frame);
    }

    /// The PDOs that the device has, or what could not be read; `None` while it is being asked. A refusal means that the
    /// device has no such object; silence is a failure.
    pub fn outcome(&self) -> Option<Result<Vec<PdoConfiguration>, PdoInquiryError>> {
        if let Some(failure) = self.failure {
            return Some(Err(failure));
        }
        if !self.questions.is_empty() {
            return None;
        }
        let read = |(direction, number): &(PdoDirection, u16)| {
            let parameters = PdoParameters::at(*direction, *number);
            PdoConfiguration::read(*direction, *number, parameters, |object| {
                self.answers.get(&object).copied()
            })
        };
        Some(Ok(self.pdos.iter().filter_map(read).collect()))
    }

    fn answered(&mut self, outcome: Result<Completed, SdoError>) {
        let Some(object) = self.questions.pop_front() else { return };
        match outcome {
            Ok(Completed::Uploaded(uploaded)) => {
                let value = number(&uploaded);
                self.answers.insert(object, value);
                if object.subindex == 0 {
                    self.ask_for_the_rest(object.index, value);
                }
            }
            Ok(Completed::Downloaded) | Err(SdoError::Aborted(_)) => {}
            Err(error) => self.failure = Some(PdoInquiryError { object, error }),
        }
    }

    fn ask_for_the_rest(&mut self, index: u16, count: u32) {
        let count = u8::try_from(count).unwrap_or(u8::MAX);
        let is_mapping = matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF);
        let question = |subindex| ObjectAddress::new(index, subindex);
        if !is_mapping {
            let known = COMMUNICATION.into_iter().filter(|subindex| *subindex <= count);
            self.questions.extend(known.map(question));
        } else if count <= MOST_MAPPED {
            self.questions.extend((1..=count).map(question));
        }
    }
}

/// Up to four bytes as a number, low byte first.
fn number(uploaded: &Uploaded) -> u32 {
    uploaded.bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}
