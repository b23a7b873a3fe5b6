//! Text files on the disk.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use nix::sys::statfs::{PROC_SUPER_MAGIC, fstatfs};

/// No file of this kind is longer; a disk image given by mistake is, and would fill the memory.
const LONGEST_MIB: u64 = 64;

/// Reads a whole file.
///
/// # Errors
/// It cannot be read, is no regular file, or is longer than 64 MiB. Whoever reads a FIFO, a device or a file of the kernel
/// may wait for ever.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(open(path)?, LONGEST_MIB << 20)
}

/// Opens a file to read.
///
/// # Errors
/// It cannot be opened, or is no regular file.
pub fn open(path: &Path) -> io::Result<File> {
    // Opening a device may do something, so this is known before.
    only_regular(std::fs::metadata(path)?.file_type())?;
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path)?;
    // Another file may have taken the name since.
    only_regular(file.metadata()?.file_type())?;
    if fstatfs(&file)?.filesystem_type() == PROC_SUPER_MAGIC {
        return Err(refused("a file of the kernel (/proc)"));
    }
    Ok(file)
}

fn read_at_most(file: File, longest: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    match file.take(longest + 1).read_to_end(&mut bytes) {
        Ok(_) if bytes.len() as u64 > longest => {
            Err(io::Error::other(format!("it is longer than {LONGEST_MIB} MiB; is this another file?")))
        }
        Ok(_) => Ok(bytes),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Err(refused("a file that may never end")),
        Err(error) => Err(error),
    }
}

fn only_regular(kind: FileType) -> io::Result<()> {
    let name = match kind {
        _ if kind.is_file() => return Ok(()),
        _ if kind.is_dir() => "a directory",
        _ if kind.is_fifo() => "a FIFO (named pipe)",
        _ if kind.is_socket() => "a socket",
        _ if kind.is_char_device() || kind.is_block_device() => "a device",
        _ => "something else",
    };
    Err(refused(name))
}

fn refused(what: &str) -> io::Error {
    io::Error::other(format!("it is {what}; only regular files are read"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    #[test]
    fn a_regular_file_is_read_whole() {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert_eq!(read(&manifest).unwrap(), std::fs::read(manifest).unwrap());
    }

    #[test]
    fn what_is_no_regular_file_is_refused_at_once_by_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        mkfifo(&fifo, Mode::S_IRWXU).unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&fifo, &link).unwrap();
        for (path, kind) in [
            (fifo.as_path(), "a FIFO"),
            (&link, "a FIFO"),
            (&socket, "a socket"),
            (folder.path(), "a directory"),
            (Path::new("/dev/null"), "a device"),
            (Path::new("/dev/zero"), "a device"),
            (Path::new("/proc/self/status"), "a file of the kernel"),
        ] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains(kind) && error.contains("only regular files"), "{path:?}: {error}");
        }
    }

    #[test]
    fn a_file_that_is_too_long_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_at_most(File::open(&path).unwrap(), 5).unwrap(), b"12345");
        let error = read_at_most(File::open(&path).unwrap(), 4).unwrap_err().to_string();
        assert!(error.contains("longer than"), "{error}");
    }
}
