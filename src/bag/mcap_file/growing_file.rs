//! One MCAP file that is still being written: read on from where it was left.

use std::path::Path;

use super::super::structure::Structure;
use super::super::topic::{OnMessage, TopicInfo};
use super::super::{BagError, chunk};
use super::walk::{FilePart, FileWalk};
use super::{RecordFile, Scan};

/// A file that may still grow: each read goes on where the last one ended.
#[derive(Debug)]
pub(crate) struct GrowingFile {
    scan: Scan,
    at: u64,
    /// How much more chunks may unpack to, bytes.
    unpack_left: u64,
}

impl GrowingFile {
    /// Nothing of it was read yet.
    pub(crate) fn new(path: &Path) -> Self {
        Self { scan: Scan::of(0, path), at: mcap::MAGIC.len() as u64, unpack_left: chunk::unpack_limit(0) }
    }

    /// Where the next read begins: behind the last record that was whole.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Its topics so far.
    pub(crate) fn topics(&self) -> impl Iterator<Item = &TopicInfo> {
        self.scan.found.channels.topics().map(|(_, topic)| &**topic)
    }

    /// What its metadata states so far, by key.
    pub(crate) fn about(&self, key: &str) -> Option<&str> {
        self.scan.found.health.about.get(key).map(String::as_str)
    }

    /// Hands on the messages that came since, in file order, and gives the bytes that it read. A record that is not whole waits for the rest
    /// of it; of a file that has ended what there is of it counts.
    pub(crate) fn more(&mut self, path: &Path, ended: bool, on_message: &mut OnMessage<'_>) -> Result<u64, BagError> {
        let mut file = RecordFile::open(path).map_err(BagError::io(path, "open"))?;
        let scan = &mut self.scan;
        let more = file.end().saturating_sub(scan.data_end);
        let unpack_left = self.unpack_left.saturating_add(chunk::UNPACK_RATIO.saturating_mul(more));
        scan.data_end = file.end();
        let mut walk =
            FileWalk { finished: scan.found.health.finished, grows: !ended, data_end: scan.data_end, unpack_left };
        // What a scan keeps of what it has read would grow without bound.
        (scan.found.segments, scan.structure) = (vec![], Structure::default());
        let read =
            file.seek(self.at).and_then(|()| walk.here(&mut file, &mut |part: &FilePart| scan.take(part, on_message)));
        self.unpack_left = walk.unpack_left;
        self.at = file.at();
        read.map_err(BagError::io(path, "read"))?;
        Ok(file.looked_at_bytes())
    }
}
