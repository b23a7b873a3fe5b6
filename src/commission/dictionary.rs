//! The objects of a family as people meet them: names, access, units.

use crate::canopen::object::{DataType, Object, ObjectAddress};
use crate::config::Quantity;

use super::failure::Failure;
use super::family::Family;
use super::subject::Subject;

/// What may be done with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Reading.
    Read,
    /// Reading and writing.
    Write,
}

/// The unit of an object's number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// A bare number, a pattern of bits, a choice.
    None,
    /// Counts of a position.
    Position,
    /// Counts of a distance.
    Distance,
    /// The drive's unit of velocity.
    Velocity,
    /// A tenth of it.
    VelocityTenth,
    /// The drive's unit of acceleration.
    Acceleration,
    /// Per mille of the rated torque.
    Torque,
    /// So many of this unit for one of the object's.
    Of(f64, &'static str),
}

/// An object with what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Address, type and name.
    pub object: Object,
    /// What may be done with it.
    pub permission: Permission,
    /// Its unit.
    pub unit: Unit,
}

impl Entry {
    /// An object that can be read.
    pub const fn read(object: Object, unit: Unit) -> Self {
        Self { object, permission: Permission::Read, unit }
    }

    /// An object that can be read and written.
    pub const fn write(object: Object, unit: Unit) -> Self {
        Self { object, permission: Permission::Write, unit }
    }

    /// A value with its unit, as the joint has it; `None` when the number says everything.
    pub fn physical(&self, subject: &Subject, value: i64) -> Option<(f64, String)> {
        let shown = |quantity: Quantity, value: f64| Some((value, quantity.show(value)));
        match self.unit {
            Unit::Position => shown(subject.position_quantity(), subject.position(value)),
            Unit::Distance => shown(subject.position_quantity(), value as f64 / subject.scale.resolution()),
            Unit::Velocity => shown(subject.velocity_quantity(), subject.velocity(value as f64)),
            Unit::VelocityTenth => shown(subject.velocity_quantity(), subject.velocity(value as f64 / 10.0)),
            Unit::Acceleration => shown(subject.acceleration_quantity(), subject.acceleration(value as f64)),
            Unit::Of(factor, unit) => {
                let value = value as f64 * factor;
                let rounded = (value * 1e6).round() / 1e6;
                Some((value, format!("{rounded} {unit}")))
            }
            Unit::Torque => Some((value as f64 / 1000.0, format!("{} % of rated", value as f64 / 10.0))),
            Unit::None => None,
        }
    }

    /// The number to write for `text`: with a unit a joint value, plain a number of the drive's where the object has no
    /// unit or `is_raw`.
    ///
    /// # Errors
    /// [`Failure::Unsuitable`] for what is no value of this object.
    pub fn parse(&self, subject: &Subject, text: &str, is_raw: bool) -> Result<i64, Failure> {
        let unsuitable = |reason: String| Failure::Unsuitable(format!("{}: {reason}", self.object));
        if is_raw || matches!(self.unit, Unit::None) {
            return integer(text).ok_or_else(|| unsuitable(format!("`{text}` is no whole number")));
        }
        let quantity = match self.unit {
            Unit::Position | Unit::Distance => subject.position_quantity(),
            Unit::Velocity => subject.velocity_quantity(),
            Unit::Acceleration => subject.acceleration_quantity(),
            Unit::Torque | Unit::Of(..) | Unit::VelocityTenth | Unit::None => {
                let reason = match self.unit {
                    Unit::Torque => "give per mille of the rated torque with `--raw`".to_owned(),
                    Unit::Of(factor, unit) => {
                        format!("give a number of {factor} {unit} with `--raw`")
                    }
                    _ => String::new(),
                };
                return Err(unsuitable(reason));
            }
        };
        let value =
            super::amount::parse(text, quantity, false).map_err(|error| unsuitable(error.to_string()))?;
        Ok(match self.unit {
            Unit::Position => subject.position_counts(value),
            Unit::Distance => subject.distance_counts(value).abs(),
            Unit::Velocity if self.object.data_type == DataType::U32 => subject.velocity_raw(value).abs(),
            Unit::Velocity => subject.velocity_raw(value),
            _ => subject.acceleration_raw(value),
        })
    }
}

/// An object as it was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// One that the family's table has.
    Known(Entry),
    /// Another one; the type was told or is that of its length.
    Unknown(ObjectAddress),
}

/// Finds an object by `index:subindex` (hexadecimal, `6064`, `0x6064:00`, `60FBh:01`) or by its name, or the beginning
/// of it.
///
/// # Errors
/// [`Failure::Unsuitable`] for what is neither, or for a name that several objects begin with.
pub fn find(family: Family, text: &str) -> Result<Choice, Failure> {
    let entries = family.objects();
    if let Some(address) = address(text) {
        let known = entries.iter().find(|entry| entry.object.address == address);
        return Ok(known.map_or(Choice::Unknown(address), |entry| Choice::Known(*entry)));
    }
    let wanted = plain(text);
    let named = |is_it: &dyn Fn(&str) -> bool| -> Vec<&Entry> {
        entries.iter().filter(|entry| is_it(&plain(entry.object.name))).collect()
    };
    let exact = named(&|name| name == wanted);
    let found = if exact.is_empty() { named(&|name| name.starts_with(&wanted)) } else { exact };
    match found.as_slice() {
        [one] => Ok(Choice::Known(**one)),
        [] => Err(Failure::Unsuitable(format!(
            "`{text}` is no object: give index:subindex in hexadecimal (6064, 1018:01) or a name, such as \
             `position actual value`"
        ))),
        several => {
            let names: Vec<String> = several.iter().map(|entry| entry.object.to_string()).collect();
            Err(Failure::Unsuitable(format!("`{text}` could be {}", names.join(", "))))
        }
    }
}

fn plain(name: &str) -> String {
    name.to_lowercase().replace(['_', '-'], " ")
}

fn address(text: &str) -> Option<ObjectAddress> {
    let hexadecimal = |text: &str| {
        let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
        let digits = digits.strip_suffix(['h', 'H']).unwrap_or(digits);
        u32::from_str_radix(digits, 16).ok()
    };
    let (index, subindex) = text.split_once(':').unwrap_or((text, "0"));
    let is_index = index.len() >= 4 && index.starts_with(|first: char| first.is_ascii_digit());
    let index = hexadecimal(index).filter(|_| is_index)?;
    Some(ObjectAddress::new(u16::try_from(index).ok()?, u8::try_from(hexadecimal(subindex)?).ok()?))
}

/// A whole number, decimal or hexadecimal (`0x…`), with `_` between digits where that helps.
pub fn integer(text: &str) -> Option<i64> {
    let text = text.trim().replace('_', "").replace('−', "-");
    let (is_negative, digits) = text.strip_prefix('-').map_or((false, text.as_str()), |rest| (true, rest));
    let value = match digits.strip_prefix("0x").or(digits.strip_prefix("0X")) {
        Some(hexadecimal) => i64::from_str_radix(hexadecimal, 16).ok()?,
        None if digits.starts_with(|first: char| first.is_ascii_digit()) => digits.parse().ok()?,
        None => return None,
    };
    Some(if is_negative { -value } else { value })
}

/// The type with this name.
pub fn data_type(name: &str) -> Option<DataType> {
    Some(match name.to_lowercase().as_str() {
        "u8" | "unsigned8" => DataType::U8,
        "i8" | "integer8" => DataType::I8,
        "u16" | "unsigned16" => DataType::U16,
        "i16" | "integer16" => DataType::I16,
        "u32" | "unsigned32" => DataType::U32,
        "i32" | "integer32" => DataType::I32,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address_of(text: &str) -> Option<ObjectAddress> {
        match find(Family::ErobCanopen, text) {
            Ok(Choice::Known(entry)) => Some(entry.object.address),
            Ok(Choice::Unknown(address)) => Some(address),
            Err(_) => None,
        }
    }

    #[test]
    fn objects_are_found_by_every_spelling_of_their_address() {
        for text in ["6064", "0x6064", "6064h", "6064:0", "6064:00", "0x6064:0x00"] {
            assert_eq!(address_of(text), Some(ObjectAddress::new(0x6064, 0)), "{text}");
        }
        assert_eq!(address_of("1018:1"), Some(ObjectAddress::new(0x1018, 1)));
        assert_eq!(address_of("5F00:3"), Some(ObjectAddress::new(0x5F00, 3)));
        assert_eq!(address_of("16064"), None);
    }

    #[test]
    fn objects_are_found_by_their_name_or_the_beginning_of_it() {
        assert_eq!(address_of("position actual value"), Some(ObjectAddress::new(0x6064, 0)));
        assert_eq!(address_of("Position-Actual"), Some(ObjectAddress::new(0x6064, 0)));
        let ambiguous = find(Family::ErobCanopen, "profile").unwrap_err().to_string();
        assert!(ambiguous.contains("6081:00 (profile velocity)"), "{ambiguous}");
        assert!(find(Family::ErobCanopen, "no such thing").is_err());
    }

    #[test]
    fn whole_numbers_are_decimal_or_hexadecimal() {
        assert_eq!(integer("-0x10"), Some(-16));
        assert_eq!(integer("1_000"), Some(1000));
        assert_eq!(integer("--1"), None);
        assert_eq!(integer("1.5"), None);
        assert_eq!(integer(""), None);
    }
}
