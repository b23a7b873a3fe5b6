//! `CompactPDO`: PDOs that the file counts but does not describe. Bit n of the key stands for sub-index n+1 of the
//! communication parameter. The values are those of the pre-defined connection set (CiA 301, 7.3.3): the first four
//! PDOs of each direction are valid, the others are not, and nothing is mapped.

use super::data_type::DataTypeCode;
use super::dictionary::{AccessType, DictionaryObject, LocatedValue, ObjectDictionary, ObjectType};
use super::number::Number;
use super::objects::{implied, list_of};
use super::value::Value;
use crate::canopen::objects::PDO_INVALID;

/// The largest number of PDOs in one direction.
const MAX_PDOS: u16 = 512;

const SUB_OBJECTS: [(u8, &str, DataTypeCode); 6] = [
    (1, "COB-ID", DataTypeCode::UNSIGNED32),
    (2, "Transmission type", DataTypeCode::UNSIGNED8),
    (3, "Inhibit time", DataTypeCode::UNSIGNED16),
    (4, "Compatibility entry", DataTypeCode::UNSIGNED8),
    (5, "Event timer", DataTypeCode::UNSIGNED16),
    (6, "SYNC start value", DataTypeCode::UNSIGNED8),
];

/// Adds the objects of every PDO that is counted but not described.
pub(super) fn expand(dictionary: &mut ObjectDictionary) {
    let mask = dictionary.device.compact_pdo;
    if mask == 0 {
        return;
    }
    let granularity = dictionary.device.granularity.clamp(1, 64);
    let mapped = if dictionary.device.granularity == 0 { 8 } else { 64 / granularity };
    for (first_id, communication, mapping, count) in [
        (0x200, 0x1400, 0x1600, dictionary.device.rpdo_count),
        (0x180, 0x1800, 0x1A00, dictionary.device.tpdo_count),
    ] {
        for place in 0..count.unwrap_or(0).min(MAX_PDOS) {
            if dictionary.object(communication + place).is_none() {
                let object = communication_parameter(communication + place, place, first_id, mask);
                insert(dictionary, object);
            }
            if dictionary.object(mapping + place).is_none() {
                insert(dictionary, mapping_parameter(mapping + place, mapped));
            }
        }
    }
}

fn communication_parameter(index: u16, place: u16, first_id: u32, mask: u8) -> DictionaryObject {
    let cob_id = if place < 4 {
        Number { constant: (first_id + 0x100 * u32::from(place)).into(), adds_node: true }
    } else {
        Number::constant(PDO_INVALID.into())
    };
    let highest = 8 - (mask & 0x3F).leading_zeros();
    let mut entries = vec![implied(
        index,
        0,
        "Highest sub-index supported",
        DataTypeCode::UNSIGNED8,
        AccessType::Constant,
        stated(Number::constant(highest.into())),
    )];
    for (subindex, name, data_type) in SUB_OBJECTS {
        if mask & 1 << (subindex - 1) == 0 {
            continue;
        }
        let default = match subindex {
            1 => cob_id,
            2 => Number::constant(0xFF),
            _ => Number::constant(0),
        };
        entries.push(implied(index, subindex, name, data_type, AccessType::ReadWrite, stated(default)));
    }
    record(index, "PDO communication parameter", entries)
}

fn mapping_parameter(index: u16, mapped: u8) -> DictionaryObject {
    let entry = |subindex: u8, name: &str, data_type| {
        let default = stated(Number::constant(0));
        implied(index, subindex, name, data_type, AccessType::ReadWrite, default)
    };
    let mut entries = vec![entry(0, "Number of mapped objects", DataTypeCode::UNSIGNED8)];
    entries.extend((1..=mapped).map(|subindex| entry(subindex, "Mapped object", DataTypeCode::UNSIGNED32)));
    record(index, "PDO mapping parameter", entries)
}

fn record(index: u16, name: &str, entries: Vec<super::dictionary::DictionaryEntry>) -> DictionaryObject {
    let object_type = ObjectType::Record;
    DictionaryObject { index, name: name.to_owned(), object_type, list: list_of(index), entries, line: None }
}

/// A value that is not written in the file.
fn stated(number: Number) -> Option<LocatedValue> {
    Some(LocatedValue { value: Value::Number(number), line: 0, span: 0..0 })
}

fn insert(dictionary: &mut ObjectDictionary, object: DictionaryObject) {
    if let Err(place) = dictionary.objects.binary_search_by_key(&object.index, |object| object.index) {
        dictionary.objects.insert(place, object);
    }
}
