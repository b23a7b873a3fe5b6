//! Reading and writing registers that the user names.

use serde_json::{Value, json};

use super::drive::ErobDrive;
use super::registers::{self, Access, Register, Unit, Values};
use crate::family::NamedEntry;
use crate::family::commission::command_value;
use crate::family::commission::dictionary::integer;
use crate::family::commission::{Failure, Report, TargetDrive, ValueText};

/// Units that a number may have beside those of the joint, each with the unit on the wire and how many of it they are.
const UNITS: [(&str, Unit, f64); 13] = [
    ("count", Unit::Counts, 1.0),
    ("count/s", Unit::CountsPerSecond, 1.0),
    ("count/s^2", Unit::CountsPerSecondSquared, 1.0),
    ("count/s²", Unit::CountsPerSecondSquared, 1.0),
    ("A", Unit::Milliamperes, 1000.0),
    ("mA", Unit::Milliamperes, 1.0),
    ("V", Unit::Millivolts, 1000.0),
    ("mV", Unit::Millivolts, 1.0),
    ("s", Unit::Milliseconds, 1000.0),
    ("ms", Unit::Milliseconds, 1.0),
    ("s", Unit::FiftyMicroseconds, 20_000.0),
    ("ms", Unit::FiftyMicroseconds, 20.0),
    ("°C", Unit::Celsius, 1.0),
];

/// Everything in the table of the manual.
pub fn entries() -> Vec<NamedEntry> {
    let named = registers::ALL.iter().map(|register| NamedEntry {
        address: format!("0x{:04X}", register.address),
        name: register.name,
        access: match register.access {
            Access::Read => "read",
            Access::ReadWrite => "read, write",
            Access::Command => "command",
        },
        unit: register.unit.symbol().to_owned(),
        values: register.values.to_string(),
        note: register.note,
    });
    named.collect()
}

/// Finds the registers that the user named, to read them.
pub fn to_read(names: &[String]) -> Result<Vec<Register>, Failure> {
    let found = names.iter().map(|name| {
        let register = find(name)?;
        if register.access.can_read() {
            return Ok(register);
        }
        Err(Failure::Unsuitable(format!("{register} cannot be read: it is a command")))
    });
    found.collect()
}

/// Finds the register that the user named, and evaluates the value.
pub fn to_write(target: &TargetDrive, name: &str, value: &ValueText) -> Result<(Register, i64), Failure> {
    let register = find(name)?;
    match register.access {
        Access::ReadWrite => {}
        Access::Read => return Err(Failure::Unsuitable(format!("{register} can only be read"))),
        Access::Command => {
            return Err(Failure::Unsuitable(format!(
                "{register} is a command; `enable`, `disable`, `move`, `save`, `clear-fault` and `zero` send it"
            )));
        }
    }
    let value = parse(target, &register, value)?;
    register.encode(value).map_err(|error| Failure::Unsuitable(error.to_string()))?;
    Ok((register, value))
}

/// Finds a register by its address (hexadecimal: `0x0066`), by its name or the beginning of its name.
fn find(text: &str) -> Result<Register, Failure> {
    let unsuitable = |reason: String| Err(Failure::Unsuitable(reason));
    if let Some(found) = registers::named(text) {
        return Ok(*found);
    }
    let wanted = text.trim().to_lowercase().replace(['_', '-'], " ");
    let begins =
        |register: &&Register| !wanted.is_empty() && register.name.to_lowercase().starts_with(&wanted);
    let found: Vec<&Register> = registers::ALL.iter().filter(begins).collect();
    match found.as_slice() {
        [one] => Ok(**one),
        [] => unsuitable(format!(
            "`{text}` is no register: give its address in hexadecimal (0x0066) or a name, such as `actual position`; \
             `entries` lists them"
        )),
        several => {
            let names: Vec<String> = several.iter().map(|register| register.to_string()).collect();
            unsuitable(format!("`{text}` could be {}", names.join(", ")))
        }
    }
}

/// The number on the wire for a value as the user wrote it.
fn parse(target: &TargetDrive, register: &Register, value: &ValueText) -> Result<i64, Failure> {
    let text = value.text.trim();
    let unsuitable = |reason: String| Failure::Unsuitable(format!("{register}: {reason}"));
    let number = integer(text);
    if value.is_raw || register.unit == Unit::None {
        if let (false, None, Values::Named(names)) = (value.is_raw, number, register.values) {
            let named = names.iter().find(|(_, name)| name.eq_ignore_ascii_case(text));
            let refused = || unsuitable(format!("`{text}` is none of {}", register.values));
            return named.map(|(value, _)| *value).ok_or_else(refused);
        }
        return number.ok_or_else(|| unsuitable(format!("`{text}` is no whole number")));
    }
    match command_value::in_units_of_drive(&UNITS, register.unit, text) {
        Some(raw) => Ok(raw),
        None => of_joint(target, register.unit, text).map_err(unsuitable),
    }
}

/// A value of the joint, with its unit.
fn of_joint(target: &TargetDrive, unit: Unit, text: &str) -> Result<i64, String> {
    let quantity = match unit {
        Unit::Counts => target.position_quantity(),
        Unit::CountsPerSecond => target.velocity_quantity(),
        Unit::CountsPerSecondSquared => target.acceleration_quantity(),
        unit => {
            let symbol = UNITS.iter().find(|(_, of, _)| *of == unit).map_or("", |(symbol, ..)| symbol);
            return Err(format!(
                "`{text}` is no value of it: write its unit, for example \"1 {symbol}\", or `--raw`"
            ));
        }
    };
    let value = command_value::parse(text, quantity, false).map_err(|error| error.to_string())?;
    Ok(match unit {
        Unit::Counts => target.position_counts(value),
        Unit::CountsPerSecond => target.velocity_raw(value),
        _ => target.acceleration_raw(value),
    })
}

/// A value in words: as on the wire, and in the units of the joint.
pub fn words(target: &TargetDrive, register: &Register, value: i64) -> String {
    if *register == registers::FAULT_CODE {
        return target.error_words(value as u16);
    }
    let shown = register.show(value);
    let number = value as f64;
    let physical = match register.unit {
        Unit::Counts => target.position_quantity().show(target.position(value)),
        Unit::CountsPerSecond => target.velocity_quantity().show(target.velocity(number)),
        Unit::CountsPerSecondSquared => target.acceleration_quantity().show(target.acceleration(number)),
        Unit::FiftyMicroseconds => format!("{} ms", number / 20.0),
        Unit::None
        | Unit::Milliamperes
        | Unit::Millivolts
        | Unit::Milliseconds
        | Unit::Celsius
        | Unit::MillinewtonMetres => return shown,
    };
    format!("{shown} = {physical}")
}

/// `read`
pub async fn read(drive: &ErobDrive, s: &TargetDrive, registers: &[Register]) -> Result<Report, Failure> {
    drive.session().step("read");
    let (mut values, mut report) = (vec![], Report::new());
    for register in registers {
        let value = drive.read(register).await?;
        values.push(json!({
            "object": format!("0x{:04X}", register.address), "name": register.name, "raw": value,
            "text": words(s, register, value),
        }));
        report.add("", &register.to_string(), Value::Null, words(s, register, value));
    }
    Ok(report.under("objects", values.into()))
}

/// `write`
pub async fn write(
    drive: &ErobDrive,
    s: &TargetDrive,
    register: &Register,
    value: i64,
) -> Result<Report, Failure> {
    let session = drive.session();
    session.step("write");
    drive.write(register, value).await?;
    let mut report = Report::new();
    report.add("object", "register", format!("0x{:04X}", register.address), register.to_string());
    report.add("written", "written", value, words(s, register, value));
    session.step("read back");
    let back = drive.read(register).await?;
    report.add("read_back", "read back", back, words(s, register, back));
    if back != value {
        session.note("the drive holds another value than was written: it may limit the value");
    }
    if !register.note.is_empty() {
        session.note(format!("{}: {}", register.name, register.note));
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DriveFamily;

    fn to_write(name: &str, text: &str) -> Result<i64, String> {
        let target = TargetDrive::unconfigured(1, DriveFamily::of_family(&super::super::FACTS)).unwrap();
        let value = ValueText { text: text.to_owned(), is_raw: false };
        super::to_write(&target, name, &value).map(|(_, value)| value).map_err(|error| error.to_string())
    }

    #[test]
    fn a_value_is_written_with_a_unit_of_the_joint_or_of_the_drive_or_as_a_word() {
        for (name, text, value) in [
            ("target absolute", "90 deg", 131_072),
            ("0x0043", "-5000 count", -5_000),
            ("profile_velocity", "0.5 turn/s", 262_144),
            ("profile-acceleration", "360 deg/s^2", 524_288),
            ("reciprocating dwell time", "1 s", 20_000),
            ("position reached time", "20 ms", 400),
            ("communication time-out", "0.5 s", 500),
            ("stall current", "1.5 A", 1_500),
            ("operation mode", "velocity control", 2),
            ("bit rate", "4", 4),
        ] {
            assert_eq!(to_write(name, text), Ok(value), "{name} {text}");
        }
    }

    #[test]
    fn what_cannot_be_written_is_refused_with_what_is_right() {
        for (name, text, words) in [
            ("target absolute", "90", "has no unit: write for example"),
            ("operation mode", "fast", "`fast` is none of 1 (torque control)"),
            ("slave address", "248", "cannot be 248: it takes 1 to 247"),
            ("stall current", "3 deg", "write its unit, for example \"1 A\""),
            ("actual position", "0 deg", "can only be read"),
            ("motor enable", "1", "is a command; `enable`"),
            ("position", "0", "could be position loop gain (0x0030), position reached status"),
            ("nonsense", "0", "is no register"),
        ] {
            let error = to_write(name, text).unwrap_err();
            assert!(error.contains(words), "{name} {text}: {error}");
        }
    }
}
