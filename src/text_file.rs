//! Files that people write: configurations, scenarios, device descriptions.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// No file of this kind is longer; a device or a disk image given by mistake is, and would fill the memory.
const LONGEST_MIB: u64 = 64;

/// Reads a whole file.
///
/// # Errors
/// It cannot be read, or is longer than 64 MiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let longest = LONGEST_MIB << 20;
    let mut bytes = Vec::new();
    File::open(path)?.take(longest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > longest {
        return Err(io::Error::other(format!("it is longer than {LONGEST_MIB} MiB; is this another file?")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_an_error_and_any_other_is_read_whole() {
        let error = read(Path::new("/dev/zero")).unwrap_err();
        assert!(error.to_string().contains("longer than 64 MiB"), "{error}");
        assert_eq!(read(Path::new("/dev/null")).unwrap(), b"");
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert_eq!(read(&manifest).unwrap(), std::fs::read(manifest).unwrap());
    }
}
