//! The values of the object dictionary, and the non-volatile memory.

use std::ops::RangeInclusive;

use super::objects::{OBJECTS, at};

/// The values of all entries, in the order of [`OBJECTS`].
#[derive(Clone, Debug)]
pub struct YzAimDictionary {
    values: [i64; OBJECTS.len()],
    stored: [i64; OBJECTS.len()],
}

impl YzAimDictionary {
    /// The dictionary of a new drive with this node ID.
    pub fn new(node: u8) -> Self {
        let values = OBJECTS.map(|object| object.default);
        let mut dictionary = Self { values, stored: values };
        dictionary.set_factory(at::NODE_ADDRESS, node.into());
        dictionary.address(node);
        dictionary
    }

    /// Updates the COB-IDs for a node ID.
    pub fn address(&mut self, node: u8) {
        for (object, value) in OBJECTS.iter().zip(&mut self.values) {
            if object.adds_node {
                *value = object.default + i64::from(node);
            }
        }
    }

    /// Sets a factory default.
    pub fn set_factory(&mut self, at: usize, value: i64) {
        self.values[at] = value;
        self.stored[at] = value;
    }

    /// Stores every parameter.
    pub fn store(&mut self) {
        for ((object, stored), value) in OBJECTS.iter().zip(&mut self.stored).zip(&self.values) {
            if object.is_stored {
                *stored = *value;
            }
        }
    }

    /// Restores the stored values or defaults of every entry with an index in `indices`. COB-IDs stay.
    pub fn restore(&mut self, indices: RangeInclusive<u16>) {
        for ((object, value), stored) in OBJECTS.iter().zip(&mut self.values).zip(&self.stored) {
            if indices.contains(&object.index) && !object.adds_node {
                *value = *stored;
            }
        }
    }

    /// The value of an entry.
    pub fn get(&self, at: usize) -> i64 {
        self.values[at]
    }

    /// The value of an entry as a real number.
    pub fn real(&self, at: usize) -> f64 {
        self.values[at] as f64
    }

    /// The stored value of an entry.
    pub fn stored(&self, at: usize) -> i64 {
        self.stored[at]
    }

    /// Sets an entry to the nearest value within its range.
    pub fn set(&mut self, at: usize, value: i64) {
        self.values[at] = value.clamp(OBJECTS[at].lowest, OBJECTS[at].highest);
    }

    /// Sets an entry to the nearest whole value within its range.
    pub fn set_real(&mut self, at: usize, value: f64) {
        self.set(at, value.round_ties_even() as i64);
    }

    /// The bytes of an entry in a frame, and their number.
    pub fn encode(&self, at: usize) -> ([u8; 4], usize) {
        let [a, b, c, d, ..] = self.values[at].to_le_bytes();
        let mut bytes = [a, b, c, d];
        let size = OBJECTS[at].bytes();
        bytes[size..].fill(0);
        (bytes, size)
    }
}

/// Decodes the bytes of an entry.
pub fn decode(at: usize, bytes: [u8; 4]) -> i64 {
    let object = OBJECTS[at];
    let unused = 32 - u32::from(object.bits);
    let aligned = u32::from_le_bytes(bytes) << unused;
    if object.lowest < 0 { i64::from(aligned as i32 >> unused) } else { i64::from(aligned >> unused) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cob_ids_follow_the_node_id_and_survive_a_restore() {
        let mut dictionary = YzAimDictionary::new(5);
        assert_eq!((dictionary.get(at::RPDO4 + 1), dictionary.get(at::TPDO2 + 1)), (0x505, 0x285));
        dictionary.address(9);
        dictionary.restore(0..=0xFFFF);
        assert_eq!(dictionary.get(at::TPDO2 + 1), 0x289);
        assert_eq!(dictionary.get(at::NODE_ADDRESS), 5);
    }

    #[test]
    fn parameters_are_stored_and_set_points_are_not() {
        let mut dictionary = YzAimDictionary::new(5);
        dictionary.set(at::PROFILE_VELOCITY, 77);
        dictionary.set(at::TARGET_POSITION, 88);
        dictionary.store();
        dictionary.set(at::PROFILE_VELOCITY, 1);
        dictionary.restore(0..=0xFFFF);
        assert_eq!((dictionary.get(at::PROFILE_VELOCITY), dictionary.get(at::TARGET_POSITION)), (77, 0));
    }

    #[test]
    fn signed_entries_keep_their_sign_in_both_directions() {
        let mut dictionary = YzAimDictionary::new(5);
        assert_eq!(decode(at::TARGET_VELOCITY, (-600i32).to_le_bytes()), -600);
        assert_eq!(decode(at::CONTROLWORD, [0x0F, 0xFF, 0x77, 0x77]), 0xFF0F);
        dictionary.set_real(at::VELOCITY, -600.4);
        assert_eq!(dictionary.encode(at::VELOCITY), ([0xA8, 0xFD, 0, 0], 2));
    }
}
