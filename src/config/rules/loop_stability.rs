//! Whether the loops that takt closes over the bus are stable, and how well they are damped.
//!
//! A loop over the bus acts once in a period. Feedback that is taken at one SYNC becomes a set-point that the drive latches
//! at the next SYNC and keeps for a period. The criterion is the damping ratio of the closed loop's poles in discrete time:
//! a pole z of a loop with the period T corresponds to the pole s = ln z / T, whose damping ratio is −Re s / |s|. A pole outside
//! the unit circle has a negative damping ratio: the loop is unstable.

use num_complex::Complex64;

/// Loops that are damped less swing for too long, and a little more inertia or delay makes them unstable.
pub const LEAST_DAMPING_RATIO: f64 = 0.3;

/// The time constant (s) of the slowest velocity loop of a drive that the position loop is to be stable with.
const VELOCITY_LOOP_TIME_CONSTANT_S: f64 = 5e-3;

/// A pole this near to 1 belongs to an error that fades in more than a million periods: it swings no more than it moves.
const STANDSTILL: f64 = 1e-6;
/// A pole this near to 0 has faded after one period.
const FADED: f64 = 1e-6;

/// The lowest damping ratio of the position loop that takt closes in CSV, with a drive whose velocity loop is a first-order
/// lag.
///
/// With a = exp(−T/τ), the drive's velocity v, its demand w and the position x change in a period by
/// v' = a·v + (1−a)·w and x' = x + τ(1−a)·v + (T − τ(1−a))·w, and the demand becomes w' = −gain · x.
pub fn velocity_loop(position_gain: f64, period_s: f64) -> f64 {
    let lag_s = VELOCITY_LOOP_TIME_CONSTANT_S;
    let a = (-period_s / lag_s).exp();
    let by_velocity = lag_s * (1.0 - a);
    let by_demand = period_s - by_velocity;
    damping_ratio([
        1.0,
        -(1.0 + a),
        a + position_gain * by_demand,
        position_gain * (by_velocity * (1.0 - a) - by_demand * a),
    ])
}

/// The lowest damping ratio of the loop that takt closes in CST, with a joint that is a free inertia. The velocity is the
/// difference of the two newest positions, which makes the loop slower than a velocity that the drive reports.
///
/// With k = stiffness · T² / 2·inertia and d = damping · T / 2·inertia the poles are the roots of
/// z⁴ − 2z³ + (1 + k + d)z² + k·z − d.
pub fn torque_loop(stiffness: f64, damping: f64, inertia: f64, period_s: f64) -> f64 {
    let d = damping * period_s / (2.0 * inertia);
    let k = stiffness * period_s * period_s / (2.0 * inertia);
    damping_ratio([1.0, -2.0, 1.0 + k + d, k, -d])
}

/// The highest gain between these two with which a loop is damped well enough; `None` where the lowest is too high.
pub fn highest(low: f64, high: f64, damping_ratio: impl Fn(f64) -> f64) -> Option<f64> {
    let is_sound = |gain: f64| damping_ratio(gain) >= LEAST_DAMPING_RATIO;
    if !is_sound(low) {
        return None;
    }
    if is_sound(high) {
        return Some(high);
    }
    let (mut low, mut high) = (low.ln(), high.ln());
    for _ in 0..48 {
        let middle = 0.5 * (low + high);
        if is_sound(middle.exp()) { low = middle } else { high = middle }
    }
    Some(low.exp())
}

/// The lowest damping ratio of the roots of a polynomial whose first coefficient is 1. A polynomial that is not finite has
/// none: that loop is unstable.
fn damping_ratio<const N: usize>(coefficients: [f64; N]) -> f64 {
    if coefficients.iter().any(|coefficient| !coefficient.is_finite()) {
        return -1.0;
    }
    roots(&coefficients)
        .into_iter()
        .map(|z| {
            let s = z.ln();
            if z.norm() < FADED || s.norm() < STANDSTILL { 1.0 } else { -s.re / s.norm() }
        })
        .fold(1.0, f64::min)
}

/// The roots by the method of Durand and Kerner: all of them at once, each corrected by its distance from the others.
fn roots(coefficients: &[f64]) -> Vec<Complex64> {
    let degree = coefficients.len() - 1;
    // No root is farther out (Cauchy's bound).
    let radius = 1.0 + coefficients.iter().skip(1).fold(0.0_f64, |most, one| most.max(one.abs()));
    let start = |index: usize| Complex64::from_polar(radius.min(2.0), 0.4 + 2.3 * index as f64);
    let mut roots: Vec<Complex64> = (0..degree).map(start).collect();
    for _ in 0..500 {
        let mut change = 0.0_f64;
        for index in 0..degree {
            let root = roots[index];
            let value = coefficients.iter().fold(Complex64::ZERO, |sum, one| sum * root + one);
            let others = roots.iter().enumerate().filter(|(other, _)| *other != index);
            let distance: Complex64 = others.map(|(_, other)| root - other).product();
            let correction = value / distance;
            if correction.is_finite() {
                roots[index] -= correction;
                change = change.max(correction.norm());
            }
        }
        if change < 1e-14 {
            break;
        }
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_roots_of_a_known_polynomial_are_found() {
        // (z − 0.5)(z + 0.25)(z² − 0.6z + 0.34), whose last two are 0.3 ± 0.5i.
        let mut found = roots(&[1.0, -0.85, 0.365, -0.01, -0.0425]);
        found.sort_by(|a, b| (a.re, a.im).partial_cmp(&(b.re, b.im)).unwrap());
        let expected = [(-0.25, 0.0), (0.3, -0.5), (0.3, 0.5), (0.5, 0.0)];
        for (root, (re, im)) in found.iter().zip(expected) {
            assert!((root - Complex64::new(re, im)).norm() < 1e-9, "{found:?}");
        }
    }

    /// The closed loop in time: the position after every period, from an offset of 1.
    fn torque_loop_in_time(stiffness: f64, damping: f64, period_s: f64, periods: usize) -> Vec<f64> {
        let (mut position, mut velocity, mut earlier, mut latched) = (1.0, 0.0, 1.0, 0.0);
        (0..periods)
            .map(|_| {
                let torque = -stiffness * position - damping * (position - earlier) / period_s;
                earlier = position;
                position += velocity * period_s + 0.5 * latched * period_s * period_s;
                velocity += latched * period_s;
                latched = torque;
                position
            })
            .collect()
    }

    fn velocity_loop_in_time(gain: f64, period_s: f64, periods: usize) -> Vec<f64> {
        let (mut position, mut velocity, mut latched) = (1.0_f64, 0.0_f64, 0.0_f64);
        let steps = 2000;
        let step_s = period_s / f64::from(steps);
        (0..periods)
            .map(|_| {
                let demand = -gain * position;
                for _ in 0..steps {
                    velocity += (latched - velocity) / VELOCITY_LOOP_TIME_CONSTANT_S * step_s;
                    position += velocity * step_s;
                }
                latched = demand;
                position
            })
            .collect()
    }

    fn swing(positions: &[f64]) -> f64 {
        positions.iter().fold(0.0, |most, position| most.max(position.abs()))
    }

    #[test]
    fn the_gain_at_which_the_criterion_turns_is_the_one_at_which_the_loop_begins_to_grow() {
        for period_s in [1e-3, 4e-3, 20e-3] {
            let limit = |ratio: &dyn Fn(f64) -> f64| {
                let (mut low, mut high) = (1e-3, 1e7);
                for _ in 0..80 {
                    let middle = f64::sqrt(low * high);
                    if ratio(middle) > 0.0 { low = middle } else { high = middle }
                }
                low
            };
            let gain = limit(&|gain| velocity_loop(gain, period_s));
            assert!(swing(&velocity_loop_in_time(0.9 * gain, period_s, 400)[300..]) < 0.1);
            assert!(swing(&velocity_loop_in_time(1.1 * gain, period_s, 400)[300..]) > 10.0);
            let damping = 0.2 / period_s;
            let stiffness = limit(&|stiffness| torque_loop(stiffness, damping, 1.0, period_s));
            assert!(swing(&torque_loop_in_time(0.9 * stiffness, damping, period_s, 1000)[900..]) < 0.1);
            assert!(swing(&torque_loop_in_time(1.1 * stiffness, damping, period_s, 1000)[900..]) > 10.0);
        }
    }

    proptest! {
        /// What passes the criterion has forgotten an offset after a few swings.
        #[test]
        fn a_torque_loop_that_is_damped_enough_comes_to_rest(
            damping in 0.001_f64..1.0, share in 0.01_f64..1.0, period_s in 250e-6_f64..0.1,
        ) {
            // As shares of inertia / period and of what the damping allows.
            let damping = damping / period_s;
            let stiffness = share * damping / period_s;
            let ratio = torque_loop(stiffness, damping, 1.0, period_s);
            if ratio >= LEAST_DAMPING_RATIO {
                let slowest_s = damping / stiffness + (1.0 / stiffness).sqrt();
                let periods = (20.0 * slowest_s / period_s) as usize + 50;
                let positions = torque_loop_in_time(stiffness, damping, period_s, 2 * periods);
                prop_assert!(swing(&positions[periods..]) < 0.01, "{}", swing(&positions[periods..]));
            }
        }
    }
}
