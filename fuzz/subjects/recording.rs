//! Fuzzes the reader of recordings and black boxes with arbitrary bytes.

use std::fs;
use std::path::PathBuf;

use takt::telemetry::{Emphasis, Recorded, RecordingReport};

/// Reads bytes as a recording. A recording that can be read can be reported as text and as JSON. An error gives the reason.
pub fn run(bytes: &[u8]) {
    let file = File::with(bytes);
    let recorded = match Recorded::open(&file.0) {
        Ok(recorded) => recorded,
        Err(error) => return assert!(error.to_string().len() > file.0.as_os_str().len()),
    };
    let report =
        RecordingReport::new(&recorded, None, 20).expect("a recording that was read once can be read again");
    assert!(!report.render(Emphasis::None).is_empty());
    serde_json::to_string(&report).expect("a report is plain data");
    let cycles = recorded.cycles(&(0..=u64::MAX)).expect("a recording that was read once can be read again");
    assert_eq!(cycles.len() as u64, recorded.statistics.cycles);
    for cycle in cycles {
        assert!(cycle.axes.len() <= recorded.machine.axes.len());
    }
}

/// A file of this thread. It is removed when it is dropped.
struct File(PathBuf);

impl File {
    fn with(bytes: &[u8]) -> Self {
        let (process, thread) = (std::process::id(), std::thread::current().id());
        let path = std::env::temp_dir().join(format!("takt-fuzz-{process}-{thread:?}.mcap"));
        fs::write(&path, bytes).expect("there is room for a small file");
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        // A file that remains is overwritten by the next one.
        let _ = fs::remove_file(&self.0);
    }
}
