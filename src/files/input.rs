//! Reading what people name: what was broken off there is completed first.

use std::io;
use std::path::Path;

use super::journal::settle;
use super::regular::{bounded_bytes, bounded_text};

/// Reads a regular file of at most so many bytes, whatever its stated size. Where a report was broken off while its files took their
/// names, it is completed first.
///
/// # Errors
/// As [`super::regular::check_regular`], and where it is longer.
pub fn read_bytes(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    settle(path)?;
    bounded_bytes(path, most_bytes)
}

/// The same for text.
///
/// # Errors
/// As [`read_bytes`], and where it is not UTF-8.
pub fn read_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    settle(path)?;
    bounded_text(path, most_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_of_their_size_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text(&path, 5).unwrap(), "12345");
        let error = read_text(&path, 4).unwrap_err().to_string();
        assert!(error.contains("at most 4 bytes, found 5"), "{error}");
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(read_text(&path, 5).unwrap_err().to_string().contains("from byte 2 on"));
        assert!(read_text(dir.path(), 5).unwrap_err().to_string().contains("found a folder"));
        #[cfg(target_os = "linux")]
        assert!(read_bytes(Path::new("/dev/zero"), 5).unwrap_err().to_string().contains("found a device"));
    }
}
