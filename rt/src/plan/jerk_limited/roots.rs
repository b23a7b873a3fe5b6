//! Roots of functions that are monotone between two points: Newton's method, kept in its bracket.

/// The most evaluations for one root. Newton's method from a bracket ends after about five; when it leaves the
/// bracket it is halved, and 64 halvings exhaust the 53 bits of a number.
const EVALUATIONS_MAX: u32 = 96;

/// A value and its derivative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// Where `function` is zero, given that it rises from `low` (value not above 0) to `high` (not below 0).
pub(super) fn rising_root(mut low: f64, mut high: f64, guess: f64, function: impl Fn(f64) -> Point) -> f64 {
    /// Newton's method doubles the digits: after a relative step this small, all are right.
    const LAST_STEP: f64 = 1e-9;
    let mut x = guess.clamp(low.min(high), high.max(low));
    for _ in 0..EVALUATIONS_MAX {
        let Point { value, slope } = function(x);
        if value > 0.0 {
            high = x;
        } else if value < 0.0 {
            low = x;
        } else {
            break;
        }
        let newton = x - value / slope;
        let inside = newton > low.min(high) && newton < low.max(high);
        let next = if inside { newton } else { 0.5 * (low + high) };
        let step = (next - x).abs();
        let exhausted = next == low || next == high;
        x = next;
        if exhausted || (inside && step <= LAST_STEP * x.abs()) {
            break;
        }
    }
    x
}
