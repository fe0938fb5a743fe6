//! What a bag holds beside its messages: attachments, and records about the bag, as they stand in its MCAP files.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use mcap::records::op;

use super::record::{Fields, Record, parse};
use super::record_file::{RecordFile, Step};

/// A file within a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct AttachedFile {
    pub(super) log_time_ns: u64,
    pub(super) create_time_ns: u64,
    pub(super) name: String,
    pub(super) media_type: String,
    pub(super) data: Vec<u8>,
}

/// One thing beside the messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Extra {
    /// An attachment.
    Attachment(AttachedFile),
    /// A record about the bag, with its name.
    Metadata(String, BTreeMap<String, String>),
    /// What cannot be read, in words.
    Lost(String),
}

/// Hands on everything that stands between the chunks of a file, one after the other, and passes over damage.
pub(super) fn read(path: &Path, on_extra: &mut dyn FnMut(Extra) -> io::Result<()>) -> io::Result<()> {
    let mut file = RecordFile::open(path)?;
    let mut body = vec![];
    loop {
        let at = file.at();
        match file.next(&mut body)? {
            Step::Record(op::DATA_END | op::FOOTER) | Step::End { .. } => return Ok(()),
            Step::Record(op::ATTACHMENT) => {
                let found =
                    if file.passed(at, &mut body)? { attachment(&body) } else { Err("is too large".to_owned()) };
                on_extra(found.map_or_else(
                    |problem| Extra::Lost(format!("an attachment at byte {at} {problem}")),
                    Extra::Attachment,
                ))?;
            }
            Step::Record(op::METADATA) => match parse(op::METADATA, &body) {
                Some(Record::Metadata { name, texts }) => {
                    let texts = texts.into_iter().map(|(key, text)| (key.to_owned(), text.to_owned())).collect();
                    on_extra(Extra::Metadata(name.to_owned(), texts))?;
                }
                _ => on_extra(Extra::Lost(format!("a metadata record at byte {at} is damaged")))?,
            },
            Step::Record(_) => {}
            Step::Cut { .. } | Step::Nonsense => {
                if file.find_chunk(at + 1)?.is_none() {
                    return Ok(());
                }
            }
        }
    }
}

fn attachment(body: &[u8]) -> Result<AttachedFile, String> {
    let damaged = || "is damaged".to_owned();
    let (content, crc) = body.split_last_chunk::<4>().ok_or_else(damaged)?;
    let crc = u32::from_le_bytes(*crc);
    if crc != 0 && crc32fast::hash(content) != crc {
        return Err("fails its CRC".to_owned());
    }
    let mut fields = Fields(content);
    let mut read = || {
        let (log_time_ns, create_time_ns) = (fields.u64()?, fields.u64()?);
        let (name, media_type) = (fields.text()?.to_owned(), fields.text()?.to_owned());
        let len = usize::try_from(fields.u64()?).ok()?;
        let data = fields.0.get(..len).filter(|data| data.len() == fields.0.len())?.to_vec();
        Some(AttachedFile { log_time_ns, create_time_ns, name, media_type, data })
    };
    read().ok_or_else(damaged)
}
