//! Reads the PDO configuration of a device by SDO, so that process data is decoded as the device reports it.
//!
//! Sub-index 0 of each parameter is read first, because it says which sub-indices exist. A device that does not answer
//! for missing objects then gets no such request. The caller makes the transfers: it uploads each
//! [`PdoReader::question`], and gives the result to [`PdoReader::answer`].

use std::collections::{BTreeMap, VecDeque};

use super::object::ObjectAddress;
use super::objects::{PdoDirection, PdoParameters};
use super::pdo_configuration::PdoConfiguration;
use super::sdo::{SdoError, Uploaded};

/// The sub-indices of a communication parameter that are read; 4 is reserved.
const COMMUNICATION: [u8; 4] = [1, 2, 3, 5];
/// The largest number of mapped objects; higher numbers mean multiplexed PDOs.
const MOST_MAPPED: u8 = 64;

/// The object that could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("reading {object}: {error}")]
pub struct PdoReadError {
    /// The object.
    pub object: ObjectAddress,
    /// The reason.
    pub error: SdoError,
}

/// Reads the configuration of some PDOs of one device.
#[derive(Debug)]
pub struct PdoReader {
    pdos: Vec<(PdoDirection, u16)>,
    /// The objects to read, the next one first.
    questions: VecDeque<ObjectAddress>,
    answers: BTreeMap<ObjectAddress, u32>,
    failure: Option<PdoReadError>,
}

impl PdoReader {
    /// Reads these PDOs (numbers counted from 1). The outcome leaves out PDOs that the device does not have.
    pub fn new(pdos: impl IntoIterator<Item = (PdoDirection, u16)>) -> Self {
        let pdos: Vec<(PdoDirection, u16)> = pdos.into_iter().collect();
        let parameters = pdos.iter().map(|(direction, number)| PdoParameters::at(*direction, *number));
        let questions = parameters.flat_map(|parameters| {
            let communication = parameters.cob_id().address.index;
            [ObjectAddress::new(communication, 0), parameters.mapped_count().address]
        });
        let questions = questions.collect();
        Self { pdos, questions, answers: BTreeMap::new(), failure: None }
    }

    /// Reads four PDOs of each direction, from this number on, which is 1 for those of a drive's first axis.
    pub fn of_four(first: u16) -> Self {
        let directions = [PdoDirection::Receive, PdoDirection::Transmit];
        let numbers = || first..first.saturating_add(4);
        let pdos =
            directions.into_iter().flat_map(|direction| numbers().map(move |number| (direction, number)));
        Self::new(pdos)
    }

    /// The next object to upload; `None` at the end.
    pub fn question(&self) -> Option<ObjectAddress> {
        self.questions.front().copied().filter(|_| self.failure.is_none())
    }

    /// Takes the result of uploading the [`PdoReader::question`].
    pub fn answer(&mut self, outcome: Result<Uploaded, SdoError>) {
        let Some(object) = self.questions.pop_front() else { return };
        match outcome {
            Ok(uploaded) => {
                let value = number(&uploaded);
                self.answers.insert(object, value);
                if object.subindex == 0 {
                    self.ask_for_the_rest(object.index, value);
                }
            }
            Err(SdoError::Aborted(_)) => {}
            Err(error) => self.failure = Some(PdoReadError { object, error }),
        }
    }

    /// The PDOs of the device, or the object that could not be read; `None` while reading. An abort means that the
    /// object does not exist; no reply is a failure.
    pub fn outcome(&self) -> Option<Result<Vec<PdoConfiguration>, PdoReadError>> {
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

/// Up to four bytes as a little-endian number.
fn number(uploaded: &Uploaded) -> u32 {
    uploaded.bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}
