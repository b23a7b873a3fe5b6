//! The files that a configuration was made of.

use std::path::{Path, PathBuf};

use takt_wire::text_file;

use super::{Config, ConfigError, OverrideError};

/// The files that a configuration was made of, with their contents: the file itself, and what it names (EDS, DCF, descriptions).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConfigSources {
    /// The file of the configuration; `None` for one that was made in code.
    pub main: Option<PathBuf>,
    /// Each file by the name under which it was read.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// Buses that were connected to another interface than the file says.
    pub interfaces: Vec<(String, String)>,
}

impl ConfigSources {
    /// Reads a configuration, as [`Config::load`], and keeps what it was made of.
    ///
    /// # Errors
    /// As [`Config::load`].
    pub fn load(path: &Path) -> Result<(Config, Self), ConfigError> {
        let (config, files) = text_file::noting(|| Config::load(path));
        Ok((config?, Self { main: Some(path.to_owned()), files, interfaces: Vec::new() }))
    }

    /// Reads the configuration anew from what is kept here.
    ///
    /// # Errors
    /// As [`Config::load`], for a file that is not kept, too; and those of an interface.
    pub fn config(&self) -> Result<Config, SourcesError> {
        let main = self.main.as_deref().ok_or(SourcesError::NoFile)?;
        let mut config = text_file::instead_of_the_disk(self.files.clone(), || Config::load(main))?;
        for (bus, interface) in &self.interfaces {
            config.override_interface(bus, interface)?;
        }
        Ok(config)
    }
}

/// The reason for which no configuration can be made of its files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourcesError {
    /// The configuration was made in code.
    #[error("the configuration was made in code: there is no file of it")]
    NoFile,
    /// The files do not say what they should.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// An interface cannot be connected.
    #[error(transparent)]
    Interface(#[from] OverrideError),
}
