//! A configuration from a file or a text. Reading it is a matter of [`config`], except for what is known here:
//! the families of drives, what their bring-up refuses, and `command_phase = "auto"`, which depends on what the buses carry.

use std::path::Path;

use super::automatic_command_phase;
use super::remedy::needs_shared_frames;
use crate::config::{self, Config, ConfigError, ConfiguredFamily, Knowledge};
use crate::family;

impl Config {
    /// Reads a file and checks it. Whether the buses can carry what it asks for is a question for
    /// [`schedule::verify`](super::verify).
    ///
    /// # Errors
    /// Every problem of the file, each with its line.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        with_knowledge(|knowledge| config::load(path, knowledge))
    }

    /// Reads and checks the text of a configuration. `source_name` is what messages call it.
    ///
    /// # Errors
    /// Every problem of the text, each with its line.
    pub fn parse(source_name: &str, text: &str) -> Result<Self, ConfigError> {
        with_knowledge(|knowledge| config::parse(source_name, text, knowledge))
    }
}

fn with_knowledge<T>(read: impl FnOnce(&Knowledge<'_>) -> T) -> T {
    let families: Vec<&'static dyn ConfiguredFamily> =
        family::all().into_iter().map(|family| -> &'static dyn ConfiguredFamily { family }).collect();
    let refused_values = family::bring_up::refused_values;
    read(&Knowledge { command_phase, needs_shared_frames, refused_values, families: &families })
}

fn command_phase(config: &Config) -> Result<u64, String> {
    automatic_command_phase(config).map_err(|error| error.to_string())
}
