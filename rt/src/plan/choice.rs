//! Choices between two numbers that compile to one or two instructions, not to a branch to guess.

/// `one` where the condition holds, else `other`. With a comparison of numbers as the condition, and no other
/// choice by the same one, it compiles to a mask.
#[inline]
pub(super) fn select(condition: bool, one: f64, other: f64) -> f64 {
    if condition { one } else { other }
}

/// The larger number: what is not a number is found at the end, see [`Profile::finish_at`](super::Profile::finish_at).
#[inline]
pub(super) fn larger(one: f64, other: f64) -> f64 {
    if one > other { one } else { other }
}

/// The smaller number.
#[inline]
pub(super) fn smaller(one: f64, other: f64) -> f64 {
    if one < other { one } else { other }
}
