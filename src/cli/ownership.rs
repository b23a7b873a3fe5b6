//! What the subcommands that command drives say of another master.

use takt::bus::ownership::{ClaimError, IfOwned};

use super::usage_error::UsageError;

/// What `--take-over` asks for.
pub const fn if_owned(take_over: bool) -> IfOwned {
    if take_over { IfOwned::TakeOver } else { IfOwned::Refuse }
}

/// Why a subcommand that has `--take-over` was refused.
pub fn usage_error(error: &ClaimError) -> UsageError {
    if error.can_be_taken_over() {
        return format!("{error}, or add --take-over, which has it stop in control first").into();
    }
    error.to_string().into()
}
