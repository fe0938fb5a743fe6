//! Whether a file's indices, times and counts are those of its messages: what other readers rely on, while this one reads it whole.

use std::collections::BTreeMap;

use mcap::records::op;

use super::record::{Fields, Record};

/// The most findings that are listed.
const LIMIT: usize = 16;

/// Where a chunk is by the file's index, and when its messages were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct ChunkPlace {
    at: u64,
    len: u64,
    first_ns: u64,
    last_ns: u64,
}

/// Messages of a chunk, or of the file.
#[derive(Clone, Debug, Default)]
struct ChunkTally {
    counts: BTreeMap<u16, u64>,
    times_ns: Option<(u64, u64)>,
}

impl ChunkTally {
    fn take(&mut self, channel_id: u16, log_time_ns: u64) {
        *self.counts.entry(channel_id).or_default() += 1;
        let (first_ns, last_ns) = self.times_ns.unwrap_or((log_time_ns, log_time_ns));
        self.times_ns = Some((first_ns.min(log_time_ns), last_ns.max(log_time_ns)));
    }

    fn add(&mut self, other: &Self) {
        for (channel_id, count) in &other.counts {
            *self.counts.entry(*channel_id).or_default() += count;
        }
        if let Some((other_first_ns, other_last_ns)) = other.times_ns {
            let (first_ns, last_ns) = self.times_ns.unwrap_or((other_first_ns, other_last_ns));
            self.times_ns = Some((first_ns.min(other_first_ns), last_ns.max(other_last_ns)));
        }
    }
}

/// The contents of a file by its summary.
#[derive(Clone, Copy, Debug)]
struct Stated {
    channels: u32,
    chunks: u32,
    times_ns: (u64, u64),
}

/// Compares a file's own account of itself with what is read of it.
#[derive(Debug, Default)]
pub(super) struct Structure {
    index: Vec<ChunkPlace>,
    stated: Option<Stated>,
    /// Channels by number with their schemas, and schemas with a digest of their contents.
    channels: BTreeMap<u16, (u16, u32)>,
    schemas: BTreeMap<u16, u32>,
    in_summary: bool,
    chunks: u32,
    indexed: u32,
    chunk: ChunkTally,
    all: ChunkTally,
    /// Messages by channel of the index behind the last chunk.
    message_index: BTreeMap<u16, u64>,
    found: Vec<String>,
    left_out: u64,
}

impl Structure {
    /// The summary at the file's end is read from here on, until the file is read from its beginning.
    pub(super) fn summary(&mut self, reads: bool) {
        self.in_summary = reads;
        self.index.sort_unstable();
    }

    /// Takes a record that is no message: of the summary, or between chunks, or in one.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8], record: &Record<'_>) {
        match (opcode, record) {
            (op::CHUNK_INDEX, _) if self.in_summary => self.index.extend(place(body)),
            (op::STATISTICS, _) if self.in_summary => self.stated = stated(body),
            (op::MESSAGE_INDEX, _) => {
                if let Some((channel_id, count)) = indexed_messages(body) {
                    *self.message_index.entry(channel_id).or_default() += count;
                }
            }
            (_, Record::Schema { id, name, encoding, data }) => {
                let digest = digest(&[name.as_bytes(), encoding.as_bytes(), data]);
                if self.schemas.insert(*id, digest).is_some_and(|known| known != digest) {
                    self.note(format!("schema {id} ({name}) is defined twice, differently"));
                }
            }
            (_, Record::Channel { id, schema_id, topic, encoding, .. }) => {
                if *schema_id != 0 && !self.schemas.contains_key(schema_id) {
                    self.note(format!(
                        "channel {id} ({topic}) refers to schema {schema_id}, which stands nowhere before it"
                    ));
                }
                let digest = digest(&[topic.as_bytes(), encoding.as_bytes()]);
                let channel = (*schema_id, digest);
                if self.channels.insert(*id, channel).is_some_and(|known| known != channel) {
                    self.note(format!("channel {id} ({topic}) is defined twice, differently"));
                }
            }
            _ => {}
        }
    }

    /// Takes a message.
    pub(super) fn message(&mut self, channel_id: u16, log_time_ns: u64) {
        self.chunk.take(channel_id, log_time_ns);
    }

    /// A chunk begins, and the one before it with its index is over; none begins at the end of the data.
    pub(super) fn next_chunk(&mut self, begins: bool) {
        if !self.message_index.is_empty() && self.message_index != self.chunk.counts {
            self.note("an index of messages counts others than its chunk holds".to_owned());
        }
        self.message_index.clear();
        self.all.add(&self.chunk);
        self.chunk = ChunkTally::default();
        self.chunks += u32::from(begins);
    }

    /// A chunk was read whose record is at `at`; its messages were taken.
    pub(super) fn chunk(&mut self, at: u64, body: &[u8], head_len: u64) {
        let (first_ns, last_ns) = self.chunk.times_ns.unwrap_or_default();
        let mut fields = Fields(body);
        let stated = (fields.u64(), fields.u64());
        if self.chunk.times_ns.is_some() && stated != (Some(first_ns), Some(last_ns)) {
            self.note(format!(
                "the chunk at byte {at} states times {} to {} ns, its messages were recorded from {first_ns} to {last_ns} ns",
                stated.0.unwrap_or_default(),
                stated.1.unwrap_or_default()
            ));
        }
        if let Ok(found) = self.index.binary_search_by_key(&at, |place| place.at) {
            self.indexed += 1;
            let place = self.index.get(found).copied();
            let len = head_len + body.len() as u64;
            if place.is_some_and(|place| place.len != len) {
                self.note(format!("the index states another length of the chunk at byte {at} than its {len} bytes"));
            }
            let fits = |place: ChunkPlace| (place.first_ns, place.last_ns) == (first_ns, last_ns);
            if self.chunk.times_ns.is_some() && !place.is_some_and(fits) {
                self.note(format!("the index states other times of the chunk at byte {at} than its messages have"));
            }
        }
    }

    /// What does not fit. Only of files without damage: after damage nothing fits.
    pub(super) fn finish(mut self, is_finished: bool) -> Vec<String> {
        self.next_chunk(false);
        let entries = u32::try_from(self.index.len()).unwrap_or(u32::MAX);
        if is_finished && entries > 0 && self.indexed < self.chunks {
            self.note(format!("the index leaves out {} of {} chunks", self.chunks - self.indexed, self.chunks));
        }
        if entries > self.indexed {
            self.note(format!("the index names {} chunks that are not there", entries - self.indexed));
        }
        if let Some(stated) = self.stated {
            if stated.chunks != self.chunks {
                self.note(format!("the summary counts {} chunks, the file holds {}", stated.chunks, self.chunks));
            }
            if stated.channels as usize != self.channels.len() {
                self.note(format!(
                    "the summary counts {} channels, the file holds {}",
                    stated.channels,
                    self.channels.len()
                ));
            }
            if self.all.times_ns.is_some_and(|times_ns| times_ns != stated.times_ns) {
                let ((first_ns, last_ns), found) = (stated.times_ns, self.all.times_ns.unwrap_or_default());
                self.note(format!(
                    "the summary states {first_ns} to {last_ns} ns, the messages were recorded from {} to {} ns",
                    found.0, found.1
                ));
            }
        }
        if self.left_out > 0 {
            self.found.push(format!("{} findings more", self.left_out));
        }
        self.found
    }

    fn note(&mut self, finding: String) {
        if self.found.len() < LIMIT {
            self.found.push(finding);
        } else {
            self.left_out += 1;
        }
    }
}

fn digest(parts: &[&[u8]]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for part in parts {
        hasher.update(part);
        hasher.update(&[0]);
    }
    hasher.finalize()
}

/// An entry of the index of chunks.
fn place(body: &[u8]) -> Option<ChunkPlace> {
    let mut fields = Fields(body);
    let (first_ns, last_ns) = (fields.u64()?, fields.u64()?);
    Some(ChunkPlace { first_ns, last_ns, at: fields.u64()?, len: fields.u64()? })
}

/// The channel of a message index, and how many messages it names.
fn indexed_messages(body: &[u8]) -> Option<(u16, u64)> {
    let mut fields = Fields(body);
    Some((fields.u16()?, u64::from(fields.u32()? / 16)))
}

fn stated(body: &[u8]) -> Option<Stated> {
    let mut fields = Fields(body);
    fields.u64()?;
    fields.u16()?;
    let channels = fields.u32()?;
    fields.u64()?;
    Some(Stated { channels, chunks: fields.u32()?, times_ns: (fields.u64()?, fields.u64()?) })
}
