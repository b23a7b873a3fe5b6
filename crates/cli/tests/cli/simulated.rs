//! `takt sim` in a process of its own, on a pseudo-terminal.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use tempfile::TempDir;

/// Starts a program that gets a processor at once where the rights allow it, as the firmware of a drive has one. On a busy machine an
/// ordinary process answers late, which a master on a line takes for a fault.
pub fn at_once(program: &str) -> Command {
    let mut command = Command::new("nice");
    command.args(["-n", "-19", program]);
    command
}

/// Simulated drives or devices, until this is dropped.
pub struct Simulated {
    process: Child,
    /// The pseudo-terminal, in a folder of its own.
    pub path: PathBuf,
    _folder: TempDir,
}

impl Simulated {
    /// `takt sim` with these arguments and `--pty`.
    pub fn new(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("line");
        let mut takt = at_once(env!("CARGO_BIN_EXE_takt"));
        takt.arg("sim").args(arguments).arg("--pty").arg(&path).stdin(Stdio::null()).stderr(Stdio::null());
        let process = takt.spawn().unwrap();
        while !path.exists() {
            thread::sleep(Duration::from_millis(5));
        }
        Self { process, path, _folder: folder }
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}
