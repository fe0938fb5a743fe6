//! Bounded reads: regular files only, and no more of them than they may hold.

use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::Path;

/// Refuses pipes, devices and sockets, which may never end, or wait for ever, or do something when read.
///
/// # Errors
/// The file system's error, and what was found instead of a regular file.
pub fn check_regular(path: &Path) -> io::Result<Metadata> {
    let kind = std::fs::metadata(path)?;
    match describe(&kind) {
        None => Ok(kind),
        Some(found) => {
            let words = format!("expected a regular file, found {found}; copy what it gives into a file");
            Err(io::Error::new(io::ErrorKind::InvalidInput, words))
        }
    }
}

/// What is at a path, links followed; none where nothing is there.
///
/// # Errors
/// If the file system refuses to answer, which does not mean that a file is absent.
pub fn look_at(path: &Path) -> io::Result<Option<Metadata>> {
    found(std::fs::metadata(path))
}

/// The same for a link itself.
///
/// # Errors
/// As [`look_at`].
pub fn look_at_link(path: &Path) -> io::Result<Option<Metadata>> {
    found(std::fs::symlink_metadata(path))
}

fn found(result: io::Result<Metadata>) -> io::Result<Option<Metadata>> {
    match result {
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => Ok(None),
        other => other.map(Some),
    }
}

/// What something is that is no regular file.
#[cfg(unix)]
pub(super) fn describe(kind: &Metadata) -> Option<&'static str> {
    use std::os::unix::fs::FileTypeExt as _;
    let of = kind.file_type();
    let names = [
        (of.is_dir(), "a folder"),
        (of.is_fifo(), "a pipe"),
        (of.is_char_device() || of.is_block_device(), "a device"),
        (of.is_socket(), "a socket"),
    ];
    names.into_iter().find_map(|(is, name)| is.then_some(name)).or((!of.is_file()).then_some("something else"))
}

/// The same where files have fewer kinds.
#[cfg(not(unix))]
pub(super) fn describe(kind: &Metadata) -> Option<&'static str> {
    (!kind.is_file()).then_some(if kind.is_dir() { "a folder" } else { "something else" })
}

/// Reads a regular file of at most so many bytes, whatever its stated size.
pub(super) fn bounded_bytes(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let stated_bytes = check_regular(path)?.len();
    let mut bytes = vec![];
    if stated_bytes <= most_bytes {
        File::open(path)?.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    }
    let found_bytes = stated_bytes.max(bytes.len() as u64);
    if found_bytes > most_bytes {
        let words = format!("expected at most {most_bytes} bytes, found {found_bytes}; is it the right file?");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, words));
    }
    Ok(bytes)
}

/// The same for text.
pub(super) fn bounded_text(path: &Path, most_bytes: u64) -> io::Result<String> {
    let bytes = bounded_bytes(path, most_bytes)?;
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(
            io::ErrorKind::InvalidData,
            format!("expected text in UTF-8, found other bytes from byte {at} on"),
        )
    })
}
