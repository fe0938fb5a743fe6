//! One MCAP file from start to end: every record that is whole, and an account of what is not.

mod growing_file;
mod loader;
mod walk;

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use super::channels::Channels;
use super::chunk::{self, HEAD_LEN};
use super::record::{Record, parse};
use super::record_file::{RecordFile, Step, Tail};
use super::segment::Segment;
use super::structure::Structure;
use super::topic::OnMessage;
use super::{BagError, Damage, FileHealth, GOVTWIN, SIMULATOR, TWIN};

pub(super) use growing_file::GrowingFile;
pub(super) use loader::Loader;
use walk::{FilePart, FileWalk, PartKind};

/// Of a file of so many bytes it pays to unpack in a thread of its own.
const LONG_BYTES: u64 = 1 << 20;

/// The most entries of damage that are listed.
const DAMAGE_LIMIT: usize = 32;

/// More compressions, or names of metadata records, are not listed.
const NAMES_LIMIT: usize = 100;

/// More texts of the program's own metadata are not kept.
const TEXTS_LIMIT: usize = 32;

/// Longer ones are cut, characters.
const TEXT_LIMIT: usize = 2000;

/// What a scan finds in a file besides its messages.
#[derive(Debug)]
pub(super) struct ScannedFile {
    pub(super) health: FileHealth,
    pub(super) channels: Channels,
    pub(super) segments: Vec<Segment>,
}

/// Reads a whole file, hands on its messages in file order, and returns the state of the file.
///
/// # Errors
/// Where the operating system refuses. Damage is no error.
pub(super) fn scan(path: &Path, on_message: &mut OnMessage<'_>) -> Result<ScannedFile, BagError> {
    let mut file = RecordFile::open(path).map_err(BagError::io(path, "open"))?;
    let apart = file.end() >= LONG_BYTES && std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1);
    scan_records(&mut file, path, apart, on_message).map_err(BagError::io(path, "read"))
}

/// The same, unpacked in a thread of its own or not.
fn scan_records(
    file: &mut RecordFile,
    path: &Path,
    apart: bool,
    on_message: &mut OnMessage<'_>,
) -> io::Result<ScannedFile> {
    let mut scan = Scan::new(file, path);
    scan.summary(file)?;
    let (finished, unpack_left) = (scan.found.health.finished, chunk::unpack_limit(file.end()));
    let mut walk = FileWalk { finished, grows: false, data_end: scan.data_end, unpack_left };
    let take = &mut |part: &FilePart| scan.take(part, on_message);
    if apart {
        walk.apart(file, take)?;
    } else {
        walk.here(file, take)?;
    }
    let health = &mut scan.found.health;
    if health.damage.is_empty() {
        health.structure = scan.structure.finish(health.finished);
    }
    Ok(scan.found)
}

/// The names of the topics with a message, where the file's summary is whole and counts them.
pub(super) fn topics(path: &Path) -> Option<Vec<String>> {
    let mut file = RecordFile::open(path).ok()?;
    let mut scan = Scan::new(&file, path);
    scan.summary(&mut file).ok()?;
    scan.found.health.stated_messages.filter(|_| scan.found.health.damage.is_empty())?;
    // A channel without a message has no count.
    let busy = scan.found.channels.topics().filter(|(id, _)| scan.counts.is_empty() || scan.counts.contains_key(id));
    Some(busy.map(|(_, topic)| topic.name.clone()).collect())
}

#[derive(Debug)]
struct Scan {
    /// Where the messages end at the latest.
    data_end: u64,
    found: ScannedFile,
    last_good_ns: Option<i64>,
    /// Messages of each channel by the file's summary.
    counts: BTreeMap<u16, u64>,
    structure: Structure,
}

impl Scan {
    fn new(file: &RecordFile, path: &Path) -> Self {
        Self::of(file.end(), path)
    }

    /// Of a file of this size.
    fn of(bytes: u64, path: &Path) -> Self {
        let health = FileHealth { path: path.to_owned(), bytes, storage: "mcap", ..FileHealth::default() };
        Self {
            data_end: bytes,
            found: ScannedFile { health, channels: Channels::default(), segments: vec![] },
            last_good_ns: None,
            counts: BTreeMap::new(),
            structure: Structure::default(),
        }
    }

    /// Reads the summary at the end of a finished file: channels, counts, whether there is an index.
    fn summary(&mut self, file: &mut RecordFile) -> io::Result<()> {
        let tail = file.tail()?;
        self.found.health.finished = tail != Tail::Unfinished;
        if let Tail::Summary { start, crc } = tail {
            if crc.is_some() && file.summary_crc(start)? != crc {
                // Where it begins is as doubtful as what it holds; all of it stands before it as well.
                self.damage(start, self.data_end - start, "the summary fails its CRC; it is done without", 0);
                return file.seek(mcap::MAGIC.len() as u64);
            }
            self.data_end = start;
            file.seek(start)?;
            let mut body = vec![];
            self.structure.summary(true);
            while let Step::Record(opcode) = file.next(&mut body)? {
                let record = parse(opcode, &body);
                if let Some(record) = &record {
                    self.structure.take(opcode, &body, record);
                }
                match record {
                    Some(Record::ChunkIndex) => self.found.health.indexed = true,
                    Some(Record::Statistics { messages, counts }) => {
                        self.found.health.stated_messages = Some(messages);
                        self.counts = counts;
                    }
                    Some(Record::Footer) => break,
                    None => {
                        let at = file.at();
                        self.damage(at, self.found.health.bytes - at, "a summary that does not hold what it should", 0);
                        break;
                    }
                    Some(record) => self.found.channels.take_in(&record),
                }
            }
            self.structure.summary(false);
        }
        file.seek(mcap::MAGIC.len() as u64)
    }

    /// Takes a part of the file, in its order.
    fn take(&mut self, part: &FilePart, on_message: &mut OnMessage<'_>) {
        match &part.kind {
            PartKind::Records => {
                let mut at = part.at;
                for (opcode, body) in part.records.iter() {
                    self.bare(at, opcode, body, on_message);
                    at += (HEAD_LEN + body.len()) as u64;
                }
            }
            PartKind::Chunk { stated_len, result } => self.chunk(part, *stated_len, result, on_message),
            PartKind::Damage { lost_bytes, problem } => self.damage(part.at, *lost_bytes, problem, 0),
        }
    }

    fn chunk(&mut self, part: &FilePart, len: u64, result: &Result<(), String>, on_message: &mut OnMessage<'_>) {
        let FilePart { at, body, records, .. } = part;
        let at = *at;
        self.structure.next_chunk(true);
        let mut segment = Segment::new(at, len);
        let last_good_ns = self.last_good_ns;
        for (opcode, data) in records.iter() {
            self.record(at, opcode, data, &mut segment, on_message);
        }
        let recovered = segment.messages();
        self.structure.chunk(at, body, HEAD_LEN as u64);
        self.keep(segment);
        let health = &mut self.found.health;
        health.chunks += 1;
        health.uncompressed_bytes += records.len() as u64;
        if !chunk::is_checked(body) {
            health.unchecked_messages += recovered;
        }
        let compression = chunk::compression(body).unwrap_or_default();
        if health.compressions.len() < NAMES_LIMIT
            && let Err(place) = health.compressions.binary_search_by(|known| known.as_str().cmp(compression))
        {
            health.compressions.insert(place, compression.to_owned());
        }
        if let Err(problem) = result {
            self.last_good_ns = last_good_ns.or(self.last_good_ns);
            self.damage(at, (HEAD_LEN + body.len()) as u64, problem, recovered);
        }
    }

    /// A record outside of any chunk.
    fn bare(&mut self, at: u64, opcode: u8, body: &[u8], on_message: &mut OnMessage<'_>) {
        let mut segment = Segment::bare(at, body.len() as u64);
        self.record(at, opcode, body, &mut segment, on_message);
        self.found.health.unchecked_messages += segment.messages();
        self.keep(segment);
    }

    fn keep(&mut self, segment: Segment) {
        let segments = &mut self.found.segments;
        if segment.messages() > 0 && !segments.last_mut().is_some_and(|last| last.absorb(&segment)) {
            segments.push(segment);
        }
    }

    fn record(&mut self, at: u64, opcode: u8, body: &[u8], segment: &mut Segment, on_message: &mut OnMessage<'_>) {
        match parse(opcode, body) {
            Some(record @ Record::Message { .. }) => {
                let Some(message) = self.found.channels.view(&record) else {
                    self.damage(at, body.len() as u64, "messages on a channel that is announced nowhere", 0);
                    return;
                };
                on_message(message);
                if let Record::Message { channel_id, log_time_ns, .. } = record {
                    self.structure.message(channel_id, log_time_ns);
                }
                segment.count(message.log_time_ns);
                self.last_good_ns = Some(message.log_time_ns);
                self.found.health.messages += 1;
            }
            Some(Record::Header { profile, library }) => {
                profile.clone_into(&mut self.found.health.profile);
                library.clone_into(&mut self.found.health.library);
            }
            Some(Record::Metadata { name, texts }) => {
                self.found.health.from_the_twin |= is_from_the_twin(name, &texts);
                if name == GOVTWIN {
                    let room = TEXTS_LIMIT.saturating_sub(self.found.health.about.len());
                    let known = texts.iter().take(room).map(|(key, text)| (clipped(key), clipped(text)));
                    self.found.health.about.extend(known);
                }
                let names = &mut self.found.health.metadata;
                if names.len() < NAMES_LIMIT {
                    names.push(name.to_owned());
                }
            }
            Some(record) => {
                self.structure.take(opcode, body, &record);
                self.found.channels.take_in(&record);
            }
            None => self.damage(at, body.len() as u64, "a record that does not hold what it should", 0),
        }
    }

    /// Notes damage; what repeats is one entry.
    fn damage(&mut self, at_byte: u64, lost_bytes: u64, problem: &str, recovered_messages: u64) {
        let full = self.found.health.damage.len() == DAMAGE_LIMIT;
        match self.found.health.damage.last_mut() {
            Some(last) if full || (last.problem == problem && recovered_messages == 0) => {
                last.lost_bytes += lost_bytes;
                last.recovered_messages += recovered_messages;
                last.places += 1;
            }
            _ => self.found.health.damage.push(Damage {
                at_byte,
                lost_bytes,
                problem: problem.to_owned(),
                places: 1,
                recovered_messages,
                last_good_ns: self.last_good_ns,
            }),
        }
    }
}

/// A text of metadata, as far as it is kept.
fn clipped(text: &str) -> String {
    text.chars().take(TEXT_LIMIT).collect()
}

/// Whether a metadata record states that the program's own twin made the data.
fn is_from_the_twin(name: &str, texts: &BTreeMap<&str, &str>) -> bool {
    name == GOVTWIN && texts.get(SIMULATOR).is_some_and(|simulator| *simulator == TWIN)
}

#[cfg(test)]
mod tests {
    use mcap::records::op;

    use super::*;

    /// Scans bytes behind the magic; what was found, and how often each byte was looked at on average.
    fn looks_per_byte(bytes: &[u8]) -> (ScannedFile, f64) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mcap");
        std::fs::write(&path, [mcap::MAGIC, bytes].concat()).unwrap();
        let mut file = RecordFile::open(&path).unwrap();
        let found = scan_records(&mut file, &path, false, &mut |_| {}).unwrap();
        let mut again = RecordFile::open(&path).unwrap();
        let apart = scan_records(&mut again, &path, true, &mut |_| {}).unwrap();
        assert_eq!((&found.health, &found.segments), (&apart.health, &apart.segments), "in a thread of its own");
        (found, file.looked_at_bytes() as f64 / bytes.len() as f64)
    }

    fn record(opcode: u8, stated_len: u64, body: &[u8]) -> Vec<u8> {
        [&[opcode][..], &stated_len.to_le_bytes(), body].concat()
    }

    /// An empty chunk without compression.
    fn chunk() -> Vec<u8> {
        record(op::CHUNK, 40, &[0; 40])
    }

    #[test]
    fn damage_is_passed_over_in_time_that_grows_with_the_file_alone() {
        for damage in [
            // Record headers that state more bytes than the file, or than any record, has.
            record(op::MESSAGE, 1 << 40, &[]),
            record(op::CHUNK, u64::MAX, &[1; 30]),
            record(op::CHUNK, RECORD_LIMIT_BEYOND, &[]),
            // No records.
            vec![0; 12],
            vec![0x7f; 3],
            vec![op::CHUNK; 70],
        ] {
            let (found, few) = looks_per_byte(&[damage.clone(), chunk()].concat().repeat(1000));
            let (_, many) = looks_per_byte(&[damage.clone(), chunk()].concat().repeat(8000));
            assert!(many < 16.0 && many < few + 1.0, "{damage:02x?}: {few} and {many} looks per byte");
            assert_eq!(found.health.chunks, 1000, "{damage:02x?}: every chunk is found");
        }
    }

    const RECORD_LIMIT_BEYOND: u64 = (super::super::record_file::RECORD_LIMIT as u64) + 1;

    #[test]
    fn a_file_unpacks_to_a_stated_number_of_bytes() {
        // Chunks of 64 MiB of zeros in some kilobytes: records of opcode 0 without a body.
        let unpacked = vec![0; 9 << 20];
        for (name, packed) in [
            ("zstd", zstd::bulk::compress(&unpacked, 1).unwrap()),
            ("lz4", {
                let mut encoder = lz4::EncoderBuilder::new().build(vec![]).unwrap();
                io::Write::write_all(&mut encoder, &unpacked).unwrap();
                encoder.finish().0
            }),
        ] {
            let head = [&[0; 16][..], &(unpacked.len() as u64).to_le_bytes(), &[0; 4]].concat();
            let name_len = (name.len() as u32).to_le_bytes();
            let packed_len = (packed.len() as u64).to_le_bytes();
            let body = [&head, &name_len[..], name.as_bytes(), &packed_len, &packed].concat();
            let bytes = record(op::CHUNK, body.len() as u64, &body).repeat(60);
            let (found, _) = looks_per_byte(&bytes);
            let most_bytes = chunk::unpack_limit(bytes.len() as u64 + mcap::MAGIC.len() as u64);
            let health = found.health;
            assert!(health.uncompressed_bytes <= most_bytes, "{name}: {}", health.uncompressed_bytes);
            let said =
                health.damage.iter().any(|damage| damage.problem.contains("a file may unpack to 256 times its size"));
            assert_eq!(said, 60 * unpacked.len() as u64 > most_bytes, "{name}: {:?}", health.damage);
        }
    }
}
