//! Reads objects and sub-objects from the sections that describe them, in full or compactly.

use std::collections::BTreeMap;

use super::data_type::DataTypeCode;
use super::dictionary::{
    AccessType, DictionaryEntry, DictionaryObject, LocatedValue, ObjectList, ObjectType,
};
use super::entry::{self, Context};
use super::findings::Reporter;
use super::ini::{Document, Pair, Section};
use super::number::{self, Number};
use super::problem::EdsProblemKind;
use super::section_name::SectionName;
use super::value::Value;
use crate::canopen::object::ObjectAddress;

/// The highest sub-index of a value; 255 describes the structure of the object.
const HIGHEST_SUBINDEX: u8 = 254;

/// The most entries of a dictionary. Drives have some thousands. A compact array is one section for 254 entries of some kilobytes each.
pub(super) const MAX_ENTRIES: usize = 65_536;

/// The sections of one object.
#[derive(Debug, Default)]
struct Parts<'d, 't> {
    object: Option<&'d Section<'t>>,
    sub_objects: BTreeMap<u8, &'d Section<'t>>,
    names: Option<&'d Section<'t>>,
    values: Option<&'d Section<'t>>,
    denotations: Option<&'d Section<'t>>,
}

/// Reads every object, in the order of their indices.
pub(super) fn read(document: &Document<'_>, reporter: &mut Reporter) -> Vec<DictionaryObject> {
    let mut parts: BTreeMap<u16, Parts<'_, '_>> = BTreeMap::new();
    for section in document.sections() {
        match SectionName::read(section.name) {
            SectionName::Object(index) => parts.entry(index).or_default().object = Some(section),
            SectionName::SubObject(index, subindex) => {
                parts.entry(index).or_default().sub_objects.insert(subindex, section);
            }
            SectionName::Names(index) => parts.entry(index).or_default().names = Some(section),
            SectionName::Values(index) => parts.entry(index).or_default().values = Some(section),
            SectionName::Denotations(index) => parts.entry(index).or_default().denotations = Some(section),
            SectionName::ObjectLinks | SectionName::Malformed | SectionName::Other => {}
        }
    }
    let is_described = |parts: &Parts<'_, '_>| parts.object.is_some() || !parts.sub_objects.is_empty();
    let (mut objects, mut entries) = (Vec::new(), 0);
    for (index, parts) in parts.into_iter().filter(|(_, parts)| is_described(parts)) {
        let first = parts.object.or(parts.sub_objects.values().next().copied());
        let header = first.map_or(0..0, |section| section.header.clone());
        let object = Reader { index, parts, reporter: &mut *reporter }.object();
        entries += object.entries.len();
        if entries > MAX_ENTRIES {
            reporter.report(EdsProblemKind::TooMany { items: "entries", most: MAX_ENTRIES }, header);
            break;
        }
        objects.push(object);
    }
    objects
}

/// The list of an object by its index (CiA 306, section 4.6.3).
pub(super) fn list_of(index: u16) -> ObjectList {
    match index {
        0x1000 | 0x1001 | 0x1018 => ObjectList::Mandatory,
        0x2000..=0x5FFF => ObjectList::Manufacturer,
        _ => ObjectList::Optional,
    }
}

struct Reader<'d, 't, 'r> {
    index: u16,
    parts: Parts<'d, 't>,
    reporter: &'r mut Reporter,
}

impl Reader<'_, '_, '_> {
    fn object(&mut self) -> DictionaryObject {
        let compact = self.compact_count();
        let object_type = self.object_type(compact);
        let mut entries = if object_type.has_sub_objects() {
            self.sub_objects(compact)
        } else {
            self.parts.object.map(|section| self.variable(section, object_type)).into_iter().collect()
        };
        self.apply_lists(&mut entries);
        let name = self.parts.object.and_then(|section| section.get("ParameterName"));
        let name = name.map(|pair| pair.value.to_owned()).unwrap_or_default();
        if let Some(section) = self.parts.object.filter(|_| object_type.has_sub_objects()) {
            if name.is_empty() {
                let kind = EdsProblemKind::MissingKey {
                    key: "ParameterName",
                    object: format!("{:04X}", self.index),
                    repair: "it has no name".to_owned(),
                };
                self.reporter.report(kind, section.header.clone());
            }
            self.check_sub_number(section, compact);
            self.check_highest(&entries);
        }
        DictionaryObject {
            index: self.index,
            name,
            object_type,
            list: list_of(self.index),
            entries,
            line: self.parts.object.map(|section| self.reporter.line_of(section.header.start)),
        }
    }

    /// The number of sub-objects that the object's own section describes.
    fn compact_count(&mut self) -> u8 {
        let Some(section) = self.parts.object else { return 0 };
        let count = entry::whole(section, "CompactSubObj", Some(self.index), self.reporter).unwrap_or(0);
        if !(0..=i128::from(HIGHEST_SUBINDEX)).contains(&count)
            && let Some(pair) = section.get("CompactSubObj")
        {
            let kind =
                EdsProblemKind::OutOfRange { key: pair.key.to_owned(), value: count, allowed: "0 to 254" };
            self.reporter.report(entry::of_object(self.index, kind), pair.span.clone());
        }
        count.clamp(0, HIGHEST_SUBINDEX.into()) as u8
    }

    /// The object type in the section, unless the other sections contradict it.
    fn object_type(&mut self, compact: u8) -> ObjectType {
        let has_sub_objects = compact > 0 || !self.parts.sub_objects.is_empty();
        let Some(section) = self.parts.object else {
            if let Some(first) = self.parts.sub_objects.values().next() {
                self.reporter
                    .report(EdsProblemKind::MissingObject { index: self.index }, first.header.clone());
            }
            return ObjectType::Record;
        };
        let found = match (has_sub_objects, compact > 0) {
            (true, true) => ObjectType::Array,
            (true, false) => ObjectType::Record,
            (false, _) => ObjectType::Variable,
        };
        let Some(pair) = section.get("ObjectType") else {
            // A section without this key describes a variable (CiA 306).
            if has_sub_objects {
                let kind = EdsProblemKind::MissingKey {
                    key: "ObjectType",
                    object: format!("{:04X}", self.index),
                    repair: format!("it was read as {found}"),
                };
                self.reporter.report(kind, section.header.clone());
            }
            return found;
        };
        let code = number::read(pair.value).and_then(|parsed| parsed.number.at(None));
        let word = || ObjectType::from_word(pair.value);
        let Some(declared) = code.and_then(ObjectType::from_code).or_else(word) else {
            let kind = EdsProblemKind::UnknownWord {
                key: pair.key.to_owned(),
                given: pair.value.to_owned(),
                repair: "it was derived from the sections; allowed: 0x2, 0x5 to 0x9",
            };
            self.reporter.report(kind, pair.span.clone());
            return found;
        };
        let is_one_value = section.get("DataType").is_some() || section.get("AccessType").is_some();
        let is_contradicted = match declared.has_sub_objects() {
            true => !has_sub_objects && is_one_value,
            false => has_sub_objects,
        };
        if !is_contradicted {
            return declared;
        }
        let kind = EdsProblemKind::WrongObjectType {
            index: self.index,
            declared: declared.word(),
            found: found.word(),
        };
        self.reporter.report(kind, pair.span.clone());
        found
    }

    fn variable(&mut self, section: &Section<'_>, object_type: ObjectType) -> DictionaryEntry {
        let usual_type = matches!(object_type, ObjectType::Domain).then_some(DataTypeCode::DOMAIN);
        let context = Context { address: ObjectAddress::new(self.index, 0), usual_type };
        entry::read(section, context, self.reporter)
    }

    fn sub_objects(&mut self, compact: u8) -> Vec<DictionaryEntry> {
        let mut entries: BTreeMap<u8, DictionaryEntry> = BTreeMap::new();
        if let Some(section) = self.parts.object.filter(|_| compact > 0) {
            entries.insert(0, self.compact_count_entry(compact));
            let template = self.compact_template(section);
            for subindex in 1..=compact {
                let name = format!("{}{subindex}", template.name);
                let address = ObjectAddress::new(self.index, subindex);
                entries.insert(subindex, DictionaryEntry { name, address, ..template.clone() });
            }
        }
        let usual_type = |subindex| if subindex == 0 { Some(DataTypeCode::UNSIGNED8) } else { None };
        let mut first_type = None;
        for (subindex, section) in self.parts.sub_objects.clone() {
            // The elements of an array have one type; usually so do elements of records without a type.
            let usual_type = usual_type(subindex).or(first_type);
            let context = Context { address: ObjectAddress::new(self.index, subindex), usual_type };
            let entry = entry::read(section, context, self.reporter);
            if subindex > 0 {
                first_type = first_type.or(entry.data_type);
            }
            if entries.insert(subindex, entry).is_some() && subindex > 0 {
                let kind = EdsProblemKind::CompactAndFull { index: self.index, subindex };
                self.reporter.report(kind, section.header.clone());
            }
        }
        entries.into_values().collect()
    }

    fn compact_template(&mut self, section: &Section<'_>) -> DictionaryEntry {
        let context = Context { address: ObjectAddress::new(self.index, 1), usual_type: None };
        entry::read(section, context, self.reporter)
    }

    fn compact_count_entry(&self, compact: u8) -> DictionaryEntry {
        // The number of errors is writable, so that they can be cleared.
        let access = if self.index == 0x1003 { AccessType::ReadWrite } else { AccessType::ReadOnly };
        let line = self.parts.object.map_or(0, |section| self.reporter.line_of(section.header.start));
        let span = self.parts.object.map_or(0..0, |section| section.header.clone());
        let value = Value::Number(Number::constant(compact.into()));
        implied(
            self.index,
            0,
            "NrOfObjects",
            DataTypeCode::UNSIGNED8,
            access,
            Some(LocatedValue { value, line, span }),
        )
    }

    /// Applies names, values and denotations from separate sections.
    fn apply_lists(&mut self, entries: &mut [DictionaryEntry]) {
        for (subindex, pair) in self.listed(self.parts.names) {
            if let Some(entry) = find(entries, subindex) {
                entry.name = pair.value.to_owned();
            }
        }
        for (subindex, pair) in self.listed(self.parts.denotations) {
            if let Some(entry) = find(entries, subindex) {
                entry.denotation = Some(pair.value.to_owned());
            }
        }
        for (subindex, pair) in self.listed(self.parts.values) {
            if let Some(entry) = find(entries, subindex) {
                entry.configured = entry::value(&pair, entry.data_type, self.reporter);
            }
        }
    }

    /// The entries `1=…`, `2=…` of a section that begins with their count.
    fn listed<'t>(&mut self, section: Option<&Section<'t>>) -> Vec<(u8, Pair<'t>)> {
        let Some(section) = section else { return vec![] };
        let listed: Vec<(u8, Pair<'t>)> = section
            .pairs()
            .iter()
            .filter(|pair| !pair.value.is_empty())
            .filter_map(|pair| Some((pair.key.parse().ok()?, pair.clone())))
            .collect();
        if let Some(pair) = section.get("NrOfEntries")
            && let Some(stated) = entry::whole(section, "NrOfEntries", Some(self.index), self.reporter)
            && usize::try_from(stated) != Ok(listed.len())
        {
            let kind = EdsProblemKind::Count { key: pair.key.to_owned(), stated, found: listed.len() };
            self.reporter.report(kind, pair.span.clone());
        }
        listed
    }

    fn check_sub_number(&mut self, section: &Section<'_>, compact: u8) {
        let Some(pair) = section.get("SubNumber").filter(|_| compact == 0) else { return };
        let Some(stated) = entry::whole(section, "SubNumber", Some(self.index), self.reporter) else {
            return;
        };
        let found = self.parts.sub_objects.len();
        if usize::try_from(stated) != Ok(found) {
            let kind = EdsProblemKind::Count { key: pair.key.to_owned(), stated, found };
            self.reporter.report(kind, pair.span.clone());
        }
    }

    /// Checks sub-index 0, which holds the highest sub-index or the number of valid entries.
    fn check_highest(&mut self, entries: &[DictionaryEntry]) {
        let Some(stated) = entries.first().filter(|entry| entry.address.subindex == 0) else { return };
        let Some((stated, number)) =
            stated.default.as_ref().and_then(|stated| Some((stated, stated.value.number(None)?)))
        else {
            return;
        };
        let highest = entries.last().map_or(0, |entry| entry.address.subindex);
        if number > i128::from(highest) {
            let key = format!("DefaultValue of {:04X}:00", self.index);
            let kind = EdsProblemKind::Count { key, stated: number, found: highest.into() };
            self.reporter.report(kind, stated.span.clone());
        }
    }
}

/// An entry that the file implies without describing it.
pub(super) fn implied(
    index: u16,
    subindex: u8,
    name: &str,
    data_type: DataTypeCode,
    access: AccessType,
    default: Option<LocatedValue>,
) -> DictionaryEntry {
    DictionaryEntry {
        address: ObjectAddress::new(index, subindex),
        name: name.to_owned(),
        data_type: Some(data_type),
        access,
        default,
        configured: None,
        low: None,
        high: None,
        is_mappable: false,
        is_write_refused: false,
        denotation: None,
    }
}

fn find(entries: &mut [DictionaryEntry], subindex: u8) -> Option<&mut DictionaryEntry> {
    entries.iter_mut().find(|entry| entry.address.subindex == subindex)
}
