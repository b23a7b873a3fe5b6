//! The PWM input: the width of a pulse to position, velocity and current, for each model (section 8 of the manual).

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use thiserror::Error;

/// The widths of pulses in µs.
const WIDTHS: RangeInclusive<f64> = 1_000.0..=2_000.0;
/// Between these widths the motor stands. The manual does not say so; it leaves them out.
const DEAD_BAND: RangeInclusive<f64> = 1_450.0..=1_550.0;
const MIDDLE: f64 = 1_500.0;

/// A model, with what its PWM input means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PwmModel {
    /// The name in the manual.
    pub name: &'static str,
    /// The lowest and the highest velocity in either direction, in Hz. The manual does not say whether it is electrical.
    pub velocity_hz: [f64; 2],
    /// The highest current in either direction, in A.
    pub current: f64,
}

const fn model(name: &'static str, velocity_hz: [f64; 2], current: f64) -> PwmModel {
    PwmModel { name, velocity_hz, current }
}

/// The models of the table.
pub const MODELS: [PwmModel; 8] = [
    model("HO4307", [0.1, 585.0], 0.74),
    model("HO5515", [0.1, 585.0], 0.74),
    model("HO6213", [10.0, 90.0], 3.71),
    model("HO7213 standard", [10.0, 90.0], 3.71),
    model("HO7213 high speed", [20.0, 495.0], 3.71),
    model("HO8110", [10.0, 450.0], 3.71),
    model("HO10010", [10.0, 450.0], 14.85),
    model("HO10025", [10.0, 450.0], 14.85),
];

/// What the width of a pulse stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PwmQuantity {
    /// rad, one turn in either direction.
    Position,
    /// Hz
    Velocity,
    /// A
    Current,
}

/// A width or a value that the input does not have.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PwmError {
    /// No pulse has this width.
    #[error("a pulse of {width_us} µs is out of range: 1000 to 2000 µs")]
    Width {
        /// µs
        width_us: f64,
    },
    /// The model does not have this value.
    #[error("{value} is out of range: 0, or {lowest} to {highest} in either direction")]
    Value {
        /// The value.
        value: f64,
        /// The smallest value other than zero.
        lowest: f64,
        /// The largest value.
        highest: f64,
    },
}

impl PwmModel {
    /// The smallest and the largest value in either direction.
    fn bounds(&self, quantity: PwmQuantity) -> [f64; 2] {
        match quantity {
            PwmQuantity::Position => [0.0, TAU],
            PwmQuantity::Velocity => self.velocity_hz,
            PwmQuantity::Current => [0.0, self.current],
        }
    }

    /// The width of the pulse in µs for a value.
    ///
    /// # Errors
    /// [`PwmError::Value`] for a value that the model does not have.
    pub fn width_us(&self, quantity: PwmQuantity, value: f64) -> Result<f64, PwmError> {
        let [lowest, highest] = self.bounds(quantity);
        let magnitude = value.abs();
        if !(magnitude <= highest && (magnitude >= lowest || magnitude == 0.0)) {
            return Err(PwmError::Value { value, lowest, highest });
        }
        let share = (magnitude - lowest) / (highest - lowest);
        let from_middle = match quantity {
            PwmQuantity::Position => share * (WIDTHS.end() - MIDDLE),
            _ if magnitude == 0.0 => 0.0,
            _ => DEAD_BAND.end() - MIDDLE + share * (WIDTHS.end() - DEAD_BAND.end()),
        };
        Ok(MIDDLE + from_middle.copysign(value))
    }

    /// The value of a width in µs.
    ///
    /// # Errors
    /// [`PwmError::Width`] for a width that no pulse has.
    pub fn value(&self, quantity: PwmQuantity, width_us: f64) -> Result<f64, PwmError> {
        if !WIDTHS.contains(&width_us) {
            return Err(PwmError::Width { width_us });
        }
        let [lowest, highest] = self.bounds(quantity);
        let from_middle = width_us - MIDDLE;
        let magnitude = match quantity {
            PwmQuantity::Position => from_middle.abs() / (WIDTHS.end() - MIDDLE) * highest,
            _ if width_us > *DEAD_BAND.start() && width_us < *DEAD_BAND.end() => return Ok(0.0),
            _ => {
                let beyond = from_middle.abs() - (DEAD_BAND.end() - MIDDLE);
                lowest + beyond / (WIDTHS.end() - DEAD_BAND.end()) * (highest - lowest)
            }
        };
        Ok(magnitude.copysign(from_middle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn named(name: &str) -> PwmModel {
        MODELS.into_iter().find(|model| model.name == name).unwrap()
    }

    #[test]
    fn the_ends_of_the_pulse_are_the_ends_of_the_tables() {
        for model in MODELS {
            let [slowest, fastest] = model.velocity_hz;
            for (quantity, value, width) in [
                (PwmQuantity::Position, -TAU, 1_000.0),
                (PwmQuantity::Position, 0.0, 1_500.0),
                (PwmQuantity::Position, TAU, 2_000.0),
                (PwmQuantity::Velocity, -fastest, 1_000.0),
                (PwmQuantity::Velocity, -slowest, 1_450.0),
                (PwmQuantity::Velocity, slowest, 1_550.0),
                (PwmQuantity::Velocity, fastest, 2_000.0),
                (PwmQuantity::Current, -model.current, 1_000.0),
                (PwmQuantity::Current, model.current, 2_000.0),
            ] {
                assert_eq!(model.width_us(quantity, value), Ok(width), "{} {quantity:?}", model.name);
                assert!((model.value(quantity, width).unwrap() - value).abs() < 1e-9, "{}", model.name);
            }
        }
    }

    #[test]
    fn the_models_have_the_limits_of_the_manual() {
        let limits = |name| (named(name).velocity_hz, named(name).current);
        assert_eq!(limits("HO4307"), ([0.1, 585.0], 0.74));
        assert_eq!(limits("HO7213 high speed"), ([20.0, 495.0], 3.71));
        assert_eq!(limits("HO10025"), ([10.0, 450.0], 14.85));
    }

    #[test]
    fn the_dead_band_stands_for_standing() {
        let motor = named("HO8110");
        for width in [1_450.1, 1_500.0, 1_549.9] {
            assert_eq!(motor.value(PwmQuantity::Velocity, width), Ok(0.0));
            assert_eq!(motor.value(PwmQuantity::Current, width), Ok(0.0));
        }
        assert_eq!(motor.width_us(PwmQuantity::Velocity, 0.0), Ok(1_500.0));
    }

    #[test]
    fn what_a_model_does_not_have_is_refused() {
        let motor = named("HO8110");
        for value in [9.9, -9.9, 450.1, f64::NAN, f64::INFINITY] {
            let refused = motor.width_us(PwmQuantity::Velocity, value).unwrap_err();
            assert!(refused.to_string().contains("10 to 450"), "{refused}");
        }
        for width in [999.9, 2_000.1, f64::NAN] {
            assert!(motor.value(PwmQuantity::Position, width).is_err());
        }
    }

    proptest! {
        #[test]
        fn a_value_comes_back_from_its_pulse(place in 0usize..MODELS.len(), share in -1.0f64..1.0) {
            let model = MODELS[place];
            for quantity in [PwmQuantity::Position, PwmQuantity::Velocity, PwmQuantity::Current] {
                let [lowest, highest] = model.bounds(quantity);
                let value = (lowest + share.abs() * (highest - lowest)).copysign(share);
                prop_assume!(value != 0.0);
                let width = model.width_us(quantity, value).unwrap();
                // The slowest value is at the edge of the dead band, where rounding decides.
                prop_assume!(quantity == PwmQuantity::Position || share.abs() > 1e-9);
                let back = model.value(quantity, width).unwrap();
                prop_assert!((back - value).abs() < 1e-9 * highest, "{back} {value}");
            }
        }
    }
}
