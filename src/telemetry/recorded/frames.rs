//! The frames of a black box.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use takt_rt::Nanoseconds;

use super::printable_name::name;
use super::records::{self, Record};
use super::{RecordedError, walk};
use crate::link::trace::TracedFrame;
use crate::telemetry::{messages, recording};

/// A frame of a black box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedFrame<'a> {
    /// The name of its bus in the configuration.
    pub bus: &'a str,
    /// Since 1970-01-01 UTC.
    pub unix_ns: Nanoseconds,
    /// The frame.
    pub traced: TracedFrame,
}

/// What a recording says of its frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordedFrames {
    /// How many there were.
    pub frames: u64,
    /// Damaged chunks and malformed messages, which were passed over.
    pub damaged: u64,
    /// True if the file was read to the end of its data.
    pub is_whole: bool,
}

/// Passes every frame of a black box to `visit`, in the order of the file.
///
/// # Errors
/// See [`RecordedError`].
pub fn frames(
    path: &Path,
    mut visit: impl FnMut(RecordedFrame<'_>),
) -> Result<RecordedFrames, RecordedError> {
    let unreadable = |error| RecordedError::Unreadable { path: path.to_owned(), error };
    let file = File::open(path).map_err(|error| unreadable(error.into()))?;
    let mut of_frames = vec![];
    let mut buses: HashMap<u16, String> = HashMap::new();
    let (mut version, mut library, mut is_of_takt) = (String::new(), String::new(), false);
    let mut is_of_other_layout = false;
    let mut found = RecordedFrames::default();
    let condition = walk::walk(BufReader::new(file), |opcode, body| match records::parse(opcode, body) {
        Some(Ok(Record::Header { library: of_file })) => library = of_file,
        Some(Ok(Record::Metadata { name, entries })) if name == recording::METADATA => {
            is_of_takt = true;
            version = entries.get("version").cloned().unwrap_or_default();
        }
        Some(Ok(Record::Schema { id, name, definition })) if name == messages::FRAME.name => {
            match messages::FRAME.can_be_read_as(&String::from_utf8_lossy(definition)) {
                true => of_frames.push(id),
                false => is_of_other_layout = true,
            }
        }
        Some(Ok(Record::Channel { id, schema, metadata })) if of_frames.contains(&schema) => {
            buses.insert(id, metadata.get("name").map_or_else(String::new, |bus| name(bus)));
        }
        Some(Ok(Record::Message { channel, log_time_ns, data })) => {
            let Some(bus) = buses.get(&channel) else { return };
            match messages::decode_frame(data) {
                Some(traced) => {
                    found.frames += 1;
                    visit(RecordedFrame { bus, unix_ns: log_time_ns, traced });
                }
                None => found.damaged += 1,
            }
        }
        Some(Err(records::Malformed)) => found.damaged += 1,
        _ => {}
    })
    .map_err(unreadable)?;
    let path = path.to_owned();
    if is_of_other_layout {
        return Err(RecordedError::OtherVersion { path, version, message: messages::FRAME.name });
    }
    if !is_of_takt {
        return Err(RecordedError::Foreign { path, library });
    }
    Ok(RecordedFrames {
        damaged: found.damaged + condition.damaged_chunks,
        is_whole: condition.is_whole,
        ..found
    })
}
