//! What a fault does.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::breakable::DriveTrouble;

/// What a fault does while it is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect {
    /// Something happens to the selected frames.
    Frames(FrameEffect),
    /// Something happens to the interface.
    Interface(InterfaceEffect),
    /// Somebody else speaks on the bus.
    Foreign(ForeignFrames),
    /// Something happens to a simulated drive.
    Drive {
        /// Its node number.
        node: u8,
        /// What.
        trouble: DriveTrouble,
    },
}

/// What happens to a selected frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEffect {
    /// It is lost on the way; a sent one counts as confirmed.
    Drop,
    /// It comes so much later; what comes after it does not wait.
    Delay {
        /// How much.
        by_ns: Nanoseconds,
        /// Where a received one is held up.
        place: DelayPlace,
    },
    /// It comes so many more times.
    Duplicate {
        /// How many.
        copies: u8,
    },
    /// Some of its bits are turned.
    Corrupt {
        /// How many.
        bits: u8,
        /// Where.
        part: Part,
    },
    /// It changes places with the other selected ones that are sent or received in one go.
    Reorder,
    /// It is sent, but never confirmed as long as the fault is there.
    EchoLoss,
    /// The interface has no room for it and for what would be sent after it.
    FullQueue,
}

impl FrameEffect {
    /// Whether it can only happen to what is sent.
    pub const fn is_of_sending(self) -> bool {
        matches!(self, Self::EchoLoss | Self::FullQueue)
    }
}

/// Where a received frame is held up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelayPlace {
    /// In the machine: it tells when it arrived.
    Machine,
    /// On its way to it, as one that is sent late: it arrives so much later.
    Bus,
}

/// A part of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The data.
    Payload,
    /// The identifier.
    Identifier,
}

/// What happens to the interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InterfaceEffect {
    /// The controller has gone off the bus: nothing is sent or received.
    BusOff,
    /// An error counter is above 127; frames still pass.
    ErrorPassive,
    /// The interface is down: nothing is sent or received.
    Down,
}

/// What somebody else says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForeignFrames {
    /// The same frame, once or in a rhythm.
    Frame {
        /// The frame.
        frame: Frame,
        /// The rhythm; `None` says it once.
        period_ns: Option<Nanoseconds>,
    },
    /// Another master commands a node what the controller had commanded it last when the fault began.
    SetPoints {
        /// The identifier of the set-points.
        id: Id,
        /// The rhythm.
        period_ns: Nanoseconds,
    },
    /// A second node of the same number: boots, and then sends its heartbeat as pre-operational.
    DuplicateNode {
        /// The number.
        node: u8,
        /// The period of the heartbeat.
        period_ns: Nanoseconds,
    },
}

/// Turns `bits` bits of a frame, each somewhere in `part`. `below` gives a random number below another.
pub fn corrupted(frame: &Frame, bits: u8, part: Part, mut below: impl FnMut(usize) -> usize) -> Frame {
    let mut data = [0; Frame::MAX_BYTES];
    let length = frame.payload().len();
    data[..length].copy_from_slice(frame.payload());
    let mut id = frame.id().value();
    for _ in 0..bits {
        match part {
            Part::Payload if length > 0 => {
                let bit = below(8 * length);
                data[bit / 8] ^= 1 << (bit % 8);
            }
            Part::Payload => {}
            Part::Identifier => id ^= 1 << below(if frame.id().is_extended() { 29 } else { 11 }),
        }
    }
    let id = if frame.id().is_extended() { Id::extended(id) } else { Id::base(id) };
    let Ok(id) = id else { return *frame };
    let changed = match frame.kind() {
        FrameKind::Data => Frame::data(id, &data[..length]),
        FrameKind::Remote => Frame::remote(id, frame.length() as u8),
        FrameKind::Fd => Frame::fd(id, &data[..length], false),
        FrameKind::FdBitRateSwitch => Frame::fd(id, &data[..length], true),
    };
    changed.unwrap_or(*frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_turned_bit_changes_one_bit(id in 0u32..0x800, data: [u8; 8], length in 1usize..=8, at: usize) {
            let frame = Frame::data(Id::base(id).unwrap(), &data[..length]).unwrap();
            let payload = corrupted(&frame, 1, Part::Payload, |limit| at % limit);
            prop_assert_eq!(payload.id(), frame.id());
            prop_assert_eq!((payload.first_word() ^ frame.first_word()).count_ones(), 1);
            let identifier = corrupted(&frame, 1, Part::Identifier, |limit| at % limit);
            prop_assert_eq!(identifier.payload(), frame.payload());
            prop_assert_eq!((identifier.id().value() ^ id).count_ones(), 1);
        }
    }

    #[test]
    fn what_has_no_data_cannot_be_broken_there() {
        let remote = Frame::remote(Id::canopen(0x700, 1), 1).unwrap();
        assert_eq!(corrupted(&remote, 3, Part::Payload, |_| 0), remote);
    }
}
