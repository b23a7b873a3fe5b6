//! A family's object dictionary for the operator: names, access, units.

use takt_wire::canopen::object::{DataType, Object, ObjectAddress};
use takt_wire::quirks::NamedObject;

use crate::config::{DriveFamily, Quantity};
use crate::family::{self, DataSheet};

use super::command_value::{integer, parse};
use super::failure::Failure;
use super::target::TargetDrive;

/// Access to an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Read only.
    Read,
    /// Read and write.
    Write,
}

/// The unit of an object's value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ObjectUnit {
    /// No unit: a plain number, bits, or a choice.
    None,
    /// A position in counts.
    Position,
    /// A distance in counts.
    Distance,
    /// The drive's unit of velocity.
    Velocity,
    /// A tenth of the drive's unit of velocity.
    VelocityTenth,
    /// The drive's unit of profile velocities (6081), without a direction.
    ProfileVelocity,
    /// The drive's unit of acceleration.
    Acceleration,
    /// Per mille of the rated torque.
    Torque,
    /// One count is this factor times the named unit.
    Of(f64, &'static str),
}

impl ObjectUnit {
    /// The unit that a quirk file names: a quantity of motion, or a factor and the name of a unit (`0.001 Nm`).
    pub(in crate::family) fn named(words: &'static str) -> Self {
        match words {
            "" => Self::None,
            "position" => Self::Position,
            "distance" => Self::Distance,
            "velocity" => Self::Velocity,
            "0.1 velocity" => Self::VelocityTenth,
            "acceleration" => Self::Acceleration,
            "torque" => Self::Torque,
            words => {
                match words.split_once(' ').and_then(|(factor, unit)| Some((factor.parse().ok()?, unit))) {
                    Some((factor, unit)) => Self::Of(factor, unit),
                    None => Self::Of(1.0, words),
                }
            }
        }
    }

    /// The unit in words; empty for a plain number.
    fn words(self) -> String {
        match self {
            Self::None => String::new(),
            Self::Position | Self::Distance => "count".to_owned(),
            Self::Velocity => "the drive's unit of velocity".to_owned(),
            Self::VelocityTenth => "a tenth of the drive's unit of velocity".to_owned(),
            Self::ProfileVelocity => "the drive's unit of profile velocity".to_owned(),
            Self::Acceleration => "the drive's unit of acceleration".to_owned(),
            Self::Torque => "per mille of the rated torque".to_owned(),
            Self::Of(factor, unit) => format!("{factor} {unit}"),
        }
    }
}

/// What an object is called whose name nobody knows.
pub(crate) const UNNAMED: &str = "object";

/// An object dictionary entry with its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectEntry {
    /// Address, type and name.
    pub object: Object,
    /// Access to it.
    pub permission: Permission,
    /// Its unit.
    pub unit: ObjectUnit,
}

impl ObjectEntry {
    /// A read-only object.
    pub const fn read(object: Object, unit: ObjectUnit) -> Self {
        Self { object, permission: Permission::Read, unit }
    }

    /// A writable object.
    pub const fn write(object: Object, unit: ObjectUnit) -> Self {
        Self { object, permission: Permission::Write, unit }
    }

    /// The value in SI units with its text; `None` for an object without a unit.
    pub fn physical(&self, target: &TargetDrive, value: i64) -> Option<(f64, String)> {
        let shown =
            |quantity: Quantity, value: f64| target.has_units().then(|| (value, quantity.show(value)));
        match self.unit {
            ObjectUnit::Position => shown(target.position_quantity(), target.position(value)),
            ObjectUnit::Distance => {
                shown(target.position_quantity(), value as f64 / target.scale.resolution())
            }
            ObjectUnit::Velocity => shown(target.velocity_quantity(), target.velocity(value as f64)),
            ObjectUnit::VelocityTenth => {
                shown(target.velocity_quantity(), target.velocity(value as f64 / 10.0))
            }
            ObjectUnit::ProfileVelocity => {
                let speed = target.velocity(target.velocity_raw_of_profile(value) as f64);
                shown(target.velocity_quantity(), speed.abs())
            }
            ObjectUnit::Acceleration => {
                shown(target.acceleration_quantity(), target.acceleration(value as f64))
            }
            ObjectUnit::Of(factor, unit) => {
                let value = value as f64 * factor;
                let rounded = (value * 1e6).round() / 1e6;
                Some((value, format!("{rounded} {unit}")))
            }
            ObjectUnit::Torque => {
                Some((value as f64 / 1000.0, format!("{} % of rated", value as f64 / 10.0)))
            }
            ObjectUnit::None => None,
        }
    }

    /// Parses the raw number to write. Text with a unit is a joint value. A plain number is a drive value: it needs
    /// `is_raw`, or an object without a unit.
    ///
    /// # Errors
    /// [`Failure::Unsuitable`] when the text is not a value of this object.
    pub fn parse(&self, target: &TargetDrive, text: &str, is_raw: bool) -> Result<i64, Failure> {
        let unsuitable = |reason: String| Failure::Unsuitable(format!("{}: {reason}", self.object));
        if is_raw || matches!(self.unit, ObjectUnit::None) {
            return integer(text).ok_or_else(|| unsuitable(format!("`{text}` is no whole number")));
        }
        let quantity = match self.unit {
            ObjectUnit::Position | ObjectUnit::Distance => target.position_quantity(),
            ObjectUnit::Velocity | ObjectUnit::ProfileVelocity => target.velocity_quantity(),
            ObjectUnit::Acceleration => target.acceleration_quantity(),
            ObjectUnit::Torque | ObjectUnit::Of(..) | ObjectUnit::VelocityTenth | ObjectUnit::None => {
                let reason = match self.unit {
                    ObjectUnit::Torque => "give per mille of the rated torque with `--raw`".to_owned(),
                    ObjectUnit::Of(factor, unit) => {
                        format!("give a number of {factor} {unit} with `--raw`")
                    }
                    _ => String::new(),
                };
                return Err(unsuitable(reason));
            }
        };
        let value = parse(text, quantity, false).map_err(|error| unsuitable(error.to_string()))?;
        Ok(match self.unit {
            ObjectUnit::Position => target.position_counts(value),
            ObjectUnit::Distance => target.distance_counts(value).abs(),
            ObjectUnit::Velocity if self.object.data_type == DataType::U32 => {
                target.velocity_raw(value).abs()
            }
            ObjectUnit::Velocity => target.velocity_raw(value),
            ObjectUnit::ProfileVelocity => target.profile_velocity_raw(target.velocity_raw(value).abs()),
            _ => target.acceleration_raw(value),
        })
    }
}

/// What can be read or written by its name, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedEntry {
    /// Where it is, as the user may write it.
    pub address: String,
    /// Its name.
    pub name: &'static str,
    /// What may be done with it: "read", "read, write", "write" or "command".
    pub access: &'static str,
    /// The unit of its number in the drive; empty for a plain number.
    pub unit: String,
    /// Which numbers it takes or shows, with their meanings; empty if any.
    pub values: String,
    /// What else must be known of it; empty if nothing.
    pub note: &'static str,
}

/// The objects that the family of a drive knows by name.
pub fn entries(drive: &DriveFamily) -> Vec<NamedEntry> {
    let known = known(drive).filter_map(|known| entry(drive, known.object.address));
    let named = known.map(|entry| NamedEntry {
        address: entry.object.address.to_string(),
        name: entry.object.name,
        access: match entry.permission {
            Permission::Read => "read",
            Permission::Write => "read, write",
        },
        unit: entry.unit.words(),
        values: String::new(),
        note: "",
    });
    named.collect()
}

/// The objects that have a name: those of the drive, and of its family the others.
fn known(drive: &DriveFamily) -> impl Iterator<Item = ObjectEntry> {
    let family = family::of(drive);
    let own = named(drive);
    let is_own = |known: &&ObjectEntry| own.iter().any(|named| named.address == known.object.address);
    let of_family: Vec<ObjectEntry> =
        family.objects().iter().filter(|known| !is_own(known)).copied().collect();
    own.iter().filter_map(|named| entry(drive, named.address)).chain(of_family)
}

/// The objects that the data sheet of a drive names.
fn named(drive: &DriveFamily) -> &[NamedObject] {
    family::of(drive).data_sheet(drive).map_or(&[], DataSheet::named)
}

/// An object selected by the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SelectedObject {
    /// An object in the family's table.
    Known(ObjectEntry),
    /// An object that is not in the table; its type is given by the user or guessed from its length.
    Unknown(ObjectAddress),
}

/// The entry of an object: what its family knows of it, and what the data sheet of the drive says, if there is one.
pub fn entry(drive: &DriveFamily, address: ObjectAddress) -> Option<ObjectEntry> {
    let family = family::of(drive);
    let known = family.objects().iter().find(|entry| entry.object.address == address).copied();
    let Some(sheet) = family.data_sheet(drive) else { return known };
    let data_type = sheet.data_type(address)?;
    let named = sheet.named().iter().find(|named| named.address == address);
    let (name, unit) = match (named, known) {
        (Some(named), _) => (named.name, ObjectUnit::named(named.unit)),
        (None, Some(entry)) => (entry.object.name, entry.unit),
        (None, None) => (UNNAMED, ObjectUnit::None),
    };
    let permission = if sheet.is_writable(address) { Permission::Write } else { Permission::Read };
    Some(ObjectEntry { object: Object { address, data_type, name }, permission, unit })
}

/// Finds an object by `index:subindex` (hexadecimal: `6064`, `0x6064:00`, `60FBh:01`), or by its name or the
/// beginning of its name.
///
/// # Errors
/// [`Failure::Unsuitable`] when nothing matches, or when several names begin like this.
pub fn find(drive: &DriveFamily, text: &str) -> Result<SelectedObject, Failure> {
    if let Some(address) = address(text) {
        return Ok(entry(drive, address).map_or(SelectedObject::Unknown(address), SelectedObject::Known));
    }
    let wanted = plain(text);
    let named = |is_it: &dyn Fn(&str) -> bool| -> Vec<ObjectEntry> {
        let named = known(drive).filter(|entry| is_it(&plain(entry.object.name)));
        named.filter_map(|named| entry(drive, named.object.address)).collect()
    };
    let exact = named(&|name| name == wanted);
    let found = if exact.is_empty() { named(&|name| name.starts_with(&wanted)) } else { exact };
    match found.as_slice() {
        [one] => Ok(SelectedObject::Known(*one)),
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

/// The data type with this name.
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
        match find(&family::EROB_CANOPEN, text) {
            Ok(SelectedObject::Known(entry)) => Some(entry.object.address),
            Ok(SelectedObject::Unknown(address)) => Some(address),
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
    fn objects_are_found_by_their_name_or_its_beginning() {
        assert_eq!(address_of("position actual value"), Some(ObjectAddress::new(0x6064, 0)));
        assert_eq!(address_of("Position-Actual"), Some(ObjectAddress::new(0x6064, 0)));
        let ambiguous = find(&family::EROB_CANOPEN, "profile").unwrap_err().to_string();
        assert!(ambiguous.contains("6081:00 (profile velocity)"), "{ambiguous}");
        assert!(find(&family::EROB_CANOPEN, "no such thing").is_err());
    }
}
