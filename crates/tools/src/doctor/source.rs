//! Where everything is read: files below a root, and a few programs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// This machine, or a copy of another one's files.
#[derive(Clone, Debug)]
pub struct Source {
    root: PathBuf,
    /// What programs answer; `None` asks them.
    answers: Option<BTreeMap<String, String>>,
}

/// Why a program gave no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CommandFailure {
    /// It is not installed.
    Missing,
    /// It failed with this message.
    Failed(String),
}

impl Source {
    /// This machine.
    pub fn this_machine() -> Self {
        Self { root: PathBuf::from("/"), answers: None }
    }

    /// A machine whose files lie below `root`, and whose programs, by their command line, answer so. Others are not
    /// installed there.
    pub fn recorded(root: &Path, answers: BTreeMap<String, String>) -> Self {
        Self { root: root.to_owned(), answers: Some(answers) }
    }

    /// Returns `true` if this is the machine that the program runs on, whose kernel can be asked.
    pub(super) fn is_this_machine(&self) -> bool {
        self.answers.is_none()
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// A file without white space at its ends; `None` when it cannot be read.
    pub(super) fn text(&self, path: &str) -> Option<String> {
        let bytes = fs::read(self.path(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    /// Returns `true` if there is something with this name.
    pub(super) fn exists(&self, path: &str) -> bool {
        self.path(path).symlink_metadata().is_ok()
    }

    /// Returns `true` if this is a container, by the marks that Docker and Podman leave.
    pub(super) fn is_container(&self) -> bool {
        self.exists("/.dockerenv") || self.exists("/run/.containerenv")
    }

    /// What a symbolic link says, whether or not that exists.
    pub(super) fn link(&self, path: &str) -> Option<String> {
        Some(fs::read_link(self.path(path)).ok()?.to_string_lossy().into_owned())
    }

    /// The last part of what a symbolic link says: the name of a driver, for instance.
    pub(super) fn link_name(&self, path: &str) -> Option<String> {
        let link = self.link(path)?;
        Some(link.rsplit('/').next()?.to_owned())
    }

    /// The names in a folder, sorted; none when it cannot be read.
    pub(super) fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(path)).into_iter().flatten().flatten();
        let mut names: Vec<_> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// What a program prints.
    pub(super) fn command(&self, program: &str, arguments: &[&str]) -> Result<String, CommandFailure> {
        if let Some(answers) = &self.answers {
            let line = format!("{program} {}", arguments.join(" "));
            return answers.get(&line).cloned().ok_or(CommandFailure::Missing);
        }
        let output = Command::new(program)
            .args(arguments)
            .env("LC_ALL", "C")
            // Not every user has the folders of the system's programs among those that are searched.
            .env("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin")
            .stdin(Stdio::null())
            .output()
            .map_err(|_| CommandFailure::Missing)?;
        if output.status.success() {
            Ok(String::from_utf8_lossy(&output.stdout).into_owned())
        } else {
            Err(CommandFailure::Failed(String::from_utf8_lossy(&output.stderr).trim().to_owned()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recorded_machine_is_read_below_its_root_and_its_programs_answer_as_recorded() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("proc")).unwrap();
        fs::write(folder.path().join("proc/version"), b"Linux \xff\n").unwrap();
        std::os::unix::fs::symlink("../../bus/usb/drivers/gs_usb", folder.path().join("driver")).unwrap();
        let answers = BTreeMap::from([("ip link".to_owned(), "[]".to_owned())]);
        let source = Source::recorded(folder.path(), answers);
        assert_eq!(source.text("/proc/version").as_deref(), Some("Linux \u{fffd}"));
        assert_eq!(source.text("/proc/cmdline"), None);
        assert_eq!(source.link_name("/driver").as_deref(), Some("gs_usb"));
        assert!(source.exists("/driver") && !source.exists("/drive"));
        assert_eq!((source.names("/proc"), source.names("/dev")), (vec!["version".to_owned()], vec![]));
        assert_eq!(source.command("ip", &["link"]).as_deref(), Ok("[]"));
        assert_eq!(source.command("tc", &[]), Err(CommandFailure::Missing));
    }

    #[test]
    fn a_program_that_is_missing_is_told_from_one_that_fails() {
        let source = Source::this_machine();
        assert_eq!(source.command("takt-no-such-program", &[]), Err(CommandFailure::Missing));
        let failed = source.command("ls", &["/no/such/folder"]);
        assert!(
            matches!(failed, Err(CommandFailure::Failed(message)) if message.contains("/no/such/folder"))
        );
    }
}
