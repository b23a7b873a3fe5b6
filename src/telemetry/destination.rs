//! Where a recording or a log is written. An existing file is never overwritten.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use takt_wire::printable::printable_path;

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
        match self.path(stem, extension) {
            Ok(path) => Opened::of(&path, create_new(&path)),
            Err((label, writer)) => Ok(Opened { label, path: None, writer }),
        }
    }

    /// Opens the first of several files, and says how they are named. A stream is opened as a whole.
    pub(crate) fn open_first(
        self,
        stem: &str,
        extension: &str,
    ) -> Result<(Opened, Option<PartNames>), OpenError> {
        match self.path(stem, extension) {
            Ok(path) => {
                let names = PartNames::unused(&path);
                Ok((names.open(1)?, Some(names)))
            }
            Err((label, writer)) => Ok((Opened { label, path: None, writer }, None)),
        }
    }

    /// The path of the file, or the stream.
    fn path(self, stem: &str, extension: &str) -> Result<PathBuf, (String, Box<dyn Write + Send>)> {
        match self {
            Self::Directory(directory) => Ok(directory.join(format!("{}.{extension}", file_name(stem)))),
            Self::File(path) => Ok(path),
            Self::Stream(label, writer) => Err((label, writer)),
        }
    }
}

impl Opened {
    fn of(path: &Path, created: io::Result<(PathBuf, File)>) -> Result<Self, OpenError> {
        let (path, file) = created.map_err(|reason| OpenError { path: printable_path(path), reason })?;
        Ok(Self { label: printable_path(&path), path: Some(path), writer: Box::new(file) })
    }
}

/// How the files of one recording are named: `run.0001.mcap`, `run.0002.mcap` …
#[derive(Clone, Debug)]
pub(crate) struct PartNames(PathBuf);

impl PartNames {
    /// Names of which none is in use: the files of an earlier recording may have been removed, but for the last ones.
    fn unused(path: &Path) -> Self {
        let is_used = |names: &Self| {
            let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty());
            let entries = fs::read_dir(directory.unwrap_or(Path::new("."))).into_iter().flatten().flatten();
            entries.map(|entry| entry.file_name()).any(|name| names.number_of(Path::new(&name)).is_some())
        };
        let later = (2_u32..).map(|number| Self(numbered(path, number)));
        let mut names = std::iter::once(Self(path.to_owned())).chain(later);
        names.find(|names| !is_used(names)).unwrap_or_else(|| Self(path.to_owned()))
    }

    /// The names that this file is one of.
    pub(crate) fn of_part(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        let stem = Path::new(path.file_stem()?);
        stem.extension().and_then(digits)?;
        let mut name = stem.file_stem()?.to_owned();
        name.push(".");
        name.push(extension);
        Some(Self(path.with_file_name(name)))
    }

    /// The path of a file by its number, from 1 on.
    pub(crate) fn path(&self, number: u32) -> PathBuf {
        let mut name = self.0.file_stem().unwrap_or_default().to_owned();
        name.push(format!(".{number:04}"));
        if let Some(extension) = self.0.extension() {
            name.push(".");
            name.push(extension);
        }
        self.0.with_file_name(name)
    }

    /// The number of a file, if it is one of these.
    fn number_of(&self, path: &Path) -> Option<u32> {
        let stem = Path::new(path.file_stem()?);
        let is_ours = path.extension() == self.0.extension() && stem.file_stem() == self.0.file_stem();
        stem.extension().filter(|_| is_ours).and_then(digits)
    }

    /// Opens a new file.
    pub(crate) fn open(&self, number: u32) -> Result<Opened, OpenError> {
        let path = self.path(number);
        let create = || {
            if let Some(directory) = path.parent() {
                fs::create_dir_all(directory)?;
            }
            Ok((path.clone(), OpenOptions::new().write(true).create_new(true).open(&path)?))
        };
        Opened::of(&path, create())
    }
}

fn digits(text: &OsStr) -> Option<u32> {
    text.to_str().filter(|text| text.len() >= 4)?.parse().ok()
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
    fn the_files_of_one_recording_are_numbered_and_never_mixed_with_those_of_an_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let begin = || RecordingDestination::File(file.clone()).open_first("", "").unwrap();
        let name = |opened: &Opened| opened.path.clone().unwrap().file_name().unwrap().to_owned();
        let (first, names) = begin();
        let names = names.unwrap();
        assert_eq!(
            (name(&first), name(&names.open(2).unwrap())),
            ("run.0001.mcap".into(), "run.0002.mcap".into())
        );
        assert_eq!(names.open(2).err().unwrap().to_string().split(": ").next(), names.path(2).to_str());
        fs::remove_file(names.path(1)).unwrap();
        let (again, _) = begin();
        assert_eq!(name(&again), "run-2.0001.mcap");
        assert_eq!(name(&begin().0), "run-3.0001.mcap");
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
