//! Choices between two numbers that compile to one or two instructions instead of a branch. The processor guesses such a
//! branch wrong about every second time.

/// `one` where the condition holds, else `other`. It compiles to a mask if the condition is a comparison of numbers that
/// decides no other choice.
#[inline]
pub(super) fn select(condition: bool, one: f64, other: f64) -> f64 {
    if condition { one } else { other }
}

/// The larger number. If one of them is not a number, the result is `other`;
/// [`Profile::finish_at`](super::Profile::finish_at) finds a result that is not a number.
#[inline]
pub(super) fn larger(one: f64, other: f64) -> f64 {
    if one > other { one } else { other }
}

/// The smaller number. If one of them is not a number, the result is `other`.
#[inline]
pub(super) fn smaller(one: f64, other: f64) -> f64 {
    if one < other { one } else { other }
}
