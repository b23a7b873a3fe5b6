//! Roots of functions that are monotone between two points: Newton's method, kept in its bracket.

use super::super::choice::select;

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

/// An end of the bracket of a root.
#[derive(Clone, Copy)]
struct End {
    at: f64,
    /// True if the function has been evaluated there.
    seen: bool,
}

/// The root of `function`, which must rise from `low` (value not above 0) to `high` (value not below 0).
///
/// A step of Newton's method that leaves the bracket goes to the end of the bracket instead. The root is often there, and
/// otherwise the method approaches it from the other side. Only after that the bracket is halved.
#[inline]
pub(super) fn rising_root(low: f64, high: f64, guess: f64, function: impl Fn(f64) -> Point) -> f64 {
    /// Newton's method doubles the right digits with each step. After a relative step this small, all digits are right.
    const LAST_STEP: f64 = 1e-9;
    let mut x = guess.clamp(low.min(high), high.max(low));
    #[cfg(test)]
    work::search();
    let (mut low, mut high) = (End { at: low, seen: false }, End { at: high, seen: false });
    for _ in 0..EVALUATIONS_MAX {
        #[cfg(test)]
        work::evaluate();
        let Point { value, slope } = function(x);
        let (this, other) = if value > 0.0 {
            (&mut high, &low)
        } else if value < 0.0 {
            (&mut low, &high)
        } else {
            break;
        };
        // The sign is wrong at the end of the bracket: rounding has put the root beyond it.
        if x == other.at {
            break;
        }
        *this = End { at: x, seen: true };
        let newton = x - value / slope;
        let (least, most) = (low.at.min(high.at), low.at.max(high.at));
        let inside = newton > least && newton < most;
        let next = if inside {
            newton
        } else {
            let end = if (newton <= least) == (low.at <= high.at) { low } else { high };
            if end.seen { 0.5 * (low.at + high.at) } else { end.at }
        };
        let step = (next - x).abs();
        let exhausted = (next == low.at && low.seen) || (next == high.at && high.seen);
        x = next;
        if exhausted || (inside && step <= LAST_STEP * x.abs()) {
            break;
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
