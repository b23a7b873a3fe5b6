//! The motion bits of the statusword: target reached, internal limit, set-point acknowledged.

use takt_rt::{OperationMode, controlword, statusword};

use super::ErobMotion;
use crate::erob::objects::at;
use crate::motion::{ARRIVED, Actual};
use crate::object_dictionary::SimulatedDictionary;

impl ErobMotion {
    /// Statusword bits 10 to 13 of an enabled drive, after a step of `duration_s`.
    #[inline]
    pub fn status_bits(
        &mut self,
        actual: Actual,
        word: u16,
        dictionary: &SimulatedDictionary,
        duration_s: f64,
    ) -> u16 {
        let is_reached = self.is_target_reached(actual, word, dictionary, duration_s);
        let bit_12 = if self.is_profile_position() {
            self.set_points.is_acknowledged
        } else {
            !matches!(self.mode, Some(OperationMode::ProfileVelocity)) || actual.velocity.abs() < ARRIVED
        };
        let mut bits = 0;
        for (is_set, bit) in [
            (is_reached, statusword::TARGET_REACHED),
            (self.is_limited, statusword::INTERNAL_LIMIT),
            (bit_12, statusword::BIT_12),
        ] {
            if is_set {
                bits |= bit;
            }
        }
        bits
    }

    fn is_target_reached(
        &mut self,
        actual: Actual,
        word: u16,
        dictionary: &SimulatedDictionary,
        duration_s: f64,
    ) -> bool {
        let milliseconds = |at| dictionary.real(at) * 1e-3;
        let position_window = f64::from(dictionary.number(at::POSITION_WINDOW) as u32);
        let (is_within, time_s) = match self.mode {
            _ if word & controlword::HALT != 0 && !self.is_cyclic() => (actual.velocity.abs() < 100.0, 0.0),
            Some(OperationMode::ProfileVelocity) => {
                let distance = dictionary.real(at::TARGET_VELOCITY) - actual.velocity;
                (
                    distance.abs() <= f64::from(dictionary.number(at::VELOCITY_WINDOW) as u16),
                    milliseconds(at::VELOCITY_WINDOW_TIME),
                )
            }
            Some(OperationMode::ProfileTorque) => (self.torque == dictionary.real(at::TARGET_TORQUE), 0.0),
            Some(OperationMode::CyclicSynchronousPosition) => {
                let distance = self.generator.target - actual.position;
                (distance.abs() <= position_window, milliseconds(at::POSITION_WINDOW_TIME))
            }
            Some(OperationMode::ProfilePosition | OperationMode::InterpolatedPosition) => {
                let is_done = self.set_points.active.is_none();
                let distance = self.generator.position - actual.position;
                (is_done && distance.abs() <= position_window, milliseconds(at::POSITION_WINDOW_TIME))
            }
            _ => (false, 0.0),
        };
        self.in_window_s = if is_within { self.in_window_s + duration_s } else { 0.0 };
        is_within && self.in_window_s > time_s
    }
}
