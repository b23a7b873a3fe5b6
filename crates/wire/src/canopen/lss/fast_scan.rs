//! LSS fastscan (CiA 305, section 6.5.3): finds the identity of one device without a node ID, bit by bit. A device
//! replies when the requested bits match its own; silence means that no device matches. With several devices the lowest
//! identity is found, because a 0 bit of any device is followed.
//!
//! A scan for the device that follows a known identity excludes that identity itself. The next higher identity shares
//! its upper bits and has a 1 where it has a 0. The scan tries these places from the lowest bit upwards. Every part that
//! is shared must be confirmed first, since a device compares its parts in order.

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
    /// The identity to exclude, and the part in which the wanted one differs from it for the first time.
    excluded: Option<(LssAddress, u8)>,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Asks whether any device is there.
    Begin,
    /// Asks whether a device shares this part with the excluded identity, and switches to the next one.
    Share { part: u8 },
    /// Asks whether a device shares the higher bits of this part with the excluded identity and has 1 in this bit.
    Branch { part: u8, bit: u8 },
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
        Self { known, values: [0; 4], excluded: None, stage: Stage::Begin }
    }

    /// A scan for the device with the lowest identity above this one.
    pub fn after(address: LssAddress) -> Self {
        Self { excluded: Some((address, 3)), ..Self::new([None; 4]) }
    }

    /// The request that is due.
    pub fn request(&self) -> LssRequest {
        match self.stage {
            Stage::Begin => LssRequest::FastScan { value: 0, lowest_bit: BEGIN, part: 0, next: 0 },
            Stage::Bit { part, bit } => {
                LssRequest::FastScan { value: self.value(part), lowest_bit: bit, part, next: part }
            }
            Stage::Share { part } => {
                LssRequest::FastScan { value: self.excluded(part), lowest_bit: 0, part, next: part + 1 }
            }
            Stage::Branch { part, bit } => {
                let value = branched(self.excluded(part), bit);
                LssRequest::FastScan { value, lowest_bit: bit, part, next: part }
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
            (Stage::Begin, true) => match self.excluded {
                None => self.begin(0),
                Some((_, 0)) => return self.branch(0, 0),
                Some(_) => self.stage = Stage::Share { part: 0 },
            },
            (Stage::Share { .. }, false) => return Scanned::ReplyLost,
            (Stage::Share { part }, true) => match self.excluded {
                Some((_, differing)) if part + 1 < differing => self.stage = Stage::Share { part: part + 1 },
                _ => return self.branch(part + 1, 0),
            },
            (Stage::Branch { part, bit }, false) => return self.branch(part, bit + 1),
            (Stage::Branch { part, bit }, true) => {
                let excluded = self.excluded_values();
                for (value, shared) in self.values.iter_mut().zip(excluded).take(part.into()) {
                    *value = shared;
                }
                let value = branched(self.excluded(part), bit);
                if let Some(place) = self.values.get_mut(usize::from(part)) {
                    *place = value;
                }
                self.stage = below(part, bit);
            }
            (Stage::Bit { part, bit }, _) => {
                if !has_reply && let Some(value) = self.values.get_mut(usize::from(part)) {
                    *value |= 1 << bit;
                }
                self.stage = below(part, bit);
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

    /// Tries the lowest bit from `bit` on in which the excluded identity has 0. When the part has none, the wanted
    /// identity differs in an earlier part, or there is none.
    fn branch(&mut self, part: u8, bit: u8) -> Scanned {
        let zeros = !self.excluded(part) & u32::MAX.checked_shl(bit.into()).unwrap_or(0);
        self.stage = match (zeros, part.checked_sub(1)) {
            (0, None) => return Scanned::NotFound,
            (0, Some(earlier)) => {
                self.excluded = self.excluded.map(|(address, _)| (address, earlier));
                Stage::Begin
            }
            (zeros, _) => Stage::Branch { part, bit: zeros.trailing_zeros() as u8 },
        };
        Scanned::Continue
    }

    fn excluded_values(&self) -> [u32; 4] {
        self.excluded.map_or([0; 4], |(address, _)| address.values())
    }

    fn excluded(&self, part: u8) -> u32 {
        self.excluded_values().get(usize::from(part)).copied().unwrap_or(0)
    }

    fn known(&self, part: u8) -> Option<u32> {
        self.known.get(usize::from(part)).copied().flatten()
    }

    fn value(&self, part: u8) -> u32 {
        self.values.get(usize::from(part)).copied().unwrap_or(0)
    }
}

/// The bits of a value above `bit`, and 1 in `bit`.
fn branched(value: u32, bit: u8) -> u32 {
    (value >> bit | 1) << bit
}

/// The stage after the question for a bit.
fn below(part: u8, bit: u8) -> Stage {
    match bit.checked_sub(1) {
        Some(bit) => Stage::Bit { part, bit },
        None => Stage::Confirm { part },
    }
}
