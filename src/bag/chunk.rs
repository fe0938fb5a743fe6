//! Chunks: their heads, and the records inside, decompressed and checked against the CRC, whole or cut short.

use std::io::{self, Read};

use mcap::records::op;

use super::record_file::HEAD_LEN;

/// The most that a chunk may hold, bytes; rosbag2 makes chunks of less than 1 MB.
const CHUNK_LIMIT: u64 = 1 << 28;

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
    fn unpack(&self, bytes: &mut Vec<u8>) -> io::Result<()> {
        let limit = self.unpacked_len.min(CHUNK_LIMIT) + 1;
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
        self.bytes.len()
    }

    /// Finds the records in the bytes; false where the bytes end inside one.
    fn find(&mut self) -> bool {
        let mut at = 0;
        while let Some((&[opcode, ref len @ ..], rest)) = self.bytes[at..].split_first_chunk::<HEAD_LEN>() {
            let Some(len) = usize::try_from(u64::from_le_bytes(*len)).ok().filter(|len| *len <= rest.len()) else {
                return false;
            };
            let start = at + HEAD_LEN;
            self.places.push(Place { opcode, start, end: start + len });
            at = start + len;
        }
        at == self.bytes.len()
    }
}

/// Reads the records of a chunk from the body of its record into `records`; an error is in words.
///
/// `stated_len` is the length that the record's head gives; a shorter `body` is a chunk cut off at
/// the end of the file. Of such a chunk every record that is whole is kept, and its CRC cannot be
/// checked. A whole chunk with a wrong CRC yields nothing, for nobody can say which record is wrong.
pub(super) fn read(body: &[u8], stated_len: u64, records: &mut Records) -> Result<(), String> {
    records.bytes.clear();
    records.places.clear();
    let chunk = Chunk::parse(body);
    if (body.len() as u64) < stated_len {
        if let Some(chunk) = chunk {
            // What was unpacked before the end is kept.
            let _ = chunk.unpack(&mut records.bytes);
            records.find();
        }
        return Err("the file ends inside a chunk".into());
    }
    let chunk = chunk.ok_or("a chunk without a readable head")?;
    let result = unpack_whole(&chunk, &mut records.bytes);
    if result.is_err() {
        records.bytes.clear();
    } else if !records.find() {
        return Err("a chunk ends inside a record".into());
    }
    result
}

fn unpack_whole(chunk: &Chunk<'_>, bytes: &mut Vec<u8>) -> Result<(), String> {
    if chunk.unpacked_len > CHUNK_LIMIT {
        return Err(format!("a chunk that says it holds {} bytes, more than any should", chunk.unpacked_len));
    }
    if chunk.packed.len() as u64 != chunk.packed_len {
        return Err("a chunk that says it is longer than its record".into());
    }
    chunk.unpack(bytes).map_err(|error| format!("a chunk cannot be unpacked ({error})"))?;
    if bytes.len() as u64 != chunk.unpacked_len {
        return Err(format!("a chunk of {} bytes unpacks to another length", chunk.unpacked_len));
    }
    let crc = crc32fast::hash(bytes);
    if chunk.crc != 0 && crc != chunk.crc {
        return Err(format!("a chunk fails its CRC (expected {:08x}, found {crc:08x})", chunk.crc));
    }
    Ok(())
}
