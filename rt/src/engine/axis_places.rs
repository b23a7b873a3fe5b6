//! Which axes are on a bus: found once, and not by a look at every axis for each bus.

use crate::record::MAX_AXES;

const _: () = assert!(MAX_AXES <= u32::BITS as usize, "each place has a bit");

/// Some of the places where the axes of the engine stand (0 to 31).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct AxisPlaces(u32);

impl AxisPlaces {
    /// Adds a place.
    pub(super) fn insert(&mut self, place: usize) {
        self.0 |= 1 << (place & 31);
    }

    /// The places, in their order.
    pub(super) fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let place = (rest != 0).then(|| rest.trailing_zeros() as usize);
            rest &= rest.wrapping_sub(1);
            place
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_that_was_added_comes_once_and_in_order() {
        let mut places = AxisPlaces::default();
        [31, 0, 7, 7].into_iter().for_each(|place| places.insert(place));
        assert!(places.iter().eq([0, 7, 31]));
    }
}
