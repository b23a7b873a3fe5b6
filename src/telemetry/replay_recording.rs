//! The recording of a replay.

use std::path::{Path, PathBuf};

use mcap::McapError;
use takt_rt::{CycleRecord, Event};

use super::black_box::reason;
use super::destination::RecordingDestination;
use super::machine::Machine;
use super::recorded::{Recorded, RecordedError};
use super::recording::Recording;
use super::wall_clock::WallClock;
use super::words;

/// A recording of a replay that is being written, with the times of day of the run.
pub struct ReplayRecording {
    file: PathBuf,
    recording: Result<Recording, McapError>,
}

/// Why the recording of a replay cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayRecordingError {
    /// The recording of the run cannot be read.
    #[error(transparent)]
    Run(#[from] RecordedError),
    /// The file cannot be opened.
    #[error("no recording: cannot write {0}")]
    Open(String),
    /// The file cannot be written to its end.
    #[error("the recording is incomplete: cannot write {file}: {reason}")]
    Write {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
}

impl ReplayRecording {
    /// Begins a new file for a replay of the recording `run`.
    ///
    /// # Errors
    /// See [`ReplayRecordingError`].
    pub fn begin(file: &Path, run: &Path, machine: &Machine) -> Result<Self, ReplayRecordingError> {
        let wall_clock = Recorded::open(run)?.wall_clock.unwrap_or_else(|| WallClock::fixed(0));
        let opened = RecordingDestination::File(file.to_owned())
            .open("", "")
            .map_err(|error| ReplayRecordingError::Open(error.to_string()))?;
        let file = opened.path.clone().unwrap_or_else(|| file.to_owned());
        Ok(Self { file, recording: Recording::begin(opened, machine, wall_clock, true) })
    }

    /// Writes a cycle and its events. After a failure nothing more is written.
    pub fn cycle(&mut self, record: &CycleRecord, events: &[Event], machine: &Machine) {
        let Ok(recording) = &mut self.recording else { return };
        let mut written = recording.cycle(record);
        for event in events {
            written =
                written.and_then(|()| recording.event(event, &words::event(event, machine).to_string()));
        }
        if let Err(error) = written {
            self.recording = Err(error);
        }
    }

    /// Writes the end. Returns the file.
    ///
    /// # Errors
    /// [`ReplayRecordingError::Write`]
    pub fn finish(self) -> Result<PathBuf, ReplayRecordingError> {
        match self.recording.and_then(Recording::finish) {
            Ok(()) => Ok(self.file),
            Err(error) => Err(ReplayRecordingError::Write {
                file: self.file.display().to_string(),
                reason: reason(&error),
            }),
        }
    }
}
