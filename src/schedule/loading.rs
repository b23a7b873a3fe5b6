//! A configuration from a file or a text. Reading it is a matter of [`config`], except for what is known here alone: the
//! families of drives, and what the buses carry, on which `command_phase = "auto"` depends.

use std::path::Path;

use super::automatic_command_phase;
use crate::config::{self, Config, ConfigError, ConfiguredFamily};
use crate::family;

impl Config {
    /// Reads a file and checks it. Whether the buses can carry what it asks for is a question for
    /// [`schedule::verify`](super::verify).
    ///
    /// # Errors
    /// Every problem of the file, each with its line and a way out.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        config::load(path, &families(), command_phase)
    }

    /// Reads and checks the text of a configuration. `source_name` is what messages call it.
    ///
    /// # Errors
    /// Every problem of the text, each with its line and a way out.
    pub fn parse(source_name: &str, text: &str) -> Result<Self, ConfigError> {
        config::parse(source_name, text, &families(), command_phase)
    }
}

fn families() -> Vec<&'static dyn ConfiguredFamily> {
    family::all().into_iter().map(|family| -> &'static dyn ConfiguredFamily { family }).collect()
}

fn command_phase(config: &Config) -> Result<u64, String> {
    automatic_command_phase(config).map_err(|error| error.to_string())
}
