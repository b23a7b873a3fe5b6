//! `takt manual`: the manual pages of takt, from the same words as `--help`.

use std::io;
use std::path::PathBuf;

use clap::Args;

use super::exit::Exit;
use super::usage_error::UsageError;

/// Write the manual pages to a folder: takt.1, takt-run.1 …
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// The folder, which must be there: for example /usr/local/share/man/man1
    folder: PathBuf,
}

/// Writes one page for takt and one for each subcommand. The exit code is 2 if the folder cannot be written to.
pub fn run(arguments: &Arguments, takt: clap::Command) -> Exit {
    let folder = &arguments.folder;
    let written = if folder.is_dir() {
        clap_mangen::generate_to(takt, folder)
    } else {
        Err(io::Error::from(io::ErrorKind::NotADirectory))
    };
    match written {
        Ok(()) => Exit::Done,
        Err(error) => {
            let message = format!("the manual cannot be written to {}: {error}", folder.display());
            UsageError::from(message).print(false)
        }
    }
}
