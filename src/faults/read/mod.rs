//! Reads and checks a [`Scenario`] file with the configuration's reader. Every problem of the file is reported with its
//! line and a remedy. `configs/faults/` has examples.

mod common;
mod kind;
mod line;

use std::fmt;
use std::path::Path;

use takt_wire::printable::printable_path;
use toml::de::DeTable;

use super::scenario::{Scenario, ScenarioFault};
use crate::config::read::document;
use crate::config::read::section::Section;
use crate::config::spot::Problems;
use crate::config::{Config, ConfigError, ProblemKind};

/// The largest number of faults in one file.
const FAULTS_AT_MOST: usize = 64;

/// Why a scenario cannot be used.
#[derive(thiserror::Error)]
#[cfg_attr(feature = "miette", derive(miette::Diagnostic))]
#[non_exhaustive]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("the scenario {path} cannot be read: {reason}")]
    Unreadable {
        /// The path.
        path: String,
        /// The operating system's reason.
        reason: String,
    },
    /// The content is invalid or does not suit the configuration. `Debug` shows each problem at its line.
    #[error(transparent)]
    #[cfg_attr(feature = "miette", diagnostic(transparent))]
    Wrong(#[from] ConfigError),
}

impl fmt::Debug for ScenarioError {
    /// For `main`: the sentence, or the problems of the file.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wrong(error) => fmt::Debug::fmt(error, formatter),
            unreadable @ Self::Unreadable { .. } => fmt::Display::fmt(unreadable, formatter),
        }
    }
}

impl Scenario {
    /// Reads a file and checks it against the configuration that it will be used with.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn load(path: &Path, config: &Config) -> Result<Self, ScenarioError> {
        let name = printable_path(path);
        match takt_wire::text_file::read(path) {
            Ok(bytes) => Ok(Self::parse(&name, &ConfigError::text_of(&name, bytes)?, config)?),
            Err(error) => Err(ScenarioError::Unreadable { path: name, reason: error.to_string() }),
        }
    }

    /// Reads and checks the text of a scenario. Messages call it `source_name`.
    ///
    /// # Errors
    /// Every problem of the text.
    pub fn parse(source_name: &str, text: &str, config: &Config) -> Result<Self, ConfigError> {
        document(source_name, text, |table, problems| read(table, problems, text, config))
    }
}

fn read<'a>(table: &'a DeTable<'a>, problems: &'a Problems, text: &str, config: &Config) -> Option<Scenario> {
    let mut root = Section::new("", 0..0, table, problems);
    root.require("fault", "at least one [[fault]]");
    let sections = root.sections("fault");
    let given = sections.len();
    if given > FAULTS_AT_MOST
        && let Some(beyond) = sections.get(FAULTS_AT_MOST)
    {
        beyond.header_spot().report(ProblemKind::OutOfRange {
            key: "fault".to_owned(),
            value: format!("a list of {given}"),
            allowed: format!("1 to {FAULTS_AT_MOST} faults"),
        });
    }
    let faults: Vec<Option<ScenarioFault>> =
        sections.into_iter().map(|section| fault(section, text, config)).collect();
    root.finish();
    Some(Scenario { faults: faults.into_iter().collect::<Option<_>>()? })
}

fn fault(mut section: Section<'_>, text: &str, config: &Config) -> Option<ScenarioFault> {
    let line = 1 + text.get(..section.header().start).map_or(0, |before| before.matches('\n').count());
    let Some(entry) = section.get("kind") else {
        let says = "what goes wrong: kind = \"drop\"";
        section
            .header_spot()
            .report(ProblemKind::MissingKey { key: "fault.kind".to_owned(), says: says.into() });
        return None;
    };
    // Without a valid kind it is unknown which other keys are valid.
    let kind = entry.choice(&kind::KINDS)?;
    let location = common::location(&mut section, config, kind.needs_axis());
    let Some(location) = location else {
        // The other keys are still checked, as if they concerned the first axis.
        let first = common::Location { bus: 0, axis: config.axes.first(), entry: None };
        kind::read(&mut section, kind, &first, config);
        section.finish();
        return None;
    };
    let read = if config.is_serial_line(location.bus) {
        line::read(&mut section, &entry, kind, &location, config)
    } else {
        kind::read(&mut section, kind, &location, config)
    };
    section.finish();
    let (window, selection, effect) = read?;
    Some(ScenarioFault {
        kind: kind.name(),
        location: location.show(config),
        line,
        bus: location.bus,
        window,
        selection,
        effect,
    })
}
