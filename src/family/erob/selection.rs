//! Reading and writing parameters that the user names, whichever protocol carries them.

use serde_json::{Value, json};
use takt_wire::erob_can::parameter::{Access, Parameter, Unit, Values};

use super::module::CommandedModule;
use crate::config::Quantity;
use crate::family::commission::command_value;
use crate::family::commission::command_value::integer;
use crate::family::commission::{Failure, NamedEntry, Report, TargetDrive, ValueText};

/// Units that a number may have beside those of the joint, each with the unit on the wire and how many of it they are.
const UNITS: [(&str, Unit, f64); 18] = [
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
    ("s", Unit::FiftyMicroseconds, 20_000.0),
    ("ms", Unit::FiftyMicroseconds, 20.0),
    ("°C", Unit::Celsius, 1.0),
    ("%", Unit::PerMille, 10.0),
    ("‰", Unit::PerMille, 1.0),
    ("mNm", Unit::MillinewtonMetres, 1.0),
];

/// Everything in the table of the manual.
pub fn entries<P: Parameter>() -> Vec<NamedEntry> {
    let named = P::all().iter().map(|parameter| NamedEntry {
        address: parameter.address(),
        name: parameter.name(),
        access: parameter.access().name(),
        unit: parameter.unit().symbol().to_owned(),
        values: parameter.values().to_string(),
        note: parameter.note(),
    });
    named.collect()
}

/// Finds the parameters that the user named, to read them.
pub fn to_read<P: Parameter>(names: &[String]) -> Result<Vec<P>, Failure> {
    let found = names.iter().map(|name| {
        let parameter: P = find(name)?;
        if parameter.access().can_read() {
            return Ok(parameter);
        }
        Err(Failure::Unsuitable(format!("{parameter} cannot be read: {}", only(parameter.access()))))
    });
    found.collect()
}

/// Finds the parameter that the user named, and evaluates the value.
pub fn to_write<P: Parameter>(
    target: &TargetDrive,
    name: &str,
    value: &ValueText,
) -> Result<(P, i64), Failure> {
    let parameter: P = find(name)?;
    match parameter.access() {
        Access::ReadWrite | Access::Write => {}
        Access::Read => return Err(Failure::Unsuitable(format!("{parameter} can only be read"))),
        access @ (Access::Command | Access::CommandWithArgument) => {
            return Err(Failure::Unsuitable(format!("{parameter} cannot be written: {}", only(access))));
        }
    }
    let value = parse(target, &parameter, value)?;
    parameter.check(value).map_err(|error| Failure::Unsuitable(error.to_string()))?;
    Ok((parameter, value))
}

/// What a parameter is for that is not read, or not written.
const fn only(access: Access) -> &'static str {
    match access {
        Access::Write => "the manual only writes it",
        Access::Read | Access::ReadWrite => "it is read",
        Access::Command | Access::CommandWithArgument => {
            "it is a command; `enable`, `disable`, `move`, `save`, `clear-fault`, `zero` and their like send it"
        }
    }
}

/// Finds a parameter by its address, by its name, by the beginning of its name or by a part of it.
fn find<P: Parameter>(text: &str) -> Result<P, Failure> {
    if let Some(parameter) = P::at(text.trim()) {
        return Ok(parameter);
    }
    let wanted = plain(text);
    let named = |is_it: &dyn Fn(&str) -> bool| -> Vec<&'static P> {
        P::all().iter().filter(|parameter| !wanted.is_empty() && is_it(&plain(parameter.name()))).collect()
    };
    let mut found = named(&|name| name == wanted);
    if found.is_empty() {
        found = named(&|name| name.starts_with(&wanted));
    }
    if found.is_empty() {
        found = named(&|name| name.contains(&wanted));
    }
    let (kind, example) = (P::KIND, P::EXAMPLE);
    match found.as_slice() {
        [one] => Ok(**one),
        [] => Err(Failure::Unsuitable(format!(
            "`{text}` is no {kind}: give its address in hexadecimal ({example}) or a name, such as `actual position`; \
             `entries` lists them"
        ))),
        several => {
            let names: Vec<String> = several.iter().map(|parameter| parameter.to_string()).collect();
            Err(Failure::Unsuitable(format!("`{text}` could be {}", names.join(", "))))
        }
    }
}

fn plain(name: &str) -> String {
    name.trim().to_lowercase().replace(['_', '-'], " ")
}

/// The number on the wire for a value as the user wrote it.
fn parse<P: Parameter>(target: &TargetDrive, parameter: &P, value: &ValueText) -> Result<i64, Failure> {
    let text = value.text.trim();
    let unsuitable = |reason: String| Failure::Unsuitable(format!("{parameter}: {reason}"));
    let number = integer(text);
    if value.is_raw || parameter.unit() == Unit::None {
        if let (false, None, Values::Named(names)) = (value.is_raw, number, parameter.values()) {
            let wanted = plain(text);
            let named = names.iter().find(|(_, name)| plain(name) == wanted).map(|(value, _)| *value);
            return named.ok_or_else(|| unsuitable(format!("`{text}` is none of {}", parameter.values())));
        }
        return number.ok_or_else(|| unsuitable(format!("`{text}` is no whole number")));
    }
    match command_value::in_units_of_drive(&UNITS, parameter.unit(), text) {
        Some(raw) => Ok(raw),
        None => of_joint(target, parameter, text).map_err(unsuitable),
    }
}

/// A value of the joint, with its unit.
fn of_joint<P: Parameter>(target: &TargetDrive, parameter: &P, text: &str) -> Result<i64, String> {
    let quantity = match parameter.unit() {
        Unit::Counts | Unit::DistanceCounts => target.position_quantity(),
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
    // What may not be negative has no direction.
    let is_signed = parameter.range().0 < 0 && parameter.values() != Values::NotNegative;
    let directed = |value: i64| if is_signed { value } else { value.abs() };
    Ok(match parameter.unit() {
        Unit::Counts => target.position_counts(value),
        Unit::DistanceCounts => directed(target.distance_counts(value)),
        Unit::CountsPerSecond => directed(target.velocity_raw(value)),
        _ => target.acceleration_raw(value),
    })
}

/// The value in SI units with its text; `None` where the number on the wire says it all.
fn physical<P: Parameter>(target: &TargetDrive, parameter: &P, value: i64) -> Option<(f64, String)> {
    let shown = |quantity: Quantity, value: f64| Some((value, quantity.show(value)));
    let number = value as f64;
    let scaled = |factor: f64, unit: &str| {
        let value = number / factor;
        Some((value, format!("{value} {unit}")))
    };
    match parameter.unit() {
        Unit::Counts => shown(target.position_quantity(), target.position(value)),
        Unit::DistanceCounts => shown(target.position_quantity(), number / target.scale.resolution()),
        Unit::CountsPerSecond => shown(target.velocity_quantity(), target.velocity(number)),
        Unit::CountsPerSecondSquared => shown(target.acceleration_quantity(), target.acceleration(number)),
        Unit::Milliamperes => scaled(1000.0, "A"),
        Unit::Millivolts => scaled(1000.0, "V"),
        Unit::Milliseconds => scaled(1000.0, "s"),
        Unit::FiftyMicroseconds => scaled(20_000.0, "s"),
        Unit::MillinewtonMetres => scaled(1000.0, "N·m"),
        Unit::PerMille => Some((number / 1000.0, format!("{} %", number / 10.0))),
        Unit::Celsius => Some((number, String::new())),
        Unit::None | Unit::EncoderCounts | Unit::BitsPerSecond => None,
    }
}

/// A value in words: as on the wire, and in the units of the joint. A fault has words of its own.
pub fn words<M: CommandedModule>(target: &TargetDrive, parameter: &M::Parameter, value: i64) -> String {
    if *parameter == M::FAULT_CODE {
        return target.error_words(value as u16).to_string();
    }
    let shown = parameter.show(value);
    match physical(target, parameter, value) {
        Some((_, physical)) if !physical.is_empty() => format!("{shown} = {physical}"),
        _ => shown,
    }
}

/// `read`
pub async fn read<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    parameters: &[M::Parameter],
) -> Result<Report, Failure> {
    m.session().step("read");
    let (mut values, mut report) = (vec![], Report::new());
    for parameter in parameters {
        let value = m.read(parameter).await.map_err(Into::into)?;
        values.push(json!({
            "object": parameter.address(), "name": parameter.name(), "raw": value,
            "value": physical(s, parameter, value).map(|(value, _)| value),
            "meaning": parameter.values().meaning(value),
        }));
        report.add("", &parameter.to_string(), Value::Null, words::<M>(s, parameter, value));
    }
    Ok(report.under("objects", values.into()))
}

/// `write`
pub async fn write<M: CommandedModule>(
    m: &M,
    s: &TargetDrive,
    parameter: &M::Parameter,
    value: i64,
) -> Result<Report, Failure> {
    let session = m.session();
    session.step("write");
    m.write(parameter, value).await.map_err(Into::into)?;
    let mut report = Report::new();
    report.add("object", M::Parameter::KIND, parameter.address(), parameter.to_string());
    report.add("written", "written", value, words::<M>(s, parameter, value));
    if parameter.access().can_read() {
        session.step("read back");
        let back = m.read(parameter).await.map_err(Into::into)?;
        report.add("read_back", "read back", back, words::<M>(s, parameter, back));
        if back != value {
            session.note("the drive holds another value than was written: it may limit the value");
        }
    }
    if !parameter.note().is_empty() {
        session.note(format!("{}: {}", parameter.name(), parameter.note()));
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DriveFamily;
    use crate::family::erob_modbus::register::Register;
    use crate::family::{erob_can, erob_modbus};
    use takt_wire::erob_can::entries::{self, Entry};

    fn to_write<P: Parameter>(name: &str, text: &str) -> Result<i64, String> {
        let facts = if P::KIND == Entry::KIND { &erob_can::FACTS } else { &erob_modbus::FACTS };
        let target = TargetDrive::unconfigured(1, DriveFamily::of_family(facts)).unwrap();
        let value = ValueText { text: text.to_owned(), is_raw: false };
        super::to_write::<P>(&target, name, &value).map(|(_, value)| value).map_err(|error| error.to_string())
    }

    #[test]
    fn an_entry_is_found_by_its_index_its_name_and_the_beginning_of_its_name() {
        let find = |text: &str| find::<Entry>(text);
        for text in ["0x0086", "86", "0086", "absolute target position", "Absolute_Target", "absolute"] {
            assert_eq!(find(text), Ok(entries::TARGET_POSITION), "{text}");
        }
        assert_eq!(find("0x232:5"), Ok(entries::MODEL_B));
        let unlisted = find("0x0777").unwrap();
        assert_eq!((unlisted.is_listed(), unlisted.to_string()), (false, "0x0777".to_owned()));
        let error = find("phase").unwrap_err().to_string();
        assert!(error.contains("could be phase U current (0x0009), phase V current"), "{error}");
        let error = find("motor current").unwrap_err().to_string();
        assert!(
            error.contains("could be actual motor current (0x0008), maximum motor current (0x0063)"),
            "{error}"
        );
        for text in ["nonsense", ""] {
            assert!(find(text).unwrap_err().to_string().contains("is no entry"));
        }
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
            assert_eq!(to_write::<Entry>(name, text), Ok(value), "{name} {text}");
        }
        for (name, text, value) in [
            ("target absolute", "90 deg", 131_072),
            ("0x0043", "-5000 count", -5_000),
            ("profile_velocity", "0.5 turn/s", 262_144),
            ("profile-acceleration", "360 deg/s^2", 524_288),
            ("maximum position error", "-1 turn", 524_288),
            ("reciprocating dwell time", "1 s", 20_000),
            ("position reached time", "20 ms", 400),
            ("communication time-out", "0.5 s", 500),
            ("stall current", "1.5 A", 1_500),
            ("operation mode", "velocity control", 2),
            ("bit rate", "4", 4),
        ] {
            assert_eq!(to_write::<Register>(name, text), Ok(value), "{name} {text}");
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
            ("stall current", "3 deg", "write its unit, for example \"1 A\""),
            ("actual position", "0 deg", "can only be read"),
            ("motor enable", "1", "it is a command; `enable`"),
            ("reset load", "1", "it is a command"),
        ] {
            let error = to_write::<Entry>(name, text).unwrap_err();
            assert!(error.contains(words), "{name} {text}: {error}");
        }
        for (name, text, words) in [
            ("target absolute", "90", "has no unit: write for example"),
            ("operation mode", "fast", "`fast` is none of 1 (torque control)"),
            ("slave address", "248", "cannot be 248: it takes 1 to 247"),
            ("stall current", "3 deg", "write its unit, for example \"1 A\""),
            ("actual position", "0 deg", "can only be read"),
            ("motor enable", "1", "it is a command; `enable`"),
            ("position", "0", "could be position loop gain (0x0030), position reached status"),
            ("nonsense", "0", "is no register"),
        ] {
            let error = to_write::<Register>(name, text).unwrap_err();
            assert!(error.contains(words), "{name} {text}: {error}");
        }
    }
}
