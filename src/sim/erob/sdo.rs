//! The SDO server: one transfer at a time, expedited or segmented (CiA 301, 7.2.4). It refuses block transfers.
//!
//! The server holds the state of a transfer and encodes its frames. [`ErobObjectAccess`], passed with each request,
//! reads and writes the objects.

use takt_rt::Nanoseconds;

use crate::sim::random::Random;
use crate::sim::sdo_reply::{AbortCode, ReplyBuffer, aborted, addressed, downloaded, uploaded};

/// Range of the response time, as measured on real units.
const LATENCY_NS: std::ops::Range<Nanoseconds> = 300_000..1_000_000;

/// Access to the objects behind the server.
pub trait ErobObjectAccess {
    /// The value of an entry as little-endian bytes, and their number.
    fn read(&mut self, index: u16, subindex: u8) -> Result<([u8; 4], usize), AbortCode>;

    /// Checks that an entry can be written, before the value is complete. Returns its size in bytes.
    fn check_write(&self, index: u16, subindex: u8) -> Result<usize, AbortCode>;

    /// Writes an entry with its complete value.
    fn write(&mut self, index: u16, subindex: u8, value: [u8; 4]) -> Result<(), AbortCode>;
}

/// A segmented transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    Download {
        index: u16,
        subindex: u8,
        size: usize,
        received: usize,
        value: [u8; 4],
        toggle: bool,
    },
    /// Every value fits one segment, so the toggle bit is always 0.
    Upload {
        index: u16,
        subindex: u8,
        size: usize,
        value: [u8; 4],
    },
}

/// The server of one node.
#[derive(Clone, Debug)]
pub struct ErobSdoServer {
    transfer: Option<Transfer>,
    reply: ReplyBuffer,
    is_upload_segmented: bool,
}

impl ErobSdoServer {
    /// An idle server. With `is_upload_segmented` it answers every upload in segments, which CiA 301 permits.
    pub fn new(latency: Random, is_upload_segmented: bool) -> Self {
        Self { transfer: None, reply: ReplyBuffer::new(latency, LATENCY_NS), is_upload_segmented }
    }

    /// Discards the transfer and the response.
    pub fn reset(&mut self) {
        self.transfer = None;
        self.reply.reset();
    }

    /// When the pending response is due.
    pub fn due_ns(&self) -> Option<Nanoseconds> {
        self.reply.due_ns()
    }

    /// The response, when it is due.
    pub fn answer(&mut self, now_ns: Nanoseconds) -> Option<[u8; 8]> {
        self.reply.take(now_ns)
    }

    /// Takes a request. A request before the last response was sent is lost, because the drive has one buffer.
    pub fn request(&mut self, now_ns: Nanoseconds, request: [u8; 8], access: &mut impl ErobObjectAccess) {
        if self.reply.is_busy() {
            return;
        }
        let index = u16::from_le_bytes([request[1], request[2]]);
        let subindex = request[3];
        let reply = match request[0] >> 5 {
            0 => self.download_segment(request, access),
            1 => self.download(request, index, subindex, access),
            2 => self.upload(index, subindex, access),
            3 => self.upload_segment(request),
            4 => {
                self.transfer = None;
                return;
            }
            _ => Err(AbortCode::Command),
        };
        let bytes = reply.unwrap_or_else(|code| {
            let (index, subindex) = self.transfer.take().map_or((index, subindex), Transfer::multiplexer);
            aborted(index, subindex, code)
        });
        self.reply.put(now_ns, Some(bytes));
    }

    fn download(
        &mut self,
        request: [u8; 8],
        index: u16,
        subindex: u8,
        access: &mut impl ErobObjectAccess,
    ) -> Result<[u8; 8], AbortCode> {
        self.transfer = None;
        let size = access.check_write(index, subindex)?;
        let is_expedited = request[0] & 0b10 != 0;
        let is_size_indicated = request[0] & 0b01 != 0;
        let data = [request[4], request[5], request[6], request[7]];
        let announced = match (is_expedited, is_size_indicated) {
            (true, true) => Some(4 - usize::from(request[0] >> 2 & 0b11)),
            (false, true) => Some(u32::from_le_bytes(data) as usize),
            (_, false) => None,
        };
        match announced {
            Some(announced) if announced > size => return Err(AbortCode::LengthTooHigh),
            Some(announced) if announced < size => return Err(AbortCode::LengthTooLow),
            _ => {}
        }
        if is_expedited {
            access.write(index, subindex, data)?;
        } else {
            let transfer =
                Transfer::Download { index, subindex, size, received: 0, value: [0; 4], toggle: false };
            self.transfer = Some(transfer);
        }
        Ok(downloaded(index, subindex))
    }

    fn download_segment(
        &mut self,
        request: [u8; 8],
        access: &mut impl ErobObjectAccess,
    ) -> Result<[u8; 8], AbortCode> {
        let Some(Transfer::Download { index, subindex, size, received, mut value, toggle }) = self.transfer
        else {
            return Err(AbortCode::Command);
        };
        if (request[0] & 0x10 != 0) != toggle {
            return Err(AbortCode::Toggle);
        }
        let length = 7 - usize::from(request[0] >> 1 & 0b111);
        let ended = received + length;
        if ended > size {
            return Err(AbortCode::LengthTooHigh);
        }
        for (to, from) in value.iter_mut().skip(received).zip(request.iter().skip(1).take(length)) {
            *to = *from;
        }
        let is_last = request[0] & 1 != 0;
        if is_last {
            if ended < size {
                return Err(AbortCode::LengthTooLow);
            }
            access.write(index, subindex, value)?;
            self.transfer = None;
        } else {
            let toggle = !toggle;
            self.transfer =
                Some(Transfer::Download { index, subindex, size, received: ended, value, toggle });
        }
        Ok([0x20 | u8::from(toggle) << 4, 0, 0, 0, 0, 0, 0, 0])
    }

    fn upload(
        &mut self,
        index: u16,
        subindex: u8,
        access: &mut impl ErobObjectAccess,
    ) -> Result<[u8; 8], AbortCode> {
        self.transfer = None;
        let (value, size) = access.read(index, subindex)?;
        if self.is_upload_segmented {
            self.transfer = Some(Transfer::Upload { index, subindex, size, value });
            return Ok(addressed(0x41, index, subindex, (size as u32).to_le_bytes()));
        }
        Ok(uploaded(index, subindex, value, size))
    }

    fn upload_segment(&mut self, request: [u8; 8]) -> Result<[u8; 8], AbortCode> {
        let Some(Transfer::Upload { size, value, .. }) = self.transfer else {
            return Err(AbortCode::Command);
        };
        if request[0] & 0x10 != 0 {
            return Err(AbortCode::Toggle);
        }
        let mut answer = [0; 8];
        answer[0] = (7 - size.min(7) as u8) << 1 | 1;
        for (to, from) in answer.iter_mut().skip(1).zip(value.iter().take(size)) {
            *to = *from;
        }
        self.transfer = None;
        Ok(answer)
    }
}

impl Transfer {
    fn multiplexer(self) -> (u16, u8) {
        match self {
            Self::Download { index, subindex, .. } | Self::Upload { index, subindex, .. } => {
                (index, subindex)
            }
        }
    }
}
