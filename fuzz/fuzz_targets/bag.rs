//! Any bytes as an MCAP file: read as a recording, as raw messages, and surveyed.
#![no_main]

use std::io::Write;

use govtwin::bag::{self, ReadOptions};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut file) = tempfile::NamedTempFile::new_in(scratch()) else { return };
    // The magic is given, so that no run is spent on finding it.
    if file.write_all(b"\x89MCAP0\r\n").and_then(|()| file.write_all(bytes)).is_err() {
        return;
    }
    let _ = bag::read(file.path(), &ReadOptions::default());
    let _ = bag::survey(file.path());
    if let Ok(messages) = bag::messages(file.path()) {
        let _ = messages.count();
    }
});

/// Memory instead of a disk where there is one.
fn scratch() -> std::path::PathBuf {
    let memory = std::path::Path::new("/dev/shm");
    if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() }
}
