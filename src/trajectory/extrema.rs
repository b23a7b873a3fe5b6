//! Where polynomials change their sign, and so where what they are the derivative of has its extrema.

use arrayvec::ArrayVec;

/// The highest degree: the velocity of a polynomial of the fifth degree has the fourth.
const MOST: usize = 4;

/// The times at which a polynomial may change its sign, in ascending order.
pub(super) type Times = ArrayVec<f64, { MOST + 2 }>;

/// Halvings after which an interval is as short as rounding lets it be.
const HALVINGS: u32 = 200;

/// The value of a polynomial with these coefficients, in ascending order.
pub(super) fn value(coefficients: &[f64], at: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * at + coefficient)
}

/// The times from 0 to `end` at which a polynomial of the fourth degree at most changes its sign, each to the last bit. Times at
/// which it is zero without a change of its sign may be among them.
///
/// Between two extrema there is at most one. The extrema are where the derivative changes its sign, which has a degree less.
pub(super) fn sign_changes(coefficients: &[f64], end: f64) -> Times {
    let mut times = Times::new();
    let degree = coefficients.iter().rposition(|coefficient| *coefficient != 0.0).unwrap_or(0);
    if degree == 0 || degree > MOST {
        return times;
    }
    let mut derivative = [0.0; MOST];
    for ((power, to), from) in (1..).zip(&mut derivative).zip(&coefficients[1..=degree]) {
        *to = f64::from(power) * from;
    }
    let turns = sign_changes(&derivative[..degree], end);
    let mut from = 0.0;
    for to in turns.into_iter().chain([end]) {
        times.extend(change_between(coefficients, from, to));
        from = to;
    }
    times
}

/// The change of sign of a polynomial that rises or falls all the way.
fn change_between(coefficients: &[f64], from: f64, to: f64) -> Option<f64> {
    let (mut low, mut high) = (from, to);
    let begins_negative = value(coefficients, low) < 0.0;
    if begins_negative == (value(coefficients, high) < 0.0) {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if (value(coefficients, middle) < 0.0) == begins_negative { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn product(roots: &[f64]) -> Vec<f64> {
        roots.iter().fold(vec![1.0], |polynomial, root| {
            let mut next = vec![0.0; polynomial.len() + 1];
            for (power, coefficient) in polynomial.iter().enumerate() {
                next[power] -= root * coefficient;
                next[power + 1] += coefficient;
            }
            next
        })
    }

    #[test]
    fn simple_roots_are_found_to_the_last_bits() {
        assert_eq!(sign_changes(&[-1.0, 2.0], 3.0).as_slice(), [0.5]);
        assert!(sign_changes(&[-1.0, 2.0], 0.4).is_empty());
        assert!(sign_changes(&[3.0], 3.0).is_empty());
        assert!(sign_changes(&[0.0; 5], 3.0).is_empty());
        let found = sign_changes(&product(&[0.25, 0.5, 1.5, 2.75]), 3.0);
        assert!(found.iter().zip([0.25, 0.5, 1.5, 2.75]).all(|(found, root)| (found - root).abs() < 1e-14));
        assert_eq!(found.len(), 4);
    }

    proptest! {
        #[test]
        fn between_neighbouring_times_the_sign_stays(
            coefficients in prop::collection::vec(-1.0f64..1.0, 1..6),
            end in 0.01f64..10.0,
        ) {
            let mut borders = vec![0.0];
            borders.extend(sign_changes(&coefficients, end));
            borders.push(end);
            let size: f64 = coefficients.iter().enumerate()
                .map(|(power, coefficient)| coefficient.abs() * end.powi(power as i32)).sum();
            for pair in borders.windows(2) {
                let values: Vec<f64> = (0..=20)
                    .map(|step| value(&coefficients, pair[0] + (pair[1] - pair[0]) * f64::from(step) / 20.0))
                    .filter(|value| value.abs() > 1e-13 * size)
                    .collect();
                prop_assert!(values.iter().all(|value| *value > 0.0) || values.iter().all(|value| *value < 0.0));
            }
        }
    }
}
