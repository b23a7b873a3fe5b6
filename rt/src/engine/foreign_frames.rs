//! Frames of another master: the first one on each bus, since they were last forgotten.

use crate::bit_set::BitSet;
use crate::frame::Id;

/// The identifiers of frames that only this controller may send.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct ForeignFrames<const BUSES: usize> {
    /// The buses on which one was seen.
    buses: BitSet,
    first: [Option<Id>; BUSES],
}

impl<const BUSES: usize> Default for ForeignFrames<BUSES> {
    fn default() -> Self {
        Self { buses: BitSet::default(), first: [None; BUSES] }
    }
}

impl<const BUSES: usize> ForeignFrames<BUSES> {
    /// Takes a frame on a bus.
    pub(super) fn note(&mut self, bus: usize, id: Id) {
        if let Some(first) = self.first.get_mut(bus) {
            first.get_or_insert(id);
            self.buses.insert(bus);
        }
    }

    /// Returns `true` if none was seen.
    pub(super) const fn is_empty(&self) -> bool {
        self.buses.is_empty()
    }

    /// The first one on each of these buses, with its bus.
    pub(super) fn on(&self, buses: BitSet) -> impl Iterator<Item = (u8, Id)> + use<BUSES> {
        let Self { buses: seen, first } = *self;
        let of = move |bus: usize| Some((bus as u8, first.get(bus).copied().flatten()?));
        seen.intersection(buses).iter().filter_map(of)
    }

    /// Forgets all of them.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}
