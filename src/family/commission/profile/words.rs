//! Names of statusword bits, controlword bits and modes.

use takt_rt::{Command, DriveState, OperationMode, controlword, statusword};

/// State and bits of a statusword. What bit 12 means depends on the mode, so it is not named.
pub fn statusword_words(word: u16) -> String {
    let bits = [
        (statusword::WARNING, "warning"),
        (statusword::TARGET_REACHED, "target reached"),
        (statusword::INTERNAL_LIMIT, "internal limit"),
        (statusword::BIT_13, "following error"),
    ];
    let set = bits.iter().filter(|(bit, _)| word & bit != 0).map(|(_, name)| *name);
    let words: Vec<&str> = std::iter::once(DriveState::decode(word).name()).chain(set).collect();
    words.join(", ")
}

/// Command and bits of a controlword.
pub fn controlword_words(word: u16) -> String {
    let command = match Command::decode(word) {
        Command::Shutdown => "shutdown",
        Command::SwitchOn => "switch on",
        Command::EnableOperation => "enable operation",
        Command::DisableVoltage => "disable voltage",
        Command::QuickStop => "quick stop",
    };
    let bits = [
        (controlword::BIT_4, "new set-point"),
        (controlword::BIT_5, "change immediately"),
        (controlword::RELATIVE, "relative"),
        (controlword::FAULT_RESET, "fault reset"),
        (controlword::HALT, "halt"),
    ];
    let set = bits.iter().filter(|(bit, _)| word & bit != 0).map(|(_, name)| *name);
    std::iter::once(command).chain(set).collect::<Vec<_>>().join(", ")
}

/// The names of the modes in object 6502.
pub fn modes_words(supported: u32) -> String {
    let modes = OperationMode::ALL.into_iter().filter(|mode| supported & mode.supported_bit() != 0);
    modes.map(OperationMode::name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statusword_and_controlword_are_decoded_by_their_masks() {
        assert_eq!(statusword_words(0x16B7), "operation enabled, warning, target reached");
        assert_eq!(statusword_words(0x1208), "fault");
        assert_eq!(controlword_words(0x1F), "enable operation, new set-point");
        assert_eq!(controlword_words(0x06), "shutdown");
        assert_eq!(
            modes_words(909),
            "profile position, profile velocity, profile torque, cyclic synchronous position, \
             cyclic synchronous velocity, cyclic synchronous torque"
        );
    }
}
