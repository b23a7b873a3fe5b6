//! Where a recording goes. An existing file is never overwritten.

use crate::printable::printable_path;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where a recording or a log is written.
pub enum Destination {
    /// A new file in this folder, named after the machine and the time. The folder is made if it does not exist.
    Directory(PathBuf),
    /// This file; with `-2`, `-3` … before its extension if it exists already. Its folder is made if need be. A folder or
    /// a device is no file.
    File(PathBuf),
    /// Anything that takes bytes, and what to call it in messages.
    Stream(String, Box<dyn Write + Send>),
}

/// Something open for writing.
pub struct Opened {
    /// What to call it in messages.
    pub label: String,
    /// The file, if it is one.
    pub path: Option<PathBuf>,
    /// Takes the bytes.
    pub writer: Box<dyn Write + Send>,
}

/// What could not be opened, and why.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct OpenError {
    path: String,
    reason: io::Error,
}

impl Destination {
    /// Opens it; `stem` and `extension` make the file name where the destination leaves it open.
    pub fn open(self, stem: &str, extension: &str) -> Result<Opened, OpenError> {
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

/// Replaces what may not stand in a file name.
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
                // Beside a folder or a device nobody would look for it.
                match fs::metadata(&candidate) {
                    Ok(found) if found.is_dir() => {
                        return Err(io::Error::other("this is a folder: name a file in it"));
                    }
                    Ok(found) if !found.is_file() => {
                        return Err(io::Error::other("this is no ordinary file"));
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
    fn a_folder_is_made_and_an_existing_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let open = || {
            let mut opened =
                Destination::Directory(folder.path().join("a/b")).open("arm 6/x", "mcap").unwrap();
            opened.writer.write_all(b"!").unwrap();
            opened.path.unwrap()
        };
        let names = [open(), open(), open()].map(|path| path.file_name().unwrap().to_owned());
        assert_eq!(names, ["arm_6_x.mcap", "arm_6_x-2.mcap", "arm_6_x-3.mcap"]);
    }

    #[test]
    fn a_folder_or_a_device_in_place_of_the_file_is_an_error_and_nothing_is_written_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("runs");
        fs::create_dir(&inside).unwrap();
        let error =
            |path: &Path| Destination::File(path.to_owned()).open("arm", "mcap").err().unwrap().to_string();
        assert_eq!(error(&inside), format!("{}: this is a folder: name a file in it", inside.display()));
        assert_eq!(error(Path::new("/dev/null")), "/dev/null: this is no ordinary file");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let obstacle = folder.path().join("runs");
        fs::write(&obstacle, "in the way").unwrap();
        let error = Destination::Directory(obstacle.clone()).open("arm", "mcap").err().unwrap();
        assert!(error.to_string().starts_with(&format!("{}/arm.mcap: ", obstacle.display())), "{error}");
    }
}
