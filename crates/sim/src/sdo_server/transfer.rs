//! The transfer that is under way.

use takt_wire::canopen::object::ObjectAddress;

/// The transfer that is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    #[default]
    None,
    Download {
        address: ObjectAddress,
        length: Option<usize>,
        toggle: bool,
    },
    Upload {
        address: ObjectAddress,
        sent: usize,
        toggle: bool,
    },
    BlockDownload(BlockDownload),
    BlockUpload(BlockUpload),
}

impl Transfer {
    pub fn address(self) -> Option<ObjectAddress> {
        match self {
            Self::None => None,
            Self::Download { address, .. } | Self::Upload { address, .. } => Some(address),
            Self::BlockDownload(transfer) => Some(transfer.address),
            Self::BlockUpload(transfer) => Some(transfer.address),
        }
    }
}

/// A block download: segments arrive until one is the last, then the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockDownload {
    pub address: ObjectAddress,
    pub length: Option<usize>,
    pub has_crc: bool,
    pub phase: DownloadPhase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DownloadPhase {
    /// Segments arrive; this one was the last in sequence.
    Segments { sequence: u8 },
    /// The last segment has arrived.
    End,
}

/// A block upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockUpload {
    pub address: ObjectAddress,
    pub has_crc: bool,
    /// Segments in a block.
    pub size: u8,
    /// Bytes that the client has confirmed, and segments that await it.
    pub confirmed: usize,
    pub phase: UploadPhase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadPhase {
    Announced,
    Segments,
    End,
}
