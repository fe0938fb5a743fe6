//! Parts of a scanned MCAP file, loaded again.

use std::io;
use std::path::{Path, PathBuf};

use mcap::records::op;

use super::super::BagError;
use super::super::channels::Channels;
use super::super::chunk::{self, Records};
use super::super::record::parse;
use super::super::record_file::{RecordFile, Step};
use super::super::segment::Segment;
use super::super::topic::OnMessage;

/// Loads segments of a scanned file again.
#[derive(Debug)]
pub(crate) struct Loader {
    path: PathBuf,
    file: RecordFile,
    channels: Channels,
}

impl Loader {
    /// Opens a scanned file.
    pub(crate) fn open(path: &Path, channels: Channels) -> Result<Self, BagError> {
        let file = RecordFile::open(path).map_err(BagError::io(path, "open"))?;
        Ok(Self { path: path.to_owned(), file, channels })
    }

    /// Hands on the messages of a segment in file order; the scan reported the damage.
    pub(crate) fn load(&mut self, segment: &Segment, on_message: &mut OnMessage<'_>) -> Result<(), BagError> {
        self.walk(segment, on_message).map_err(BagError::io(&self.path, "read"))
    }

    fn walk(&mut self, segment: &Segment, on_message: &mut OnMessage<'_>) -> io::Result<()> {
        let mut body = vec![];
        let mut records = Records::default();
        self.file.seek(segment.at)?;
        while self.file.at() < segment.end {
            let (opcode, len) = match self.file.next(&mut body)? {
                Step::Record(opcode) => (opcode, body.len() as u64),
                Step::Cut { opcode, stated_len } => {
                    self.file.rest(&mut body)?;
                    (opcode, stated_len)
                }
                Step::Nonsense | Step::End { .. } => return Ok(()),
            };
            if opcode == op::CHUNK {
                // What is whole is in `records` even where the chunk is damaged.
                let _ = chunk::read(&body, len, u64::MAX, &mut records);
                for (opcode, data) in records.iter() {
                    self.hand_on(opcode, data, on_message);
                }
            } else {
                self.hand_on(opcode, &body, on_message);
            }
            if body.len() as u64 != len {
                return Ok(());
            }
        }
        Ok(())
    }

    fn hand_on(&self, opcode: u8, body: &[u8], on_message: &mut OnMessage<'_>) {
        if let Some(message) = parse(opcode, body).and_then(|record| self.channels.view(&record)) {
            on_message(message);
        }
    }
}
