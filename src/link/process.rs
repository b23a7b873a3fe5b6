//! Who holds a lock.

use std::fmt;

/// A process at the other end of a lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Process {
    /// Its process ID; 0 for a process that cannot be seen from here: in a container, or of another user where it answers nothing.
    pub pid: i32,
    /// The user it belongs to.
    pub user: u32,
}

impl Process {
    /// Returns `true` for the calling process.
    pub(super) fn is_this(&self) -> bool {
        u32::try_from(self.pid) == Ok(std::process::id())
    }
}

impl fmt::Display for Process {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.pid {
            0 => write!(f, "a process that cannot be seen from here (user {})", self.user),
            pid => write!(f, "process {pid} (user {})", self.user),
        }
    }
}
