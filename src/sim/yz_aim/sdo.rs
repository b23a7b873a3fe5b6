//! The SDO server: expedited transfers, one at a time (manual 5.05).

use takt_rt::Nanoseconds;

use crate::sim::random::Random;

/// From a request to its answer, as seen on real units: about 0.3 ms.
const LATENCY_NS: std::ops::Range<Nanoseconds> = 270_000..330_000;

/// Why a request is refused. The manual names no abort codes; these are those of CiA 301, 7.2.4.3.17.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum AbortCode {
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

/// A request, read from its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// 40h
    Read,
    /// 2Fh, 2Bh, 27h, 23h; 22h without a size.
    Write {
        /// The bytes that follow.
        data: [u8; 4],
        /// How many of them count.
        size: Option<usize>,
    },
    /// 80h: the client gives up.
    Abort,
    /// Anything else.
    Other,
}

/// A request with what it names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Addressed {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// What is wanted.
    pub request: Request,
}

impl Addressed {
    /// Reads a frame. Unpadded ones of four bytes and more are taken, since published masters send such.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let &[command, low, high, subindex, ref rest @ ..] = payload else { return None };
        let mut data = [0; 4];
        for (to, from) in data.iter_mut().zip(rest) {
            *to = *from;
        }
        let request = match command {
            0x40 => Request::Read,
            0x22 => Request::Write { data, size: None },
            0x23 | 0x27 | 0x2B | 0x2F => {
                Request::Write { data, size: Some(4 - usize::from(command >> 2 & 3)) }
            }
            0x80 => Request::Abort,
            _ => Request::Other,
        };
        Some(Self { index: u16::from_le_bytes([low, high]), subindex, request })
    }

    /// The answer to a reader.
    pub fn value(&self, value: [u8; 4], size: usize) -> [u8; 8] {
        self.answer(0x43 | (4 - size.min(4) as u8) << 2, value)
    }

    /// The answer to a writer.
    pub fn written(&self) -> [u8; 8] {
        self.answer(0x60, [0; 4])
    }

    /// The answer to whoever is refused.
    pub fn refused(&self, code: AbortCode) -> [u8; 8] {
        self.answer(0x80, (code as u32).to_le_bytes())
    }

    fn answer(&self, command: u8, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
        let [low, high] = self.index.to_le_bytes();
        [command, low, high, self.subindex, a, b, c, d]
    }
}

/// The one buffer for an answer. While it is full, requests are lost.
#[derive(Clone, Copy, Debug)]
pub struct SdoServer {
    pending: Option<(Nanoseconds, Option<[u8; 8]>)>,
    latency: Random,
}

impl SdoServer {
    /// A server at rest.
    pub fn new(latency: Random) -> Self {
        Self { pending: None, latency }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.pending = None;
    }

    /// Whether a request is being worked on; another one that comes now is lost.
    pub fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    /// Takes the answer; a request without one takes its time all the same.
    pub fn answer(&mut self, now_ns: Nanoseconds, answer: Option<[u8; 8]>) {
        self.pending = Some((now_ns + self.latency.within(LATENCY_NS), answer));
    }

    /// When the present request is done with.
    pub fn due_ns(&self) -> Option<Nanoseconds> {
        self.pending.map(|(due_ns, _)| due_ns)
    }

    /// Gives the answer out, when it is due.
    pub fn take(&mut self, now_ns: Nanoseconds) -> Option<[u8; 8]> {
        let (_, answer) = self.pending.filter(|(due_ns, _)| *due_ns <= now_ns)?;
        self.pending = None;
        answer
    }
}
