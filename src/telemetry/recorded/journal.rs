//! The journal of a recording, and the files of its configuration.

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::records::{self, Record};
use super::{RecordedError, walk};
use crate::config::ConfigSources;
use crate::journal::{Journal, JournalDefect};
use crate::telemetry::destination::PartNames;
use crate::telemetry::recording;

/// What a recording has for a replay.
#[derive(Debug, Default)]
pub struct RecordedJournal {
    /// The journal; `None` if the recording has none.
    pub journal: Option<Journal>,
    /// The files of the configuration.
    pub sources: ConfigSources,
    /// Entries that were lost while it was written; `None` if the file does not say so, because it was cut off.
    pub lost: Option<u64>,
    /// The first defect.
    pub defect: Option<JournalDefect>,
    /// True if this version of takt can read the journal.
    pub is_of_other_version: bool,
    /// The file that it begins in, if that is an earlier one of the same run.
    pub begins_in: Option<PathBuf>,
    /// The files that were read: this one, and those of the same run behind it.
    pub files: Vec<PathBuf>,
}

/// Reads the journal of a recording. Of several files, the first one is read with all that follow it.
///
/// # Errors
/// See [`RecordedError`].
pub fn journal(path: &Path) -> Result<RecordedJournal, RecordedError> {
    let mut found = RecordedJournal::default();
    let mut next = Some(path.to_owned());
    while let Some(path) = next.take() {
        let part = add_file(&path, &mut found)?;
        found.files.push(path.clone());
        let Some((first, number)) = part else { break };
        if number > 1 && found.files.len() == 1 {
            found.begins_in = Some(path.with_file_name(first));
            break;
        }
        let names =
            PartNames::of_part(&path).filter(|names| names.path(1).file_name() == Some(first.as_ref()));
        next = names.map(|names| names.path(number + 1)).filter(|next| next.exists());
    }
    Ok(found)
}

/// Reads the journal of a recording in memory, which must be a whole one.
///
/// # Errors
/// See [`RecordedError`].
pub fn journal_in_memory(name: &Path, bytes: &[u8]) -> Result<RecordedJournal, RecordedError> {
    let mut found = RecordedJournal::default();
    let part = add(name, bytes, &mut found)?;
    found.begins_in = part.filter(|(_, number)| *number > 1).map(|(first, _)| PathBuf::from(first));
    Ok(found)
}

/// Adds what one file has. Returns the name of the first file of several, and the number of this one.
fn add_file(path: &Path, found: &mut RecordedJournal) -> Result<Option<(OsString, u32)>, RecordedError> {
    let file = File::open(path)
        .map_err(|error| RecordedError::Unreadable { path: path.to_owned(), error: error.into() })?;
    add(path, BufReader::new(file), found)
}

/// As [`add_file`].
fn add(
    path: &Path,
    file: impl Read,
    found: &mut RecordedJournal,
) -> Result<Option<(OsString, u32)>, RecordedError> {
    let mut part = None;
    let mut channels = HashSet::new();
    walk::walk(file, |opcode, body| match records::parse(opcode, body) {
        Some(Ok(Record::Channel { id, metadata, .. })) => {
            if let Some(version) = metadata.get("journal") {
                found.is_of_other_version |= version != recording::JOURNAL_VERSION;
                channels.insert(id);
            }
        }
        Some(Ok(Record::Message { channel, data, .. })) if channels.contains(&channel) => {
            let added = found.journal.get_or_insert_default().add_block(data);
            found.defect = found.defect.or(added.err());
        }
        Some(Ok(Record::Metadata { name, entries })) if name == recording::PART => {
            let first = entries.get(recording::FIRST_PART).map(OsString::from);
            let number = entries.get(recording::PART_NUMBER).and_then(|number| number.parse().ok());
            part = first.zip(number);
        }
        Some(Ok(Record::Metadata { name, entries })) => found.metadata(&name, entries),
        _ => {}
    })
    .map_err(|error| RecordedError::Unreadable { path: path.to_owned(), error })?;
    Ok(part)
}

impl RecordedJournal {
    fn metadata(&mut self, name: &str, entries: BTreeMap<String, String>) {
        match name {
            recording::JOURNAL_END => {
                self.lost = entries.get("lost").and_then(|lost| lost.parse().ok());
            }
            recording::CONFIGURATION => {
                self.sources.main = entries.get(recording::MAIN_FILE).map(PathBuf::from);
                self.sources.interfaces = entries
                    .into_iter()
                    .filter_map(|(key, interface)| {
                        let bus = key.strip_prefix(recording::INTERFACE_OF)?.to_owned();
                        Some((bus, interface))
                    })
                    .collect();
            }
            recording::CONFIGURATION_FILES => {
                self.sources.files = entries
                    .into_iter()
                    .map(|(path, text)| (PathBuf::from(path), text.into_bytes()))
                    .collect();
            }
            _ => {}
        }
    }
}
