//! `--take-over`, and the messages when another program has the bus.

use takt::link::OpenError;
use takt::link::ownership::{ClaimError, IfOwned};

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

/// The error of a subcommand that only listens.
pub fn not_heard(error: &OpenError) -> UsageError {
    if error.is_line_taken() {
        return format!(
            "{error}. A serial line belongs to one program. If a controller has it, have that write every frame (`candump = true` in \
             [telemetry]) and follow its log: tail -f LOG | takt monitor -"
        )
        .into();
    }
    error.to_string().into()
}
