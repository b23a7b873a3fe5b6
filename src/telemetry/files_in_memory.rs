//! Files in memory, where there is no disk.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::destination::RecordingDestination;

/// No more files are kept; the oldest goes first.
const FILES: usize = 16;

/// The newest files. Every clone shows the same ones.
#[derive(Clone, Debug, Default)]
pub struct FilesInMemory(Arc<Mutex<VecDeque<FileInMemory>>>);

/// A file, which may still be written.
#[derive(Clone, Debug)]
pub struct FileInMemory {
    /// Its name.
    pub name: String,
    bytes: Arc<Mutex<Vec<u8>>>,
}

impl FilesInMemory {
    /// A new file with this name.
    pub(super) fn open(&self, stem: &str) -> RecordingDestination {
        let file = FileInMemory { name: format!("{stem}.mcap"), bytes: Arc::default() };
        let mut files = locked(&self.0);
        if files.len() >= FILES {
            files.pop_front();
        }
        files.push_back(file.clone());
        RecordingDestination::Stream(file.name, Box::new(Writer(file.bytes)))
    }

    /// All of them, the oldest first.
    pub fn all(&self) -> Vec<FileInMemory> {
        locked(&self.0).iter().cloned().collect()
    }
}

impl FileInMemory {
    /// What has been written so far.
    pub fn bytes(&self) -> Vec<u8> {
        locked(&self.bytes).clone()
    }
}

struct Writer(Arc<Mutex<Vec<u8>>>);

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        locked(&self.0).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A panic of another holder leaves the bytes as they are.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
