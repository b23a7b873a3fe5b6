//! The values of the object dictionary, and the non-volatile memory.

use crate::sim::sdo_reply::AbortCode;

use super::objects::{ErobAccess, ErobDataType, Missing, OBJECTS, find, place};

impl From<Missing> for AbortCode {
    fn from(missing: Missing) -> Self {
        match missing {
            Missing::Index => Self::NoObject,
            Missing::Subindex => Self::NoSubindex,
        }
    }
}

/// The values of all entries in the order of [`OBJECTS`], each with the bits of its SDO transfer.
#[derive(Clone, Debug)]
pub struct ErobDictionary {
    values: [u32; OBJECTS.len()],
    saved: [u32; OBJECTS.len()],
}

impl ErobDictionary {
    /// The dictionary of a new drive with this node ID.
    pub fn new(node: u8) -> Self {
        let values = OBJECTS.map(|object| {
            mask(object.data_type, object.default + if object.adds_node { node.into() } else { 0 })
        });
        Self { values, saved: values }
    }

    /// Sets a factory default, which every restart restores.
    pub fn set_factory(&mut self, at: usize, value: u32) {
        self.set(at, value);
        self.saved[at] = self.values[at];
    }

    /// Saves every parameter, as "save" does.
    pub fn save(&mut self) {
        for ((object, saved), value) in OBJECTS.iter().zip(&mut self.saved).zip(&self.values) {
            if object.is_saved {
                *saved = *value;
            }
        }
    }

    /// Restores the saved values or defaults of every entry with an index in `indices`, as a restart does.
    pub fn restore(&mut self, indices: std::ops::RangeInclusive<u16>) {
        for ((object, value), saved) in OBJECTS.iter().zip(&mut self.values).zip(&self.saved) {
            if indices.contains(&object.index) {
                *value = *saved;
            }
        }
    }

    /// The position of an entry for a read access.
    pub fn for_reading(index: u16, subindex: u8) -> Result<usize, AbortCode> {
        let at = find(index, subindex)?;
        if OBJECTS[at].access == ErobAccess::WriteOnly { Err(AbortCode::WriteOnly) } else { Ok(at) }
    }

    /// The position of an entry for a write access.
    pub fn for_writing(index: u16, subindex: u8) -> Result<usize, AbortCode> {
        let at = find(index, subindex)?;
        if OBJECTS[at].access == ErobAccess::ReadOnly { Err(AbortCode::ReadOnly) } else { Ok(at) }
    }

    /// The bits of an entry.
    pub fn get(&self, at: usize) -> u32 {
        self.values[at]
    }

    /// The value of a signed entry.
    pub fn signed(&self, at: usize) -> i32 {
        let value = self.values[at];
        match OBJECTS[at].data_type {
            ErobDataType::I8 => i32::from(value as u8 as i8),
            ErobDataType::I16 => i32::from(value as u16 as i16),
            _ => value as i32,
        }
    }

    /// The value of an unsigned entry, as a real number.
    pub fn real(&self, at: usize) -> f64 {
        f64::from(self.values[at])
    }

    /// The value of a signed entry, as a real number.
    pub fn signed_real(&self, at: usize) -> f64 {
        f64::from(self.signed(at))
    }

    /// Sets an entry; bits beyond its type are discarded.
    pub fn set(&mut self, at: usize, value: u32) {
        self.values[at] = mask(OBJECTS[at].data_type, value);
    }

    /// Sets a signed entry to the nearest value within its range.
    pub fn set_real(&mut self, at: usize, value: f64) {
        let nearest = value.round_ties_even();
        let value = match OBJECTS[at].data_type {
            ErobDataType::I8 => (nearest as i8).into(),
            ErobDataType::I16 => (nearest as i16).into(),
            _ => nearest as i32,
        };
        self.set(at, value as u32);
    }
}

fn mask(data_type: ErobDataType, value: u32) -> u32 {
    match data_type.bytes() {
        1 => value & 0xFF,
        2 => value & 0xFFFF,
        _ => value,
    }
}

/// Positions of the entries that the drive itself uses.
pub mod at {
    use super::place;

    macro_rules! places {
        ($($(#[$meta:meta])* $name:ident = $index:literal : $subindex:literal;)*) => {
            $($(#[$meta])* #[doc = concat!("Object ", stringify!($index), ":", stringify!($subindex))]
            pub const $name: usize = place($index, $subindex);)*
        };
    }

    places! {
        ERROR_REGISTER = 0x1001:0;
        ERROR_HISTORY = 0x1003:0;
        SYNC_ID = 0x1005:0;
        CYCLE_PERIOD = 0x1006:0;
        GUARD_TIME = 0x100C:0;
        LIFE_TIME_FACTOR = 0x100D:0;
        CONSUMER_HEARTBEAT = 0x1016:1;
        PRODUCER_HEARTBEAT = 0x1017:0;
        ERROR_BEHAVIOUR = 0x1029:1;
        MOTOR_ENCODER = 0x2240:0;
        ENCODER_DIFFERENCE = 0x2241:0;
        BATTERY_RESET = 0x2242:0;
        TEMPERATURE = 0x22A2:0;
        TORQUE_ESTIMATE = 0x3B69:0;
        ERROR_CODE = 0x603F:0;
        CONTROLWORD = 0x6040:0;
        STATUSWORD = 0x6041:0;
        SHUTDOWN_OPTION = 0x605B:0;
        FAULT_REACTION_OPTION = 0x605E:0;
        OPERATION_MODE = 0x6060:0;
        OPERATION_MODE_DISPLAY = 0x6061:0;
        POSITION_DEMAND = 0x6062:0;
        POSITION = 0x6064:0;
        FOLLOWING_ERROR_WINDOW = 0x6065:0;
        POSITION_WINDOW = 0x6067:0;
        POSITION_WINDOW_TIME = 0x6068:0;
        VELOCITY_DEMAND = 0x606B:0;
        VELOCITY = 0x606C:0;
        VELOCITY_WINDOW = 0x606D:0;
        VELOCITY_WINDOW_TIME = 0x606E:0;
        TARGET_TORQUE = 0x6071:0;
        TORQUE_DEMAND = 0x6074:0;
        RATED_CURRENT = 0x6075:0;
        RATED_TORQUE = 0x6076:0;
        TORQUE = 0x6077:0;
        CURRENT = 0x6078:0;
        TARGET_POSITION = 0x607A:0;
        POSITION_MIN = 0x607D:1;
        POSITION_MAX = 0x607D:2;
        MAX_PROFILE_VELOCITY = 0x607F:0;
        PROFILE_VELOCITY = 0x6081:0;
        PROFILE_ACCELERATION = 0x6083:0;
        PROFILE_DECELERATION = 0x6084:0;
        QUICK_STOP_DECELERATION = 0x6085:0;
        TORQUE_SLOPE = 0x6087:0;
        POSITION_OFFSET = 0x60B0:0;
        VELOCITY_OFFSET = 0x60B1:0;
        TORQUE_OFFSET = 0x60B2:0;
        INTERPOLATION_PERIOD = 0x60C2:1;
        INTERPOLATION_EXPONENT = 0x60C2:2;
        MAX_ACCELERATION = 0x60C5:0;
        MAX_DECELERATION = 0x60C6:0;
        FOLLOWING_ERROR = 0x60F4:0;
        TARGET_VELOCITY = 0x60FF:0;
        SUPPORTED_MODES = 0x6502:0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cob_id_defaults_contain_the_node_id() {
        let dictionary = ErobDictionary::new(5);
        assert_eq!(dictionary.get(place(0x1400, 1)), 0x205);
        assert_eq!(dictionary.get(place(0x1801, 1)), 0x8000_0285);
        assert_eq!(dictionary.get(place(0x1014, 0)), 0x85);
    }

    #[test]
    fn a_restore_brings_back_saved_parameters_but_not_set_points() {
        let mut dictionary = ErobDictionary::new(5);
        dictionary.set(at::PROFILE_VELOCITY, 77);
        dictionary.set(at::TARGET_POSITION, 88);
        dictionary.save();
        dictionary.set(at::PROFILE_VELOCITY, 1);
        dictionary.restore(0..=0xFFFF);
        assert_eq!((dictionary.get(at::PROFILE_VELOCITY), dictionary.get(at::TARGET_POSITION)), (77, 0));
    }

    #[test]
    fn signed_values_keep_their_sign_and_saturate() {
        let mut dictionary = ErobDictionary::new(5);
        dictionary.set_real(at::TORQUE, -5.0);
        assert_eq!((dictionary.get(at::TORQUE), dictionary.signed(at::TORQUE)), (0xFFFB, -5));
        dictionary.set_real(at::TORQUE, 1e9);
        assert_eq!(dictionary.signed(at::TORQUE), 32_767);
        dictionary.set_real(at::POSITION, -1e12);
        assert_eq!(dictionary.signed(at::POSITION), i32::MIN);
    }
}
