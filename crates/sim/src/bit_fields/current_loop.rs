//! The current loop of a motor: how fast and how exactly the torque is the demanded one.

/// Time constant of the loop with its preset gains: s. It is much faster than the loops above it.
const TIME_S: f64 = 0.000_02;
/// The share of the demand that is missing without an integral part, with the preset proportional gain.
const DROOP: f64 = 0.05;

/// A first-order loop with factors for its gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoop {
    /// Factor of the proportional gain: without any there is no torque.
    pub kp: f64,
    /// Factor of the integral gain: without any the torque stays below the demand.
    pub ki: f64,
    torque: f64,
}

impl Default for CurrentLoop {
    /// With the preset gains.
    fn default() -> Self {
        Self { kp: 1.0, ki: 1.0, torque: 0.0 }
    }
}

impl CurrentLoop {
    /// The motor has no current.
    pub fn reset(&mut self) {
        self.torque = 0.0;
    }

    /// The torque after this time under a demand.
    pub fn step(&mut self, demand: f64, duration_s: f64) -> f64 {
        // The integral part takes away what the proportional part leaves.
        let reached = if self.ki > 0.0 { 1.0 } else { self.kp / (self.kp + DROOP) };
        let reached = if self.kp > 0.0 { reached } else { 0.0 };
        let share = 1.0 - (-duration_s * self.kp.max(0.0) / TIME_S).exp();
        let share = if self.kp > 0.0 { share } else { 1.0 };
        self.torque += share * (demand * reached - self.torque);
        self.torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(gains: CurrentLoop, time_s: f64) -> f64 {
        let mut current_loop = gains;
        let steps = (time_s / 1e-5).round() as usize;
        (0..steps).fold(0.0, |_, _| current_loop.step(1.0, 1e-5))
    }

    #[test]
    fn a_higher_gain_is_faster_and_an_integral_part_leaves_no_error() {
        let preset = CurrentLoop::default();
        assert!((after(preset, 0.01) - 1.0).abs() < 1e-6);
        assert!(after(CurrentLoop { kp: 2.0, ..preset }, 0.00002) > after(preset, 0.00002) + 0.1);
        let without = CurrentLoop { ki: 0.0, ..preset };
        assert!((after(without, 0.01) - 1.0 / 1.05).abs() < 1e-6);
        assert_eq!(after(CurrentLoop { kp: 0.0, ..preset }, 0.01), 0.0);
    }
}
