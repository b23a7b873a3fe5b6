//! A set of small numbers, one bit each.

use crate::capacity::{MAX_AXES, MAX_BUSES};

const _: () = assert!(MAX_AXES <= u32::BITS as usize, "each axis has a bit");
const _: () = assert!(MAX_BUSES <= u32::BITS as usize, "each bus has a bit");

/// Some of the buses, or some of the axes, by their numbers (0 to 31).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct BitSet(u32);

impl FromIterator<usize> for BitSet {
    fn from_iter<I: IntoIterator<Item = usize>>(numbers: I) -> Self {
        let mut set = Self::default();
        numbers.into_iter().for_each(|number| set.insert(number));
        set
    }
}

impl BitSet {
    /// Adds a number.
    pub fn insert(&mut self, number: usize) {
        self.0 |= 1 << (number & 31);
    }

    /// Takes a number away. Returns whether it was in the set.
    pub fn take(&mut self, number: usize) -> bool {
        let was_there = self.contains(number);
        self.0 &= !(1 << (number & 31));
        was_there
    }

    /// Returns `true` if a number is in the set.
    pub const fn contains(self, number: usize) -> bool {
        self.0 >> (number & 31) & 1 == 1
    }

    /// This set less the numbers of another.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Those that are in both.
    #[must_use]
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The numbers of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns `true` if no number is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// So many numbers, from 0 on.
    pub const fn first(count: usize) -> Self {
        if count >= 32 { Self(u32::MAX) } else { Self((1 << count) - 1) }
    }

    /// The numbers, in ascending order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let number = (rest != 0).then(|| rest.trailing_zeros() as usize);
            rest &= rest.wrapping_sub(1);
            number
        })
    }

    /// Returns `true` if all of these numbers, at least one, are in another set too.
    pub const fn is_within(self, other: Self) -> bool {
        self.0 != 0 && self.0 & !other.0 == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_that_was_added_comes_once_and_in_order() {
        let mut set = BitSet::default();
        [31, 0, 7, 7].into_iter().for_each(|number| set.insert(number));
        assert!(set.iter().eq([0, 7, 31]));
    }
}
