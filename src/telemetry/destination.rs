//! Where a recording or a log is written. An existing file is never overwritten.

use crate::printable::printable_path;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where a recording or a log is written.
#[non_exhaustive]
pub enum RecordingDestination {
    /// A new file in this folder, named after the machine and the time. The folder is made if it does not exist.
    Directory(PathBuf),
    /// This file; with `-2`, `-3` … before its extension if it exists already. Its folder is made if it does not exist. A
    /// folder or a device is an error.
    File(PathBuf),
    /// Any writer, with its name in messages.
    Stream(String, Box<dyn Write + Send>),
}

/// An open destination.
pub(crate) struct Opened {
    /// Its name in messages.
    pub label: String,
    /// The file, if it is one.
    pub path: Option<PathBuf>,
    /// Takes the bytes.
    pub writer: Box<dyn Write + Send>,
}

/// Why a file could not be opened.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub(crate) struct OpenError {
    path: String,
    reason: io::Error,
}

impl RecordingDestination {
    /// Opens it. For a folder, `stem` and `extension` make the file name.
    pub(crate) fn open(self, stem: &str, extension: &str) -> Result<Opened, OpenError> {
        let path = match self {
            Self::Directory(directory) => directory.join(format!("{}.{extension}", file_name(stem))),
            Self::File(path) => path,
            Self::Stream(label, writer) => return Ok(Opened { label, path: None, writer }),
        };
        let (path, file) =
            create_new(&path).map_err(|reason| OpenError { path: printable_path(&path), reason })?;
        Ok(Opened { label: printable_path(&path), path: Some(path), writer: Box::new(file) })
    }
}

/// Replaces the characters that a file name may not have.
fn file_name(stem: &str) -> String {
    stem.chars()
        .map(|letter| if letter.is_alphanumeric() || "-_.".contains(letter) { letter } else { '_' })
        .collect()
}

fn create_new(path: &Path) -> io::Result<(PathBuf, File)> {
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory)?;
    }
    let mut candidate = path.to_owned();
    for number in 2_u32.. {
        match OpenOptions::new().write(true).create_new(true).open(&candidate) {
            Ok(file) => return Ok((candidate, file)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                // A file beside a folder or a device would not be found.
                match fs::metadata(&candidate) {
                    Ok(found) if found.is_dir() => {
                        return Err(io::Error::other("this is a folder; name a file in it"));
                    }
                    Ok(found) if !found.is_file() => {
                        return Err(io::Error::other("this is not a regular file"));
                    }
                    _ => {}
                }
                candidate = numbered(path, number);
            }
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// `run.mcap` → `run-2.mcap`
fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_folder_is_made_and_an_existing_file_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let open = || {
            let mut opened =
                RecordingDestination::Directory(folder.path().join("a/b")).open("arm 6/x", "mcap").unwrap();
            opened.writer.write_all(b"!").unwrap();
            opened.path.unwrap()
        };
        let names = [open(), open(), open()].map(|path| path.file_name().unwrap().to_owned());
        assert_eq!(names, ["arm_6_x.mcap", "arm_6_x-2.mcap", "arm_6_x-3.mcap"]);
    }

    #[test]
    fn a_folder_or_a_device_in_place_of_the_file_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("runs");
        fs::create_dir(&inside).unwrap();
        let error = |path: &Path| {
            RecordingDestination::File(path.to_owned()).open("arm", "mcap").err().unwrap().to_string()
        };
        assert_eq!(error(&inside), format!("{}: this is a folder; name a file in it", inside.display()));
        assert_eq!(error(Path::new("/dev/null")), "/dev/null: this is not a regular file");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("runs");
        fs::write(&file, "in the way").unwrap();
        let error = RecordingDestination::Directory(file.clone()).open("arm", "mcap").err().unwrap();
        assert!(error.to_string().starts_with(&format!("{}/arm.mcap: ", file.display())), "{error}");
    }
}
