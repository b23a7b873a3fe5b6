//! What can be transferred, what comes of it, and why it may fail.

use takt_rt::Nanoseconds;

use super::abort::AbortCode;
use crate::canopen::object::{DataType, ObjectAddress};
use crate::printable::printable;

/// The most bytes that an upload takes; what a server sends beyond is refused.
pub const MAX_UPLOAD_BYTES: usize = 1 << 16;

/// What to transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// Read an object.
    Upload {
        /// The object.
        object: ObjectAddress,
    },
    /// Read a long object in blocks; as [`Transfer::Upload`] when the server has no block transfer.
    BlockUpload {
        /// The object.
        object: ObjectAddress,
    },
    /// Write a long object in blocks; as [`Transfer::Download`] when the server has no block transfer, and up to four
    /// bytes in any case.
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
        /// Its new value; up to four bytes go in one frame, more (or none) in segments.
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

/// What an upload has brought.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uploaded {
    /// The bytes; four when the server did not tell how many count.
    pub bytes: Vec<u8>,
    /// Whether the server told how many bytes count.
    pub is_size_known: bool,
}

impl Uploaded {
    /// The number that the bytes hold; `None` when there are not as many as the type needs.
    pub fn number(&self, data_type: DataType) -> Option<i64> {
        let counted = if self.is_size_known { self.bytes.len() } else { data_type.length() };
        data_type.decode(self.bytes.get(..counted)?)
    }

    /// The text that the bytes hold (VISIBLE_STRING), without trailing zeros and blanks.
    pub fn text(&self) -> String {
        printable(String::from_utf8_lossy(&self.bytes).trim_end_matches(['\0', ' ']))
    }
}

/// How a transfer has succeeded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completed {
    /// The object has been read.
    Uploaded(Uploaded),
    /// The object has been written.
    Downloaded,
}

/// Why a transfer has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// Nothing usable came in time.
    #[error("no reply within {} ms, asked {attempts} times{}", reply_timeout_ns / 1_000_000, unusable_words(*.unusable))]
    NoReply {
        /// How often the transfer was begun.
        attempts: u8,
        /// How long was waited each time.
        reply_timeout_ns: Nanoseconds,
        /// Frames on the node's reply identifier that were no answer to this transfer.
        unusable: u16,
    },
    /// The server gave it up.
    #[error("abort {0}")]
    Aborted(AbortCode),
    /// The toggle bit of a segment did not alternate.
    #[error("the toggle bit of a segment did not alternate")]
    ToggleNotAlternated,
    /// The segments hold another number of bytes than announced.
    #[error("{received} bytes came where {announced} were announced")]
    SizeMismatch {
        /// What the server announced.
        announced: u32,
        /// What came, as far as it was taken.
        received: u32,
    },
    /// More than [`MAX_UPLOAD_BYTES`].
    #[error("the object is longer than {limit} bytes")]
    TooLong {
        /// The limit in bytes.
        limit: u32,
    },
    /// A segment without data that is not the last one: the transfer would never end.
    #[error("an empty segment came that is not the last one")]
    EmptySegment,
    /// The checksum of a block transfer is another one than that of the data.
    #[error("checksum 0x{received:04X} came for data with 0x{computed:04X}")]
    Checksum {
        /// That of the data that came.
        computed: u16,
        /// That of the server.
        received: u16,
    },
    /// A block was acknowledged that was not sent, or blocks were lost again and again.
    #[error("blocks were lost again and again, or acknowledged without having been sent")]
    BlockSequence,
}

fn unusable_words(count: u16) -> String {
    match count {
        0 => String::new(),
        1 => ", one frame came that is no answer to it".to_owned(),
        _ => format!(", {count} frames came that are no answer to it"),
    }
}
