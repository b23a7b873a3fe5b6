//! Roots of functions that are monotone between two points: Newton's method, kept in its bracket.

use super::super::choice::{larger, select, smaller};

/// The most evaluations for one root. Newton's method inside a bracket ends after about five. A step out of the bracket
/// halves it instead, and 64 halvings exhaust the 53 bits of a number.
pub(in super::super) const EVALUATIONS_MAX: u32 = 96;

/// The value of a function and its derivative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// By how much a distance exceeds the wanted one. The result is 0 where the excess is not more than the rounding of terms of this
/// size: otherwise a search would go on among digits without meaning.
#[inline]
pub(super) fn excess(distance: f64, size: f64, wanted: f64) -> f64 {
    let excess = distance - wanted;
    select(excess.abs() <= 4.0 * f64::EPSILON * (size + wanted.abs()), 0.0, excess)
}

/// The root of `function`, which must rise from `low` (value not above 0) to `high` (value not below 0).
///
/// A step of Newton's method that leaves the bracket goes to the end of the bracket instead. The root is often there, and
/// otherwise the method approaches it from the other side. Only after that the bracket is halved.
#[inline]
pub(super) fn rising_root(low: f64, high: f64, guess: f64, function: impl Fn(f64) -> Point) -> f64 {
    /// Newton's method doubles the right digits with each step. After a relative step this small, all digits are right.
    const LAST_STEP: f64 = 1e-9;
    let rises = low <= high;
    let (mut least, mut most) = if rises { (low, high) } else { (high, low) };
    // Whether the function has been evaluated there.
    let (mut least_seen, mut most_seen) = (false, false);
    let mut x = larger(smaller(guess, most), least);
    #[cfg(test)]
    work::search();
    for _ in 0..EVALUATIONS_MAX {
        #[cfg(test)]
        work::evaluate();
        let Point { value, slope } = function(x);
        if value == 0.0 || value.is_nan() {
            break;
        }
        // Where the sign is wrong at an end of the bracket, rounding has put the root beyond that end.
        if (value > 0.0) == rises {
            if x == least {
                break;
            }
            (most, most_seen) = (x, true);
        } else {
            if x == most {
                break;
            }
            (least, least_seen) = (x, true);
        }
        let newton = x - value / slope;
        if newton > least && newton < most {
            let step = (newton - x).abs();
            x = newton;
            if step <= LAST_STEP * x.abs() {
                break;
            }
        } else {
            let (end, seen) = if newton <= least { (least, least_seen) } else { (most, most_seen) };
            x = if seen { 0.5 * (least + most) } else { end };
            if seen && (x == least || x == most) {
                break;
            }
        }
    }
    x
}

/// Counts the searches of this thread, for the tests of the bound.
#[cfg(test)]
pub(in super::super) mod work {
    extern crate std;

    use core::cell::Cell;

    std::thread_local! {
        static SEARCHES: Cell<u32> = const { Cell::new(0) };
        static EVALUATIONS: Cell<u32> = const { Cell::new(0) };
    }

    pub(super) fn search() {
        SEARCHES.set(SEARCHES.get() + 1);
    }

    pub(super) fn evaluate() {
        EVALUATIONS.set(EVALUATIONS.get() + 1);
    }

    /// The searches and evaluations since the last call.
    pub(in super::super::super) fn take() -> (u32, u32) {
        (SEARCHES.take(), EVALUATIONS.take())
    }
}
