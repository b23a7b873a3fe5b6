//! What can be read and written in a module, and what of it is kept without power.

use takt_wire::modbus::exception::ExceptionCode;

use crate::commanded_module::{ControlMode, ModuleSettings, ramp};
use crate::profile_motions::MotionProfile;

/// The addresses of a module end before this one.
const END: usize = 0x100;

/// When a setting may be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writable {
    /// At any time.
    Always,
    /// Not while the motor is enabled. The manual writes these while it is disabled; that others are refused is the behaviour of the
    /// same module by its own CAN protocol.
    Disabled,
}

/// How a setting is written into registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Width {
    One,
    /// The high word has the lower address.
    Two,
}

/// A setting: its address, its width, its value from the factory, the values that it takes, and when it may be written.
type Factory = (u16, Width, i64, (i64, i64), Writable);

pub const SLAVE_ADDRESS: u16 = 0x0000;
pub const BIT_RATE: u16 = 0x0001;
pub const COMMUNICATION_TIMEOUT: u16 = 0x0002;
pub const OPERATION_MODE: u16 = 0x0040;
pub const MOTION_MODE: u16 = 0x0041;
pub const CONTROL_SOURCE: u16 = 0x0042;
pub const TARGET_POSITION: u16 = 0x0043;
pub const RELATIVE_POSITION: u16 = 0x0045;
pub const VELOCITY: u16 = 0x0047;
pub const ACCELERATION: u16 = 0x0049;
pub const DECELERATION: u16 = 0x004B;
pub const DWELL_TIME: u16 = 0x004D;
pub const TARGET_CURRENT: u16 = 0x004F;
pub const TARGET_VELOCITY: u16 = 0x0051;
pub const REACHED_WINDOW: u16 = 0x0079;
pub const REACHED_TIME: u16 = 0x007A;
pub const MAXIMUM_VELOCITY: u16 = 0x00B5;
pub const POSITION_ERROR: u16 = 0x00B9;
pub const POSITION_MINIMUM: u16 = 0x00BD;
pub const POSITION_MAXIMUM: u16 = 0x00BF;
pub const TORQUE_VELOCITY_LIMIT: u16 = 0x00D8;

/// Units of 0.05 ms.
pub const FIFTY_MICROSECONDS: u64 = 50_000;

const WORD: (i64, i64) = (0, u16::MAX as i64);
const SIGNED_WORD: (i64, i64) = (i16::MIN as i64, i16::MAX as i64);
const DOUBLE: (i64, i64) = (0, u32::MAX as i64);
const SIGNED_DOUBLE: (i64, i64) = (i32::MIN as i64, i32::MAX as i64);

use Width::{One, Two};
use Writable::{Always, Disabled};

/// In the order of their addresses.
const FACTORY: [Factory; 37] = [
    (SLAVE_ADDRESS, One, 1, (1, 247), Always),
    (BIT_RATE, One, 4, (1, 4), Always),
    (COMMUNICATION_TIMEOUT, One, 0, (0, 4_000), Always),
    (0x0030, One, 100, WORD, Always),
    (0x0031, One, 100, WORD, Always),
    (0x0032, One, 20, WORD, Always),
    (OPERATION_MODE, One, 3, (1, 3), Disabled),
    (MOTION_MODE, One, 1, (0, 2), Always),
    (CONTROL_SOURCE, One, 0, (0, 1), Disabled),
    (TARGET_POSITION, Two, 0, SIGNED_DOUBLE, Always),
    (RELATIVE_POSITION, Two, 0, SIGNED_DOUBLE, Always),
    (VELOCITY, Two, 5_566, SIGNED_DOUBLE, Always),
    (ACCELERATION, Two, 5_566, DOUBLE, Always),
    (DECELERATION, Two, 5_566, DOUBLE, Always),
    (DWELL_TIME, Two, 0, DOUBLE, Always),
    (TARGET_CURRENT, Two, 0, SIGNED_DOUBLE, Always),
    (TARGET_VELOCITY, Two, 0, SIGNED_DOUBLE, Always),
    (REACHED_WINDOW, One, 50, WORD, Always),
    (REACHED_TIME, One, 400, WORD, Always),
    (0x00B0, Two, 6_300, DOUBLE, Always),
    (0x00B2, Two, 12_600, DOUBLE, Always),
    (0x00B4, One, 1_000, WORD, Always),
    (MAXIMUM_VELOCITY, Two, 262_144, DOUBLE, Always),
    (0x00B7, Two, 1_000_000, DOUBLE, Always),
    (POSITION_ERROR, Two, 10_484, DOUBLE, Always),
    (0x00BB, Two, 84_000, DOUBLE, Always),
    (POSITION_MINIMUM, Two, i32::MIN as i64, SIGNED_DOUBLE, Always),
    (POSITION_MAXIMUM, Two, i32::MAX as i64, SIGNED_DOUBLE, Always),
    (0x00C1, Two, 20_000, DOUBLE, Always),
    (0x00C3, Two, 20_000, DOUBLE, Always),
    (0x00C5, Two, 7_560, DOUBLE, Always),
    (0x00C7, Two, 100, DOUBLE, Always),
    (0x00C9, One, 20_000, WORD, Always),
    (0x00CA, Two, 20_000, DOUBLE, Always),
    (0x00CC, Two, 60_000, DOUBLE, Always),
    (0x00D1, One, 85, SIGNED_WORD, Always),
    (TORQUE_VELOCITY_LIMIT, Two, 0, SIGNED_DOUBLE, Disabled),
];

/// The settings of a module.
#[derive(Clone, Debug)]
pub struct Settings {
    present: [u16; END],
    saved: [u16; END],
}

impl Settings {
    /// Those from the factory, but for the address of the slave and the code of its bit rate.
    pub fn new(address: u8, bit_rate_code: u16) -> Self {
        let mut settings = Self { present: [0; END], saved: [0; END] };
        for (address, _, value, ..) in &FACTORY {
            settings.set(*address, *value);
        }
        settings.set(SLAVE_ADDRESS, address.into());
        settings.set(BIT_RATE, bit_rate_code.into());
        settings.saved = settings.present;
        settings
    }

    /// The word of an address, if it belongs to a setting.
    pub fn word(&self, address: u16) -> Option<u16> {
        owner(address)?;
        self.present.get(usize::from(address)).copied()
    }

    /// The value of a setting; 0 if there is none.
    pub fn get(&self, address: u16) -> i64 {
        let word = |address: u16| i64::from(self.present.get(usize::from(address)).copied().unwrap_or(0));
        match owner(address) {
            Some((start, Two, _, (lowest, _), _)) => {
                let bits = (word(*start) << 16 | word(*start + 1)) as u32;
                if *lowest < 0 { bits.cast_signed().into() } else { bits.into() }
            }
            Some((start, One, _, (lowest, _), _)) => {
                let bits = word(*start) as u16;
                if *lowest < 0 { bits.cast_signed().into() } else { bits.into() }
            }
            None => 0,
        }
    }

    /// Changes a setting that is there.
    pub fn set(&mut self, address: u16, value: i64) {
        let Some((start, width, ..)) = owner(address) else { return };
        let at = usize::from(*start);
        match width {
            One => self.present[at] = value as u16,
            Two => {
                self.present[at] = (value >> 16) as u16;
                self.present[at + 1] = value as u16;
            }
        }
    }

    /// Writes words from an address on: all of them, or none.
    ///
    /// # Errors
    /// There is no such setting; half of a number of 32 bits is missing (the manual writes both halves at once); a setting does not take
    /// the value, or not now.
    pub fn write(&mut self, start: u16, words: &[u16], is_enabled: bool) -> Result<(), ExceptionCode> {
        let mut changed = self.clone();
        let (mut address, mut left) = (start, words);
        while let [first, rest @ ..] = left {
            let setting = owner(address).filter(|(begin, ..)| *begin == address);
            let (_, width, _, (lowest, highest), writable) = setting.ok_or(ExceptionCode::ILLEGAL_ADDRESS)?;
            let (value, count, rest) = match (width, rest) {
                (One, rest) => (
                    i64::from(if *lowest < 0 { first.cast_signed() as i32 } else { i32::from(*first) }),
                    1,
                    rest,
                ),
                (Two, [second, rest @ ..]) => {
                    let bits = u32::from(*first) << 16 | u32::from(*second);
                    (if *lowest < 0 { bits.cast_signed().into() } else { bits.into() }, 2, rest)
                }
                (Two, []) => return Err(ExceptionCode::ILLEGAL_VALUE),
            };
            if value < *lowest || value > *highest {
                return Err(ExceptionCode::ILLEGAL_VALUE);
            }
            if *writable == Disabled && is_enabled && value != self.get(address) {
                return Err(ExceptionCode::DEVICE_FAILURE);
            }
            changed.set(address, value);
            address = address.saturating_add(count);
            left = rest;
        }
        *self = changed;
        Ok(())
    }

    /// What shapes the motions.
    pub fn of_module(&self) -> ModuleSettings {
        let number = |address| self.get(address) as f64;
        let fifty_microseconds =
            |address| u64::try_from(self.get(address)).unwrap_or(0).saturating_mul(FIFTY_MICROSECONDS);
        let mode = ControlMode::of(self.get(OPERATION_MODE));
        let most = number(MAXIMUM_VELOCITY);
        ModuleSettings {
            mode,
            motion_mode: self.get(MOTION_MODE),
            target: number(TARGET_POSITION),
            distance: number(RELATIVE_POSITION),
            profile: MotionProfile {
                velocity: number(VELOCITY).clamp(-most, most),
                acceleration: ramp(number(ACCELERATION)),
                deceleration: ramp(number(DECELERATION)),
                quick_stop: 1e6,
                dwell_ns: fifty_microseconds(DWELL_TIME),
                positions: (number(POSITION_MINIMUM), number(POSITION_MAXIMUM)),
            },
            set_point: number(if mode == ControlMode::Torque { TARGET_CURRENT } else { TARGET_VELOCITY }),
            // As in the manual's example: the joint moves with 0.
            velocity_limit: match self.get(TORQUE_VELOCITY_LIMIT) {
                0 => f64::INFINITY,
                limit => limit.unsigned_abs() as f64,
            },
            position_error: number(POSITION_ERROR),
            window: number(REACHED_WINDOW),
            settling_ns: fifty_microseconds(REACHED_TIME),
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
        for address in [TARGET_POSITION, RELATIVE_POSITION, TARGET_CURRENT, TARGET_VELOCITY] {
            self.set(address, 0);
        }
    }
}

/// The setting that an address belongs to.
fn owner(address: u16) -> Option<&'static Factory> {
    let after = FACTORY.partition_point(|(start, ..)| *start <= address);
    let setting = FACTORY.get(after.checked_sub(1)?)?;
    let words = if setting.1 == Two { 2 } else { 1 };
    (address - setting.0 < words).then_some(setting)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings::new(7, 4)
    }

    #[test]
    fn the_settings_stand_in_the_order_of_their_addresses() {
        assert!(FACTORY.is_sorted_by_key(|(address, ..)| *address));
        assert_eq!(
            (settings().word(0x0003), settings().word(0x00CE), settings().word(0xFFFF)),
            (None, None, None)
        );
        assert_eq!(
            (settings().get(SLAVE_ADDRESS), settings().get(POSITION_MINIMUM)),
            (7, i64::from(i32::MIN))
        );
    }

    #[test]
    fn a_write_that_is_refused_in_part_changes_nothing() {
        let mut settings = settings();
        assert_eq!(settings.write(TARGET_POSITION, &[0xFFFF, 0xFFFE], true), Ok(()));
        assert_eq!(settings.get(TARGET_POSITION), -2);
        for (start, words, code) in [
            (TARGET_POSITION, &[1][..], ExceptionCode::ILLEGAL_VALUE),
            (TARGET_POSITION + 1, &[1], ExceptionCode::ILLEGAL_ADDRESS),
            (TARGET_VELOCITY, &[1, 1, 1], ExceptionCode::ILLEGAL_ADDRESS),
            (MOTION_MODE, &[3], ExceptionCode::ILLEGAL_VALUE),
            (OPERATION_MODE, &[2, 0], ExceptionCode::DEVICE_FAILURE),
            (0x00FF, &[1], ExceptionCode::ILLEGAL_ADDRESS),
        ] {
            assert_eq!(settings.write(start, words, true), Err(code), "{start:04X}");
        }
        assert_eq!((settings.get(TARGET_POSITION), settings.get(TARGET_VELOCITY)), (-2, 0));
    }

    #[test]
    fn what_was_saved_is_there_after_the_power_was_off_and_commands_are_not() {
        let mut settings = settings();
        settings.set(VELOCITY, 1_000);
        settings.set(TARGET_VELOCITY, 500);
        settings.save();
        settings.set(VELOCITY, 3_000);
        settings.restore();
        assert_eq!((settings.get(VELOCITY), settings.get(TARGET_VELOCITY)), (1_000, 0));
    }
}
