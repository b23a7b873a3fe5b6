//! Where the axes of a group stand among those of the controller. Clients name the axes of a group in the group's own order.

use takt_rt::MAX_AXES;

/// The numbers of the axes of a group in the controller, in the order of the group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GroupAxes {
    places: Vec<usize>,
    /// Whether each axis has the same number in the group as in the controller.
    are_own: bool,
}

impl GroupAxes {
    /// The places of the axes with these numbers.
    pub fn new(places: Vec<usize>) -> Self {
        let are_own = places.iter().enumerate().all(|(own, place)| own == *place);
        Self { places, are_own }
    }

    /// Their numbers in the controller.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    /// How many axes the group has.
    #[cfg(feature = "internals")]
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// From the order of the group to that of the controller. What belongs to no axis of the group has the default.
    pub fn spread<T: Copy + Default>(&self, of_group: [T; MAX_AXES]) -> [T; MAX_AXES] {
        if self.are_own {
            return of_group;
        }
        let mut all = [T::default(); MAX_AXES];
        for (place, value) in self.places.iter().zip(of_group) {
            if let Some(to) = all.get_mut(*place) {
                *to = value;
            }
        }
        all
    }

    /// From the order of the controller to that of the group.
    pub fn pick<T: Copy + Default>(&self, all: &[T]) -> [T; MAX_AXES] {
        let mut of_group = [T::default(); MAX_AXES];
        for (to, place) in of_group.iter_mut().zip(&self.places) {
            *to = all.get(*place).copied().unwrap_or_default();
        }
        of_group
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spread_is_picked_again_in_the_order_of_the_group() {
        let places = GroupAxes::new(vec![5, 2, 3]);
        let mut of_group = [0; MAX_AXES];
        of_group[..3].copy_from_slice(&[10, 20, 30]);
        let all = places.spread(of_group);
        assert_eq!(all[..7], [0, 0, 20, 30, 0, 10, 0]);
        assert_eq!((places.pick(&all), places.count()), (of_group, 3));
        assert_eq!(GroupAxes::new(vec![0, 1]).spread(of_group), of_group);
    }
}
