//! `--take-over`, and the message when another master is found.

use crate::link::ownership::{ClaimError, IfOwned};

use super::usage_error::UsageError;

/// The meaning of `--take-over`.
pub const fn if_owned(take_over: bool) -> IfOwned {
    if take_over { IfOwned::TakeOver } else { IfOwned::Refuse }
}

/// The error of a subcommand that has `--take-over`.
pub fn usage_error(error: &ClaimError) -> UsageError {
    if error.can_be_taken_over() {
        return format!("{error}, or add --take-over, which has it stop in control first").into();
    }
    error.to_string().into()
}
