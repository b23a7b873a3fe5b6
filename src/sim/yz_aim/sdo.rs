//! The SDO server: expedited transfers, one at a time (manual 5.05).

use takt_rt::Nanoseconds;

use crate::sim::random::Random;

/// Range of the response time, as measured on real units: about 0.3 ms.
const LATENCY_NS: std::ops::Range<Nanoseconds> = 270_000..330_000;

/// The abort codes. The manual names none; these are those of CiA 301, 7.2.4.3.17.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum YzAimAbortCode {
    /// Command specifier not valid or unknown.
    Command = 0x0504_0001,
    /// Attempt to write a read-only object.
    ReadOnly = 0x0601_0002,
    /// Object does not exist in the object dictionary.
    NoObject = 0x0602_0000,
    /// Data type does not match, length of service parameter does not match.
    Length = 0x0607_0010,
    /// Invalid value for parameter.
    Value = 0x0609_0030,
}

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
        self.answer(0x43 | (4 - size.min(4) as u8) << 2, value)
    }

    /// The response to a write request.
    pub fn written(&self) -> [u8; 8] {
        self.answer(0x60, [0; 4])
    }

    /// The abort response.
    pub fn refused(&self, code: YzAimAbortCode) -> [u8; 8] {
        self.answer(0x80, (code as u32).to_le_bytes())
    }

    fn answer(&self, command: u8, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
        let [low, high] = self.index.to_le_bytes();
        [command, low, high, self.subindex, a, b, c, d]
    }
}

/// The server, with one buffer for the response. Requests are lost while it is full.
#[derive(Clone, Copy, Debug)]
pub struct YzAimSdoServer {
    pending: Option<(Nanoseconds, Option<[u8; 8]>)>,
    latency: Random,
}

impl YzAimSdoServer {
    /// An idle server.
    pub fn new(latency: Random) -> Self {
        Self { pending: None, latency }
    }

    /// Discards the response.
    pub fn reset(&mut self) {
        self.pending = None;
    }

    /// Whether a request is being processed; a further one is lost.
    pub fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    /// Queues the response; a request without a response takes the same time.
    pub fn answer(&mut self, now_ns: Nanoseconds, answer: Option<[u8; 8]>) {
        self.pending = Some((now_ns + self.latency.within(LATENCY_NS), answer));
    }

    /// When the current request is finished.
    pub fn due_ns(&self) -> Option<Nanoseconds> {
        self.pending.map(|(due_ns, _)| due_ns)
    }

    /// The response, when it is due.
    pub fn take(&mut self, now_ns: Nanoseconds) -> Option<[u8; 8]> {
        let (_, answer) = self.pending.filter(|(due_ns, _)| *due_ns <= now_ns)?;
        self.pending = None;
        answer
    }
}
