//! The error codes of an eRob.

use takt_wire::canopen::emcy::ErrorCode;

/// The fault of a drive whose multi-turn battery is empty or was disconnected.
pub const MULTI_TURN_BATTERY: ErrorCode = ErrorCode(0x730F);

/// The name of an error code, with this drive's own codes.
pub fn error_words(code: ErrorCode) -> &'static str {
    if code == MULTI_TURN_BATTERY { "battery voltage of the multi-turn encoder low" } else { code.words() }
}

/// An error code with its name.
pub fn error_text(code: ErrorCode) -> String {
    format!("0x{:04X} ({})", code.0, error_words(code))
}

/// The cure of an error that is this drive's own.
pub(super) fn error_advice(code: ErrorCode) -> Option<&'static str> {
    (code == MULTI_TURN_BATTERY).then_some(
        "replace the battery, then use `clear-fault --yes`; this also clears the turn count, so the joint's zero \
         must be set again",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_battery_fault_has_a_name() {
        assert_eq!(error_words(MULTI_TURN_BATTERY), "battery voltage of the multi-turn encoder low");
        assert_eq!(error_words(ErrorCode(0x8611)), "following error");
    }
}
