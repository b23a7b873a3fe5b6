//! Fast scan (CiA 305, section 6.5.3): finds the identity of one device without a node number, bit by bit. A device
//! answers when the bits that were asked for are its own; that nobody answers is an answer too. Of several devices the
//! one with the lowest identity is found, since a 0 that anybody has is followed.

use super::LssAddress;
use super::wire::LssRequest;

/// The value of `lowest_bit` that begins a scan.
const BEGIN: u8 = 0x80;

/// What is known of the identity beforehand, in the order of [`LssAddress::values`]. What is known is asked for at once
/// instead of bit by bit, and a device that has another value is not found.
pub type Known = [Option<u32>; 4];

/// How far a scan has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FastScan {
    known: Known,
    values: [u32; 4],
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Is there anybody?
    Begin,
    /// Is this bit of this value 0?
    Bit { part: u8, bit: u8 },
    /// Is this the whole value? Then the next one is meant.
    Confirm { part: u8 },
}

/// What an answer, or silence, has led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scanned {
    /// The next question is due.
    GoOn,
    /// Nobody is there.
    Nobody,
    /// This device; it is in configuration now.
    Found(LssAddress),
    /// The value that was put together is nobody's: answers were lost.
    Lost,
}

impl FastScan {
    pub fn new(known: Known) -> Self {
        Self { known, values: [0; 4], stage: Stage::Begin }
    }

    /// The question that is due.
    pub fn request(&self) -> LssRequest {
        match self.stage {
            Stage::Begin => LssRequest::FastScan { value: 0, lowest_bit: BEGIN, part: 0, next: 0 },
            Stage::Bit { part, bit } => {
                LssRequest::FastScan { value: self.value(part), lowest_bit: bit, part, next: part }
            }
            Stage::Confirm { part } => {
                // After the last value the first one is meant, and the device changes to configuration.
                let next = (part + 1) % 4;
                LssRequest::FastScan { value: self.value(part), lowest_bit: 0, part, next }
            }
        }
    }

    /// Takes note whether anybody has answered the question.
    pub fn answered(&mut self, is_answered: bool) -> Scanned {
        match (self.stage, is_answered) {
            (Stage::Begin, false) => return Scanned::Nobody,
            (Stage::Begin, true) => self.begin(0),
            (Stage::Bit { part, bit }, _) => {
                if !is_answered && let Some(value) = self.values.get_mut(usize::from(part)) {
                    *value |= 1 << bit;
                }
                self.stage = match bit.checked_sub(1) {
                    Some(bit) => Stage::Bit { part, bit },
                    None => Stage::Confirm { part },
                };
            }
            (Stage::Confirm { part: 3 }, true) => {
                return Scanned::Found(LssAddress::from_values(self.values));
            }
            (Stage::Confirm { part }, true) => self.begin(part + 1),
            (Stage::Confirm { part }, false) if self.known(part).is_some() => return Scanned::Nobody,
            (Stage::Confirm { .. }, false) => return Scanned::Lost,
        }
        Scanned::GoOn
    }

    fn begin(&mut self, part: u8) {
        self.stage = match (self.known(part), self.values.get_mut(usize::from(part))) {
            (Some(known), Some(value)) => {
                *value = known;
                Stage::Confirm { part }
            }
            _ => Stage::Bit { part, bit: 31 },
        };
    }

    fn known(&self, part: u8) -> Option<u32> {
        self.known.get(usize::from(part)).copied().flatten()
    }

    fn value(&self, part: u8) -> u32 {
        self.values.get(usize::from(part)).copied().unwrap_or(0)
    }
}
