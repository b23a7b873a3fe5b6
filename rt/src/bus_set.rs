//! A set of buses.

/// Some of the buses, by their numbers (0 to 31).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusSet(u32);

impl BusSet {
    /// Adds a bus.
    pub fn insert(&mut self, bus: usize) {
        self.0 |= 1 << (bus & 31);
    }

    /// Takes a bus away. Returns whether it was in the set.
    pub fn take(&mut self, bus: usize) -> bool {
        let was_there = self.contains(bus);
        self.0 &= !(1 << (bus & 31));
        was_there
    }

    /// Whether a bus is in the set.
    pub const fn contains(self, bus: usize) -> bool {
        self.0 >> (bus & 31) & 1 == 1
    }

    /// This set less the buses of another.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The buses of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether no bus is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// So many buses, from the first on.
    pub const fn first(buses: usize) -> Self {
        if buses >= 32 { Self(u32::MAX) } else { Self((1 << buses) - 1) }
    }

    /// The buses, in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let bus = (rest != 0).then(|| rest.trailing_zeros() as usize);
            rest &= rest.wrapping_sub(1);
            bus
        })
    }

    /// Whether all of these buses, at least one, are in another set too.
    pub const fn is_within(self, other: Self) -> bool {
        self.0 != 0 && self.0 & !other.0 == 0
    }
}
