//! From the text of a scenario file to a checked [`Scenario`], with the reader of the configuration: every problem of the
//! file is found, each with its line and a way out. `configs/faults/` has examples.

mod common;
mod kind;

use std::path::Path;

use toml::de::DeTable;

use super::scenario::{Fault, Scenario};
use crate::config::read::document;
use crate::config::read::entry::Problems;
use crate::config::read::section::Section;
use crate::config::{Config, ConfigError, ProblemKind};
use crate::printable::printable_path;

/// More faults than this in one file are a slip.
const FAULTS_AT_MOST: usize = 64;

/// A scenario that cannot be played.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("the scenario {path} cannot be read: {reason}")]
    Unreadable {
        /// The path.
        path: String,
        /// What the operating system said.
        reason: String,
    },
    /// It is not right, or does not suit the configuration. `miette` shows each problem with its line.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Wrong(#[from] ConfigError),
}

impl Scenario {
    /// Reads a file and checks it against the configuration that it is to be played with.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn load(path: &Path, config: &Config) -> Result<Self, ScenarioError> {
        let name = printable_path(path);
        match crate::text_file::read(path) {
            Ok(bytes) => Ok(Self::parse(&name, &ConfigError::text_of(&name, bytes)?, config)?),
            Err(error) => Err(ScenarioError::Unreadable { path: name, reason: error.to_string() }),
        }
    }

    /// Reads and checks the text of a scenario. `source_name` is what messages call it.
    ///
    /// # Errors
    /// Every problem of the text.
    pub fn parse(source_name: &str, text: &str, config: &Config) -> Result<Self, ConfigError> {
        document(source_name, text, |table, problems| read(table, problems, text, config))
    }
}

fn read<'a>(
    table: &'a DeTable<'a>,
    problems: &'a Problems<'a>,
    text: &str,
    config: &Config,
) -> Option<Scenario> {
    let mut root = Section::new("", 0..0, table, problems);
    root.require("fault", "at least one [[fault]]");
    let sections = root.sections("fault");
    let given = sections.len();
    if given > FAULTS_AT_MOST
        && let Some(beyond) = sections.get(FAULTS_AT_MOST)
    {
        beyond.report_here(ProblemKind::OutOfRange {
            key: "fault".to_owned(),
            value: format!("a list of {given}"),
            allowed: format!("1 to {FAULTS_AT_MOST} faults"),
        });
    }
    let faults: Vec<Option<Fault>> =
        sections.into_iter().map(|section| fault(section, text, config)).collect();
    root.finish();
    Some(Scenario { faults: faults.into_iter().collect::<Option<_>>()? })
}

fn fault(mut section: Section<'_>, text: &str, config: &Config) -> Option<Fault> {
    let line = 1 + text.get(..section.header().start).map_or(0, |before| before.matches('\n').count());
    let Some(entry) = section.get("kind") else {
        let says = "what goes wrong: kind = \"drop\"";
        section.report_here(ProblemKind::MissingKey { key: "fault.kind".to_owned(), says });
        return None;
    };
    // Without a kind nobody can say which other keys mean anything.
    let word = entry.choice(&kind::WORDS)?;
    let place = common::place(&mut section, config, word.needs_axis());
    let Some(place) = place else {
        // Its other keys are looked at all the same, as if they concerned the first axis.
        let first = common::Place { bus: 0, axis: config.axes.first(), entry: None };
        kind::read(&mut section, word, &first, config);
        section.finish();
        return None;
    };
    let read = kind::read(&mut section, word, &place, config);
    section.finish();
    let (window, selection, effect) = read?;
    Some(Fault {
        kind: word.name(),
        place: place.show(config),
        line,
        bus: place.bus,
        window,
        selection,
        effect,
    })
}
