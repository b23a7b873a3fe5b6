//! Reads and writes any object.

use serde_json::json;
use takt_wire::canopen::object::{DataType, Object, ObjectAddress};
use takt_wire::canopen::sdo::Uploaded;

use super::command_value;
use super::contact;
use super::dictionary::{self, ObjectEntry, Permission, SelectedObject};
use super::failure::Failure;
use super::report::Report;
use super::sdo_session::{SdoSession, number};
use super::target::TargetDrive;
use super::task::ValueText;

/// An object to read.
pub struct ReadObject {
    address: ObjectAddress,
    /// Its dictionary entry, if it is known.
    entry: Option<ObjectEntry>,
    /// The data type given by the user.
    data_type: Option<DataType>,
}

/// An object to write.
pub struct WriteObject {
    object: Object,
    value: i64,
    /// Its dictionary entry, if it is known.
    entry: Option<ObjectEntry>,
}

/// Finds the objects that the user named.
pub fn to_read(
    target: &TargetDrive,
    names: &[String],
    data_type: Option<DataType>,
) -> Result<Vec<ReadObject>, Failure> {
    let objects = names.iter().map(|name| {
        Ok(match dictionary::find(&target.drive, name)? {
            SelectedObject::Known(entry) => {
                ReadObject { address: entry.object.address, entry: Some(entry), data_type }
            }
            SelectedObject::Unknown(address) => ReadObject { address, entry: None, data_type },
        })
    });
    objects.collect()
}

/// Finds the object that the user named, and evaluates the value.
pub fn to_write(
    target: &TargetDrive,
    name: &str,
    value: &ValueText,
    data_type: Option<DataType>,
) -> Result<WriteObject, Failure> {
    let (object, entry) = match (dictionary::find(&target.drive, name)?, data_type) {
        (SelectedObject::Known(entry), None) => (entry.object, Some(entry)),
        (SelectedObject::Known(entry), Some(data_type)) if data_type == entry.object.data_type => {
            (entry.object, Some(entry))
        }
        (SelectedObject::Known(entry), Some(_)) => {
            return Err(Failure::Unsuitable(format!(
                "{} is {:?}, not what --type says",
                entry.object, entry.object.data_type
            )));
        }
        (SelectedObject::Unknown(address), Some(data_type)) => {
            (Object { address, data_type, name: "object" }, None)
        }
        (SelectedObject::Unknown(address), None) => {
            return Err(Failure::Unsuitable(format!(
                "nothing is known of {address}: say its type with --type (u8, i8, u16, i16, u32, i32)"
            )));
        }
    };
    let value = match entry {
        Some(entry) => entry.parse(target, &value.text, value.is_raw)?,
        None => command_value::integer(&value.text)
            .ok_or_else(|| Failure::Unsuitable(format!("`{}` is no whole number", value.text)))?,
    };
    if entry.is_some_and(|entry| entry.permission == Permission::Read) {
        return Err(Failure::Unsuitable(format!("{object} can only be read")));
    }
    object.data_type.encode(value).ok_or(Failure::DoesNotFit { object, value })?;
    Ok(WriteObject { object, value, entry })
}

/// Reads objects in order.
pub async fn read(c: &SdoSession, target: &TargetDrive, objects: &[ReadObject]) -> Result<Report, Failure> {
    contact::connect(c, target).await?;
    c.step("read");
    let mut values = vec![];
    let mut report = Report::new();
    for wanted in objects {
        let address = wanted.address;
        let uploaded =
            c.upload(address).await?.map_err(|error| Failure::TextTransfer { object: address, error })?;
        let object = wanted.data_type.map_or(wanted.entry.map(|entry| entry.object), |data_type| {
            Some(Object {
                address,
                data_type,
                name: wanted.entry.map_or("object", |entry| entry.object.name),
            })
        });
        let Some(object) = object else {
            let text = bytes_in_words(&uploaded);
            values.push(json!({ "object": address.to_string(), "bytes": uploaded.bytes }));
            report.add("", &address.to_string(), serde_json::Value::Null, text);
            continue;
        };
        // A type given by the user must match the data. The table's type only suggests the length.
        let value = match wanted.data_type {
            Some(data_type) => uploaded
                .number(data_type)
                .ok_or(Failure::Length { object, received: uploaded.bytes.len() })?,
            None => number(&object, &uploaded)?,
        };
        let physical = wanted.entry.and_then(|entry| entry.physical(target, value));
        let meaning = target.family().meaning(&target.drive, &object, value);
        let mut text = object.show(value);
        if let Some((_, shown)) = &physical {
            text = format!("{text} = {shown}");
        }
        if let Some(meaning) = &meaning {
            text = format!("{text}: {meaning}");
        }
        values.push(json!({
            "object": address.to_string(), "name": object.name, "raw": value,
            "value": physical.map(|(value, _)| value), "meaning": meaning,
        }));
        report.add("", &object.to_string(), serde_json::Value::Null, text);
    }
    Ok(report.under("objects", values.into()))
}

/// Writes an object and reads it back.
pub async fn write(c: &SdoSession, target: &TargetDrive, write: WriteObject) -> Result<Report, Failure> {
    let WriteObject { object, value, entry } = write;
    contact::connect(c, target).await?;
    c.step("write");
    c.write(&object, value).await?;
    c.step("read back");
    let back = c.read_optional(&object).await?;
    let mut report = Report::new();
    report.add("object", "object", object.address.to_string(), object.to_string());
    report.add("written", "written", value, object.show(value));
    if let Some(back) = back {
        let meaning = target.family().meaning(&target.drive, &object, back);
        let mut text = object.show(back);
        if let Some((_, shown)) = entry.and_then(|entry| entry.physical(target, back)) {
            text = format!("{text} = {shown}");
        }
        if let Some(meaning) = meaning {
            text = format!("{text}: {meaning}");
        }
        report.add("read_back", "read back", back, text);
        if back != value {
            c.note("the drive holds another value than was written: it may be a command object, or limit the value");
        }
    }
    Ok(report)
}

fn bytes_in_words(uploaded: &Uploaded) -> String {
    let bytes = uploaded.bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
    let mut numbers = vec![];
    let data: [u8; 4] = std::array::from_fn(|at| uploaded.bytes.get(at).copied().unwrap_or(0));
    let length = uploaded.bytes.len();
    let unsigned = u32::from_le_bytes(data);
    if (1..=4).contains(&length) {
        numbers.push(format!("unsigned {unsigned}"));
        let shift = 32 - 8 * length as u32;
        numbers.push(format!("signed {}", (unsigned << shift).cast_signed() >> shift));
    }
    if length > 4 && uploaded.bytes.iter().all(|byte| byte.is_ascii_graphic() || *byte == b' ' || *byte == 0)
    {
        numbers.push(format!("text {:?}", uploaded.text()));
    }
    format!("{length} bytes {bytes} ({})", numbers.join(", "))
}
