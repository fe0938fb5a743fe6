//! The records of MCAP that matter here, read with every length checked against the bytes there are.
//!
//! The `mcap` crate's own parser reserves whatever a damaged length asks for, up to 4 GiB, and cannot
//! read an attachment of fewer than four bytes; so damage has to be met before it.

use std::collections::BTreeMap;

use mcap::records::op;

/// The longest name that is believed, bytes; ROS 2 allows 255.
const LONGEST_NAME_BYTES: usize = 1024;

/// A record's body, as far as it is used.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Record<'a> {
    /// The file's profile and writer.
    Header { profile: &'a str, library: &'a str },
    /// A schema by its number.
    Schema { id: u16, name: &'a str, encoding: &'a str, data: &'a [u8] },
    /// A channel by its number.
    Channel { id: u16, schema_id: u16, topic: &'a str, encoding: &'a str, metadata: BTreeMap<&'a str, &'a str> },
    /// A message.
    Message { channel_id: u16, sequence: u32, log_time_ns: u64, publish_time_ns: u64, data: &'a [u8] },
    /// The file's stated number of messages, and each channel that has any where that can be read.
    Statistics { messages: u64, counts: BTreeMap<u16, u64> },
    /// Metadata of this name; its texts where they can be read.
    Metadata { name: &'a str, texts: BTreeMap<&'a str, &'a str> },
    /// One of the index of chunks.
    ChunkIndex,
    /// The end.
    Footer,
    /// Anything else.
    Other,
}

/// Reads a record; `None` if its body does not match its opcode.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    let mut fields = Fields(body);
    Some(match opcode {
        op::HEADER => Record::Header { profile: fields.name()?, library: fields.name()? },
        op::SCHEMA => {
            let (id, name, encoding) = (fields.u16()?, fields.name()?, fields.name()?);
            Record::Schema { id, name, encoding, data: fields.sized()? }
        }
        op::CHANNEL => Record::Channel {
            id: fields.u16()?,
            schema_id: fields.u16()?,
            topic: fields.name()?,
            encoding: fields.name()?,
            metadata: fields.map()?,
        },
        op::MESSAGE => Record::Message {
            channel_id: fields.u16()?,
            sequence: fields.u32()?,
            log_time_ns: fields.u64()?,
            publish_time_ns: fields.u64()?,
            data: fields.0,
        },
        op::STATISTICS => Record::Statistics { messages: fields.u64()?, counts: fields.counts().unwrap_or_default() },
        op::METADATA => Record::Metadata { name: fields.name()?, texts: fields.map().unwrap_or_default() },
        op::CHUNK_INDEX => Record::ChunkIndex,
        op::FOOTER => Record::Footer,
        _ => Record::Other,
    })
}

/// What is left of a body.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    fn take<const LEN: usize>(&mut self) -> Option<[u8; LEN]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    /// Bytes behind their length.
    fn sized(&mut self) -> Option<&'a [u8]> {
        let len = usize::try_from(self.u32()?).ok()?;
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.sized()?).ok()
    }

    /// Text that is kept for every topic, and so must be short.
    fn name(&mut self) -> Option<&'a str> {
        self.text().filter(|name| name.len() <= LONGEST_NAME_BYTES)
    }

    /// Messages by channel, behind how many schemas, channels, attachments, metadata and chunks there are, and two times.
    fn counts(&mut self) -> Option<BTreeMap<u16, u64>> {
        self.take::<{ 2 + 4 * 4 + 2 * 8 }>()?;
        let mut pairs = Fields(self.sized()?);
        let mut counts = BTreeMap::new();
        while !pairs.0.is_empty() {
            counts.insert(pairs.u16()?, pairs.u64()?);
        }
        Some(counts)
    }

    /// Texts by texts behind their length in bytes.
    fn map(&mut self) -> Option<BTreeMap<&'a str, &'a str>> {
        let mut pairs = Fields(self.sized()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}
