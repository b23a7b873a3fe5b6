//! Bits 10 to 13 of the statusword of an enabled axis, by its mode (CiA 402-2).

use takt_rt::{OperationMode, controlword, statusword};

use super::{Actual, Motion};
use crate::cia402::profile::Profile;

/// A velocity below which an axis stands, where the data sheet lacks object 606F: a share of its highest one.
const STANDSTILL: f64 = 0.002;

impl Motion {
    /// The bits after a step of `duration_s`.
    pub fn status_bits(&mut self, actual: Actual, word: u16, profile: &Profile<'_>, duration_s: f64) -> u16 {
        let is_reached = self.is_target_reached(actual, word, profile, duration_s);
        let bit_12 = match self.mode {
            _ if self.has_set_points() => self.set_points.is_acknowledged,
            Some(OperationMode::ProfileVelocity) => self.stands(actual, profile),
            Some(OperationMode::Homing) => self.homing.is_done(),
            Some(OperationMode::InterpolatedPosition) => word & controlword::BIT_4 != 0,
            Some(
                OperationMode::CyclicSynchronousPosition
                | OperationMode::CyclicSynchronousVelocity
                | OperationMode::CyclicSynchronousTorque,
            ) => true,
            _ => false,
        };
        let bit_13 = match self.mode {
            Some(OperationMode::Homing) => self.homing.has_failed(),
            _ => self.has_following_error,
        };
        let bits = [
            (is_reached, statusword::TARGET_REACHED),
            (self.is_limited, statusword::INTERNAL_LIMIT),
            (bit_12, statusword::BIT_12),
            (bit_13, statusword::BIT_13),
        ];
        bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |word, (_, bit)| word | bit)
    }

    fn stands(&self, actual: Actual, profile: &Profile<'_>) -> bool {
        let threshold = profile.dictionary.real_at(profile.places.velocity_threshold);
        let threshold = threshold.map_or(0.0, |threshold| threshold * profile.units.velocity);
        actual.velocity.abs() <= threshold.max(STANDSTILL * profile.highest_velocity)
    }

    fn is_target_reached(
        &mut self,
        actual: Actual,
        word: u16,
        profile: &Profile<'_>,
        duration_s: f64,
    ) -> bool {
        let places = profile.places;
        // A window is at least one count wide.
        let window = profile.real(places.position_window).max(1.0);
        let window_time_s = profile.milliseconds(places.position_window_time);
        let is_halted = word & controlword::HALT != 0;
        let is_near = |target: f64| (target - actual.position).abs() <= window;
        let (is_within, time_s) = match self.mode {
            Some(
                OperationMode::ProfilePosition
                | OperationMode::ProfileVelocity
                | OperationMode::ProfileTorque
                | OperationMode::Homing
                | OperationMode::InterpolatedPosition,
            ) if is_halted => (self.stands(actual, profile), 0.0),
            Some(OperationMode::ProfileVelocity) => {
                let target = profile.real(places.target_velocity) * profile.units.velocity;
                let window = profile.real(places.velocity_window) * profile.units.velocity;
                let distance = (target - actual.velocity).abs();
                let is_within = distance <= window.max(STANDSTILL * profile.highest_velocity);
                (is_within, profile.milliseconds(places.velocity_window_time))
            }
            Some(OperationMode::ProfileTorque) => (self.torque == profile.real(places.target_torque), 0.0),
            Some(OperationMode::Homing) => (!self.homing.is_running() && self.stands(actual, profile), 0.0),
            _ if self.has_set_points() => {
                (self.set_points.active.is_none() && is_near(self.generator.position), window_time_s)
            }
            Some(OperationMode::CyclicSynchronousPosition | OperationMode::InterpolatedPosition) => {
                (is_near(self.generator.target), window_time_s)
            }
            _ => (false, 0.0),
        };
        self.in_window_s = if is_within { self.in_window_s + duration_s } else { 0.0 };
        is_within && self.in_window_s > time_s
    }
}
