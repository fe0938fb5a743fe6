//! The records inside one chunk: decompressed, checked against the chunk's CRC, whole or cut short.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// The largest record that is believed, bytes; a longer one is damage, not data.
const RECORD_LIMIT_BYTES: usize = 1 << 28;

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

    /// Bytes of the records read.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }
}

/// Reads the records of a chunk from the body of its record into `records`.
///
/// `stated_len` is the length that the record's head gives; a shorter `body` is a chunk cut off at
/// the end of the file. Of such a chunk every record that is whole is kept, and its CRC cannot be
/// checked. A whole chunk with a wrong CRC yields nothing, for nobody can say which record is wrong.
pub(super) fn read(body: &[u8], stated_len: u64, records: &mut Records) -> Result<(), McapError> {
    records.bytes.clear();
    records.places.clear();
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let mut head = [op::CHUNK, 0, 0, 0, 0, 0, 0, 0, 0];
    head[1..].copy_from_slice(&stated_len.to_le_bytes());
    reader.insert(head.len()).copy_from_slice(&head);
    reader.notify_read(head.len());
    let mut rest = body;
    let cut = (body.len() as u64) < stated_len;
    loop {
        match reader.next_event() {
            None => return Ok(()),
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                let start = records.bytes.len();
                records.bytes.extend_from_slice(data);
                records.places.push(Place { opcode, start, end: records.bytes.len() });
            }
            Some(Err(error)) => {
                if !cut {
                    records.places.clear();
                }
                return Err(error);
            }
        }
    }
}
