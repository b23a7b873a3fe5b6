//! The lists of objects, which should agree with the sections.

use std::collections::BTreeMap;

use super::dictionary::{ObjectDictionary, ObjectList};
use super::entry;
use super::findings::Reporter;
use super::ini::{Document, Pair, Section};
use super::number;
use super::problem::EdsProblemKind;

const LISTS: [(&str, ObjectList); 3] = [
    ("MandatoryObjects", ObjectList::Mandatory),
    ("OptionalObjects", ObjectList::Optional),
    ("ManufacturerObjects", ObjectList::Manufacturer),
];

/// Records the list of each object, and warns of disagreement.
pub(super) fn check(document: &Document<'_>, dictionary: &mut ObjectDictionary, reporter: &mut Reporter) {
    let mut listed = BTreeMap::new();
    for (name, list) in LISTS {
        let Some(section) = document.section(name) else { continue };
        read(section, list, dictionary, &mut listed, reporter);
    }
    for object in &mut dictionary.objects {
        match listed.get(&object.index) {
            Some(list) => object.list = *list,
            None => {
                let section = document.section(&format!("{:04X}", object.index));
                let span = section.map_or(0..0, |section| section.header.clone());
                // An object without its own section has already been reported.
                if section.is_some() {
                    reporter.report(EdsProblemKind::NotListed { index: object.index }, span);
                }
            }
        }
    }
}

fn read(
    section: &Section<'_>,
    list: ObjectList,
    dictionary: &ObjectDictionary,
    listed: &mut BTreeMap<u16, ObjectList>,
    reporter: &mut Reporter,
) {
    let mut found = 0;
    for pair in section.pairs().iter().filter(|pair| pair.key.parse::<u16>().is_ok()) {
        if pair.value.is_empty() {
            continue;
        }
        let Some(index) = index(pair, dictionary, reporter) else { continue };
        found += 1;
        if dictionary.object(index).is_none() {
            reporter.report(EdsProblemKind::ListedOnly { index }, pair.span.clone());
        } else if listed.insert(index, list).is_some() {
            reporter.report(EdsProblemKind::ListedTwice { index }, pair.span.clone());
        }
    }
    if let Some(pair) = section.get("SupportedObjects")
        && let Some(stated) = entry::whole(section, "SupportedObjects", None, reporter)
        && usize::try_from(stated) != Ok(found)
    {
        let kind = EdsProblemKind::Count { key: pair.key.to_owned(), stated, found };
        reporter.report(kind, pair.span.clone());
    }
}

/// The index in a line. A hexadecimal number without `0x` is accepted if only that is an object.
fn index(pair: &Pair<'_>, dictionary: &ObjectDictionary, reporter: &mut Reporter) -> Option<u16> {
    let number = number::read(pair.value).and_then(|parsed| parsed.number.at(None));
    let number = number.and_then(|number| u16::try_from(number).ok());
    if let Some(index) = number.filter(|index| dictionary.object(*index).is_some()) {
        return Some(index);
    }
    let given = pair.value.to_owned();
    let hexadecimal = u16::from_str_radix(pair.value, 16).ok();
    if let Some(index) = hexadecimal.filter(|index| dictionary.object(*index).is_some()) {
        reporter.report(EdsProblemKind::DecimalIndex { given, index }, pair.span.clone());
        return Some(index);
    }
    if number.is_none() {
        let kind = EdsProblemKind::UnknownWord {
            key: pair.key.to_owned(),
            given,
            repair: "it was ignored; allowed: an index, as in 0x1018",
        };
        reporter.report(kind, pair.span.clone());
    }
    number
}
