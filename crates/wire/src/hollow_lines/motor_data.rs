//! The 16 bytes of a command to a motor and of its reply: those of its CAN FD frames (section 4 of the manual).
//!
//! The simulated motor reads commands and writes replies. The other side is the layout of the family; here it is for the masters of
//! tests alone.

use std::f64::consts::TAU;

/// The bytes of a command and of a reply.
pub use takt_rt::transparent::DATA_BYTES;
use thiserror::Error;

/// Counts of one turn of the position.
pub const COUNTS_PER_TURN: f64 = 1_048_576.0;
/// The bits of the position.
const POSITION_BITS: u32 = 40;
/// The code of 1 kHz of electrical frequency.
const VELOCITY_ONE_KHZ: f64 = 8_388_608.0;
/// The code of 100 A.
const CURRENT_100_A: f64 = 32_768.0;

/// What a motor is led by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum MotorMode {
    /// The current.
    #[default]
    Torque = 0,
    /// The velocity; the current is its limit.
    Velocity = 1,
    /// The position; velocity and current are limits.
    Position = 2,
}

impl MotorMode {
    fn of(code: u8) -> Option<Self> {
        [Self::Torque, Self::Velocity, Self::Position].into_iter().find(|mode| *mode as u8 == code)
    }
}

/// What a motor is to do besides moving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MotorRun {
    /// No torque.
    #[default]
    Free,
    /// Move.
    Run,
    /// No torque; the present position becomes zero. The next command must not repeat it, or the motor does it again.
    FreeAndSetZero,
}

/// A command to a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorCommand {
    /// The position in counts, within 40 bits.
    pub position: i64,
    /// The velocity, as [`MotorScale`] has it.
    pub velocity: i32,
    /// The current, as [`MotorScale`] has it.
    pub current: i16,
    /// What the motor is led by.
    pub mode: MotorMode,
    /// Whether it moves.
    pub run: MotorRun,
    /// The gain of the position loop.
    pub kp: u8,
    /// The damping of the position loop.
    pub kd: u8,
}

/// The reply of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorReply {
    /// The position in counts.
    pub position: i64,
    /// The velocity, as [`MotorScale`] has it.
    pub velocity: i32,
    /// The current, as [`MotorScale`] has it.
    pub current: i16,
    /// What the motor is led by.
    pub mode: MotorMode,
    /// True if it runs; otherwise it is free.
    pub is_running: bool,
    /// The error code; 0 for none. The manual does not have it: working code reads it from the upper half of the run status.
    pub error: u8,
    /// °C
    pub temperature: i8,
    /// The identifier of the motor.
    pub id: u8,
}

/// What is wrong with a command or a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MotorDataError {
    /// The position does not fit into 40 bits.
    #[error("the position {counts} counts does not fit into 40 bits")]
    Position {
        /// Counts.
        counts: i64,
    },
    /// There is no such mode.
    #[error("byte 11 is {code}, and the modes are 0, 1 and 2")]
    Mode {
        /// The code.
        code: u8,
    },
    /// There is no such run state.
    #[error("byte 12 is 0x{code:02X}, whose lower half is neither 0 nor 1")]
    Run {
        /// The code.
        code: u8,
    },
    /// The zero is set only while the motor is free.
    #[error(
        "byte 15 is {code} while byte 12 is {run}: the zero is set by 1, and only while the motor is stopped"
    )]
    Zero {
        /// The code of the zero.
        code: u8,
        /// The code of the run state.
        run: u8,
    },
}

impl MotorCommand {
    /// The bytes of the command.
    ///
    /// # Errors
    /// [`MotorDataError::Position`] for a position beyond 40 bits.
    pub fn encode(&self) -> Result<[u8; DATA_BYTES], MotorDataError> {
        let [p0, p1, p2, p3, p4] = position_bytes(self.position)?;
        let [v0, v1, v2, v3] = self.velocity.to_be_bytes();
        let [c0, c1] = self.current.to_be_bytes();
        let (run, zero) = match self.run {
            MotorRun::Free => (0, 0),
            MotorRun::Run => (1, 0),
            MotorRun::FreeAndSetZero => (0, 1),
        };
        Ok([p0, p1, p2, p3, p4, v0, v1, v2, v3, c0, c1, self.mode as u8, run, self.kp, self.kd, zero])
    }

    /// Reads the bytes of a command.
    ///
    /// # Errors
    /// See [`MotorDataError`].
    pub fn decode(bytes: &[u8; DATA_BYTES]) -> Result<Self, MotorDataError> {
        let [p0, p1, p2, p3, p4, v0, v1, v2, v3, c0, c1, mode, run, kp, kd, zero] = *bytes;
        let run = match (run, zero) {
            (0, 0) => MotorRun::Free,
            (1, 0) => MotorRun::Run,
            (0, 1) => MotorRun::FreeAndSetZero,
            (0 | 1, code) => return Err(MotorDataError::Zero { code, run }),
            (code, _) => return Err(MotorDataError::Run { code }),
        };
        Ok(Self {
            position: position([p0, p1, p2, p3, p4]),
            velocity: i32::from_be_bytes([v0, v1, v2, v3]),
            current: i16::from_be_bytes([c0, c1]),
            mode: MotorMode::of(mode).ok_or(MotorDataError::Mode { code: mode })?,
            run,
            kp,
            kd,
        })
    }
}

impl MotorReply {
    /// The bytes of the reply.
    ///
    /// # Errors
    /// [`MotorDataError::Position`] for a position beyond 40 bits.
    pub fn encode(&self) -> Result<[u8; DATA_BYTES], MotorDataError> {
        let [p0, p1, p2, p3, p4] = position_bytes(self.position)?;
        let [v0, v1, v2, v3] = self.velocity.to_be_bytes();
        let [c0, c1] = self.current.to_be_bytes();
        let run = u8::from(self.is_running) | self.error << 4;
        let [temperature] = self.temperature.to_be_bytes();
        Ok([p0, p1, p2, p3, p4, v0, v1, v2, v3, c0, c1, self.mode as u8, run, 0, temperature, self.id])
    }

    /// Reads the bytes of a reply. The reserved byte 13 may have any value.
    ///
    /// # Errors
    /// See [`MotorDataError`].
    pub fn decode(bytes: &[u8; DATA_BYTES]) -> Result<Self, MotorDataError> {
        let [p0, p1, p2, p3, p4, v0, v1, v2, v3, c0, c1, mode, run, _, temperature, id] = *bytes;
        let is_running = match run & 0x0F {
            0 => false,
            1 => true,
            _ => return Err(MotorDataError::Run { code: run }),
        };
        Ok(Self {
            position: position([p0, p1, p2, p3, p4]),
            velocity: i32::from_be_bytes([v0, v1, v2, v3]),
            current: i16::from_be_bytes([c0, c1]),
            mode: MotorMode::of(mode).ok_or(MotorDataError::Mode { code: mode })?,
            is_running,
            error: run >> 4,
            temperature: i8::from_be_bytes([temperature]),
            id,
        })
    }
}

fn position_bytes(counts: i64) -> Result<[u8; 5], MotorDataError> {
    let [a, b, c, bytes @ ..] = counts.to_be_bytes();
    let sign = if counts < 0 { 0xFF } else { 0 };
    let is_sound = [a, b, c] == [sign; 3] && (bytes[0] & 0x80 != 0) == (counts < 0);
    if is_sound { Ok(bytes) } else { Err(MotorDataError::Position { counts }) }
}

/// The position of its five bytes, with its sign.
pub(super) fn position([a, b, c, d, e]: [u8; 5]) -> i64 {
    let shift = i64::BITS - POSITION_BITS;
    (i64::from_be_bytes([0, 0, 0, a, b, c, d, e]) << shift) >> shift
}

/// The scales of a motor. Its velocity is an electrical frequency, so it depends on the pole pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorScale {
    /// The pole pairs of the motor.
    pub pole_pairs: std::num::NonZeroU16,
}

impl MotorScale {
    /// rad/s of a velocity code.
    pub fn velocity(self, code: i32) -> f64 {
        f64::from(code) / VELOCITY_ONE_KHZ * 1_000.0 / f64::from(self.pole_pairs.get()) * TAU
    }

    /// The code of a velocity in rad/s; the largest one there is for more.
    pub fn velocity_code(self, velocity: f64) -> i32 {
        (velocity / TAU * f64::from(self.pole_pairs.get()) / 1_000.0 * VELOCITY_ONE_KHZ).round() as i32
    }

    /// A of a current code.
    pub fn current(self, code: i16) -> f64 {
        f64::from(code) / CURRENT_100_A * 100.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::num::NonZeroU16;

    proptest! {
        #[test]
        fn what_is_decoded_is_encoded_to_the_same_bytes(bytes in any::<[u8; DATA_BYTES]>(), mode in 0u8..3, run in 0u8..2) {
            let mut command = bytes;
            (command[11], command[12], command[15]) = (mode, run, bytes[15] & (1 - run));
            prop_assert_eq!(MotorCommand::decode(&command).unwrap().encode(), Ok(command));
            let mut reply = bytes;
            (reply[11], reply[12], reply[13]) = (mode, run | bytes[12] & 0xF0, 0);
            prop_assert_eq!(MotorReply::decode(&reply).unwrap().encode(), Ok(reply));
        }

        #[test]
        fn any_bytes_are_decoded_or_refused(bytes in any::<[u8; DATA_BYTES]>()) {
            let _ = MotorCommand::decode(&bytes);
            let _ = MotorReply::decode(&bytes);
        }
    }

    #[test]
    fn positions_have_forty_bits() {
        let command = |position| MotorCommand { position, ..MotorCommand::default() };
        for sound in [0, 1, -1, (1 << 39) - 1, -(1 << 39), -81_266_187] {
            let bytes = command(sound).encode().unwrap();
            assert_eq!(MotorCommand::decode(&bytes), Ok(command(sound)));
        }
        for counts in [1 << 39, -(1 << 39) - 1, i64::MAX, i64::MIN] {
            assert_eq!(command(counts).encode(), Err(MotorDataError::Position { counts }));
        }
    }

    #[test]
    fn what_no_motor_understands_is_refused() {
        let with = |place: usize, code| {
            let mut bytes = [0; DATA_BYTES];
            bytes[place] = code;
            MotorCommand::decode(&bytes)
        };
        assert_eq!(with(11, 3), Err(MotorDataError::Mode { code: 3 }));
        assert_eq!(with(12, 2), Err(MotorDataError::Run { code: 2 }));
        assert_eq!(with(15, 2), Err(MotorDataError::Zero { code: 2, run: 0 }));
        let mut both = [0; DATA_BYTES];
        (both[12], both[15]) = (1, 1);
        assert_eq!(MotorCommand::decode(&both), Err(MotorDataError::Zero { code: 1, run: 1 }));
    }

    #[test]
    fn the_scales_are_those_of_the_manual() {
        let scale = MotorScale { pole_pairs: NonZeroU16::new(14).unwrap() };
        // The manual: f = velocity / 8388608 * 1000 Hz, rpm = f * 60 / 14.
        assert!((scale.velocity(8_388_608) / TAU * 60.0 - 1_000.0 * 60.0 / 14.0).abs() < 1e-9);
        assert_eq!(scale.velocity_code(scale.velocity(-12_345)), -12_345);
        assert!((scale.current(8) - 0.0244).abs() < 1e-4);
        assert_eq!(scale.velocity_code(f64::MAX), i32::MAX);
    }
}
