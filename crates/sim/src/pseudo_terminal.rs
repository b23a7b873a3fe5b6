//! A pseudo-terminal: a serial line without a cable. A simulated device is at one end; any program opens the other one as it
//! would open `/dev/ttyUSB0`.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use nix::fcntl::{FcntlArg, FdFlag, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;
use takt_rt::Nanoseconds;

/// The device's end of a serial line without a cable. Reading and writing never wait.
#[derive(Debug)]
pub struct PseudoTerminal {
    device_end: File,
    /// The other end is held open. Without that, every program that closes it would end the line for the device.
    _other_end: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
}

impl PseudoTerminal {
    /// Makes a pair of ends.
    ///
    /// # Errors
    /// What the system said.
    pub fn open() -> io::Result<Self> {
        let ends = openpty(None, None)?;
        // Without this the line would echo, and change CR to LF, for every program that does not ask for a raw one.
        let mut settings = tcgetattr(&ends.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&ends.slave, SetArg::TCSANOW, &settings)?;
        let flags = OFlag::from_bits_truncate(fcntl(&ends.master, FcntlArg::F_GETFL)?);
        fcntl(&ends.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
        // A program that is started beside this would hold the line open.
        for end in [&ends.master, &ends.slave] {
            fcntl(end, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC))?;
        }
        let path = ttyname(&ends.slave)?;
        Ok(Self { device_end: File::from(ends.master), _other_end: ends.slave, path, link: None })
    }

    /// Gives the other end a second path, for as long as this is open. A link that leads nowhere, as a process that was killed
    /// leaves it behind, is replaced.
    ///
    /// # Errors
    /// What the system said; `AlreadyExists` if something else has this path.
    pub fn link(&mut self, link: &Path) -> io::Result<()> {
        let is_left_behind =
            fs::symlink_metadata(link).is_ok_and(|found| found.is_symlink()) && !link.exists();
        if is_left_behind {
            fs::remove_file(link)?;
        }
        symlink(&self.path, link)?;
        self.link = Some(link.to_owned());
        Ok(())
    }

    /// The path of the other end.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The second path of the other end.
    pub fn linked_path(&self) -> Option<&Path> {
        self.link.as_deref()
    }

    /// Waits until something has arrived, but not longer than `timeout_ns`.
    pub fn wait(&self, timeout_ns: Nanoseconds) {
        let timeout = PollTimeout::try_from(timeout_ns.div_ceil(1_000_000)).unwrap_or(PollTimeout::MAX);
        // Whatever it says, the caller reads.
        let _ = poll(&mut [PollFd::new(self.device_end.as_fd(), PollFlags::POLLIN)], timeout);
    }
}

impl Read for PseudoTerminal {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.device_end.read(bytes)
    }
}

impl Write for PseudoTerminal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.device_end.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.device_end.flush()
    }
}

impl Drop for PseudoTerminal {
    fn drop(&mut self) {
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|target| target == self.path)
        {
            // It leads nowhere from now on, and the next one replaces it.
            let _ = fs::remove_file(link);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::OpenOptions;
    use std::io::ErrorKind;

    fn other_end(path: &Path) -> File {
        OpenOptions::new().read(true).write(true).open(path).unwrap()
    }

    #[test]
    fn bytes_cross_unchanged_in_both_directions_and_nothing_is_echoed() {
        let mut device = PseudoTerminal::open().unwrap();
        let mut bytes = [0; 16];
        assert_eq!(device.read(&mut bytes).unwrap_err().kind(), ErrorKind::WouldBlock);
        let mut host = other_end(device.path());
        host.write_all(b"S8\r\n\x03").unwrap();
        device.wait(1_000_000_000);
        assert_eq!(device.read(&mut bytes).unwrap(), 5);
        assert_eq!(&bytes[..5], b"S8\r\n\x03");
        device.write_all(b"\r\x07\xFF").unwrap();
        host.read_exact(&mut bytes[..3]).unwrap();
        assert_eq!(&bytes[..3], b"\r\x07\xFF");
        assert_eq!(device.read(&mut bytes).unwrap_err().kind(), ErrorKind::WouldBlock);
    }

    #[test]
    fn a_program_that_closes_its_end_leaves_the_line_for_the_next_one() {
        let mut device = PseudoTerminal::open().unwrap();
        drop(other_end(device.path()));
        let mut bytes = [0; 16];
        assert_eq!(device.read(&mut bytes).unwrap_err().kind(), ErrorKind::WouldBlock);
        other_end(device.path()).write_all(b"x").unwrap();
        device.wait(1_000_000_000);
        assert_eq!(device.read(&mut bytes).unwrap(), 1);
    }

    #[test]
    fn a_link_lasts_as_long_as_the_line_and_replaces_none_but_one_that_leads_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("can0");
        symlink("/dev/pts/takt-none", &link).unwrap();
        let mut first = PseudoTerminal::open().unwrap();
        first.link(&link).unwrap();
        assert_eq!(fs::read_link(&link).unwrap(), first.path());
        let mut second = PseudoTerminal::open().unwrap();
        assert_eq!(second.link(&link).unwrap_err().kind(), ErrorKind::AlreadyExists);
        drop(second);
        assert_eq!(first.linked_path(), Some(link.as_path()));
        drop(first);
        assert!(fs::symlink_metadata(&link).is_err());
    }
}
