//! Checks that PDO mappings refer to existing, mappable objects with the right length.

use takt_rt::MappedObject;

use super::data_type::{DataTypeCode, ValueKind};
use super::dictionary::{DictionaryEntry, ObjectDictionary};
use super::findings::Reporter;
use super::problem::EdsProblemKind;
use crate::canopen::object::ObjectAddress;

/// The indices of simple data types, which are mapped as placeholders.
const DUMMIES: std::ops::RangeInclusive<u16> = 0x0001..=0x0007;

/// Warns of mapped objects that contradict the dictionary.
pub(super) fn check(dictionary: &ObjectDictionary, reporter: &mut Reporter) {
    let is_mapping = |index| matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF);
    for object in dictionary.objects.iter().filter(|object| is_mapping(object.index)) {
        let count = dictionary.number(ObjectAddress::new(object.index, 0), None).unwrap_or(0);
        for entry in
            object.entries.iter().filter(|entry| (1..=count).contains(&entry.address.subindex.into()))
        {
            check_entry(dictionary, entry, reporter);
        }
    }
}

fn check_entry(dictionary: &ObjectDictionary, entry: &DictionaryEntry, reporter: &mut Reporter) {
    let Some(stated) = entry.configured.as_ref().or(entry.default.as_ref()) else { return };
    let Some(parameter) = stated.value.number(None).and_then(|number| u32::try_from(number).ok()) else {
        return;
    };
    let mapped = MappedObject::from_parameter(parameter);
    let Some(reason) = contradiction(dictionary, mapped) else { return };
    let kind = EdsProblemKind::BadMapping {
        mapping: entry.address.to_string(),
        mapped: ObjectAddress::new(mapped.index, mapped.subindex).to_string(),
        reason,
    };
    reporter.report(kind, stated.span.clone());
}

fn contradiction(dictionary: &ObjectDictionary, mapped: MappedObject) -> Option<String> {
    if DUMMIES.contains(&mapped.index) && mapped.subindex == 0 {
        let is_declared = dictionary.dummies.contains(&DataTypeCode(mapped.index));
        return (!is_declared).then(|| "[DummyUsage] does not allow this dummy".to_owned());
    }
    let Some(entry) = dictionary.entry(ObjectAddress::new(mapped.index, mapped.subindex)) else {
        return Some("this object does not exist".to_owned());
    };
    if !entry.is_mappable {
        return Some("its PDOMapping is 0".to_owned());
    }
    let data_type = entry.data_type?;
    let bits = data_type.bits()?;
    // Devices map BOOLEAN as one bit or as a byte.
    let is_boolean_byte = data_type.kind() == ValueKind::Unsigned(1) && mapped.bits == 8;
    (bits != mapped.bits && !is_boolean_byte)
        .then(|| format!("the mapping has {} bits, but {data_type} has {bits}", mapped.bits))
}
