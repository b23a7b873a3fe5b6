//! The stiffness of a motor behind the pulse module (section 6 of the manual).
//!
//! The manual contradicts itself in the first byte: its text says 0x00, its example has 0x01, which is the identifier that the
//! motor must have there. It says neither the baud rate nor whether a checksum follows.

use thiserror::Error;

/// The bytes of a setting.
pub const SETTING_BYTES: usize = 6;
/// The first byte of the printed example.
pub const FIRST_BYTE_OF_EXAMPLE: u8 = 0x01;

/// A loop gain that is multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LoopGain {
    /// Proportional gain of the velocity loop.
    VelocityKp = 2,
    /// Integral gain of the velocity loop.
    VelocityKi = 3,
    /// Proportional gain of the current loop.
    CurrentKp = 4,
    /// Integral gain of the current loop.
    CurrentKi = 5,
}

/// A setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StiffnessSetting {
    /// The gains of the position loop.
    PositionLoop {
        /// Stiffness.
        p: u8,
        /// Damping.
        d: u8,
    },
    /// A preset gain is multiplied; 1 leaves it as it is.
    Multiplier {
        /// The gain.
        gain: LoopGain,
        /// The factor: finite, not negative.
        factor: f32,
    },
}

/// What is wrong with a setting.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SettingError {
    /// No gain can be multiplied by this.
    #[error("a gain cannot be multiplied by {factor}: the factor is a number from 0 on")]
    Factor {
        /// The factor.
        factor: f32,
    },
    /// No setting has this index.
    #[error("byte 2 is {index}: the settings are 1 to 5")]
    Index {
        /// The index.
        index: u8,
    },
    /// The unused bytes are not zero.
    #[error("bytes 5 and 6 of the position loop must be 0")]
    Unused,
}

impl StiffnessSetting {
    /// The bytes of the setting, with this first byte.
    ///
    /// # Errors
    /// [`SettingError::Factor`] for a factor that no gain can have.
    pub fn encode(self, first: u8) -> Result<[u8; SETTING_BYTES], SettingError> {
        match self {
            Self::PositionLoop { p, d } => Ok([first, 1, p, d, 0, 0]),
            Self::Multiplier { factor, .. } if !is_factor(factor) => Err(SettingError::Factor { factor }),
            Self::Multiplier { gain, factor } => {
                let [a, b, c, d] = factor.to_be_bytes();
                Ok([first, gain as u8, a, b, c, d])
            }
        }
    }

    /// Reads the bytes of a setting. Returns the first byte, too.
    ///
    /// # Errors
    /// See [`SettingError`].
    pub fn decode(bytes: &[u8; SETTING_BYTES]) -> Result<(u8, Self), SettingError> {
        let [first, index, a, b, c, d] = *bytes;
        let gain = match (index, [c, d]) {
            (1, [0, 0]) => return Ok((first, Self::PositionLoop { p: a, d: b })),
            (1, _) => return Err(SettingError::Unused),
            (2, _) => LoopGain::VelocityKp,
            (3, _) => LoopGain::VelocityKi,
            (4, _) => LoopGain::CurrentKp,
            (5, _) => LoopGain::CurrentKi,
            _ => return Err(SettingError::Index { index }),
        };
        let factor = f32::from_be_bytes([a, b, c, d]);
        if !is_factor(factor) {
            return Err(SettingError::Factor { factor });
        }
        Ok((first, Self::Multiplier { gain, factor }))
    }
}

fn is_factor(factor: f32) -> bool {
    factor.is_finite() && factor >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_multiplier_is_a_big_endian_float() {
        let setting = StiffnessSetting::Multiplier { gain: LoopGain::CurrentKi, factor: 1.0 };
        let bytes = [0, 5, 0x3F, 0x80, 0, 0];
        assert_eq!(setting.encode(0), Ok(bytes));
        assert_eq!(StiffnessSetting::decode(&bytes), Ok((0, setting)));
    }

    #[test]
    fn what_is_no_setting_is_refused() {
        for factor in [-1.0, f32::INFINITY, f32::NEG_INFINITY] {
            let setting = StiffnessSetting::Multiplier { gain: LoopGain::VelocityKp, factor };
            assert_eq!(setting.encode(0), Err(SettingError::Factor { factor }));
        }
        let nan = StiffnessSetting::Multiplier { gain: LoopGain::VelocityKp, factor: f32::NAN };
        assert!(nan.encode(0).is_err());
        assert!(StiffnessSetting::decode(&[0, 2, 0x7F, 0xC0, 0, 0]).is_err());
        assert_eq!(StiffnessSetting::decode(&[0, 6, 0, 0, 0, 0]), Err(SettingError::Index { index: 6 }));
        assert_eq!(StiffnessSetting::decode(&[0, 1, 0, 0, 0, 1]), Err(SettingError::Unused));
    }
}
