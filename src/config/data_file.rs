//! What quirk files and descriptions of bit fields have in common: how they are read, the drive that they are about, and its errors in
//! words.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use takt_wire::described_drive::{Confirmation, DescribedDrive};
use takt_wire::printable::printable_path;

use super::ConfigError;
use super::read::entry::Entry;
use super::read::section::Section;
use super::spot::Problems;

const CONFIRMATIONS: [(&str, Confirmation); 2] = [
    (Confirmation::DataSheetOnly.name(), Confirmation::DataSheetOnly),
    (Confirmation::TriedOnHardware.name(), Confirmation::TriedOnHardware),
];

/// Reads a file by what parses its text.
///
/// # Errors
/// The file cannot be read, or every problem of its text.
pub(super) fn load<T>(
    path: &Path,
    parse: impl FnOnce(&str, &str) -> Result<T, ConfigError>,
) -> Result<T, ConfigError> {
    let name = printable_path(path);
    match takt_wire::text_file::read(path) {
        Ok(bytes) => parse(&name, &ConfigError::text_of(&name, bytes)?),
        Err(error) => Err(ConfigError::unreadable(&name, error.to_string())),
    }
}

/// Reads the keys of `[drive]` that every file has.
pub(super) fn drive(section: &mut Section<'_>) -> Option<DescribedDrive> {
    let text = |entry: &Entry<'_>| entry.text().map(str::to_owned);
    let vendor = section.require("vendor", "the vendor: vendor = \"Acme\"");
    let vendor = vendor.and_then(|entry| text(&entry));
    let product = section.require("product", "the product: product = \"Servo 1\"");
    let product = product.and_then(|entry| text(&entry));
    let says = "whether anybody has tried it: status = \"from its data sheet, not tried on hardware\"";
    let confirmation = section.require("status", says).and_then(|entry| entry.choice(&CONFIRMATIONS));
    let sources = section.require("sources", "the documents that it was taken from: sources = [\"…\"]");
    let sources = sources.and_then(|entry| each(&entry, text));
    Some(DescribedDrive {
        vendor: vendor?,
        product: product?,
        confirmation: confirmation?,
        sources: sources?,
    })
}

/// Reads the table of this name whose keys are values themselves, such as error codes, so that it has no fixed keys. `allowed` says how
/// `read_key` wants them.
pub(super) fn keyed<'a, K: Ord, T>(
    (name, entry): (&str, Option<Entry<'a>>),
    problems: &'a Problems,
    (read_key, allowed): (impl Fn(&str) -> Option<K>, &str),
    read: impl Fn(&Entry<'a>) -> Option<T>,
) -> Option<Vec<(K, T)>> {
    let Some(entry) = entry else { return Some(vec![]) };
    let mut pairs = vec![];
    let mut are_right = true;
    for (key, value) in entry.table()? {
        let spot = Entry::new(format!("{name}.{}", key.get_ref()), value, problems);
        let key_value = read_key(key.get_ref());
        if key_value.is_none() {
            spot.report_range(format!("the key {:?}", key.get_ref()), allowed.to_owned());
        }
        match (key_value, read(&spot)) {
            (Some(key), Some(value)) => pairs.push((key, value)),
            _ => are_right = false,
        }
    }
    pairs.sort_by(|(one, _), (other, _)| one.cmp(other));
    are_right.then_some(pairs)
}

/// Reads the table `[errors]`: error codes in words.
pub(super) fn errors<'a>(
    entry: Option<Entry<'a>>,
    problems: &'a Problems,
    code: impl Fn(&str) -> Option<u16>,
    allowed: &str,
) -> Option<Vec<(u16, String)>> {
    keyed(("errors", entry), problems, (code, allowed), |entry| entry.text().map(str::to_owned))
}

/// The same text for the rest of the process: a file is read few times, and its names are compared and shown everywhere.
pub(super) fn interned(text: &str) -> &'static str {
    static TEXTS: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut texts = TEXTS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = texts.get(text) {
        return known;
    }
    let text: &'static str = text.to_owned().leak();
    texts.insert(text);
    text
}

/// An entry that may be absent: `Some(None)` then, and `None` when it is wrong.
pub(super) fn optional<'a, T>(
    entry: Option<Entry<'a>>,
    read: impl FnOnce(Entry<'a>) -> Option<T>,
) -> Option<Option<T>> {
    match entry {
        None => Some(None),
        Some(entry) => read(entry).map(Some),
    }
}

/// Every element of a list, even after one was wrong.
pub(super) fn each<'a, T>(entry: &Entry<'a>, read: impl Fn(&Entry<'a>) -> Option<T>) -> Option<Vec<T>> {
    let read: Vec<Option<T>> = entry.list()?.iter().map(read).collect();
    read.into_iter().collect()
}

/// Every element of a list that must have one, even after one was wrong.
pub(super) fn each_of_some<'a, T>(
    entry: &Entry<'a>,
    what: &str,
    read: impl Fn(&Entry<'a>) -> Option<T>,
) -> Option<Vec<T>> {
    let found = each(entry, read)?;
    if found.is_empty() {
        entry.report_range("an empty list".to_owned(), format!("at least one {what}"));
    }
    (!found.is_empty()).then_some(found)
}
