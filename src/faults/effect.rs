//! The effects of faults.

use takt_rt::{Frame, FrameKind, Id, Nanoseconds};

use super::injectable::DriveEffect;

/// The effect of a fault while it is active.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Effect {
    /// On the selected frames.
    Frames(FrameEffect),
    /// On the interface.
    Interface(InterfaceEffect),
    /// Frames from a foreign station.
    Foreign(ForeignFrames),
    /// On a serial line, or on the selected requests and replies there.
    Line(LineEffect),
    /// On a simulated drive.
    Drive {
        /// The node ID.
        node: u8,
        /// The effect.
        effect: DriveEffect,
    },
}

/// The effect on a selected frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameEffect {
    /// The frame is lost; a sent one counts as confirmed.
    Drop,
    /// The frame is delayed; later frames overtake it.
    Delay {
        /// The delay.
        by_ns: Nanoseconds,
        /// Where a received frame is delayed.
        place: DelayPlace,
    },
    /// The frame is repeated.
    Duplicate {
        /// Number of additional copies.
        copies: u8,
    },
    /// Some bits are inverted.
    Corrupt {
        /// Number of bits.
        bits: u8,
        /// The part of the frame.
        part: Part,
    },
    /// The selected frames of one call are shuffled.
    Reorder,
    /// The frame is sent, but not confirmed while the fault is active.
    EchoLoss,
    /// The interface has no room for the frame and for those after it.
    FullQueue,
}

impl FrameEffect {
    /// Returns `true` if this effect exists for sent frames only.
    pub(crate) const fn is_of_sending(self) -> bool {
        matches!(self, Self::EchoLoss | Self::FullQueue)
    }
}

/// The effect on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LineEffect {
    /// The request, or the reply, is lost.
    Drop,
    /// It is late; the next request may overtake it.
    Delay {
        /// The delay.
        by_ns: Nanoseconds,
    },
    /// Some bits are inverted on the wire, behind the check sum.
    Corrupt {
        /// Number of bits.
        bits: u8,
        /// The part of the request, or of the reply.
        part: Part,
    },
    /// The line is gone, like that of an adapter that is pulled out: nothing is sent or received.
    Gone,
}

/// Where a received frame is delayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelayPlace {
    /// In the machine: its timestamp stays that of its arrival.
    Machine,
    /// On the bus: it arrives later, and its timestamp is later.
    Bus,
}

/// A part of a frame, or of a request or reply on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The data. On a serial line: everything behind the address, the check sum too.
    Payload,
    /// The identifier. On a serial line: the address, which is the first byte.
    Identifier,
}

/// The effect on the interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum InterfaceEffect {
    /// The controller has gone off the bus: nothing is sent or received.
    BusOff,
    /// An error counter is above 127; frames still pass.
    ErrorPassive,
    /// The interface is down: nothing is sent or received.
    Down,
}

/// The frames of a foreign station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ForeignFrames {
    /// One frame, once or periodically.
    Frame {
        /// The frame.
        frame: Frame,
        /// The period; `None` sends it once.
        period_ns: Option<Nanoseconds>,
    },
    /// Another master repeats the last set-points that the controller had sent when the fault began.
    SetPoints {
        /// The identifier of the set-points.
        id: Id,
        /// The period.
        period_ns: Nanoseconds,
    },
    /// A second node with the same node ID boots, then sends its heartbeat as pre-operational.
    DuplicateNode {
        /// The node ID.
        node: u8,
        /// The period of the heartbeat.
        period_ns: Nanoseconds,
    },
}

/// Inverts `bits` bits of a frame, each anywhere in `part`. `below(n)` returns a random number below n.
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
        fn one_inverted_bit_changes_one_bit(id in 0u32..0x800, data: [u8; 8], length in 1usize..=8, at: usize) {
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
    fn a_frame_without_data_keeps_its_payload() {
        let remote = Frame::remote(Id::canopen(0x700, 1), 1).unwrap();
        assert_eq!(corrupted(&remote, 3, Part::Payload, |_| 0), remote);
    }
}
