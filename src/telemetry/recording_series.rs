//! A recording in one file or in several: when a file has reached its size, the next one begins, and the oldest is removed.
//! Each can be read alone: it has the schemas, the description of the machine, and the configuration.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use mcap::{McapError, McapResult};
use takt_rt::{CycleRecord, Event};

use super::announce;
use super::destination::{OpenError, Opened, PartNames, RecordingDestination};
use super::history::OnBus;
use super::machine::Machine;
use super::recording::{self, Recording};
use super::wall_clock::WallClock;
use crate::config::ConfigSources;
use crate::link::trace::TracedHealth;

/// How recordings are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingOptions {
    /// True if recordings and black boxes are compressed (zstd). Default yes.
    pub is_compressed: bool,
    /// The most bytes of a file; then the next one begins. `None`, the default, makes a single file. A [`RecordingDestination::Stream`]
    /// is always one.
    pub size_limit_bytes: Option<u64>,
    /// How many files of the run are kept, the newest ones; `None` keeps all.
    pub keep: Option<usize>,
}

impl RecordingOptions {
    /// The smallest limit of the size of a file: below, most of a file would be its schemas and its configuration.
    pub const SMALLEST_LIMIT_BYTES: u64 = 1 << 20;
}

impl Default for RecordingOptions {
    fn default() -> Self {
        Self { is_compressed: true, size_limit_bytes: None, keep: None }
    }
}

/// A recording that is being written.
pub struct RecordingSeries {
    options: RecordingOptions,
    machine: Machine,
    wall_clock: WallClock,
    /// The configuration, if there is a journal.
    sources: Option<ConfigSources>,
    current: Recording,
    /// How the files are named, if there may be several.
    names: Option<PartNames>,
    number: u32,
    /// The files that are kept, the oldest first.
    files: Vec<PathBuf>,
    removed: u64,
}

/// Why a recording does not begin.
#[derive(Debug, thiserror::Error)]
pub enum BeginError {
    /// The file cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The file cannot be written.
    #[error("{label}: {}", super::black_box::reason(error))]
    Write {
        /// Its name.
        label: String,
        /// The file, if it is one.
        path: Option<PathBuf>,
        /// Why.
        error: McapError,
    },
}

impl BeginError {
    /// The file that was opened, if any.
    pub fn path(&self) -> Option<PathBuf> {
        match self {
            Self::Open(_) => None,
            Self::Write { path, .. } => path.clone(),
        }
    }
}

impl RecordingSeries {
    /// Begins the first file.
    pub fn begin(
        destination: RecordingDestination,
        stem: &str,
        options: RecordingOptions,
        machine: &Machine,
        wall_clock: WallClock,
    ) -> Result<Self, BeginError> {
        let (opened, names) = match options.size_limit_bytes {
            Some(_) => destination.open_first(stem, "mcap")?,
            None => (destination.open(stem, "mcap")?, None),
        };
        let files: Vec<PathBuf> = opened.path.iter().cloned().collect();
        let (label, path) = (opened.label.clone(), opened.path.clone());
        let written = begin_file(opened, machine, wall_clock, options, names.as_ref(), 1);
        let current = written.map_err(|error| BeginError::Write { label, path, error })?;
        announce::opened("recording", &current.label);
        Ok(Self {
            options,
            machine: machine.clone(),
            wall_clock,
            sources: None,
            current,
            names,
            number: 1,
            files,
            removed: 0,
        })
    }

    /// Adds the journal, and the files that the configuration was made of.
    pub fn begin_journal(&mut self, sources: &ConfigSources) -> McapResult<()> {
        self.sources = Some(sources.clone());
        self.current.begin_journal(sources)
    }

    /// The file that is being written, for messages.
    pub fn label(&self) -> &str {
        &self.current.label
    }

    /// The files that are kept, the oldest first.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// How many older files were removed.
    pub fn removed(&self) -> u64 {
        self.removed
    }

    /// Writes a cycle.
    pub fn cycle(&mut self, record: &CycleRecord) -> McapResult<()> {
        self.current.cycle(record)
    }

    /// Writes an event and its text.
    pub fn event(&mut self, event: &Event, text: &str) -> McapResult<()> {
        self.current.event(event, text)
    }

    /// Writes the health of a bus.
    pub fn health(&mut self, health: &OnBus<TracedHealth>) -> McapResult<()> {
        self.current.health(health)
    }

    /// Writes a block of the journal.
    pub fn journal(&mut self, block: &[u8]) -> McapResult<()> {
        self.current.journal(block)
    }

    /// Begins the next file, if the current one is full.
    pub fn rotate(&mut self) -> McapResult<()> {
        let Some((names, limit)) = self.names.as_ref().zip(self.options.size_limit_bytes) else {
            return Ok(());
        };
        if !self.current.is_full(limit) {
            return Ok(());
        }
        let number = self.number + 1;
        let opened = names.open(number).map_err(|error| McapError::Io(io::Error::other(error)))?;
        let path = opened.path.clone();
        let (machine, clock) = (&self.machine, self.wall_clock);
        let mut next = begin_file(opened, machine, clock, self.options, Some(names), number)?;
        next.continue_after(&self.current);
        if let Some(sources) = &self.sources {
            next.begin_journal(sources)?;
        }
        self.number = number;
        self.files.extend(path);
        let full = std::mem::replace(&mut self.current, next);
        let label = full.label.clone();
        full.finish()?;
        announce::closed("recording", &label);
        announce::opened("recording", &self.current.label);
        let surplus =
            self.files.len().saturating_sub(self.options.keep.map_or(usize::MAX, |keep| keep.max(1)));
        for oldest in self.files.drain(..surplus) {
            // If it cannot be removed, it stays.
            self.removed += u64::from(fs::remove_file(oldest).is_ok());
        }
        Ok(())
    }

    /// Writes the end of a recording; with a journal, of which so many entries were lost.
    pub fn finish_with(self, lost: Option<u64>) -> McapResult<()> {
        self.current.finish_with(lost)
    }
}

fn begin_file(
    opened: Opened,
    machine: &Machine,
    wall_clock: WallClock,
    options: RecordingOptions,
    names: Option<&PartNames>,
    number: u32,
) -> McapResult<Recording> {
    let mut recording = Recording::begin(opened, machine, wall_clock, options.is_compressed)?;
    if let Some(names) = names {
        let first = names.path(1);
        let first = first.file_name().unwrap_or(Path::new("").as_os_str()).to_string_lossy().into_owned();
        let part = [(recording::FIRST_PART, first), (recording::PART_NUMBER, number.to_string())];
        let part = part.map(|(key, value)| (key.to_owned(), value));
        recording.metadata(recording::PART, BTreeMap::from(part))?;
    }
    Ok(recording)
}
