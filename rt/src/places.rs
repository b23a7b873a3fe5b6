//! Where the axes of a group stand among those of the engine.

use core::ops::Range;

/// Places beside each other, from the first on and up to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Places {
    /// The first place.
    pub first: usize,
    /// The place behind the last one.
    pub end: usize,
}

impl Places {
    /// The same as a range.
    pub const fn range(self) -> Range<usize> {
        self.first..self.end
    }

    /// Returns `true` if this is one of them.
    pub const fn contains(self, place: usize) -> bool {
        self.first <= place && place < self.end
    }
}
