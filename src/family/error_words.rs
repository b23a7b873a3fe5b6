//! The error codes of drives in words, each with its cure. What a code means depends on the family of the drive.

use takt_wire::canopen::emcy::ErrorCode;

use super::DataSheet;
use super::registry::{named, of};
use crate::config::DriveFamily;
use crate::words;
use crate::words::Words;

/// A drive that reports a fault without a code.
const NO_CODE: &str = "`takt drive … info` reads what the drive knows of it, and `clear-fault` clears it";
/// A code without a cure of its own.
pub(super) const UNKNOWN: &str =
    "remove its cause, then `takt drive … clear-fault`; if it stays, power-cycle the drive";

/// The cures of standard codes: mask, code, cure. The first that matches holds.
const CURES: [(u16, u16, &str); 17] = [
    (0xFFFF, 0x7121, "free the joint, then `takt drive … clear-fault`"),
    (
        0xFFFF,
        0x8130,
        "make sure that the controller runs and its heartbeat reaches the drive; the next bring-up clears it",
    ),
    (
        0xFFFF,
        0x8611,
        "look for a blocked or overloaded joint, and lower its acceleration; then `takt drive … clear-fault`",
    ),
    (
        0xFFFF,
        0x8612,
        "move the joint back inside its range by hand or with `takt drive … move`, and check its limits",
    ),
    (0xFFF0, 0x2350, "let the drive cool, and lower load and acceleration"),
    (0xF000, 0x2000, "look for a blocked joint and a damaged motor cable, and lower load and acceleration"),
    (
        0xFFF0,
        0x3210,
        "check the supply; a hard deceleration raises it: lower the deceleration or fit a brake resistor",
    ),
    (0xFFF0, 0x3220, "check the supply and its cable: it falls under load"),
    (0xF000, 0x3000, "check the supply and its cable"),
    (0xF000, 0x4000, "let the drive cool, and check load, cooling and ambient temperature"),
    (0xFF00, 0x5500, "power-cycle the drive; if it stays, its memory needs the vendor's service"),
    (0xF000, 0x5000, "power-cycle the drive; if it stays, it needs the vendor's service"),
    (
        0xFF00,
        0x6300,
        "check the parameters that were written to the drive, or restore its defaults, then power-cycle it",
    ),
    (0xF000, 0x6000, "power-cycle the drive; if it stays, it needs the vendor's service"),
    (0xFF00, 0x7300, "check the encoder and its cable, then power-cycle the drive"),
    (0xFF00, 0x8100, "check wiring, termination and load of the bus, then `takt drive … clear-fault`"),
    (0xFF00, 0x8600, "look for a blocked joint, and check limits and gains; then `takt drive … clear-fault`"),
];

/// The cure of a standard code.
fn standard_cure(code: ErrorCode) -> &'static str {
    match CURES.iter().find(|(mask, wanted, _)| code.0 & mask == *wanted) {
        Some((_, _, cure)) => cure,
        None => UNKNOWN,
    }
}

/// A code with its name.
pub fn coded(code: u16, name: Words) -> Words {
    words!("{code} ({name})", code = format!("0x{code:04X}"), name)
}

/// A code of CiA 301 or CiA 402 with its name.
pub fn standard_error(code: u16) -> Words {
    coded(code, Words::bilingual(ErrorCode(code).bilingual()))
}

/// The code of a drive in words. Recordings of earlier versions do not name the family.
pub fn error_words(family: Option<&str>, code: u16) -> Words {
    match family.and_then(named) {
        Some(family) => family.error_words(code),
        None => standard_error(code),
    }
}

/// The code of a drive in words: its own, or else those of its family.
pub fn drive_error_words(drive: &DriveFamily, code: u16) -> Words {
    own_error_words(own_errors(drive), code).unwrap_or_else(|| of(drive).error_words(code))
}

/// What clears the fault of a drive and its cause: its own cure, or else that of its family.
pub fn drive_error_cure(drive: &DriveFamily, code: u16) -> &'static str {
    let own = of(drive).data_sheet(drive).and_then(|sheet| sheet.own_cure(code));
    own.unwrap_or_else(|| error_cure(Some(drive.word), code))
}

/// The error codes that a drive has its own words for.
pub fn own_errors(drive: &DriveFamily) -> &[(u16, String)] {
    of(drive).data_sheet(drive).map_or(&[], DataSheet::own_errors)
}

/// The code in a drive's own words, if it has some for it.
pub fn own_error_words(own: &[(u16, String)], code: u16) -> Option<Words> {
    let own = own.iter().find(|(known, _)| *known == code);
    own.map(|(_, words)| coded(code, words.clone().into()))
}

/// What clears the fault and its cause.
pub fn error_cure(family: Option<&str>, code: u16) -> &'static str {
    if code == 0 {
        return NO_CODE;
    }
    family
        .and_then(named)
        .and_then(|family| family.error_cure(code))
        .unwrap_or_else(|| standard_cure(ErrorCode(code)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_family_has_its_own_words_and_cures_for_a_code() {
        let (erob, yz_aim) = (Some("erob-canopen"), Some("yz-aim"));
        assert_eq!(
            error_words(erob, 0x730F).to_string(),
            "0x730F (battery voltage of the multi-turn encoder low)"
        );
        assert!(error_cure(erob, 0x730F).contains("replace the battery"));
        assert_eq!(error_words(yz_aim, 0x12).to_string(), "alarm 12h (blocked rotor)");
        assert!(error_cure(yz_aim, 0x12).contains("free the shaft"));
        assert_eq!(error_words(None, 0x8611).to_string(), "0x8611 (following error)");
        assert!(error_cure(None, 0x8611).contains("lower its acceleration"));
    }

    #[test]
    fn every_code_has_a_cure_and_no_cure_is_out_of_reach() {
        let families = crate::family::all().into_iter().map(|family| Some(family.word()));
        for family in families.chain([None]) {
            assert!((0..=u16::MAX).all(|code| !error_cure(family, code).is_empty()));
        }
        for (_, _, cure) in CURES {
            assert!((1..=u16::MAX).any(|code| error_cure(None, code) == cure), "{cure}");
        }
    }
}
