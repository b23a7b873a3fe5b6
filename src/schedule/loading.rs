//! A configuration from a file or a text. Reading it is a matter of [`config`], except for `command_phase = "auto"`: that
//! depends on what the buses carry, which is known here.

use std::path::Path;

use super::automatic_command_phase;
use crate::config::{self, Config, ConfigError};

impl Config {
    /// Reads a file and checks it. Whether the buses can carry what it asks for is a question for
    /// [`schedule::verify`](super::verify).
    ///
    /// # Errors
    /// Every problem of the file, each with its line.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        config::load(path, command_phase)
    }

    /// Reads and checks the text of a configuration. `source_name` is what messages call it.
    ///
    /// # Errors
    /// Every problem of the text, each with its line.
    pub fn parse(source_name: &str, text: &str) -> Result<Self, ConfigError> {
        config::parse(source_name, text, command_phase)
    }
}

fn command_phase(config: &Config) -> Result<u64, String> {
    automatic_command_phase(config).map_err(|error| error.to_string())
}
