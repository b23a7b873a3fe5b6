//! Converts a frame to and from the layout of the kernel (`linux/can.h`).

use crate::frame::{Frame, FrameKind, Id};

/// The content of a message from a raw CAN socket.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Message {
    /// A frame of the bus.
    Frame(Frame),
    /// A report of the driver about errors, states and losses; see `error_frame`.
    Error {
        /// The classes of the error, `CAN_ERR_…`.
        class: u32,
        /// The details of each class.
        details: [u8; 8],
    },
    /// A message with a length or a content that no CAN frame has.
    Unknown,
}

/// An empty buffer for a classic or a CAN FD frame.
pub(super) const EMPTY: libc::canfd_frame = {
    // SAFETY: it holds numbers only, for which zero is valid.
    unsafe { core::mem::zeroed() }
};

/// Writes a frame in the layout of the kernel. Returns how many bytes of the buffer are the message: by the length, the kernel
/// tells classic from CAN FD frames.
pub(super) fn write(frame: &Frame, to: &mut libc::canfd_frame) -> usize {
    let id = frame.id().value() | if frame.id().is_extended() { libc::CAN_EFF_FLAG } else { 0 };
    *to = EMPTY;
    to.can_id = id;
    to.len = frame.length() as u8; // At most 64, by its type.
    for (byte, value) in to.data.iter_mut().zip(frame.payload()) {
        *byte = *value;
    }
    match frame.kind() {
        FrameKind::Data => libc::CAN_MTU,
        FrameKind::Remote => {
            to.can_id |= libc::CAN_RTR_FLAG;
            libc::CAN_MTU
        }
        FrameKind::Fd => libc::CANFD_MTU,
        FrameKind::FdBitRateSwitch => {
            to.flags = libc::CANFD_BRS as u8;
            libc::CANFD_MTU
        }
    }
}

/// Reads a message of `bytes` bytes.
pub(super) fn read(from: &libc::canfd_frame, bytes: usize) -> Message {
    if bytes != libc::CAN_MTU && bytes != libc::CANFD_MTU {
        return Message::Unknown;
    }
    if from.can_id & libc::CAN_ERR_FLAG != 0 {
        let [a, b, c, d, e, f, g, h, ..] = from.data;
        return Message::Error { class: from.can_id & libc::CAN_ERR_MASK, details: [a, b, c, d, e, f, g, h] };
    }
    let id = if from.can_id & libc::CAN_EFF_FLAG != 0 {
        Id::extended(from.can_id & libc::CAN_EFF_MASK)
    } else {
        Id::base(from.can_id & libc::CAN_SFF_MASK)
    };
    let Some(payload) = from.data.get(..from.len.into()) else { return Message::Unknown };
    let frame = id.and_then(|id| {
        if bytes == libc::CANFD_MTU {
            Frame::fd(id, payload, from.flags & libc::CANFD_BRS as u8 != 0)
        } else if from.can_id & libc::CAN_RTR_FLAG != 0 {
            Frame::remote(id, from.len)
        } else {
            Frame::data(id, payload)
        }
    });
    frame.map_or(Message::Unknown, Message::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_frame() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0u32..=0x7FF).prop_map(|id| Id::base(id).unwrap()),
            (0u32..=0x1FFF_FFFF).prop_map(|id| Id::extended(id).unwrap()),
        ];
        let length =
            prop::sample::select([0usize, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].as_slice());
        (id, length, any::<[u8; 64]>(), 0..3).prop_map(|(id, length, bytes, kind)| {
            let bytes = &bytes[..length];
            match kind {
                0 => Frame::data(id, &bytes[..length.min(8)]),
                1 => Frame::remote(id, length.min(8) as u8),
                _ => Frame::fd(id, bytes, length % 3 == 0),
            }
            .unwrap()
        })
    }

    proptest! {
        #[test]
        fn every_frame_comes_back_as_it_was_written(frame in any_frame()) {
            let mut buffer = EMPTY;
            let bytes = write(&frame, &mut buffer);
            prop_assert_eq!(bytes, if frame.is_fd() { libc::CANFD_MTU } else { libc::CAN_MTU });
            prop_assert_eq!(read(&buffer, bytes), Message::Frame(frame));
        }

        #[test]
        fn whatever_a_message_holds_it_is_read_without_panic(can_id in any::<u32>(), len in any::<u8>(), flags in any::<u8>(), bytes in 0usize..80) {
            let mut buffer = EMPTY;
            buffer.can_id = can_id;
            buffer.len = len;
            buffer.flags = flags;
            if let Message::Frame(frame) = read(&buffer, bytes) {
                prop_assert!(bytes == libc::CAN_MTU || bytes == libc::CANFD_MTU);
                prop_assert_eq!(frame.length(), usize::from(len));
            }
        }
    }

    #[test]
    fn a_message_of_another_length_is_no_frame() {
        for bytes in [0, 8, 15, 17, 71, 73] {
            assert_eq!(read(&EMPTY, bytes), Message::Unknown);
        }
    }
}
