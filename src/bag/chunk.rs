//! Chunks: their heads, and the records inside, decompressed and checked against the CRC, whole or cut short.

use std::io::{self, Read};

use mcap::records::op;

/// A record's head: opcode and length.
pub(super) const HEAD_LEN: usize = 9;

/// The most that a chunk may hold, bytes; rosbag2 makes chunks of less than 1 MB.
const CHUNK_LIMIT: u64 = 1 << 28;

/// How many times its own size a file may unpack to; zstd makes some 20 of ROS 2's messages.
pub(super) const UNPACK_RATIO: u64 = 256;

/// What any file may unpack to, bytes.
const UNPACK_LEAST: u64 = 1 << 26;

/// The most that the chunks of a file of this size may hold together, bytes.
pub(super) fn unpack_limit(file_bytes: u64) -> u64 {
    UNPACK_LEAST.saturating_add(UNPACK_RATIO.saturating_mul(file_bytes))
}

/// Body of a chunk before the name of its compression: times, size, CRC, length of the name.
const FIXED_LEN: usize = 8 + 8 + 8 + 4 + 4;

/// The head of a chunk, and its data as far as they are there.
struct Chunk<'a> {
    unpacked_len: u64,
    crc: u32,
    compression: &'a str,
    packed_len: u64,
    packed: &'a [u8],
}

impl<'a> Chunk<'a> {
    fn parse(body: &'a [u8]) -> Option<Self> {
        let (head, rest) = body.split_at_checked(FIXED_LEN)?;
        let (unpacked_len, rest_of_head) = head.get(16..)?.split_first_chunk()?;
        let (crc, name_len) = rest_of_head.split_first_chunk()?;
        let name_len = u32::from_le_bytes(name_len.try_into().ok()?);
        let (name, rest) = rest.split_at_checked(usize::try_from(name_len).ok()?)?;
        let (packed_len, packed) = rest.split_first_chunk()?;
        let packed_len = u64::from_le_bytes(*packed_len);
        Some(Self {
            unpacked_len: u64::from_le_bytes(*unpacked_len),
            crc: u32::from_le_bytes(*crc),
            compression: std::str::from_utf8(name).ok()?,
            packed_len,
            packed: usize::try_from(packed_len).ok().and_then(|len| packed.get(..len)).unwrap_or(packed),
        })
    }

    /// Unpacks as much as there is, at most one byte more than there should be.
    fn unpack(&self, most_bytes: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
        let limit = self.unpacked_len.min(CHUNK_LIMIT).min(most_bytes) + 1;
        match self.compression {
            "" => self.packed.take(limit).read_to_end(bytes),
            "zstd" => zstd::Decoder::with_buffer(self.packed)?.take(limit).read_to_end(bytes),
            "lz4" => lz4::Decoder::new(self.packed)?.take(limit).read_to_end(bytes),
            other => Err(io::Error::other(format!("compressed with `{other}`, expected `zstd`, `lz4` or nothing"))),
        }
        .map(|_| ())
    }
}

/// The name of a chunk's compression; `None` where this cannot be a chunk.
pub(super) fn compression(body: &[u8]) -> Option<&str> {
    Chunk::parse(body).map(|chunk| chunk.compression)
}

/// Whether a chunk has a checksum.
pub(super) fn is_checked(body: &[u8]) -> bool {
    Chunk::parse(body).is_some_and(|chunk| chunk.crc != 0)
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
    Chunk::parse(body).is_some_and(|chunk| {
        let head_len = (FIXED_LEN + chunk.compression.len() + 8) as u64;
        ["", "lz4", "zstd"].contains(&chunk.compression) && chunk.packed_len.checked_add(head_len) == Some(len)
    })
}

/// The records of one chunk, found as they are asked for: as many as nine bytes each may be in it.
#[derive(Debug, Default)]
pub(super) struct Records {
    bytes: Vec<u8>,
    unpacked_bytes: u64,
}

impl Records {
    /// The records that are whole, with their opcodes.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u8, &[u8])> {
        let mut left = &self.bytes[..];
        std::iter::from_fn(move || {
            let (opcode, body, rest) = split(left)?;
            left = rest;
            Some((opcode, body))
        })
    }

    /// Puts a record behind the others.
    pub(super) fn push(&mut self, opcode: u8, body: &[u8]) {
        self.bytes.push(opcode);
        self.bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
        self.bytes.extend_from_slice(body);
    }

    /// Leaves none.
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Bytes that are in memory for them.
    pub(super) fn held_bytes(&self) -> usize {
        self.bytes.capacity()
    }

    /// Bytes of the records, their heads included.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Bytes that were unpacked to find them, those of chunks that turned out wrong included.
    pub(super) fn unpacked_bytes(&self) -> u64 {
        self.unpacked_bytes
    }

    /// False where the bytes end inside a record.
    fn are_whole(&self) -> bool {
        self.iter().map(|(_, body)| HEAD_LEN + body.len()).sum::<usize>() == self.bytes.len()
    }
}

/// The opcode and body of the first record, and what follows; none where no record is whole.
fn split(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&[opcode, ref len @ ..], rest) = bytes.split_first_chunk::<HEAD_LEN>()?;
    let (body, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*len)).ok()?)?;
    Some((opcode, body, rest))
}

/// Reads the records of a chunk from the body of its record into `records`; an error is in words.
///
/// `stated_len` is the length that the record's head gives; a shorter `body` is a chunk cut off at
/// the end of the file. Of such a chunk every record that is whole is kept, and its CRC cannot be
/// checked. A whole chunk with a wrong CRC yields nothing, because the wrong record cannot be identified. No more than
/// `most_bytes` are unpacked.
pub(super) fn read(body: &[u8], stated_len: u64, most_bytes: u64, records: &mut Records) -> Result<(), String> {
    records.bytes.clear();
    records.unpacked_bytes = 0;
    let chunk = Chunk::parse(body);
    if (body.len() as u64) < stated_len {
        if let Some(chunk) = chunk {
            // What was unpacked before the end is kept.
            let _ = chunk.unpack(most_bytes, &mut records.bytes);
            records.unpacked_bytes = records.len() as u64;
        }
        return Err("the file ends inside a chunk".into());
    }
    let chunk = chunk.ok_or("a chunk without a readable head")?;
    let result = unpack_whole(&chunk, most_bytes, &mut records.bytes);
    records.unpacked_bytes = records.len() as u64;
    if result.is_err() {
        records.bytes.clear();
    } else if !records.are_whole() {
        return Err("a chunk ends inside a record".into());
    }
    result
}

fn unpack_whole(chunk: &Chunk<'_>, most_bytes: u64, bytes: &mut Vec<u8>) -> Result<(), String> {
    let Chunk { unpacked_len, .. } = *chunk;
    if unpacked_len > CHUNK_LIMIT {
        return Err(format!("a chunk that says it holds {unpacked_len} bytes, expected at most {CHUNK_LIMIT}"));
    }
    if unpacked_len > most_bytes {
        return Err(format!(
            "a chunk that says it holds {unpacked_len} bytes, expected at most {most_bytes}: a file may unpack to \
             {UNPACK_RATIO} times its size"
        ));
    }
    if chunk.packed.len() as u64 != chunk.packed_len {
        return Err("a chunk that says it is longer than its record".into());
    }
    chunk.unpack(most_bytes, bytes).map_err(|error| format!("a chunk cannot be unpacked ({error})"))?;
    if bytes.len() as u64 != chunk.unpacked_len {
        return Err(format!("a chunk of {} bytes unpacks to another length", chunk.unpacked_len));
    }
    let crc = crc32fast::hash(bytes);
    if chunk.crc != 0 && crc != chunk.crc {
        return Err(format!("a chunk fails its CRC (expected {:08x}, found {crc:08x})", chunk.crc));
    }
    Ok(())
}
