//! Where the axes of a group stand among those of the controller. Clients name the axes of a group in the group's own order.

use takt_rt::MAX_AXES;

/// The numbers of the axes of a group in the controller, in the order of the group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GroupAxes {
    places: Vec<usize>,
    /// True if each axis has the same number in the group as in the controller.
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
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Brings values from the order of the group to that of the controller. What belongs to no axis of the group gets the default.
    pub fn spread<T: Copy + Default>(&self, values: &mut [T; MAX_AXES]) {
        if self.are_own {
            return;
        }
        let of_group = *values;
        *values = [T::default(); MAX_AXES];
        for (place, value) in self.places.iter().zip(of_group) {
            if let Some(to) = values.get_mut(*place) {
                *to = value;
            }
        }
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
    fn each_value_is_spread_to_the_place_of_its_axis_and_picked_from_there() {
        let of_group: [_; MAX_AXES] = std::array::from_fn(|axis| 10 * (axis + 1));
        let (axes, mut values) = (GroupAxes::new(vec![5, 2, 3]), of_group);
        axes.spread(&mut values);
        assert_eq!((axes.count(), &values[..7]), (3, &[0, 0, 20, 30, 0, 10, 0][..]));
        assert_eq!(axes.pick(&values)[..4], [10, 20, 30, 0]);
        let mut values = of_group;
        GroupAxes::new(vec![0, 1]).spread(&mut values);
        assert_eq!(values, of_group);
    }
}
