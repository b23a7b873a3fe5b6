//! Files that people write: configurations, scenarios, device descriptions.

#[cfg_attr(not(target_os = "linux"), path = "no_disk.rs")]
mod disk;

#[cfg(target_os = "linux")]
pub use disk::open;

use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};

thread_local! {
    /// The files that this thread has read, where somebody notes them.
    static NOTED: RefCell<Option<Vec<TextFile>>> = const { RefCell::new(None) };
    /// Files that stand in for those of the disk.
    static GIVEN: RefCell<Option<Vec<TextFile>>> = const { RefCell::new(None) };
}

/// A file by the name under which it was read.
pub type TextFile = (PathBuf, Vec<u8>);

/// What `body` returns, and the files that it has read in this thread.
pub fn noting<T>(body: impl FnOnce() -> T) -> (T, Vec<TextFile>) {
    let before = NOTED.replace(Some(Vec::new()));
    let returned = body();
    (returned, NOTED.replace(before).unwrap_or_default())
}

/// What `body` returns if these files are all that there are.
pub fn instead_of_the_disk<T>(files: Vec<TextFile>, body: impl FnOnce() -> T) -> T {
    let before = GIVEN.replace(Some(files));
    let returned = body();
    GIVEN.set(before);
    returned
}

/// Reads a whole file.
///
/// # Errors
/// The file cannot be read, is no regular file, or is longer than 64 MiB; or there is no such file among those that stand in for the disk.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let given = GIVEN.with_borrow(|files| {
        let files = files.as_ref()?;
        let found = files.iter().find(|(name, _)| name == path).map(|(_, bytes)| bytes.clone());
        Some(found.ok_or_else(|| io::Error::other("the recording does not have this file")))
    });
    let bytes = given.unwrap_or_else(|| disk::read(path))?;
    NOTED.with_borrow_mut(|noted| {
        if let Some(noted) = noted {
            noted.push((path.to_owned(), bytes.clone()));
        }
    });
    Ok(bytes)
}
