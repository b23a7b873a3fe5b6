//! LSS fastscan (CiA 305, section 6.5.3): finds the identity of one device without a node ID, bit by bit. A device
//! replies when the requested bits match its own; silence means that no device matches. With several devices the lowest
//! identity is found, because a 0 bit of any device is followed.

use super::LssAddress;
use super::wire::LssRequest;

/// The value of `lowest_bit` that begins a fastscan.
const BEGIN: u8 = 0x80;

/// The known parts of the identity, in the order of [`LssAddress::values`]. A known part is confirmed in one request. A
/// device with another value is not found.
pub type KnownIdentity = [Option<u32>; 4];

/// The state of a fastscan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FastScan {
    known: KnownIdentity,
    values: [u32; 4],
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Asks whether any device is there.
    Begin,
    /// Asks whether this bit of this part is 0.
    Bit { part: u8, bit: u8 },
    /// Asks whether the part is complete, and switches to the next one.
    Confirm { part: u8 },
}

/// The result of one request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scanned {
    /// The next request is due.
    Continue,
    /// No device matches.
    NotFound,
    /// This device was found; it is in configuration state.
    Found(LssAddress),
    /// No device has the identity that was found bit by bit: replies were lost.
    ReplyLost,
}

impl FastScan {
    pub fn new(known: KnownIdentity) -> Self {
        Self { known, values: [0; 4], stage: Stage::Begin }
    }

    /// The request that is due.
    pub fn request(&self) -> LssRequest {
        match self.stage {
            Stage::Begin => LssRequest::FastScan { value: 0, lowest_bit: BEGIN, part: 0, next: 0 },
            Stage::Bit { part, bit } => {
                LssRequest::FastScan { value: self.value(part), lowest_bit: bit, part, next: part }
            }
            Stage::Confirm { part } => {
                // After the last part the first one follows, and the device enters configuration state.
                let next = (part + 1) % 4;
                LssRequest::FastScan { value: self.value(part), lowest_bit: 0, part, next }
            }
        }
    }

    /// Evaluates whether any device has replied.
    pub fn evaluate(&mut self, has_reply: bool) -> Scanned {
        match (self.stage, has_reply) {
            (Stage::Begin, false) => return Scanned::NotFound,
            (Stage::Begin, true) => self.begin(0),
            (Stage::Bit { part, bit }, _) => {
                if !has_reply && let Some(value) = self.values.get_mut(usize::from(part)) {
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
            (Stage::Confirm { part }, false) if self.known(part).is_some() => return Scanned::NotFound,
            (Stage::Confirm { .. }, false) => return Scanned::ReplyLost,
        }
        Scanned::Continue
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
