//! The records of an MCAP file as they lie in it, each looked at before it is believed.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use mcap::records::op;

use super::chunk::{self, HEAD_LEN};

/// The largest record that is believed, bytes; rosbag2 makes chunks of less than 1 MB.
pub(super) const RECORD_LIMIT: usize = 1 << 28;

/// Footer record and closing magic.
const TAIL_LEN: u64 = HEAD_LEN as u64 + 20 + mcap::MAGIC.len() as u64;

/// Opcode and length of a footer.
const FOOTER_HEAD: &[u8] = &[op::FOOTER, 20, 0, 0, 0, 0, 0, 0, 0];

/// How far one look for the next chunk goes at most, bytes.
const WINDOW_LEN: usize = 1 << 16;

/// How far the first look goes, bytes: where chunk follows on damage every few bytes, long looks would add up.
const FIRST_LOOK_LEN: usize = 1 << 8;

/// The contents at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// A whole record; its body was read.
    Record(u8),
    /// A record whose stated length exceeds the rest of the file or the limit; [`RecordFile::rest`] reads what is there.
    Cut { opcode: u8, stated_len: u64 },
    /// No record can begin here.
    Nonsense,
    /// Nothing: the file ends here, `left` bytes short of a head.
    End { left: u64 },
}

/// How a file ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tail {
    /// Without a footer: whoever wrote it did not finish.
    Unfinished,
    /// As a finished file without a summary.
    NoSummary,
    /// As a finished file whose summary begins at this byte, and has this CRC where it states one.
    Summary { start: u64, crc: Option<u32> },
}

/// An MCAP file, read record by record.
#[derive(Debug)]
pub(super) struct RecordFile {
    reader: BufReader<File>,
    at: u64,
    end: u64,
    /// Bytes looked at so far, those that were looked at twice counted twice.
    looked_at_bytes: u64,
}

impl RecordFile {
    /// Opens a file at its first record, behind the magic.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let end = file.metadata()?.len();
        let mut this = Self { reader: BufReader::with_capacity(WINDOW_LEN, file), at: 0, end, looked_at_bytes: 0 };
        this.seek(mcap::MAGIC.len() as u64)?;
        Ok(this)
    }

    /// Where the next record is read.
    pub(super) fn at(&self) -> u64 {
        self.at
    }

    /// Size of the file.
    pub(super) fn end(&self) -> u64 {
        self.end
    }

    /// Bytes looked at so far.
    pub(super) fn looked_at_bytes(&self) -> u64 {
        self.looked_at_bytes
    }

    /// Goes to a place.
    pub(super) fn seek(&mut self, at: u64) -> io::Result<()> {
        let offset = i64::try_from(i128::from(at) - i128::from(self.at)).map_err(io::Error::other)?;
        self.reader.seek_relative(offset)?;
        self.at = at;
        Ok(())
    }

    /// Reads the record here into `body` and goes behind it.
    pub(super) fn next(&mut self, body: &mut Vec<u8>) -> io::Result<Step> {
        body.clear();
        let left = self.end.saturating_sub(self.at);
        if left < HEAD_LEN as u64 {
            return Ok(Step::End { left });
        }
        let mut head = [0; HEAD_LEN];
        self.reader.read_exact(&mut head)?;
        self.at += HEAD_LEN as u64;
        self.looked_at_bytes += HEAD_LEN as u64;
        let [opcode, len @ ..] = head;
        let stated_len = u64::from_le_bytes(len);
        // Opcodes up to 0x0f are in use, those from 0x80 are anybody's, the others are reserved.
        if opcode == 0 || (0x10..0x80).contains(&opcode) {
            return Ok(Step::Nonsense);
        }
        let left = left - HEAD_LEN as u64;
        if opcode == op::ATTACHMENT && stated_len <= left {
            // It holds nothing that is wanted here, and may be large.
            self.seek(self.at + stated_len)?;
            return Ok(Step::Record(opcode));
        }
        if stated_len > left.min(RECORD_LIMIT as u64) {
            // Not read yet: where a chunk follows, that is read instead, and whatever lies between is looked at once.
            return Ok(Step::Cut { opcode, stated_len });
        }
        self.read(stated_len, body)?;
        let whole = body.len() as u64 == stated_len;
        Ok(if whole { Step::Record(opcode) } else { Step::Cut { opcode, stated_len } })
    }

    /// Reads the body of a record that was passed over, whose head stands at a place, and goes behind it; false where it is larger than any that
    /// is believed.
    pub(super) fn passed(&mut self, at: u64, body: &mut Vec<u8>) -> io::Result<bool> {
        let end = self.at;
        let len = end.saturating_sub(at + HEAD_LEN as u64);
        if len > RECORD_LIMIT as u64 {
            return Ok(false);
        }
        body.clear();
        self.seek(at + HEAD_LEN as u64)?;
        self.read(len, body)?;
        Ok(true)
    }

    /// Reads what there is of a record behind its head, up to the limit, and goes behind it.
    pub(super) fn rest(&mut self, body: &mut Vec<u8>) -> io::Result<()> {
        body.clear();
        self.read(RECORD_LIMIT as u64, body)
    }

    fn read(&mut self, len: u64, body: &mut Vec<u8>) -> io::Result<()> {
        self.reader.by_ref().take(len).read_to_end(body)?;
        self.at += body.len() as u64;
        self.looked_at_bytes += body.len() as u64;
        Ok(())
    }

    /// Looks for the next place from `from` on where a chunk could begin.
    pub(super) fn find_chunk(&mut self, from: u64) -> io::Result<Option<u64>> {
        let mut at = from;
        let mut window = Vec::new();
        let mut look_len = FIRST_LOOK_LEN;
        while at < self.end {
            self.seek(at)?;
            window.clear();
            self.read(look_len as u64, &mut window)?;
            let found = (0..window.len()).find(|&place| {
                window[place] == op::CHUNK && chunk::looks_like_one(&window[place..], self.end - at - place as u64)
            });
            if let Some(place) = found {
                let found = at + place as u64;
                self.seek(found)?;
                return Ok(Some(found));
            }
            // A chunk that begins in the last bytes is seen whole in the next window.
            let step = if window.len() > chunk::LOOK_LEN { window.len() - chunk::LOOK_LEN } else { window.len() };
            at += step.max(1) as u64;
            look_len = WINDOW_LEN.min(2 * look_len);
        }
        Ok(None)
    }

    /// Says how the file ends.
    pub(super) fn tail(&mut self) -> io::Result<Tail> {
        let Some(at) = self.end.checked_sub(TAIL_LEN).filter(|at| *at >= mcap::MAGIC.len() as u64) else {
            return Ok(Tail::Unfinished);
        };
        self.seek(at)?;
        let mut tail = vec![];
        self.read(TAIL_LEN, &mut tail)?;
        let footer = tail.strip_suffix(mcap::MAGIC).and_then(|tail| tail.strip_prefix(FOOTER_HEAD));
        let start = footer.and_then(|footer| footer.first_chunk()).map(|start| u64::from_le_bytes(*start));
        let crc = footer.and_then(|footer| footer.last_chunk()).map(|crc| u32::from_le_bytes(*crc));
        Ok(match start {
            None => Tail::Unfinished,
            Some(start) if start > 0 && start < at => Tail::Summary { start, crc: crc.filter(|crc| *crc != 0) },
            Some(_) => Tail::NoSummary,
        })
    }

    /// The CRC of a summary that begins at `start`: up to that of the footer itself.
    pub(super) fn summary_crc(&mut self, start: u64) -> io::Result<Option<u32>> {
        let end = self.end.saturating_sub(mcap::MAGIC.len() as u64 + 4);
        self.seek(start)?;
        let mut crc = crc32fast::Hasher::new();
        let mut bytes = Vec::new();
        while self.at < end {
            bytes.clear();
            self.read((end - self.at).min(WINDOW_LEN as u64), &mut bytes)?;
            if bytes.is_empty() {
                return Ok(None);
            }
            crc.update(&bytes);
        }
        Ok(Some(crc.finalize()))
    }
}
