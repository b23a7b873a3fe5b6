//! Reading a configuration, whose drives may be of every family.

use std::path::Path;

use super::registry;
use crate::config::{Config, ConfigError, ConfiguredFamily};

fn families() -> Vec<&'static dyn ConfiguredFamily> {
    registry::all().into_iter().map(|family| -> &'static dyn ConfiguredFamily { family }).collect()
}

impl Config {
    /// Reads a file and checks it. Whether the buses can carry what it asks for is a question for
    /// [`crate::bus::schedule::verify`].
    ///
    /// # Errors
    /// Every problem of the file, each with its line and a way out.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::load_with(path, &families())
    }

    /// Reads and checks the text of a configuration. `source_name` is what messages call it.
    ///
    /// # Errors
    /// Every problem of the text, each with its line and a way out.
    pub fn parse(source_name: &str, text: &str) -> Result<Self, ConfigError> {
        Self::parse_with(source_name, text, &families())
    }
}
