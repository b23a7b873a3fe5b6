//! What a serial line carries: frames as lines of text, or as blocks of bytes.

use arrayvec::ArrayVec;

use crate::frame::Frame;
use crate::slcan::{AdapterLine, Command, LINE_BYTES, LineReader, encode_frame};
use crate::transparent::{FrameReader, TransparentFrame};

/// A frame as bytes of a line.
pub(super) type FrameBytes = ArrayVec<u8, LINE_BYTES>;

/// Frames to the bytes of a line and back.
pub trait LineCodec {
    /// Returns `true` if the line carries such a frame.
    #[doc(hidden)]
    fn carries(&self, frame: &Frame) -> bool;
    /// The bytes of a frame that it carries.
    #[doc(hidden)]
    fn encode(&self, frame: &Frame) -> ArrayVec<u8, LINE_BYTES>;
    /// Takes the next byte. Returns what it completes, if that matters.
    #[doc(hidden)]
    fn push(&mut self, byte: u8) -> Option<Arrival>;
    /// What is said before the line is left.
    #[doc(hidden)]
    fn closing_line(&self) -> ArrayVec<u8, LINE_BYTES>;
}

/// What has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// A frame.
    Frame(Frame),
    /// Bytes that are no frame, or a refusal.
    Disturbed,
}

/// The text of SLCAN.
#[derive(Debug, Default)]
pub struct SlcanCodec {
    reader: LineReader,
    takes_fd: bool,
}

impl SlcanCodec {
    /// On a bus with or without CAN FD.
    pub(super) fn new(takes_fd: bool) -> Self {
        Self { reader: LineReader::default(), takes_fd }
    }
}

impl LineCodec for SlcanCodec {
    fn carries(&self, frame: &Frame) -> bool {
        self.takes_fd || !frame.is_fd()
    }

    fn encode(&self, frame: &Frame) -> FrameBytes {
        encode_frame(frame)
    }

    fn push(&mut self, byte: u8) -> Option<Arrival> {
        match AdapterLine::decode(self.reader.push(byte)?) {
            Ok(AdapterLine::Frame(frame)) => Some(Arrival::Frame(frame)),
            Ok(AdapterLine::Accepted | AdapterLine::Information) => None,
            Ok(AdapterLine::Refused) | Err(_) => Some(Arrival::Disturbed),
        }
    }

    fn closing_line(&self) -> FrameBytes {
        Command::Close.text().iter().copied().collect()
    }
}

/// The blocks of a transparent converter between RS-485 and CAN FD.
#[derive(Debug, Default)]
pub struct TransparentCodec {
    reader: FrameReader,
    /// The bytes that belonged to no frame when that was said last.
    discarded: u64,
}

impl LineCodec for TransparentCodec {
    fn carries(&self, frame: &Frame) -> bool {
        TransparentFrame::of(frame).is_some()
    }

    fn encode(&self, frame: &Frame) -> FrameBytes {
        let block = TransparentFrame::of(frame).map(|block| block.encode());
        block.into_iter().flatten().collect()
    }

    fn push(&mut self, byte: u8) -> Option<Arrival> {
        let found = self.reader.push(byte);
        if let Some(block) = found {
            return Some(Arrival::Frame(block.frame()));
        }
        // One disturbed block has this many bytes in all: it counts once.
        let since = self.reader.discarded().saturating_sub(self.discarded);
        let is_new = since > 0 && (self.discarded == 0 || since >= crate::transparent::FRAME_BYTES as u64);
        if is_new {
            self.discarded = self.reader.discarded();
        }
        is_new.then_some(Arrival::Disturbed)
    }

    fn closing_line(&self) -> FrameBytes {
        FrameBytes::new()
    }
}
