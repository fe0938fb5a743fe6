//! One MCAP file from start to end: every record that is whole, and an account of what is not.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use mcap::records::{Record, op};

use super::chunk::{self, Records};
use super::topic::{RawView, TopicInfo};
use super::{BagError, Damage, FileHealth};

/// Opcode and length.
const HEAD_LEN: u64 = 9;

/// What a scan hands on: each message in file order.
pub(super) type OnMessage<'a> = dyn FnMut(RawView<'_>) + 'a;

/// Reads a whole file, hands on its messages in file order, and says how the file is.
///
/// # Errors
/// Where the operating system refuses, or the file is no MCAP file. Damage is no error.
pub(super) fn scan(path: &Path, on_message: &mut OnMessage<'_>) -> Result<(FileHealth, Channels), BagError> {
    let file = File::open(path).map_err(BagError::io(path, "open"))?;
    let bytes = file.metadata().map_err(BagError::io(path, "read"))?.len();
    let health = FileHealth { path: path.to_owned(), bytes, storage: "mcap", ..FileHealth::default() };
    let mut scan = Scan { channels: Channels::default(), health, last_good_ns: None, in_summary: false };
    scan.run(BufReader::with_capacity(1 << 16, file), on_message).map_err(BagError::io(path, "read"))?;
    Ok((scan.health, scan.channels))
}

/// Schemas and channels met so far.
#[derive(Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, (String, String, Vec<u8>)>,
    topics: BTreeMap<u16, Arc<TopicInfo>>,
}

impl Channels {
    /// The topics in the order of their channel numbers.
    pub(super) fn topics(&self) -> impl Iterator<Item = &Arc<TopicInfo>> {
        self.topics.values()
    }

    pub(super) fn get(&self, channel_id: u16) -> Option<&Arc<TopicInfo>> {
        self.topics.get(&channel_id)
    }

    /// Takes in a schema or channel record; others pass by.
    pub(super) fn take_in(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Record::Channel(channel) => {
                let (type_name, schema_encoding, schema) =
                    self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let text = |key: &str| channel.metadata.get(key).cloned().unwrap_or_default();
                let info = TopicInfo {
                    type_name,
                    schema_encoding,
                    schema,
                    offered_qos_profiles: text("offered_qos_profiles"),
                    type_hash: text("topic_type_hash"),
                    name: channel.topic,
                    encoding: channel.message_encoding,
                };
                // The summary repeats channels; the same `Arc` stays so that comparing is cheap.
                if self.topics.get(&channel.id).is_none_or(|known| **known != info) {
                    self.topics.insert(channel.id, Arc::new(info));
                }
            }
            _ => {}
        }
    }
}

struct Scan {
    channels: Channels,
    health: FileHealth,
    last_good_ns: Option<i64>,
    in_summary: bool,
}

impl Scan {
    fn run(&mut self, mut reader: impl Read, on_message: &mut OnMessage<'_>) -> std::io::Result<()> {
        let mut at = mcap::MAGIC.len() as u64;
        let mut magic = [0; 8];
        reader.read_exact(&mut magic)?;
        let mut body = Vec::new();
        let mut records = Records::default();
        loop {
            let mut head = [0; HEAD_LEN as usize];
            let found = read_up_to(&mut reader, &mut head)?;
            if found < head.len() {
                self.damage(at, found as u64, "the file ends without a footer, its writer did not finish".into(), 0);
                return Ok(());
            }
            let opcode = head[0];
            let len = u64::from_le_bytes([head[1], head[2], head[3], head[4], head[5], head[6], head[7], head[8]]);
            body.clear();
            reader.by_ref().take(len).read_to_end(&mut body)?;
            let whole = body.len() as u64 == len;
            if opcode == op::CHUNK {
                self.chunk(at, &body, len, &mut records, on_message);
            } else if whole {
                self.record(at, opcode, &body, on_message);
            }
            if !whole {
                if opcode != op::CHUNK {
                    let problem = format!("the file ends inside a record (opcode {opcode:#04x}, {len} bytes)");
                    self.damage(at, HEAD_LEN + body.len() as u64, problem, 0);
                }
                return Ok(());
            }
            if opcode == op::FOOTER {
                let found = read_up_to(&mut reader, &mut magic)?;
                self.health.finished = found == magic.len() && magic == mcap::MAGIC;
                return Ok(());
            }
            at += HEAD_LEN + len;
        }
    }

    fn chunk(&mut self, at: u64, body: &[u8], len: u64, records: &mut Records, on_message: &mut OnMessage<'_>) {
        let result = chunk::read(body, len, records);
        let before = self.health.messages;
        let last_good_ns = self.last_good_ns;
        for (opcode, data) in records.iter() {
            self.record(at, opcode, data, on_message);
        }
        self.health.chunks += 1;
        self.health.uncompressed_bytes += records.len() as u64;
        if let Err(error) = result {
            let problem =
                if (body.len() as u64) < len { "the file ends inside a chunk".into() } else { error.to_string() };
            let recovered = self.health.messages - before;
            self.damage(at, HEAD_LEN + body.len() as u64, problem, recovered);
            if let Some(damage) = self.health.damage.last_mut() {
                damage.last_good_ns = last_good_ns;
            }
        }
    }

    fn record(&mut self, at: u64, opcode: u8, body: &[u8], on_message: &mut OnMessage<'_>) {
        // Attachments hold nothing that is wanted here, and unknown opcodes are to be ignored.
        if opcode == op::ATTACHMENT {
            return;
        }
        match mcap::parse_record(opcode, body) {
            Ok(Record::Message { header, data }) => {
                let Some(topic) = self.channels.get(header.channel_id) else {
                    let problem = format!("a message on channel {}, which was never announced", header.channel_id);
                    self.damage(at, body.len() as u64, problem, 0);
                    return;
                };
                let log_time_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                let publish_time_ns = i64::try_from(header.publish_time).unwrap_or(i64::MAX);
                on_message(RawView { topic, log_time_ns, publish_time_ns, sequence: header.sequence, data: &data });
                self.health.messages += 1;
                self.last_good_ns = Some(log_time_ns);
            }
            Ok(Record::Header(header)) => {
                self.health.profile = header.profile;
                self.health.library = header.library;
            }
            Ok(Record::ChunkIndex(index)) => {
                self.health.indexed = true;
                if let Err(place) = self.health.compressions.binary_search(&index.compression) {
                    self.health.compressions.insert(place, index.compression);
                }
            }
            Ok(Record::Metadata(metadata)) => self.health.metadata.push(metadata.name),
            Ok(Record::DataEnd(_)) => self.in_summary = true,
            Ok(record) => self.channels.take_in(record),
            Err(error) => self.damage(at, body.len() as u64, error.to_string(), 0),
        }
    }

    fn damage(&mut self, at_byte: u64, lost_bytes: u64, problem: String, recovered_messages: u64) {
        let last_good_ns = self.last_good_ns;
        self.health.damage.push(Damage { at_byte, lost_bytes, problem, recovered_messages, last_good_ns });
    }
}

/// Fills as much of the buffer as there is.
fn read_up_to(reader: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match reader.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
