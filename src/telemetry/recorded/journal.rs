//! The journal of a recording, and the files of its configuration.

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::records::{self, Record};
use super::{RecordedError, walk};
use crate::config::ConfigSources;
use crate::journal::{BlockDefect, Journal};
use crate::telemetry::destination::PartNames;
use crate::telemetry::{messages, recording};

/// A part of a journal that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum JournalDefect {
    /// A block.
    #[error("{}: block {number} of the journal is damaged: {defect}", file.display())]
    Block {
        /// The file.
        file: PathBuf,
        /// The number of the block in this file, counted from 1.
        number: u64,
        /// The defect.
        defect: BlockDefect,
    },
    /// Chunks of the file, in which blocks of the journal may be.
    #[error("{}: {count} damaged chunks: the journal is not whole", file.display())]
    Chunks {
        /// The file.
        file: PathBuf,
        /// How many.
        count: u64,
    },
}

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
    /// True if this version of takt cannot read the journal.
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
    let mut number = 0;
    let condition = walk::walk(file, |opcode, body| match records::parse(opcode, body) {
        Some(Ok(Record::Channel { id, metadata, .. })) => {
            if let Some(version) = metadata.get("journal") {
                if version == recording::JOURNAL_VERSION {
                    channels.insert(id);
                } else {
                    found.is_of_other_version = true;
                }
            }
        }
        Some(Ok(Record::Message { channel, data, .. })) if channels.contains(&channel) => {
            number += 1;
            let journal = found.journal.get_or_insert_default();
            let added = messages::decode_journal(data)
                .ok_or(BlockDefect::Undecodable)
                .and_then(|block| journal.add_block(block));
            if let Err(defect) = added {
                let file = path.to_owned();
                found.defect.get_or_insert(JournalDefect::Block { file, number, defect });
            }
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
    if condition.damaged_chunks > 0 {
        let (file, count) = (path.to_owned(), condition.damaged_chunks);
        found.defect.get_or_insert(JournalDefect::Chunks { file, count });
    }
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::Cursor;

    use mcap::records::MessageHeader;
    use mcap::{WriteOptions, Writer};

    use super::*;
    use crate::journal::ClockAnswer;
    use crate::telemetry::cdr::CdrEncoder;

    /// A recording in which these are the blocks of a journal of this version.
    fn file_of(version: &str, blocks: &[Vec<u8>]) -> Vec<u8> {
        let mut file = Cursor::new(vec![]);
        let mut writer = Writer::with_options(&mut file, WriteOptions::new().compression(None)).unwrap();
        let metadata = BTreeMap::from([("journal".to_owned(), version.to_owned())]);
        let channel_id = writer.add_channel(0, "/journal", "cdr", &metadata).unwrap();
        for block in blocks {
            let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
            let mut encoder = CdrEncoder::default();
            messages::encode_journal(block, &mut encoder);
            writer.write_to_known_channel(&header, encoder.bytes()).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    fn read(file: &[u8]) -> RecordedJournal {
        journal_in_memory(Path::new("run.mcap"), file).unwrap()
    }

    fn block() -> Vec<u8> {
        let mut journal = Journal::default();
        journal.add_clock(ClockAnswer::Now(1_000_000));
        journal.take_block().unwrap()
    }

    #[test]
    fn a_journal_of_another_version_is_not_read() {
        let found = read(&file_of("2", &[b"a block of version 2".to_vec()]));
        assert!(found.is_of_other_version && found.journal.is_none() && found.defect.is_none());
        assert!(!read(&file_of(recording::JOURNAL_VERSION, &[block()])).is_of_other_version);
    }

    #[test]
    fn the_first_damaged_block_is_named_with_its_file_its_number_and_the_reason() {
        let damaged = b"no block".to_vec();
        let found = read(&file_of(recording::JOURNAL_VERSION, &[block(), damaged.clone(), damaged]));
        assert_eq!(
            found.defect.map(|defect| defect.to_string()).as_deref(),
            Some("run.mcap: block 2 of the journal is damaged: it cannot be decoded")
        );
        assert_eq!(found.journal.map(|journal| journal.clock.len()), Some(1));
    }

    #[test]
    fn a_journal_is_not_whole_if_a_chunk_of_the_file_is_damaged() {
        let block = block();
        let mut file = file_of(recording::JOURNAL_VERSION, std::slice::from_ref(&block));
        assert_eq!(read(&file).defect, None);
        let at = file.windows(block.len()).position(|bytes| bytes == block).unwrap();
        file[at] ^= 1;
        let defect = JournalDefect::Chunks { file: "run.mcap".into(), count: 1 };
        assert_eq!(read(&file).defect, Some(defect));
    }
}
