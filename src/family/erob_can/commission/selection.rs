//! Reading and writing entries that the user names.

use serde_json::{Value, json};

use crate::canopen::object::DataType;
use crate::config::Quantity;
use crate::erob_can::entries::{self, Entry, EntryAccess, Unit, Values};
use crate::erob_can::frame::EntryAddress;
use crate::family::commission::command_value;
use crate::family::commission::dictionary::integer;
use crate::family::commission::{Failure, Report, TargetDrive, ValueText};
use crate::family::erob_can::session::ErobCanSession;

/// Units that a number may have beside those of the joint, each with the unit on the wire and how many of it they are.
const UNITS: [(&str, Unit, f64); 15] = [
    ("count", Unit::Counts, 1.0),
    ("count", Unit::DistanceCounts, 1.0),
    ("count", Unit::EncoderCounts, 1.0),
    ("count/s", Unit::CountsPerSecond, 1.0),
    ("count/s^2", Unit::CountsPerSecondSquared, 1.0),
    ("count/s²", Unit::CountsPerSecondSquared, 1.0),
    ("A", Unit::Milliamperes, 1000.0),
    ("mA", Unit::Milliamperes, 1.0),
    ("V", Unit::Millivolts, 1000.0),
    ("mV", Unit::Millivolts, 1.0),
    ("s", Unit::Milliseconds, 1000.0),
    ("ms", Unit::Milliseconds, 1.0),
    ("%", Unit::PerMille, 10.0),
    ("‰", Unit::PerMille, 1.0),
    ("mNm", Unit::MillinewtonMetres, 1.0),
];

/// An entry to read.
#[derive(Debug)]
pub struct ToRead {
    address: EntryAddress,
    /// What the table says of it, if it has it.
    entry: Option<&'static Entry>,
}

/// An entry to write.
#[derive(Debug)]
pub struct ToWrite {
    address: EntryAddress,
    entry: Option<&'static Entry>,
    value: i32,
}

/// Finds the entries that the user named.
pub fn to_read(names: &[String], data_type: Option<DataType>) -> Result<Vec<ToRead>, Failure> {
    check_type(data_type)?;
    let found = names.iter().map(|name| {
        let (address, entry) = find(name)?;
        match entry {
            Some(entry) if !entry.access.can_read() => {
                Err(Failure::Unsuitable(format!("{entry} cannot be read: {}", only(entry))))
            }
            _ => Ok(ToRead { address, entry }),
        }
    });
    found.collect()
}

/// Finds the entry that the user named, and evaluates the value.
pub fn to_write(
    target: &TargetDrive,
    name: &str,
    value: &ValueText,
    data_type: Option<DataType>,
) -> Result<ToWrite, Failure> {
    check_type(data_type)?;
    let (address, entry) = find(name)?;
    let Some(entry) = entry else {
        if data_type.is_none() {
            return Err(Failure::Unsuitable(format!(
                "nothing is known of {address}: say with --type i32 that you mean it"
            )));
        }
        let value = integer(&value.text).and_then(|value| i32::try_from(value).ok());
        let no_number = || Failure::Unsuitable("the value is no whole number of 32 bits".to_owned());
        return Ok(ToWrite { address, entry: None, value: value.ok_or_else(no_number)? });
    };
    match entry.access {
        EntryAccess::ReadWrite | EntryAccess::Write => {}
        EntryAccess::Read => return Err(Failure::Unsuitable(format!("{entry} can only be read"))),
        EntryAccess::Command | EntryAccess::CommandWithArgument => {
            return Err(Failure::Unsuitable(format!("{entry} cannot be written: {}", only(entry))));
        }
    }
    let value = parse(target, entry, value)?;
    entry.check(value).map_err(|error| Failure::Unsuitable(error.to_string()))?;
    Ok(ToWrite { address, entry: Some(entry), value })
}

/// What an entry is for that is not read, or not written.
fn only(entry: &Entry) -> &'static str {
    match entry.access {
        EntryAccess::Write => "the manual only writes it",
        EntryAccess::Read | EntryAccess::ReadWrite => "it is read",
        EntryAccess::Command | EntryAccess::CommandWithArgument => {
            "it is a command; `enable`, `disable`, `move`, `save`, `zero` and `release-brake` send it"
        }
    }
}

/// On the wire every entry has 32 bits.
fn check_type(data_type: Option<DataType>) -> Result<(), Failure> {
    match data_type {
        None | Some(DataType::I32 | DataType::U32) => Ok(()),
        Some(_) => {
            Err(Failure::Unsuitable("every entry of this protocol has 32 bits: --type i32".to_owned()))
        }
    }
}

/// Finds an entry by `index:sub-index` (hexadecimal: `86`, `0x0232`, `0232:5`), or by its name, its beginning or a part of it.
fn find(text: &str) -> Result<(EntryAddress, Option<&'static Entry>), Failure> {
    if let Some(address) = address(text) {
        return Ok((address, entries::find(address)));
    }
    let wanted = plain(text);
    let named = |is_it: &dyn Fn(&str) -> bool| -> Vec<&'static Entry> {
        entries::ALL.iter().filter(|entry| is_it(&plain(entry.name))).collect()
    };
    let mut found = named(&|name| name == wanted);
    if found.is_empty() {
        found = named(&|name| name.starts_with(&wanted));
    }
    if found.is_empty() {
        found = named(&|name| name.contains(&wanted));
    }
    match found.as_slice() {
        [one] => Ok((one.address, Some(one))),
        [] => Err(Failure::Unsuitable(format!(
            "`{text}` is no entry: give its index in hexadecimal (0x0086, 0x0232:5) or a name, such as \
             `actual position`; `entries` lists them"
        ))),
        several => {
            let names: Vec<String> = several.iter().map(|entry| entry.to_string()).collect();
            Err(Failure::Unsuitable(format!("`{text}` could be {}", names.join(", "))))
        }
    }
}

fn plain(name: &str) -> String {
    name.to_lowercase().replace(['_', '-'], " ")
}

fn address(text: &str) -> Option<EntryAddress> {
    let hexadecimal = |text: &str| {
        let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
        u16::from_str_radix(digits.strip_suffix(['h', 'H']).unwrap_or(digits), 16).ok()
    };
    let (index, sub_index) = text.split_once(':').map_or((text, None), |(index, sub)| (index, Some(sub)));
    // A name begins with a letter.
    let index = hexadecimal(index).filter(|_| text.starts_with(|first: char| first.is_ascii_digit()))?;
    match sub_index {
        None => Some(EntryAddress::new(index)),
        Some(sub_index) => Some(EntryAddress::sub(index, hexadecimal(sub_index)?)),
    }
}

/// The number on the wire for a value as the user wrote it.
fn parse(target: &TargetDrive, entry: &Entry, value: &ValueText) -> Result<i32, Failure> {
    let text = value.text.trim();
    let unsuitable = |reason: String| Failure::Unsuitable(format!("{entry}: {reason}"));
    let number = integer(text);
    if value.is_raw || matches!(entry.unit, Unit::None) {
        if let (false, None, Values::Named(names)) = (value.is_raw, number, entry.values) {
            let wanted = plain(text);
            let named = names.iter().find(|(_, name)| plain(name) == wanted);
            let named = named.map(|(value, _)| *value);
            return named.ok_or_else(|| unsuitable(format!("`{text}` is none of {}", entry.values)));
        }
        let number = number.and_then(|number| i32::try_from(number).ok());
        return number.ok_or_else(|| unsuitable(format!("`{text}` is no whole number of 32 bits")));
    }
    let raw = match command_value::in_units_of_drive(&UNITS, entry.unit, text) {
        Some(raw) => raw,
        None => of_joint(target, entry, text).map_err(unsuitable)?,
    };
    i32::try_from(raw).map_err(|_| unsuitable(format!("{raw} does not fit 32 bits")))
}

/// A value of the joint, with its unit.
fn of_joint(target: &TargetDrive, entry: &Entry, text: &str) -> Result<i64, String> {
    let quantity = match entry.unit {
        Unit::Counts | Unit::DistanceCounts => target.position_quantity(),
        Unit::CountsPerSecond => target.velocity_quantity(),
        Unit::CountsPerSecondSquared => target.acceleration_quantity(),
        unit => {
            return Err(format!(
                "`{text}` is no value of it: write its unit, for example \"100 {}\", or `--raw`",
                unit.symbol()
            ));
        }
    };
    let value = command_value::parse(text, quantity, false).map_err(|error| error.to_string())?;
    Ok(match entry.unit {
        Unit::Counts => target.position_counts(value),
        // What may not be negative has no direction.
        Unit::DistanceCounts => signed(entry, target.distance_counts(value)),
        Unit::CountsPerSecond => signed(entry, target.velocity_raw(value)),
        _ => target.acceleration_raw(value),
    })
}

fn signed(entry: &Entry, value: i64) -> i64 {
    if matches!(entry.values, Values::Range(0, _)) { value.abs() } else { value }
}

/// The value in SI units with its text; `None` where the number on the wire says it all.
pub fn physical(target: &TargetDrive, entry: &Entry, value: i32) -> Option<(f64, String)> {
    let shown = |quantity: Quantity, value: f64| Some((value, quantity.show(value)));
    let scaled = |unit: &str| {
        let value = f64::from(value) / 1000.0;
        Some((value, format!("{value} {unit}")))
    };
    match entry.unit {
        Unit::Counts => shown(target.position_quantity(), target.position(value.into())),
        Unit::DistanceCounts => {
            shown(target.position_quantity(), f64::from(value) / target.scale.resolution())
        }
        Unit::CountsPerSecond => shown(target.velocity_quantity(), target.velocity(value.into())),
        Unit::CountsPerSecondSquared => {
            shown(target.acceleration_quantity(), target.acceleration(value.into()))
        }
        Unit::Milliamperes => scaled("A"),
        Unit::Millivolts => scaled("V"),
        Unit::Milliseconds => scaled("s"),
        Unit::MillinewtonMetres => scaled("N·m"),
        Unit::PerMille => Some((f64::from(value) / 1000.0, format!("{} %", f64::from(value) / 10.0))),
        Unit::Celsius => Some((value.into(), String::new())),
        Unit::None | Unit::EncoderCounts | Unit::BitsPerSecond => None,
    }
}

/// A value in words: as on the wire, and in the units of the joint.
pub fn words(target: &TargetDrive, entry: &Entry, value: i32) -> String {
    if *entry == entries::ERROR_CODE {
        return target.error_words(value as u16);
    }
    let shown = entry.show(value);
    match physical(target, entry, value) {
        Some((_, physical)) if !physical.is_empty() => format!("{shown} = {physical}"),
        _ => shown,
    }
}

/// `read`
pub async fn read(c: &ErobCanSession, s: &TargetDrive, entries: &[ToRead]) -> Result<Report, Failure> {
    c.step("read");
    let (mut values, mut report) = (vec![], Report::new());
    for ToRead { address, entry } in entries {
        let value = c.read_at(*address).await?;
        let physical = entry.and_then(|entry| physical(s, entry, value)).map(|(value, _)| value);
        values.push(json!({
            "object": address.to_string(), "name": entry.map_or("entry", |entry| entry.name), "raw": value,
            "value": physical, "meaning": entry.and_then(|entry| entry.meaning(value)),
        }));
        let text = entry.map_or_else(|| value.to_string(), |entry| words(s, entry, value));
        report.add("", &entries::describe(*address), Value::Null, text);
    }
    Ok(report.under("objects", values.into()))
}

/// `write`
pub async fn write(c: &ErobCanSession, s: &TargetDrive, write: ToWrite) -> Result<Report, Failure> {
    let ToWrite { address, entry, value } = write;
    let shown = |value| entry.map_or_else(|| i32::to_string(&value), |entry| words(s, entry, value));
    c.step("write");
    c.write_at(address, value).await?;
    let mut report = Report::new();
    report.add("object", "entry", address.to_string(), entries::describe(address));
    report.add("written", "written", value, shown(value));
    if entry.is_some_and(|entry| entry.access.can_read()) {
        c.step("read back");
        let back = c.read_at(address).await?;
        report.add("read_back", "read back", back, shown(back));
        if back != value {
            c.note("the drive holds another value than was written: it may limit the value");
        }
    }
    if let Some(entry) = entry.filter(|entry| !entry.note.is_empty()) {
        c.note(format!("{}: {}", entry.name, entry.note));
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DriveFamily;

    fn target() -> TargetDrive {
        TargetDrive::unconfigured(1, DriveFamily::of_family(&super::super::super::FACTS)).unwrap()
    }

    fn to_write(name: &str, text: &str) -> Result<i32, String> {
        let value = ValueText { text: text.to_owned(), is_raw: false };
        super::to_write(&target(), name, &value, None)
            .map(|write| write.value)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn an_entry_is_found_by_its_index_its_name_and_the_beginning_of_its_name() {
        for text in ["0x0086", "86", "0086", "absolute target position", "Absolute_Target", "absolute"] {
            let (address, entry) = find(text).unwrap();
            assert_eq!((address.index, entry), (0x86, Some(&entries::TARGET_POSITION)), "{text}");
        }
        assert_eq!(find("0x232:5").unwrap().1, Some(&entries::MODEL_B));
        assert_eq!(find("0x0777").unwrap(), (EntryAddress::new(0x777), None));
        let error = find("phase").unwrap_err().to_string();
        assert!(error.contains("could be phase U current (0x0009), phase V current"), "{error}");
        let error = find("motor current").unwrap_err().to_string();
        assert!(
            error.contains("could be actual motor current (0x0008), maximum motor current (0x0063)"),
            "{error}"
        );
        assert!(find("nonsense").unwrap_err().to_string().contains("is no entry"));
    }

    #[test]
    fn a_value_is_written_with_a_unit_of_the_joint_or_of_the_drive_or_as_a_word() {
        for (name, text, value) in [
            ("absolute", "90 deg", 131_072),
            ("absolute", "-5000 count", -5_000),
            ("profile velocity", "0.5 turn/s", 262_144),
            ("profile velocity", "30000 count/s", 30_000),
            ("profile acceleration", "360 deg/s^2", 524_288),
            ("stall current", "1.5 A", 1_500),
            ("stall current", "1500 mA", 1_500),
            ("dwell time", "0.25 s", 250),
            ("maximum output torque", "120 %", 1_200),
            ("operating mode", "velocity control", 2),
            ("operating mode", "3", 3),
            ("position loop gain", "120", 120),
        ] {
            assert_eq!(to_write(name, text), Ok(value), "{name} {text}");
        }
    }

    #[test]
    fn a_value_without_its_unit_out_of_range_or_for_a_command_is_refused_with_what_is_right() {
        for (name, text, words) in [
            ("absolute", "90", "has no unit: write for example \"170 deg\""),
            ("operating mode", "4", "takes 1 (torque control), 2 (velocity control), 3 (position control)"),
            ("operating mode", "fast", "`fast` is none of 1 (torque control)"),
            ("CAN address", "65", "cannot be 65: it takes 1 to 64"),
            ("stall current", "-1 A", "takes 0 and more"),
            ("stall current", "3 deg", "write its unit, for example \"100 mA\""),
            ("actual position", "0 deg", "can only be read"),
            ("motor enable", "1", "it is a command; `enable`"),
            ("reset load", "1", "it is a command"),
            ("0x0777", "1", "nothing is known of 0x0777"),
        ] {
            let error = to_write(name, text).unwrap_err();
            assert!(error.contains(words), "{name} {text}: {error}");
        }
    }
}
