//! The pins for encoder pulses: the parameter STEP_CONFIG (section 9 of the manual).

use thiserror::Error;

/// How long a pulse is.
const PULSE_S: f64 = 0.001;
/// More than a turn between two pulses makes no sense.
const DEGREES_AT_MOST: u16 = 360;

/// What the pins of the encoder are used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderOutput {
    /// They are the input of the vendor's encoder behind the reducer.
    Input,
    /// A pulse of 1 ms on `encoder1` at every step, and one on `encoder2` at each pass of the zero of the turn.
    Pulses {
        /// Degrees between two pulses, 1 to 360.
        degrees: u16,
    },
}

/// A step that the output does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "STEP_CONFIG cannot be {given}: 0 for an input, or 1 to {DEGREES_AT_MOST} degrees between two pulses"
)]
pub struct StepError {
    /// What was given.
    pub given: i64,
}

impl EncoderOutput {
    /// The value of STEP_CONFIG.
    ///
    /// # Errors
    /// [`StepError`] for a step of no degree, or of more than a turn.
    pub fn step_config(self) -> Result<u16, StepError> {
        match self {
            Self::Input => Ok(0),
            Self::Pulses { degrees } if (1..=DEGREES_AT_MOST).contains(&degrees) => Ok(degrees),
            Self::Pulses { degrees } => Err(StepError { given: degrees.into() }),
        }
    }

    /// What a value of STEP_CONFIG means.
    ///
    /// # Errors
    /// [`StepError`] for a value out of range.
    pub fn of_step_config(value: i64) -> Result<Self, StepError> {
        match u16::try_from(value) {
            Ok(0) => Ok(Self::Input),
            Ok(degrees @ 1..=DEGREES_AT_MOST) => Ok(Self::Pulses { degrees }),
            _ => Err(StepError { given: value }),
        }
    }

    /// The speed in degrees per second at which a pulse ends only when the next one begins. Stay well below it.
    pub fn speed_limit(self) -> Option<f64> {
        match self {
            Self::Input => None,
            Self::Pulses { degrees } => Some(f64::from(degrees) / PULSE_S),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_is_an_input_and_more_is_a_step_of_no_more_than_a_turn() {
        assert_eq!(EncoderOutput::of_step_config(0), Ok(EncoderOutput::Input));
        for degrees in [1, 90, 360] {
            let output = EncoderOutput::Pulses { degrees };
            assert_eq!(EncoderOutput::of_step_config(degrees.into()), Ok(output));
            assert_eq!(output.step_config(), Ok(degrees));
        }
        for given in [-1, 361, 65_536, i64::MAX] {
            assert_eq!(EncoderOutput::of_step_config(given), Err(StepError { given }));
        }
        assert!(EncoderOutput::Pulses { degrees: 0 }.step_config().is_err());
        assert!(EncoderOutput::Pulses { degrees: 361 }.step_config().is_err());
    }

    #[test]
    fn the_pulses_must_not_run_into_each_other() {
        assert_eq!(EncoderOutput::Pulses { degrees: 1 }.speed_limit(), Some(1_000.0));
        assert_eq!(EncoderOutput::Input.speed_limit(), None);
    }
}
