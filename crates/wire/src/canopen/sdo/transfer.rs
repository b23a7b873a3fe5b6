//! Transfers, their results and errors.

use takt_rt::Nanoseconds;

use super::abort::AbortCode;
use crate::canopen::object::{DataType, ObjectAddress};
use crate::printable::printable;

/// The largest upload in bytes; a longer one fails.
pub const MAX_UPLOAD_BYTES: usize = 1 << 16;

/// A transfer to start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// Read an object.
    Upload {
        /// The object.
        object: ObjectAddress,
    },
    /// Read a long object in blocks; falls back to [`Transfer::Upload`] when the server has no block transfer.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
    },
    /// Write a long object in blocks; falls back to [`Transfer::Download`] when the server has no block transfer, and
    /// for up to four bytes.
    BlockDownload {
        /// The object.
        object: ObjectAddress,
        /// Its new value.
        data: Vec<u8>,
    },
    /// Write an object.
    Download {
        /// The object.
        object: ObjectAddress,
        /// Its new value; up to four bytes are expedited, other lengths are segmented.
        data: Vec<u8>,
    },
}

impl Transfer {
    /// The object.
    pub const fn object(&self) -> ObjectAddress {
        match self {
            Self::Upload { object }
            | Self::Download { object, .. }
            | Self::BlockUpload { object }
            | Self::BlockDownload { object, .. } => *object,
        }
    }
}

/// The data of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uploaded {
    /// The bytes; four when the server did not indicate the size.
    pub bytes: Vec<u8>,
    /// True if the server indicated the size.
    pub is_size_known: bool,
}

impl Uploaded {
    /// Decodes a number; `None` when the number of bytes differs from the type's.
    pub fn number(&self, data_type: DataType) -> Option<i64> {
        let counted = if self.is_size_known { self.bytes.len() } else { data_type.length() };
        data_type.decode(self.bytes.get(..counted)?)
    }

    /// As [`Uploaded::number`], where the device decides the length, and the type the sign.
    pub fn number_of_any_length(&self, data_type: DataType) -> Option<i64> {
        self.number(data_type).or_else(|| self.number(data_type.of_length(self.bytes.len())?))
    }

    /// Decodes a text (VISIBLE_STRING), without trailing zeros and blanks.
    pub fn text(&self) -> String {
        printable(String::from_utf8_lossy(&self.bytes).trim_end_matches(['\0', ' ']))
    }
}

/// The result of a successful transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completed {
    /// The object has been read.
    Uploaded(Uploaded),
    /// The object has been written.
    Downloaded,
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SdoError {
    /// No valid response arrived in time.
    #[error("no reply within {} ms in {attempts} attempts{}", reply_timeout_ns / 1_000_000, unusable_words(*.unusable))]
    NoReply {
        /// How many times the transfer was started.
        attempts: u8,
        /// The timeout of each request.
        reply_timeout_ns: Nanoseconds,
        /// Frames with the node's response identifier that did not belong to this transfer.
        unusable: u16,
    },
    /// The server aborted the transfer.
    #[error("abort {0}")]
    Aborted(AbortCode),
    /// The toggle bit of a segment did not alternate.
    #[error("the toggle bit of a segment did not alternate")]
    ToggleNotAlternated,
    /// The size differs from the announced one.
    #[error("{received} bytes received, but {announced} were announced")]
    SizeMismatch {
        /// The announced size.
        announced: u32,
        /// The received size so far.
        received: u32,
    },
    /// More than is kept.
    #[error("the object is longer than {limit} bytes")]
    TooLong {
        /// The limit in bytes.
        limit: u32,
    },
    /// A segment without data that is not the last one: the transfer would never end.
    #[error("an empty segment was received that is not the last one")]
    EmptySegment,
    /// The CRC of a block transfer is wrong.
    #[error("the CRC is 0x{received:04X}, but that of the received data is 0x{computed:04X}")]
    Checksum {
        /// The CRC of the received data.
        computed: u16,
        /// The CRC that the server sent.
        received: u16,
    },
    /// An acknowledgement for segments that were not sent, or repeated loss of blocks.
    #[error("blocks were lost repeatedly, or segments were acknowledged that had not been sent")]
    BlockSequence,
}

fn unusable_words(count: u16) -> String {
    match count {
        0 => String::new(),
        1 => ", one frame received did not belong to it".to_owned(),
        _ => format!(", {count} frames received did not belong to it"),
    }
}
