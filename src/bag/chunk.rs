//! Chunks: their heads, and the records inside, decompressed and checked against the CRC, whole or cut short.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::record_file::{HEAD_LEN, RECORD_LIMIT};

/// Body of a chunk before the name of its compression: times, size, CRC, length of the name.
const FIXED_LEN: usize = 8 + 8 + 8 + 4 + 4;

/// The name of a chunk's compression, and how long its head is; `None` where this cannot be a chunk.
pub(super) fn compression(body: &[u8]) -> Option<(&str, usize)> {
    let (head, rest) = body.split_at_checked(FIXED_LEN)?;
    let len = u32::from_le_bytes(head.get(28..)?.try_into().ok()?);
    let name = std::str::from_utf8(rest.get(..usize::try_from(len).ok()?)?).ok()?;
    Some((name, FIXED_LEN + name.len() + 8))
}

/// Bytes that [`looks_like_one`] needs.
pub(super) const LOOK_LEN: usize = HEAD_LEN + FIXED_LEN + 4 + 8;

/// Bytes that could be the beginning of a chunk record: known compression, lengths that agree.
pub(super) fn looks_like_one(bytes: &[u8], left_in_file: u64) -> bool {
    let Some((&[opcode, ref len @ ..], body)) = bytes.split_first_chunk::<HEAD_LEN>() else { return false };
    let len = u64::from_le_bytes(*len);
    if opcode != op::CHUNK || len > left_in_file.saturating_sub(HEAD_LEN as u64) {
        return false;
    }
    let Some((name, head_len)) = compression(body).filter(|(name, _)| ["", "lz4", "zstd"].contains(name)) else {
        return false;
    };
    let at = FIXED_LEN + name.len();
    let packed = body.get(at..at + 8).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
    packed.and_then(|packed| packed.checked_add(head_len as u64)) == Some(len)
}

/// One record of a chunk: its opcode and where its body lies in [`Records::bytes`].
#[derive(Clone, Copy, Debug)]
struct Place {
    opcode: u8,
    start: usize,
    end: usize,
}

/// The records of one chunk.
#[derive(Debug, Default)]
pub(super) struct Records {
    bytes: Vec<u8>,
    places: Vec<Place>,
}

impl Records {
    pub(super) fn iter(&self) -> impl Iterator<Item = (u8, &[u8])> {
        self.places.iter().map(|place| (place.opcode, &self.bytes[place.start..place.end]))
    }

    /// Bytes of the records, their heads included.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() + HEAD_LEN * self.places.len()
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.places.clear();
    }

    fn push(&mut self, opcode: u8, data: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(data);
        self.places.push(Place { opcode, start, end: self.bytes.len() });
    }
}

/// Reads the records of a chunk from the body of its record into `records`.
///
/// `stated_len` is the length that the record's head gives; a shorter `body` is a chunk cut off at
/// the end of the file. Of such a chunk every record that is whole is kept, and its CRC cannot be
/// checked. A whole chunk with a wrong CRC yields nothing, for nobody can say which record is wrong.
pub(super) fn read(body: &[u8], stated_len: u64, records: &mut Records) -> Result<(), McapError> {
    records.clear();
    let cut = (body.len() as u64) < stated_len;
    let result = feed(body, stated_len, records);
    if result.is_err() && !cut {
        records.clear();
    }
    result
}

fn feed(body: &[u8], stated_len: u64, records: &mut Records) -> Result<(), McapError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let mut head = [op::CHUNK; HEAD_LEN];
    head[1..].copy_from_slice(&stated_len.to_le_bytes());
    reader.insert(HEAD_LEN).copy_from_slice(&head);
    reader.notify_read(HEAD_LEN);
    let mut rest = body;
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode } => records.push(opcode, data),
        }
    }
    Ok(())
}
