//! What rosbag2 compressed: whole files, unpacked beside nothing into a temporary file, and messages one by one.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use super::chunk::{UNPACK_RATIO, unpack_limit};
use super::topic::RawView;
use super::{BagError, Damage};
use govtwin_files::Scratch;

/// How a zstd frame begins; no CDR message does.
const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// The largest message that is unpacked, bytes.
const MESSAGE_LIMIT: u64 = 1 << 28;

/// Whether bytes are compressed with zstd.
pub(super) fn is_packed(bytes: &[u8]) -> bool {
    bytes.starts_with(ZSTD_MAGIC)
}

/// Unpacks a file that is compressed as a whole, as far as possible, and returns what was wrong with it.
///
/// # Errors
/// Where the operating system refuses.
pub(super) fn file(path: &Path) -> Result<(Scratch, Option<Damage>), BagError> {
    let packed = File::open(path).map_err(BagError::io(path, "open"))?;
    let bytes = packed.metadata().map_err(BagError::io(path, "read"))?.len();
    let mut unpacked = Scratch::new().map_err(BagError::io(path, "unpack to a temporary file"))?;
    let mut decoder = zstd::Decoder::new(packed).map_err(BagError::io(path, "read"))?;
    let (mut left, mut part) = (unpack_limit(bytes), vec![0; 1 << 17]);
    let problem = loop {
        match decoder.read(&mut part) {
            Ok(0) => break None,
            Ok(len) if len as u64 > left => {
                break Some(format!("a file may unpack to {UNPACK_RATIO} times its size, and this one goes on"));
            }
            Ok(len) => {
                left -= len as u64;
                let written = unpacked.write_all(part.get(..len).unwrap_or_default());
                written.map_err(BagError::io(path, "unpack to a temporary file"))?;
            }
            Err(error) => break Some(format!("the compressed file cannot be unpacked further ({error})")),
        }
    };
    let damage = problem.map(|problem| Damage {
        at_byte: 0,
        lost_bytes: 0,
        problem,
        places: 1,
        recovered_messages: 0,
        last_good_ns: None,
    });
    Ok((unpacked, damage))
}

/// Unpacks messages that are compressed one by one, and counts those that cannot be.
pub(super) struct Messages {
    decompressor: Option<zstd::bulk::Decompressor<'static>>,
    bytes: Vec<u8>,
    left: u64,
    /// Messages that were compressed.
    pub(super) packed: u64,
    /// Those of them that stayed so.
    pub(super) failed: u64,
    first_problem: Option<String>,
}

impl Messages {
    /// For the messages of a file of this size.
    pub(super) fn new(file_bytes: u64) -> Self {
        let left = unpack_limit(file_bytes);
        Self { decompressor: None, bytes: vec![], left, packed: 0, failed: 0, first_problem: None }
    }

    /// The message unpacked; as it is where it was not compressed, or cannot be unpacked.
    pub(super) fn unpack<'a>(&'a mut self, message: RawView<'a>) -> RawView<'a> {
        if !is_packed(message.data) || message.topic.encoding != "cdr" {
            return message;
        }
        self.packed += 1;
        match self.unpack_bytes(message.data) {
            Ok(()) => {
                self.left = self.left.saturating_sub(self.bytes.len() as u64);
                RawView { data: &self.bytes, ..message }
            }
            Err(problem) => {
                self.failed += 1;
                self.first_problem.get_or_insert(problem);
                message
            }
        }
    }

    /// The findings on messages that could not be unpacked.
    pub(super) fn damage(&self) -> Option<Damage> {
        let problem = self.first_problem.as_ref()?;
        Some(Damage {
            at_byte: 0,
            lost_bytes: 0,
            problem: format!("{} compressed messages cannot be unpacked ({problem})", self.failed),
            places: 1,
            recovered_messages: 0,
            last_good_ns: None,
        })
    }

    fn unpack_bytes(&mut self, packed: &[u8]) -> Result<(), String> {
        let words = |error: std::io::Error| error.to_string();
        let most_bytes = MESSAGE_LIMIT.min(self.left);
        self.bytes.clear();
        match zstd::zstd_safe::get_frame_content_size(packed) {
            Ok(Some(len)) if len > most_bytes => {
                Err(format!("it says it holds {len} bytes, expected at most {most_bytes}"))
            }
            Ok(Some(len)) => {
                self.bytes.reserve(usize::try_from(len).unwrap_or_default());
                if self.decompressor.is_none() {
                    self.decompressor = Some(zstd::bulk::Decompressor::new().map_err(words)?);
                }
                let Some(decompressor) = &mut self.decompressor else { return Ok(()) };
                decompressor.decompress_to_buffer(packed, &mut self.bytes).map(|_| ()).map_err(words)
            }
            // Its writer did not know the size beforehand.
            Ok(None) => {
                let mut decoder = zstd::Decoder::with_buffer(packed).map_err(words)?.take(most_bytes);
                decoder.read_to_end(&mut self.bytes).map(|_| ()).map_err(words)
            }
            Err(error) => Err(error.to_string()),
        }
    }
}

impl std::fmt::Debug for Messages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Messages").field("packed", &self.packed).field("failed", &self.failed).finish_non_exhaustive()
    }
}
