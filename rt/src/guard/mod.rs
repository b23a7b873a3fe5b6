//! The guard: the last check of every set-point, whatever its source, before it becomes a frame.

mod following_error;
#[cfg(test)]
mod planned;
mod stopping_bound;
mod stream;

use crate::fault::Fault;
use crate::plan::State;

pub use following_error::FollowingErrorGuard;
pub use stopping_bound::braking_distance;
pub use stream::{SetPointSteps, check_braking, check_jerk};

/// What an axis may never be asked to do. rad (m) and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct AxisLimits {
    /// Lowest position.
    pub position_min: f64,
    /// Highest position.
    pub position_max: f64,
    /// Highest speed.
    pub velocity: f64,
    /// Highest acceleration.
    pub acceleration: f64,
    /// Highest deceleration.
    pub deceleration: f64,
    /// Highest jerk; infinite for trapezoids.
    pub jerk: f64,
    /// Highest torque in N·m (force in N).
    pub torque: f64,
}

/// A limit that is not a number that can be kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimitError {
    /// The range of positions is empty or not finite.
    PositionRange {
        /// The lowest position.
        position_min: f64,
        /// The highest position.
        position_max: f64,
    },
    /// The velocity is not a positive, finite number.
    Velocity {
        /// What it is.
        value: f64,
    },
    /// The acceleration is not a positive, finite number.
    Acceleration {
        /// What it is.
        value: f64,
    },
    /// The deceleration is not a positive, finite number.
    Deceleration {
        /// What it is.
        value: f64,
    },
    /// The jerk is not a positive number.
    Jerk {
        /// What it is.
        value: f64,
    },
    /// The torque is not a positive, finite number.
    Torque {
        /// What it is.
        value: f64,
    },
}

impl core::error::Error for LimitError {}

impl core::fmt::Display for LimitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (name, value) = match self {
            Self::PositionRange { position_min, position_max } => {
                return write!(f, "positions from {position_min} to {position_max} are no range");
            }
            Self::Jerk { value } => return write!(f, "the jerk limit must be a positive number: {value}"),
            Self::Velocity { value } => ("velocity", value),
            Self::Acceleration { value } => ("acceleration", value),
            Self::Deceleration { value } => ("deceleration", value),
            Self::Torque { value } => ("torque", value),
        };
        write!(f, "the {name} limit must be a positive, finite number: {value}")
    }
}

impl AxisLimits {
    /// No limit at all. No axis may have these; they are for what is not to be limited before it is checked.
    pub const NONE: Self = Self {
        position_min: f64::NEG_INFINITY,
        position_max: f64::INFINITY,
        velocity: f64::INFINITY,
        acceleration: f64::INFINITY,
        deceleration: f64::INFINITY,
        jerk: f64::INFINITY,
        torque: f64::INFINITY,
    };

    /// Checks that every limit is a number that can be kept.
    pub fn validate(&self) -> Result<(), LimitError> {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let (position_min, position_max) = (self.position_min, self.position_max);
        if !(position_min.is_finite() && position_max.is_finite() && position_min < position_max) {
            return Err(LimitError::PositionRange { position_min, position_max });
        }
        for (value, error) in [
            (self.velocity, LimitError::Velocity { value: self.velocity }),
            (self.acceleration, LimitError::Acceleration { value: self.acceleration }),
            (self.deceleration, LimitError::Deceleration { value: self.deceleration }),
            (self.torque, LimitError::Torque { value: self.torque }),
        ] {
            if !positive(value) {
                return Err(error);
            }
        }
        if self.jerk > 0.0 { Ok(()) } else { Err(LimitError::Jerk { value: self.jerk }) }
    }

    /// How fast the velocity, with its sign, may rise and how fast it may fall when a joint at this velocity is stopped: all
    /// the way, though the stop may turn it round.
    pub(crate) fn rising_and_falling(&self, velocity: f64) -> (f64, f64) {
        let AxisLimits { acceleration, deceleration, .. } = *self;
        if velocity > 0.0 {
            (acceleration, deceleration)
        } else if velocity < 0.0 {
            (deceleration, acceleration)
        } else {
            (acceleration.min(deceleration), acceleration.min(deceleration))
        }
    }

    /// The limits with the smaller one of acceleration and deceleration for both. Which of them holds changes where the joint turns
    /// round, and what was possible to stop before must be so behind it.
    pub(crate) fn both_ways(&self) -> Self {
        let smaller = self.acceleration.min(self.deceleration);
        Self { acceleration: smaller, deceleration: smaller, ..*self }
    }

    /// Returns `true` if `position` may be a target.
    pub fn contain(&self, position: f64) -> bool {
        self.position_min <= position && position <= self.position_max
    }
}

/// Room for the rounding of floating-point differences, relative to the limit.
const TOLERANCE: f64 = 1e-6;

/// Checks the step from the set-points of the last two cycles to the next one.
///
/// Velocity and acceleration are judged by what the drive will see, the differences of the positions, and not by
/// what the set-point says of itself. Outside the position limits a step is allowed only if it leads back.
#[inline]
pub fn check(
    limits: &AxisLimits,
    period_s: f64,
    before_last: f64,
    last: f64,
    next: &State,
) -> Result<(), Fault> {
    if !(next.position.is_finite() && next.velocity.is_finite() && next.acceleration.is_finite()) {
        return Err(Fault::NotFinite { position: next.position });
    }
    if !limits.contain(next.position) {
        check_outside(limits, last, next.position)?;
    }
    let velocity = (next.position - last) / period_s;
    if velocity.abs() > limits.velocity * (1.0 + TOLERANCE) {
        return Err(Fault::VelocityLimit { velocity, limit: limits.velocity });
    }
    let last_velocity = (last - before_last) / period_s;
    let acceleration = (velocity - last_velocity) / period_s;
    if acceleration.abs() <= limits.acceleration * (1.0 + TOLERANCE) {
        return Ok(());
    }
    let limit = limits.acceleration.max(limits.deceleration);
    // Positions of some radians are known to some 1e-16 of a radian, which the division by the squared period
    // turns into visible acceleration.
    let noise = 4.0 * f64::EPSILON * (1.0 + next.position.abs()) / (period_s * period_s);
    if acceleration.abs() > limit * (1.0 + TOLERANCE) + noise {
        return Err(Fault::AccelerationLimit { acceleration, limit });
    }
    Ok(())
}

/// Checks a set-point outside of the position limits: it must lead back.
fn check_outside(limits: &AxisLimits, last: f64, position: f64) -> Result<(), Fault> {
    let room = TOLERANCE * (limits.position_max - limits.position_min);
    for (limit, beyond, deeper) in [
        (limits.position_max, position > limits.position_max + room, position > last),
        (limits.position_min, position < limits.position_min - room, position < last),
    ] {
        if beyond && deeper {
            return Err(Fault::PositionLimit { position, limit });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Rule;
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -1.0,
        position_max: 2.0,
        velocity: 3.0,
        acceleration: 10.0,
        deceleration: 20.0,
        jerk: f64::INFINITY,
        torque: 50.0,
    };
    const PERIOD_S: f64 = 0.001;

    fn at(position: f64) -> State {
        State { position, ..State::default() }
    }

    fn rule(before_last: f64, last: f64, next: State) -> Option<Rule> {
        check(&LIMITS, PERIOD_S, before_last, last, &next).err().map(|fault| fault.rule())
    }

    #[test]
    fn a_number_that_is_none_is_never_passed_on() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(rule(0.0, 0.0, at(bad)), Some(Rule::NotFinite));
            assert_eq!(rule(0.0, 0.0, State { velocity: bad, ..at(0.0) }), Some(Rule::NotFinite));
            assert_eq!(rule(0.0, 0.0, State { acceleration: bad, ..at(0.0) }), Some(Rule::NotFinite));
        }
    }

    #[test]
    fn beyond_a_position_limit_only_the_way_back_is_open() {
        assert_eq!(rule(2.0, 2.0, at(2.000_01)), Some(Rule::PositionLimit));
        assert_eq!(rule(2.5, 2.5, at(2.499_99)), None);
        assert_eq!(rule(2.5, 2.5, at(2.5)), None);
        assert_eq!(rule(-1.5, -1.5, at(-1.500_01)), Some(Rule::PositionLimit));
    }

    #[test]
    fn the_step_counts_and_not_what_the_set_point_says_of_itself() {
        let lying = State { velocity: 0.1, ..at(0.0031) };
        assert_eq!(rule(-0.0031, 0.0, lying), Some(Rule::VelocityLimit));
        assert_eq!(rule(-0.003, 0.0, at(0.003)), None);
    }

    #[test]
    fn acceleration_is_the_difference_of_two_steps() {
        assert_eq!(rule(0.0, 0.0, at(20.0 * PERIOD_S * PERIOD_S)), None);
        assert_eq!(rule(0.0, 0.0, at(20.1 * PERIOD_S * PERIOD_S)), Some(Rule::AccelerationLimit));
    }

    proptest! {
        #[test]
        fn no_triple_that_passes_breaks_a_limit(a in -2.0f64..3.0, b in -0.01f64..0.01, c in -0.01f64..0.01) {
            let (last, next) = (a + b, a + b + c);
            if check(&LIMITS, PERIOD_S, a, last, &at(next)).is_ok() {
                prop_assert!((next - last).abs() <= 3.0 * PERIOD_S * 1.001);
                prop_assert!((next - 2.0 * last + a).abs() <= 20.0 * PERIOD_S * PERIOD_S * 1.001);
                prop_assert!(next <= 2.001 || next <= last);
                prop_assert!(next >= -1.001 || next >= last);
            }
        }
    }
}
