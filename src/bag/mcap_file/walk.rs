//! The parts of an MCAP file in order, chunks unpacked: read by the thread that takes them, or by one of its own ahead of it.

use std::io;
use std::sync::mpsc::{channel, sync_channel};

use mcap::records::op;

use super::super::chunk::{self, HEAD_LEN, Records};
use super::super::record_file::{RECORD_LIMIT, RecordFile, Step};

/// Records outside of chunks go together up to so many bytes.
const TOGETHER_BYTES: usize = 1 << 16;

/// A part that takes more memory, bytes, is waited for until it was taken, and its memory is not used again.
const LARGE_BYTES: usize = 1 << 21;

/// A part of a file.
#[derive(Debug, Default)]
pub(super) struct FilePart {
    /// Where it begins, bytes from the start of the file.
    pub(super) at: u64,
    pub(super) kind: PartKind,
    /// The body of a chunk, as far as it is there.
    pub(super) body: Vec<u8>,
    pub(super) records: Records,
}

/// What a part is.
#[derive(Debug, Default)]
pub(super) enum PartKind {
    /// Records outside of any chunk, one right behind the other.
    #[default]
    Records,
    /// A chunk and its records.
    Chunk {
        /// The length of its body by its head.
        stated_len: u64,
        /// What is wrong with it.
        result: Result<(), String>,
    },
    /// Something that is no record.
    Damage { lost_bytes: u64, problem: &'static str },
}

impl FilePart {
    fn held_bytes(&self) -> usize {
        self.body.capacity() + self.records.held_bytes()
    }
}

/// A walk over a file.
#[derive(Debug)]
pub(super) struct FileWalk {
    /// The file has a footer.
    pub(super) finished: bool,
    /// It is still being written: the place stays at the first record that is not whole.
    pub(super) grows: bool,
    /// Where the messages end at the latest.
    pub(super) data_end: u64,
    /// How much more chunks may unpack to, bytes.
    pub(super) unpack_left: u64,
}

/// Where parts go, each for an empty one; records outside of chunks are gathered before.
struct PartTaker<'a> {
    part: FilePart,
    to: &'a mut dyn FnMut(FilePart) -> FilePart,
}

impl PartTaker<'_> {
    fn send(&mut self) {
        let part = std::mem::take(&mut self.part);
        self.part = (self.to)(part);
        self.part.kind = PartKind::Records;
        self.part.records.clear();
    }

    /// Hands on what was gathered.
    fn flush(&mut self) {
        if self.part.records.len() > 0 {
            self.send();
        }
    }

    fn bare(&mut self, at: u64, opcode: u8, body: &[u8]) {
        if self.part.records.len() == 0 {
            self.part.at = at;
        }
        self.part.records.push(opcode, body);
        if self.part.records.len() >= TOGETHER_BYTES {
            self.send();
        }
    }

    fn damage(&mut self, at: u64, lost_bytes: u64, problem: &'static str) {
        self.flush();
        (self.part.at, self.part.kind) = (at, PartKind::Damage { lost_bytes, problem });
        self.send();
    }

    /// Unpacks a chunk; gives how many bytes there were in it.
    fn chunk(&mut self, at: u64, body: &mut Vec<u8>, stated_len: u64, most_bytes: u64) -> u64 {
        self.flush();
        let result = chunk::read(body, stated_len, most_bytes, &mut self.part.records);
        let unpacked_bytes = self.part.records.unpacked_bytes();
        std::mem::swap(&mut self.part.body, body);
        (self.part.at, self.part.kind) = (at, PartKind::Chunk { stated_len, result });
        self.send();
        unpacked_bytes
    }
}

impl FileWalk {
    /// Hands each part to who takes it.
    pub(super) fn here(&mut self, file: &mut RecordFile, take: &mut dyn FnMut(&FilePart)) -> io::Result<()> {
        self.over(file, &mut |part| {
            take(&part);
            part
        })
    }

    /// The same, but a thread of its own reads and unpacks while parts are taken: at most three are in memory, or one where it is large.
    /// Where no thread can be started there is none.
    pub(super) fn apart(&mut self, file: &mut RecordFile, take: &mut dyn FnMut(&FilePart)) -> io::Result<()> {
        let done = std::thread::scope(|scope| {
            let (to, from) = sync_channel::<FilePart>(1);
            let (give_back, back) = channel::<FilePart>();
            let (walk, file) = (&mut *self, &mut *file);
            let reading = std::thread::Builder::new().spawn_scoped(scope, move || {
                let mut out = 0;
                walk.over(file, &mut |part| {
                    let large = part.held_bytes() > LARGE_BYTES;
                    // Who takes them is there until the end; should it not be, its panic is met there.
                    out += usize::from(to.send(part).is_ok());
                    let mut empty = None;
                    loop {
                        let taken = if large && out > 0 { back.recv().ok() } else { back.try_recv().ok() };
                        let Some(part) = taken else { break };
                        out -= 1;
                        empty = Some(part).filter(|part| part.held_bytes() <= LARGE_BYTES);
                    }
                    empty.unwrap_or_default()
                })
            });
            let reading = reading.ok()?;
            for part in &from {
                take(&part);
                // Nobody needs it any more where the reader has ended.
                let _ = give_back.send(part);
            }
            Some(reading.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        });
        done.unwrap_or_else(|| self.here(file, take))
    }

    fn over(&mut self, file: &mut RecordFile, to: &mut dyn FnMut(FilePart) -> FilePart) -> io::Result<()> {
        let mut hand = PartTaker { part: FilePart::default(), to };
        let result = self.parts(file, &mut hand);
        hand.flush();
        result
    }

    fn parts(&mut self, file: &mut RecordFile, hand: &mut PartTaker<'_>) -> io::Result<()> {
        let mut body = vec![];
        loop {
            let at = file.at();
            let step = file.next(&mut body)?;
            match step {
                Step::Record(op::DATA_END) if self.finished => return Ok(()),
                Step::Record(op::FOOTER) => return Ok(()),
                Step::Record(op::CHUNK) => {
                    let len = body.len() as u64;
                    self.chunk(at, &mut body, len, hand);
                }
                // It was passed over, and nothing is right behind it.
                Step::Record(op::ATTACHMENT) => hand.flush(),
                Step::Record(opcode) => hand.bare(at, opcode, &body),
                Step::End { .. } if self.grows => return file.seek(at),
                Step::End { left } => {
                    if !self.finished {
                        hand.damage(at, left, "the file ends without a footer: its writer did not finish");
                    }
                    return Ok(());
                }
                // The rest of it is still to come, and nothing behind it can be there.
                Step::Cut { stated_len, .. } if self.grows && stated_len <= RECORD_LIMIT as u64 => {
                    return file.seek(at);
                }
                Step::Cut { .. } | Step::Nonsense => {
                    if let Some(next) = file.find_chunk(at + 1)? {
                        hand.damage(at, next - at, "not a record; reading went on at the next chunk");
                        continue;
                    }
                    if self.grows {
                        return file.seek(at);
                    }
                    match step {
                        Step::Cut { opcode: op::CHUNK, stated_len } => {
                            file.seek(at + HEAD_LEN as u64)?;
                            file.rest(&mut body)?;
                            self.chunk(at, &mut body, stated_len, hand);
                        }
                        Step::Cut { opcode, .. } => {
                            let problem = match opcode {
                                op::MESSAGE => "the file ends inside a message",
                                op::MESSAGE_INDEX..=op::CHUNK_INDEX | op::STATISTICS..=op::SUMMARY_OFFSET => {
                                    "the file ends inside an index, which holds no message"
                                }
                                _ => "the file ends inside a record",
                            };
                            hand.damage(at, self.data_end.saturating_sub(at), problem);
                        }
                        _ => hand.damage(at, self.data_end.saturating_sub(at), "not a record"),
                    }
                    return Ok(());
                }
            }
        }
    }

    fn chunk(&mut self, at: u64, body: &mut Vec<u8>, stated_len: u64, hand: &mut PartTaker<'_>) {
        let unpacked_bytes = hand.chunk(at, body, stated_len, self.unpack_left);
        self.unpack_left = self.unpack_left.saturating_sub(unpacked_bytes);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::super::record_file::RecordFile;
    use super::super::scan_records;

    /// Everything that a scan finds and hands on.
    fn found(path: &Path, apart: bool) -> String {
        let mut messages = vec![];
        let mut file = RecordFile::open(path).unwrap();
        let scanned = scan_records(&mut file, path, apart, &mut |message| messages.push(message.to_owned())).unwrap();
        format!("{:?} {:?} {messages:?} {}", scanned.health, scanned.segments, file.looked_at_bytes())
    }

    #[test]
    fn a_thread_of_its_own_finds_the_same_in_sound_and_in_damaged_files() {
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/bag");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mcap");
        let mut seed = 1_u64;
        let mut draw = |below: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize % below
        };
        for entry in std::fs::read_dir(corpus).unwrap() {
            let sound = [mcap::MAGIC, &std::fs::read(entry.unwrap().path()).unwrap()].concat();
            for trial in 0..60 {
                let mut bytes = sound.clone();
                let at = 8 + draw(bytes.len() - 8);
                match trial % 4 {
                    0 if trial > 0 => bytes.truncate(at),
                    1 => bytes[at] ^= 1 << draw(8),
                    2 => drop(bytes.drain(at..at + draw(100).min(sound.len() - at))),
                    3 => bytes.extend_from_within(at..),
                    _ => {}
                }
                std::fs::write(&path, &bytes).unwrap();
                assert_eq!(found(&path, false), found(&path, true));
            }
        }
    }
}
