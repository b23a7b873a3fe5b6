//! Electronic data sheets and device configuration files (CiA 306): reads a device's object dictionary from files as
//! they are found in practice.
//!
//! [`load`] and [`parse`] return an [`ObjectDictionary`] with [`Findings`]. Each repair is a warning with its position.
//! What cannot be repaired is an error; all errors are reported together:
//!
//! - **Repaired**: case and spelling of keys, sections and `$NODEID`; counts and lists that disagree with the sections;
//!   missing data types, access types and names; object types that the sub-objects contradict; impossible limits;
//!   repeated keys and sections (the first one is used, as by the profile functions of Windows); lines that are not
//!   valid.
//! - **Refused**: values that do not fit their type, because a wrong value could reach a drive; a configured value that
//!   appears twice with different values; files without any object.
//!
//! A number with a leading zero is octal, by the standard, with a warning if the decimal number would differ. With
//! digits that are not octal it is decimal, with a warning too. A hexadecimal number of a signed type may be its bit
//! pattern (`0xFFFFFFFF` is -1 in INTEGER32).
//!
//! ```text
//! parse ── text ── ini: sections, keys and values with their positions
//!   └── read ── device, objects (entry, value, number), lists, compact_pdo, mapping
//! ```

mod compact_pdo;
mod data_type;
#[cfg(feature = "miette")]
mod diagnostic;
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

use crate::printable::printable_path;
use std::path::Path;

pub use data_type::{DataTypeCode, ValueKind};
pub use dictionary::{
    AccessType, DeviceCommissioning, DeviceInfo, DictionaryEntry, DictionaryObject, FileInfo, LocatedValue,
    ObjectDictionary, ObjectList, ObjectType,
};
pub use findings::{Findings, SourcePosition};
pub use number::{Anomaly, Number};
pub use problem::{EdsProblem, EdsProblemKind, Severity};
pub use value::Value;

/// A readable file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Its content.
    pub dictionary: ObjectDictionary,
    /// The repairs; all of them are warnings.
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

/// Reads an EDS or DCF. Messages call it `source_name`.
pub fn parse(source_name: &str, bytes: &[u8]) -> Result<Loaded, Findings> {
    let text = text::decode(bytes);
    let (dictionary, problems) = read::read(&text);
    let findings = Findings::new(source_name, text, problems);
    match dictionary {
        Some(dictionary) if !findings.has_errors() => Ok(Loaded { dictionary, warnings: findings }),
        _ => Err(findings),
    }
}
