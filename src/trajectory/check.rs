//! Whether a path keeps every limit, by the exact extrema of its polynomials.
//!
//! The guard of the real-time thread judges the differences of the set-points that are sent. A difference of positions is a mean
//! of the velocity, one of velocities a mean of the acceleration: what keeps its limits everywhere keeps them in every sample.

use takt_rt::{AxisLimits, Polynomial};

use super::error::BrokenLimit;
use super::extrema::{sign_changes, value};

/// Room for rounding, relative to the limit (of the position: to the range): half of what the guard has.
const TOLERANCE: f64 = 0.5e-6;

/// A limit that is broken, and the first extremum beyond it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Violation {
    pub broken: BrokenLimit,
    /// Since the beginning of the polynomial, in seconds.
    pub time_s: f64,
    pub value: f64,
    /// With the sign of the value.
    pub limit: f64,
}

/// The position, and its first three derivatives, as coefficients.
struct Derivatives {
    position: [f64; 6],
    velocity: [f64; 5],
    acceleration: [f64; 4],
    jerk: [f64; 3],
    snap: [f64; 2],
}

fn derivative<const N: usize>(of: &[f64]) -> [f64; N] {
    let mut derivative = [0.0; N];
    for ((power, to), from) in (1..).zip(&mut derivative).zip(&of[1..]) {
        *to = f64::from(power) * from;
    }
    derivative
}

impl Derivatives {
    fn of(polynomial: &Polynomial) -> Self {
        let position = polynomial.0;
        let velocity = derivative(&position);
        let acceleration = derivative(&velocity);
        let jerk = derivative(&acceleration);
        Self { position, velocity, acceleration, jerk, snap: derivative(&jerk) }
    }

    fn are_finite(&self) -> bool {
        // Each coefficient of the position is in one of these.
        self.position.iter().chain(&self.jerk).all(|coefficient| coefficient.is_finite())
    }
}

/// The first limit that an axis breaks on this polynomial, from its beginning to `duration_s`.
pub(super) fn violation(polynomial: &Polynomial, duration_s: f64, limits: &AxisLimits) -> Option<Violation> {
    let of = Derivatives::of(polynomial);
    if !of.are_finite() {
        // Points so close in time that no number is large enough for the speed between them.
        let (value, limit) = (f64::INFINITY, limits.velocity);
        return Some(Violation { broken: BrokenLimit::Velocity, time_s: 0.0, value, limit });
    }
    let turns = sign_changes(&of.velocity, duration_s);
    position_violation(&of, &turns, duration_s, limits)
        .or_else(|| {
            let times = sign_changes(&of.acceleration, duration_s).into_iter().chain([0.0, duration_s]);
            largest(&of.velocity, times, BrokenLimit::Velocity, limits.velocity)
        })
        .or_else(|| acceleration_violation(&of, &turns, duration_s, limits))
        .or_else(|| {
            let times = sign_changes(&of.snap, duration_s).into_iter().chain([0.0, duration_s]);
            largest(&of.jerk, times, BrokenLimit::Jerk, limits.jerk)
        })
}

fn position_violation(
    of: &Derivatives,
    turns: &[f64],
    duration_s: f64,
    limits: &AxisLimits,
) -> Option<Violation> {
    let mut times = turns.iter().copied().chain([duration_s]);
    times.find_map(|time_s| {
        let (broken, value, limit) = position_beyond(value(&of.position, time_s), limits)?;
        Some(Violation { broken, time_s, value, limit })
    })
}

/// How far a polynomial leads outside of the positions at its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Excursion {
    /// Since the beginning of the polynomial, in seconds.
    pub time_s: f64,
    pub position: f64,
    /// The position at the nearer end.
    pub nearest: f64,
}

impl Excursion {
    pub(super) fn distance(&self) -> f64 {
        (self.position - self.nearest).abs()
    }
}

/// Returns the position that is farthest outside of those at both ends, if the axis turns round on its way.
pub(super) fn excursion(polynomial: &Polynomial, duration_s: f64) -> Option<Excursion> {
    let of = Derivatives::of(polynomial);
    let [first, last] = [0.0, duration_s].map(|time_s| value(&of.position, time_s));
    let turns = sign_changes(&of.velocity, duration_s).into_iter().map(|time_s| {
        let position = value(&of.position, time_s);
        Excursion { time_s, position, nearest: position.max(first.min(last)).min(first.max(last)) }
    });
    turns.max_by(|one, other| one.distance().total_cmp(&other.distance()))
}

/// A position that is beyond a limit, and the limit.
pub(super) fn position_beyond(position: f64, limits: &AxisLimits) -> Option<(BrokenLimit, f64, f64)> {
    let room = TOLERANCE * (limits.position_max - limits.position_min);
    let limit = if position > limits.position_max { limits.position_max } else { limits.position_min };
    let is_within = (limits.position_min - room..=limits.position_max + room).contains(&position);
    (!is_within).then_some((BrokenLimit::Position, position, limit))
}

/// A value that is beyond a limit of its magnitude, and the limit with the sign of the value.
pub(super) fn beyond(value: f64, broken: BrokenLimit, limit: f64) -> Option<(BrokenLimit, f64, f64)> {
    is_beyond(value, limit).then_some((broken, value, limit.copysign(value)))
}

/// The largest magnitude at some times, if it is beyond the limit.
fn largest(
    coefficients: &[f64],
    times: impl Iterator<Item = f64>,
    broken: BrokenLimit,
    limit: f64,
) -> Option<Violation> {
    let values = times.map(|time_s| (time_s, value(coefficients, time_s)));
    let (time_s, value) = values.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()))?;
    is_beyond(value, limit).then_some(Violation { broken, time_s, value, limit: limit.copysign(value) })
}

fn is_beyond(value: f64, limit: f64) -> bool {
    value.is_nan() || value.abs() > limit * (1.0 + TOLERANCE)
}

/// The shortest time between two changes of the direction, as a share of the whole.
const SHORTEST_SHARE: f64 = 1e-9;

/// Speeding up and slowing down have limits of their own. Between two changes of the direction the acceleration has its extrema
/// at the ends and where the jerk changes its sign.
fn acceleration_violation(
    of: &Derivatives,
    turns: &[f64],
    duration_s: f64,
    limits: &AxisLimits,
) -> Option<Violation> {
    let extrema = sign_changes(&of.jerk, duration_s);
    let mut from_s = 0.0;
    for to_s in turns.iter().copied().chain([duration_s]) {
        // Where an axis comes to rest at an end, rounding makes it turn round just before: that is no interval.
        if to_s - from_s <= SHORTEST_SHARE * duration_s {
            continue;
        }
        let direction = value(&of.velocity, 0.5 * (from_s + to_s));
        let inside = extrema.iter().copied().filter(|time_s| (from_s..=to_s).contains(time_s));
        let mut worst: Option<Violation> = None;
        for time_s in [from_s, to_s].into_iter().chain(inside) {
            let value = value(&of.acceleration, time_s);
            let (broken, limit) = if value * direction >= 0.0 {
                (BrokenLimit::Acceleration, limits.acceleration)
            } else {
                (BrokenLimit::Deceleration, limits.deceleration)
            };
            let is_worse = worst.is_none_or(|worst| value.abs() > worst.value.abs());
            if is_beyond(value, limit) && is_worse {
                worst = Some(Violation { broken, time_s, value, limit: limit.copysign(value) });
            }
        }
        if worst.is_some() {
            return worst;
        }
        from_s = to_s;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits {
        position_min: -1.0,
        position_max: 2.0,
        velocity: 3.0,
        acceleration: 10.0,
        deceleration: 20.0,
        jerk: 200.0,
        torque: 50.0,
    };

    fn broken(coefficients: [f64; 6], duration_s: f64) -> Option<(BrokenLimit, f64, f64, f64)> {
        violation(&Polynomial(coefficients), duration_s, &LIMITS)
            .map(|found| (found.broken, found.time_s, found.value, found.limit))
    }

    #[test]
    fn an_extremum_between_the_points_counts() {
        // A parabola with its top of 2.1 in the middle of a second.
        let found = broken([1.6, 2.0, -2.0, 0.0, 0.0, 0.0], 1.0).unwrap();
        assert_eq!(found.0, BrokenLimit::Position);
        assert!((found.1 - 0.5).abs() < 1e-12 && (found.2 - 2.1).abs() < 1e-12 && found.3 == 2.0);
        assert_eq!(broken([1.5, 2.0, -2.0, 0.0, 0.0, 0.0], 1.0), None);
    }

    #[test]
    fn speeding_up_and_slowing_down_have_limits_of_their_own() {
        // 15 rad/s² from 0 on in one direction, and the same while a speed of 1.5 rad/s falls to 0.
        let found = broken([0.0, 0.0, -7.5, 0.0, 0.0, 0.0], 0.1).unwrap();
        assert_eq!((found.0, found.2, found.3), (BrokenLimit::Acceleration, -15.0, -10.0));
        assert_eq!(broken([0.0, 1.5, -7.5, 0.0, 0.0, 0.0], 0.1), None);
        let found = broken([0.0, 1.5, -7.5, 0.0, 0.0, 0.0], 0.11).unwrap();
        assert_eq!(found.0, BrokenLimit::Acceleration, "it turns round at 0.1 s");
        let found = broken([0.0, -2.5, 12.5, 0.0, 0.0, 0.0], 0.1).unwrap();
        assert_eq!((found.0, found.2, found.3), (BrokenLimit::Deceleration, 25.0, 20.0));
    }

    #[test]
    fn numbers_that_are_too_large_are_a_violation() {
        assert!(broken([0.0, f64::INFINITY, 0.0, 0.0, 0.0, 0.0], 1.0).is_some());
        assert!(broken([0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN], 1.0).is_some());
    }

    proptest! {
        #[test]
        fn a_violation_is_found_if_and_only_if_samples_show_one(
            coefficients in prop::array::uniform6(-1.0f64..1.0),
            size in 0.1f64..20.0,
            duration_s in 0.1f64..2.0,
        ) {
            let mut scaled = coefficients.map(|coefficient| coefficient * size);
            scaled[0] /= size;
            let polynomial = Polynomial(scaled);
            let samples = || (0..=5_000).map(|step| {
                let time_s = duration_s * f64::from(step) / 5_000.0;
                (polynomial.state(time_s), polynomial.jerk(time_s))
            });
            let excess = samples().map(|(state, jerk)| {
                let limit = if state.acceleration * state.velocity >= 0.0 { LIMITS.acceleration } else { LIMITS.deceleration };
                [
                    state.position - LIMITS.position_max,
                    LIMITS.position_min - state.position,
                    state.velocity.abs() / LIMITS.velocity - 1.0,
                    state.acceleration.abs() / limit - 1.0,
                    jerk.abs() / LIMITS.jerk - 1.0,
                ].into_iter().fold(f64::NEG_INFINITY, f64::max)
            }).fold(f64::NEG_INFINITY, f64::max);
            match violation(&polynomial, duration_s, &LIMITS) {
                None => prop_assert!(excess < 2e-6, "{excess}"),
                Some(found) => {
                    prop_assert!(excess > -1e-2, "{found:?} and {excess}");
                    prop_assert!((0.0..=duration_s).contains(&found.time_s));
                    let state = polynomial.state(found.time_s);
                    let seen = match found.broken {
                        BrokenLimit::Position => state.position,
                        BrokenLimit::Velocity => state.velocity,
                        BrokenLimit::Acceleration | BrokenLimit::Deceleration => state.acceleration,
                        BrokenLimit::Jerk => polynomial.jerk(found.time_s),
                    };
                    prop_assert!((seen - found.value).abs() < 1e-9 * (1.0 + seen.abs()));
                }
            }
        }
    }
}
