//! Electronic data sheets and device configuration files (CiA 306): what a device's object dictionary holds, read from
//! files as they are rather than as they should be.
//!
//! [`load`] and [`parse`] give an [`ObjectDictionary`] with [`Findings`]: every repair that was made is a warning with its
//! place. What cannot be repaired is an error, and all of them are told at once:
//!
//! - **Repaired**: another case or spelling of keys, sections and `$NODEID`; counts and lists that disagree with the
//!   sections; missing data types, access types and names; object types that the sub-objects contradict; limits that
//!   cannot be; keys and sections that are there twice (the first counts, as Windows' profile functions have it); lines
//!   that are none.
//! - **Refused**: values that are no value of their type, because a wrong one could reach a drive; a configured value that
//!   is there twice and differs; files without any object.
//!
//! A number with a leading zero is octal, as the standard has it, with a warning where the decimal reading would give
//! another number; digits that octal does not have make it decimal, with a warning too. A hexadecimal number of a signed
//! type may be its bit pattern (`0xFFFFFFFF` is -1 in INTEGER32).
//!
//! ```text
//! parse ── text ── ini: sections, keys and values with their places
//!   └── read ── device, objects (entry, value, number), lists, compact_pdo, mapping
//! ```

mod compact_pdo;
mod data_type;
mod dictionary;
mod entry;
mod findings;
mod ini;
mod lists;
mod mapping;
mod number;
mod objects;
mod problem;
mod read;
mod section_name;
mod text;
mod value;

use std::path::Path;

use crate::printable::printable_path;

pub use data_type::{DataType, ValueKind};
pub use dictionary::{
    AccessType, DeviceCommissioning, DeviceInfo, DictionaryEntry, DictionaryObject, FileInfo,
    ObjectDictionary, ObjectList, ObjectType, Stated,
};
pub use findings::{Findings, Place};
pub use number::{Number, Oddity};
pub use problem::{Problem, ProblemKind, Severity};
pub use value::Value;

/// A file that could be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// What it says.
    pub dictionary: ObjectDictionary,
    /// What had to be repaired; all of them are warnings.
    pub warnings: Findings,
}

/// Reads an EDS or DCF from a file.
pub fn load(path: &Path) -> Result<Loaded, Findings> {
    let name = printable_path(path);
    match crate::text_file::read(path) {
        Ok(bytes) => parse(&name, &bytes),
        Err(error) => Err(Findings::unreadable(&name, error.to_string())),
    }
}

/// Reads an EDS or DCF. `source_name` is what messages call it.
pub fn parse(source_name: &str, bytes: &[u8]) -> Result<Loaded, Findings> {
    let text = text::decode(bytes);
    let (dictionary, problems) = read::read(&text);
    let findings = Findings::new(source_name, text, problems);
    match dictionary {
        Some(dictionary) if !findings.has_errors() => Ok(Loaded { dictionary, warnings: findings }),
        _ => Err(findings),
    }
}
