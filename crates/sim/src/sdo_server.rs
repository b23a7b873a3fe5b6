//! The SDO server of a simulated device: one transfer at a time, expedited, segmented or in blocks (CiA 301, 7.2.4). Its
//! replies leave after the latency of the device.
//!
//! The server holds the state of a transfer and encodes its frames. [`ObjectAccess`], passed with each request, reads and
//! writes the objects.

mod block;
mod transfer;

use std::collections::VecDeque;
use std::ops::Range;

use takt_rt::Nanoseconds;
use takt_wire::canopen::object::ObjectAddress;

use super::random::Random;
use super::sdo_reply::{AbortCode, aborted, addressed, downloaded, uploaded};
use transfer::Transfer;

/// The longest value of a transfer: bytes.
const BUFFER: usize = 4096;
/// The most segments of a block (CiA 301, 7.2.4.3.9), and a reply.
const REPLIES: usize = 128;

/// Access to the objects behind the server.
pub trait ObjectAccess {
    /// Appends the value of an object as little-endian bytes.
    fn read(&mut self, address: ObjectAddress, value: &mut Vec<u8>) -> Result<(), AbortCode>;

    /// Checks that an object can be written, before the value is complete. Returns its length in bytes, if that is fixed.
    fn check_write(&mut self, address: ObjectAddress) -> Result<Option<usize>, AbortCode>;

    /// Writes an object with its complete value.
    fn write(&mut self, address: ObjectAddress, value: &[u8]) -> Result<(), AbortCode>;

    /// The code with which the device refuses where the standard has `code`; `None` when it does not reply.
    fn refusal(&self, code: AbortCode) -> Option<AbortCode> {
        Some(code)
    }
}

/// The transfers that a server has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoFeatures {
    /// Expedited ones only, with the commands that such a transfer needs.
    Expedited,
    /// Expedited and segmented ones.
    Segmented {
        /// True if it answers every upload in segments, which CiA 301 permits.
        is_upload_segmented: bool,
    },
    /// All, block transfers too.
    Blocks,
}

/// The commands of expedited transfers: read, and write with and without a size.
const EXPEDITED: [u8; 6] = [0x40, 0x22, 0x23, 0x27, 0x2B, 0x2F];
/// The command with which a client aborts.
const ABORT: u8 = 0x80;

/// The server of one node.
#[derive(Clone, Debug)]
pub struct SdoServer {
    transfer: Transfer,
    /// The value of the transfer.
    value: Vec<u8>,
    replies: VecDeque<[u8; 8]>,
    /// When the present request is done and its replies leave. The server is busy until then.
    due_ns: Option<Nanoseconds>,
    latency: Random,
    latency_ns: Range<Nanoseconds>,
    features: SdoFeatures,
}

impl SdoServer {
    /// An idle server whose replies take a time in this range.
    pub fn new(latency: Random, latency_ns: Range<Nanoseconds>, features: SdoFeatures) -> Self {
        Self {
            transfer: Transfer::None,
            value: Vec::with_capacity(BUFFER),
            replies: VecDeque::with_capacity(REPLIES),
            due_ns: None,
            latency,
            latency_ns,
            features,
        }
    }

    /// A placeholder without memory, for the time in which the server accesses the device that holds it.
    pub const fn taken() -> Self {
        Self {
            transfer: Transfer::None,
            value: Vec::new(),
            replies: VecDeque::new(),
            due_ns: None,
            latency: Random::placeholder(),
            latency_ns: 0..1,
            features: SdoFeatures::Expedited,
        }
    }

    /// Discards the transfer and the replies.
    pub fn reset(&mut self) {
        self.transfer = Transfer::None;
        self.replies.clear();
        self.due_ns = None;
    }

    /// When the present request is done.
    pub fn due_ns(&self) -> Option<Nanoseconds> {
        self.due_ns
    }

    /// A reply that is due.
    pub fn answer(&mut self, now_ns: Nanoseconds) -> Option<[u8; 8]> {
        if self.due_ns.is_none_or(|due_ns| due_ns > now_ns) {
            return None;
        }
        let reply = self.replies.pop_front();
        if self.replies.is_empty() {
            self.due_ns = None;
        }
        reply
    }

    /// Takes a request. A request before the last reply was sent is lost, because the server has one buffer.
    pub fn request(&mut self, now_ns: Nanoseconds, request: [u8; 8], access: &mut impl ObjectAccess) {
        if self.due_ns.is_some() {
            return;
        }
        let address = ObjectAddress::new(u16::from_le_bytes([request[1], request[2]]), request[3]);
        let handled = self.handle(request, address, access);
        if let Err(code) = handled {
            let ObjectAddress { index, subindex } = self.transfer.address().unwrap_or(address);
            self.transfer = Transfer::None;
            self.replies.extend(access.refusal(code).map(|code| aborted(index, subindex, code)));
        }
        // A refusal in silence takes as long as a reply.
        if handled.is_err() || !self.replies.is_empty() {
            self.due_ns = Some(now_ns + self.latency.within(self.latency_ns.clone()));
        }
    }

    fn handle(
        &mut self,
        request: [u8; 8],
        address: ObjectAddress,
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        if request[0] == ABORT {
            self.transfer = Transfer::None;
            return Ok(());
        }
        if self.receives_block() {
            return self.receive_block_segment(request);
        }
        if self.features == SdoFeatures::Expedited && !EXPEDITED.contains(&request[0]) {
            return Err(AbortCode::Command);
        }
        match request[0] >> 5 {
            0 => self.download_segment(request, access),
            1 => self.download(request, address, access),
            2 => self.upload(address, access),
            3 => self.upload_segment(request),
            4 => {
                self.transfer = Transfer::None;
                Ok(())
            }
            5 if self.features == SdoFeatures::Blocks => self.block_upload(request, address, access),
            6 if self.features == SdoFeatures::Blocks => self.block_download(request, address, access),
            _ => Err(AbortCode::Command),
        }
    }

    fn download(
        &mut self,
        request: [u8; 8],
        address: ObjectAddress,
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        self.transfer = Transfer::None;
        let length = access.check_write(address)?;
        let is_expedited = request[0] & 0b10 != 0;
        let is_size_indicated = request[0] & 0b01 != 0;
        let data = [request[4], request[5], request[6], request[7]];
        let announced = match (is_expedited, is_size_indicated) {
            (true, true) => Some(4 - usize::from(request[0] >> 2 & 0b11)),
            (false, true) => Some(u32::from_le_bytes(data) as usize),
            (_, false) => None,
        };
        check_length(announced, length)?;
        if is_expedited {
            let given = announced.or(length).unwrap_or(4).min(4);
            access.write(address, &data[..given])?;
        } else {
            self.value.clear();
            self.transfer = Transfer::Download { address, length, toggle: false };
        }
        self.replies.push_back(downloaded(address.index, address.subindex));
        Ok(())
    }

    fn download_segment(
        &mut self,
        request: [u8; 8],
        access: &mut impl ObjectAccess,
    ) -> Result<(), AbortCode> {
        let Transfer::Download { address, length, toggle } = self.transfer else {
            return Err(AbortCode::Command);
        };
        if (request[0] & 0x10 != 0) != toggle {
            return Err(AbortCode::Toggle);
        }
        let count = 7 - usize::from(request[0] >> 1 & 0b111);
        self.append(&request[1..=count], length)?;
        if request[0] & 1 != 0 {
            check_length(Some(self.value.len()), length)?;
            access.write(address, &self.value)?;
            self.transfer = Transfer::None;
        } else {
            self.transfer = Transfer::Download { address, length, toggle: !toggle };
        }
        self.replies.push_back([0x20 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0]);
        Ok(())
    }

    /// Appends data of a download, while it is not longer than the object.
    fn append(&mut self, data: &[u8], length: Option<usize>) -> Result<(), AbortCode> {
        let ended = self.value.len() + data.len();
        if length.is_some_and(|length| ended > length) {
            return Err(AbortCode::LengthTooHigh);
        }
        if ended > BUFFER {
            return Err(AbortCode::Memory);
        }
        self.value.extend_from_slice(data);
        Ok(())
    }

    fn upload(&mut self, address: ObjectAddress, access: &mut impl ObjectAccess) -> Result<(), AbortCode> {
        self.transfer = Transfer::None;
        self.value.clear();
        access.read(address, &mut self.value)?;
        let size = self.value.len();
        let ObjectAddress { index, subindex } = address;
        let is_segmented = self.features == SdoFeatures::Segmented { is_upload_segmented: true };
        if (1..=4).contains(&size) && !is_segmented {
            let mut data = [0; 4];
            data[..size].copy_from_slice(&self.value);
            self.replies.push_back(uploaded(index, subindex, data, size));
        } else {
            self.transfer = Transfer::Upload { address, sent: 0, toggle: false };
            self.replies.push_back(addressed(0x41, index, subindex, (size as u32).to_le_bytes()));
        }
        Ok(())
    }

    fn upload_segment(&mut self, request: [u8; 8]) -> Result<(), AbortCode> {
        let Transfer::Upload { address, sent, toggle } = self.transfer else {
            return Err(AbortCode::Command);
        };
        if (request[0] & 0x10 != 0) != toggle {
            return Err(AbortCode::Toggle);
        }
        let left = &self.value[sent..];
        let count = left.len().min(7);
        let is_last = count == left.len();
        let mut answer = [0; 8];
        answer[0] = u8::from(toggle) << 4 | (7 - count as u8) << 1 | u8::from(is_last);
        answer[1..=count].copy_from_slice(&left[..count]);
        self.replies.push_back(answer);
        self.transfer = if is_last {
            Transfer::None
        } else {
            Transfer::Upload { address, sent: sent + count, toggle: !toggle }
        };
        Ok(())
    }
}

/// Checks the length of a value against that of its object.
fn check_length(given: Option<usize>, length: Option<usize>) -> Result<(), AbortCode> {
    match (given, length) {
        (Some(given), Some(length)) if given > length => Err(AbortCode::LengthTooHigh),
        (Some(given), Some(length)) if given < length => Err(AbortCode::LengthTooLow),
        _ => Ok(()),
    }
}
