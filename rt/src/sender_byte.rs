//! The sender of a frame, by its payload.

/// A byte of a frame, or a part of one, that says which drive has sent it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct SenderByte {
    /// Its place in the payload, from 0.
    pub at: u8,
    /// The bits of it that say so.
    pub mask: u8,
    /// What these bits are in the frames of this drive; its other bits are 0.
    pub value: u8,
}

impl SenderByte {
    /// A whole byte.
    pub const fn whole(at: u8, value: u8) -> Self {
        Self { at, mask: 0xFF, value }
    }

    /// Returns `true` if a payload is of this drive.
    pub fn has_sent(self, payload: &[u8]) -> bool {
        payload.get(usize::from(self.at)).is_some_and(|byte| byte & self.mask == self.value)
    }
}
