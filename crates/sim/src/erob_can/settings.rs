//! What can be written to a module, and what of it is kept without power.

use crate::commanded_module::{ControlMode, ModuleSettings, STEEPEST, ramp};
use crate::profile_motions::MotionProfile;

/// When a setting may be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writable {
    /// At any time.
    Always,
    /// Not while the joint moves (error 0015).
    AtRest,
    /// Not while the motor is enabled (error 0016).
    Disabled,
}

/// A setting: its index, its value from the factory, and when it may be written.
type Factory = (u16, i32, Writable);

pub const CAN_ADDRESS: u16 = 0x0043;
pub const OPERATING_MODE: u16 = 0x004E;
/// Torque, velocity, position, and what the manual calls a pure loader model.
pub const OPERATING_MODES: std::ops::RangeInclusive<i32> = 1..=4;
pub const MAXIMUM_VELOCITY: u16 = 0x0050;
pub const POSITION_MINIMUM: u16 = 0x0052;
pub const POSITION_MAXIMUM: u16 = 0x0053;
pub const POSITION_ERROR: u16 = 0x0054;
pub const TARGET_POSITION: u16 = 0x0086;
pub const RELATIVE_POSITION: u16 = 0x0087;
pub const ACCELERATION: u16 = 0x0088;
pub const DECELERATION: u16 = 0x0089;
pub const VELOCITY: u16 = 0x008A;
pub const QUICK_STOP: u16 = 0x008C;
pub const MOTION_MODE: u16 = 0x008D;
pub const DWELL_TIME: u16 = 0x0093;
pub const LIMITS_APPLY: u16 = 0x009E;
pub const POSITIONED_THRESHOLD: u16 = 0x0109;
pub const POSITIONED_TIME: u16 = 0x010A;
pub const SET_POINT: u16 = 0x01FE;
pub const TORQUE_VELOCITY_LIMIT: u16 = 0x0204;

/// In the order of their indices.
const FACTORY: [Factory; 35] = [
    (CAN_ADDRESS, 1, Writable::Disabled),
    (OPERATING_MODE, 3, Writable::Disabled),
    (MAXIMUM_VELOCITY, 262_144, Writable::Always),
    (POSITION_MINIMUM, i32::MIN, Writable::Always),
    (POSITION_MAXIMUM, i32::MAX, Writable::Always),
    (POSITION_ERROR, 10_484, Writable::Always),
    (0x0055, 84_000, Writable::Always),
    (0x0056, 7_560, Writable::Always),
    (0x0057, 100, Writable::Always),
    (0x0058, 20_000, Writable::Always),
    (0x0062, 20_000, Writable::Disabled),
    (0x0063, 20_000, Writable::Disabled),
    (0x0064, 100, Writable::Always),
    (0x0066, 100, Writable::Always),
    (0x0067, 100, Writable::Always),
    (TARGET_POSITION, 0, Writable::Always),
    (RELATIVE_POSITION, 0, Writable::Always),
    (ACCELERATION, 5_566, Writable::Always),
    (DECELERATION, 5_566, Writable::Always),
    (VELOCITY, 5_566, Writable::Always),
    (0x008B, 0, Writable::AtRest),
    (QUICK_STOP, 1_000_000, Writable::Always),
    (MOTION_MODE, 1, Writable::AtRest),
    (DWELL_TIME, 0, Writable::Always),
    (LIMITS_APPLY, 1, Writable::AtRest),
    (0x00FD, 1_000, Writable::Always),
    (0x00FF, 1, Writable::Disabled),
    (POSITIONED_THRESHOLD, 50, Writable::Always),
    (POSITIONED_TIME, 20, Writable::Always),
    (0x0112, 0, Writable::Disabled),
    (0x0124, 0, Writable::Always),
    (0x0129, 1_200, Writable::Disabled),
    (0x01FD, 0, Writable::Always),
    (SET_POINT, 0, Writable::Always),
    (TORQUE_VELOCITY_LIMIT, 0, Writable::Disabled),
];

/// The settings of a module.
#[derive(Clone, Debug)]
pub struct Settings {
    present: [i32; FACTORY.len()],
    saved: [i32; FACTORY.len()],
    /// True if the velocity limit of torque control may be written at any time, as some firmware seems to allow.
    has_free_velocity_limit: bool,
}

impl Settings {
    /// Those from the factory, but for the node ID.
    pub fn new(node: u8, has_free_velocity_limit: bool) -> Self {
        let mut settings = FACTORY.map(|(_, value, _)| value);
        if let Some(address) = place(CAN_ADDRESS) {
            settings[address] = node.into();
        }
        Self { present: settings, saved: settings, has_free_velocity_limit }
    }

    /// The value of a setting.
    pub fn value(&self, index: u16) -> Option<i32> {
        place(index).map(|place| self.present[place])
    }

    /// The value of a setting that is known to be there.
    pub fn get(&self, index: u16) -> f64 {
        self.value(index).unwrap_or(0).into()
    }

    /// When a setting may be written; `None` if there is no such setting.
    pub fn writable(&self, index: u16) -> Option<Writable> {
        match index {
            TORQUE_VELOCITY_LIMIT if self.has_free_velocity_limit => Some(Writable::Always),
            _ => place(index).map(|place| FACTORY[place].2),
        }
    }

    /// Writes a setting that is there.
    pub fn set(&mut self, index: u16, value: i32) {
        if let Some(place) = place(index) {
            self.present[place] = value;
        }
    }

    /// What shapes the motions.
    pub fn of_module(&self) -> ModuleSettings {
        let settling_ms = self.value(POSITIONED_TIME).and_then(|ms| u64::try_from(ms).ok()).unwrap_or(0);
        ModuleSettings {
            mode: ControlMode::of(self.value(OPERATING_MODE).unwrap_or(0).into()),
            motion_mode: self.value(MOTION_MODE).unwrap_or(0).into(),
            target: self.get(TARGET_POSITION),
            distance: self.get(RELATIVE_POSITION),
            profile: self.profile(),
            set_point: self.get(SET_POINT),
            velocity_limit: self.get(TORQUE_VELOCITY_LIMIT).abs(),
            position_error: self.get(POSITION_ERROR),
            window: self.get(POSITIONED_THRESHOLD),
            settling_ns: settling_ms.saturating_mul(1_000_000),
        }
    }

    fn profile(&self) -> MotionProfile {
        let most = self.get(MAXIMUM_VELOCITY);
        let dwell_ms = self.value(DWELL_TIME).and_then(|ms| u64::try_from(ms).ok()).unwrap_or(0);
        MotionProfile {
            velocity: self.get(VELOCITY).clamp(-most, most),
            acceleration: self.rate(ACCELERATION),
            deceleration: self.rate(DECELERATION),
            quick_stop: self.get(QUICK_STOP),
            dwell_ns: dwell_ms.saturating_mul(1_000_000),
            positions: (self.get(POSITION_MINIMUM), self.get(POSITION_MAXIMUM)),
        }
    }

    /// Without limits of their own, motions change the velocity at once.
    fn rate(&self, index: u16) -> f64 {
        match self.value(LIMITS_APPLY) {
            Some(0) => STEEPEST,
            _ => ramp(self.get(index)),
        }
    }

    /// Keeps the present values without power.
    pub fn save(&mut self) {
        self.saved = self.present;
    }

    /// The values after the power was off.
    pub fn restore(&mut self) {
        self.present = self.saved;
        // What commands a motion is no parameter.
        for index in [TARGET_POSITION, RELATIVE_POSITION, SET_POINT] {
            self.set(index, 0);
        }
    }
}

fn place(index: u16) -> Option<usize> {
    FACTORY.binary_search_by_key(&index, |(index, ..)| *index).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_stand_in_the_order_of_their_indices() {
        assert!(FACTORY.is_sorted_by_key(|(index, ..)| *index));
    }

    #[test]
    fn what_was_saved_is_there_after_the_power_was_off_and_commands_are_not() {
        let mut settings = Settings::new(7, false);
        settings.set(VELOCITY, 1000);
        settings.save();
        settings.set(VELOCITY, 2000);
        settings.set(SET_POINT, 500);
        settings.save();
        settings.set(VELOCITY, 3000);
        settings.restore();
        assert_eq!((settings.get(VELOCITY), settings.get(SET_POINT)), (2000.0, 0.0));
        assert_eq!(settings.value(CAN_ADDRESS), Some(7));
    }
}
