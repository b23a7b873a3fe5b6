//! Values made from the bytes of a fuzzer.

use takt_rt::{Frame, Id};

/// The identifiers of NMT, SYNC, TIME, and layer settings from slave and master.
const FOR_ALL: [u32; 5] = [0x000, 0x080, 0x100, 0x7E4, 0x7E5];

/// Reads values from bytes. Behind the end, every byte is 0.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    pub fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let length = N.min(self.0.len());
        let (own, rest) = self.0.split_at(length);
        bytes[..length].copy_from_slice(own);
        self.0 = rest;
        bytes
    }

    pub fn short(&mut self) -> u16 {
        u16::from_le_bytes(self.bytes())
    }

    pub fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    /// An arbitrary number; mostly one of a usual size.
    pub fn number(&mut self) -> f64 {
        match self.byte() {
            0..8 => f64::from_le_bytes(self.bytes()),
            _ => f64::from(i16::from_le_bytes(self.bytes())) / 8192.0,
        }
    }

    /// A frame of any kind. Most have an identifier of the pre-defined connection set.
    pub fn frame(&mut self) -> Frame {
        let kind = self.byte();
        let id = match kind & 3 {
            0 => Id::extended(self.word() & 0x1FFF_FFFF),
            1 => Id::base(u32::from(self.short()) & 0x7FF),
            3 => Id::base(FOR_ALL[usize::from(self.byte()) % FOR_ALL.len()]),
            _ => Ok(Id::canopen(u16::from(self.byte() & 15) << 7, self.byte() % 8)),
        };
        let id = id.expect("the identifier is cut to its field");
        let length = usize::from(kind >> 4).min(8);
        let frame = match kind >> 2 & 3 {
            0 => Frame::remote(id, length as u8),
            1 => Frame::fd(id, &self.bytes::<64>(), kind & 0x10 != 0),
            _ => Frame::data(id, &self.bytes::<8>()[..length]),
        };
        frame.expect("the length fits the kind")
    }
}
