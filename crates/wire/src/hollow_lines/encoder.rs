//! The hollow encoder, which is polled over a serial port (section 10 of the manual). Its baud rate is not stated.

use std::f64::consts::TAU;

use super::motor_data::{COUNTS_PER_TURN, DATA_BYTES, position};
use super::transparent::TransparentFrame;

/// The identifier in the request and in the reply of the manual.
const ENCODER: u8 = 0x01;

/// The request for the position.
pub const REQUEST: TransparentFrame = TransparentFrame { id: ENCODER, data: [0; DATA_BYTES] };

/// A reading of the encoder. The manual does not say what the other bytes of the reply mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderReading {
    /// Counts.
    pub position: i64,
}

impl EncoderReading {
    /// The reading in a reply. Its identifier is not checked: an encoder answers with another one than a motor.
    pub fn of(reply: &TransparentFrame) -> Self {
        let [a, b, c, d, e, ..] = reply.data;
        Self { position: position([a, b, c, d, e]) }
    }

    /// The angle within one turn, 0 to 2π rad. It assumes the counts of the motors.
    pub fn angle(self) -> f64 {
        (self.position as f64 / COUNTS_PER_TURN).rem_euclid(1.0) * TAU
    }
}
