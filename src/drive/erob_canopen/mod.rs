//! ZeroErr eRob with CANopen firmware (eRunner manual 1.7, chapter 5, and field experience): bring-up and shutdown, the
//! vendor's error codes, and the vendor's own protocol.

pub(super) mod bring_up;

use takt_rt::{Frame, Id};

use super::identifiers::OtherProtocol;
use crate::canopen::emcy::ErrorCode;
use crate::canopen::sdo::SdoTiming;
use crate::procedure::SdoQuirks;

/// The fault of a drive whose multi-turn battery is empty or was disconnected.
pub const MULTI_TURN_BATTERY: ErrorCode = ErrorCode(0x730F);

/// Its SDO server follows the standard.
pub(super) const SDO_QUIRKS: SdoQuirks = SdoQuirks {
    timing: SdoTiming { reply_timeout_ns: 100_000_000, retries: 2 },
    gap_ns: 0,
    has_short_replies: false,
    has_other_lengths: false,
    is_silent_if_absent: false,
};

/// The name of an error code, with this drive's own codes.
pub fn error_words(code: ErrorCode) -> &'static str {
    if code == MULTI_TURN_BATTERY { "battery voltage of the multi-turn encoder low" } else { code.words() }
}

/// An error code with its name.
pub fn error_text(code: ErrorCode) -> String {
    format!("0x{:04X} ({})", code.0, error_words(code))
}

/// The cure of an error that is this drive's own.
pub fn error_advice(code: ErrorCode) -> Option<&'static str> {
    (code == MULTI_TURN_BATTERY).then_some(
        "replace the battery, then use `clear-fault --yes`; this also clears the turn count, so the joint's zero \
         must be set again",
    )
}

/// The vendor's own protocol of firmware without CANopen. The request 0x0002 reads the position and changes nothing.
/// Above node ID 63 its identifiers are those of other nodes' SDO.
pub(super) fn other_protocol(node: u8) -> Option<OtherProtocol> {
    let name = "vendor's custom CAN protocol";
    let id = |base: u32| Id::base(base + u32::from(node)).ok();
    let (request, answer) = (id(0x640)?, id(0x5C0)?);
    (1..=63).contains(&node).then(|| OtherProtocol {
        name,
        request: Frame::of(request, [0x00, 0x02]),
        answer,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probe_in_the_vendors_protocol_reads_the_position_and_uses_no_other_nodes_identifiers() {
        let request = other_protocol(2).unwrap();
        assert_eq!(format!("{:?}", request.request), "642#0002");
        assert_eq!(request.answer.value(), 0x5C2);
        assert_eq!(other_protocol(64), None);
    }

    #[test]
    fn the_battery_fault_has_a_name() {
        assert_eq!(error_words(MULTI_TURN_BATTERY), "battery voltage of the multi-turn encoder low");
        assert_eq!(error_words(ErrorCode(0x8611)), "following error");
    }
}
