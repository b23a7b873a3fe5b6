//! The requests to the SDO server: expedited transfers, one at a time (manual 5.05). The manual names no abort codes; the
//! drive uses those of CiA 301.

use takt_rt::Nanoseconds;

use crate::sim::sdo_reply::{AbortCode, aborted, downloaded, uploaded};

/// Range of the response time, as measured on real units: about 0.3 ms.
pub const LATENCY_NS: std::ops::Range<Nanoseconds> = 270_000..330_000;

/// A decoded request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YzAimRequest {
    /// 40h
    Read,
    /// 2Fh, 2Bh, 27h, 23h; 22h without a size.
    Write {
        /// The data bytes.
        data: [u8; 4],
        /// How many of them are valid, if indicated.
        size: Option<usize>,
    },
    /// 80h: the client aborts.
    Abort,
    /// Anything else.
    Other,
}

/// A request and its object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Addressed {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// The request.
    pub request: YzAimRequest,
}

impl Addressed {
    /// Decodes a frame. Frames of four bytes and more are accepted without padding, because published masters send them
    /// so.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let &[command, low, high, subindex, ref rest @ ..] = payload else { return None };
        let mut data = [0; 4];
        for (to, from) in data.iter_mut().zip(rest) {
            *to = *from;
        }
        let request = match command {
            0x40 => YzAimRequest::Read,
            0x22 => YzAimRequest::Write { data, size: None },
            0x23 | 0x27 | 0x2B | 0x2F => {
                YzAimRequest::Write { data, size: Some(4 - usize::from(command >> 2 & 3)) }
            }
            0x80 => YzAimRequest::Abort,
            _ => YzAimRequest::Other,
        };
        Some(Self { index: u16::from_le_bytes([low, high]), subindex, request })
    }

    /// The response to a read request.
    pub fn value(&self, value: [u8; 4], size: usize) -> [u8; 8] {
        uploaded(self.index, self.subindex, value, size)
    }

    /// The response to a write request.
    pub fn written(&self) -> [u8; 8] {
        downloaded(self.index, self.subindex)
    }

    /// The abort response.
    pub fn refused(&self, code: AbortCode) -> [u8; 8] {
        aborted(self.index, self.subindex, code)
    }
}
