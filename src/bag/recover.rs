//! Every message of a damaged bag that can be saved, in a new bag.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::extras::{self, Extra};
use super::metadata::Metadata;
use super::{BagError, FileHealth, GOVTWIN, Warning, Writer, WriterOptions, messages, unfinished};

/// The metadata record that rosbag2 and this program write into each bag.
const ROSBAG2: &str = "rosbag2";

/// What was saved.
#[derive(Debug)]
pub struct Recovered {
    /// Messages by topic; 0 for a topic that is announced and has none.
    pub messages: BTreeMap<String, u64>,
    /// How the files of the damaged bag are.
    pub files: Vec<FileHealth>,
    /// What a user should read about them.
    pub warnings: Vec<Warning>,
    /// The new bag.
    pub bag: PathBuf,
    /// Names of the attachments that were saved.
    pub attachments: Vec<String>,
    /// Names of the records about the bag that were saved.
    pub metadata: Vec<String>,
    /// What stands beside the messages and could not be saved, in words.
    pub lost: Vec<String>,
}

impl Recovered {
    /// Bytes of the damaged bag that hold nothing that could be read.
    pub fn lost_bytes(&self) -> u64 {
        self.files.iter().flat_map(|file| &file.damage).map(|damage| damage.lost_bytes).sum()
    }
}

/// Where a broken-off recording of this name is kept, if there is one and the name itself is free.
pub fn broken_off(place: &Path) -> Option<PathBuf> {
    let kept = unfinished::kept(place);
    (!place.exists() && kept.is_dir()).then_some(kept)
}

/// The name that the broken-off recording at this path would have had.
pub fn intended_place(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_string_lossy();
    let name = name.strip_prefix('.')?.strip_suffix(".unfinished")?;
    Some(path.with_file_name(name))
}

/// Writes every message of the bag at `source` that can be read into a new bag `dir`, in the order of recording, unchanged,
/// with topics, schemas, metadata of channels, attachments and what the bag says of itself. The damaged bag is not touched.
///
/// # Errors
/// Where there is no bag at `source`, `dir` exists, or the operating system refuses.
pub fn recover(source: &Path, dir: &Path) -> Result<Recovered, BagError> {
    Writer::check(dir, WriterOptions::default())?;
    let found = messages(source)?;
    let (files, warnings) = (found.files().to_vec(), found.warnings().to_vec());
    let mut counts: BTreeMap<String, u64> = found.topics().iter().map(|topic| (topic.name.clone(), 0)).collect();
    let mut writer = Writer::create(dir, WriterOptions::default())?;
    for topic in found.topics() {
        writer.announce(topic)?;
    }
    let mut about: BTreeMap<String, String> = files.iter().flat_map(|file| file.about.clone()).collect();
    about.insert("recovered_from".to_owned(), source.display().to_string());
    writer.describe(GOVTWIN, about)?;
    writer.custom_data.clone_from(&found.custom_data);
    let (mut attachments, mut metadata, mut lost) = (vec![], vec![], vec![]);
    for path in found.readable() {
        let mut failed = None;
        let mut save = |extra| -> std::io::Result<()> {
            let saved = match extra {
                Extra::Attachment(file) => writer.attach(&file).map(|()| attachments.push(file.name)),
                // What the program and rosbag2 say of a bag is said anew, but for what the recording's user said.
                Extra::Metadata(name, values) if [GOVTWIN, ROSBAG2].contains(&name.as_str()) => {
                    let metadata = values.get("serialized_metadata").and_then(|text| Metadata::parse(text).ok());
                    writer.custom_data =
                        writer.custom_data.take().or(metadata.and_then(|metadata| metadata.custom_data));
                    Ok(())
                }
                Extra::Metadata(name, values) => writer.describe(&name, values).map(|()| metadata.push(name)),
                Extra::Lost(words) => {
                    lost.push(words);
                    Ok(())
                }
            };
            saved.map_err(|error| {
                failed = Some(error);
                std::io::ErrorKind::Other.into()
            })
        };
        let read = extras::read(&path, &mut save);
        if let Some(error) = failed {
            return Err(error);
        }
        read.map_err(BagError::io(&path, "read"))?;
    }
    for message in found {
        let message = message?;
        writer.copy(&message)?;
        *counts.entry(message.topic.name.clone()).or_default() += 1;
    }
    Ok(Recovered { messages: counts, files, warnings, bag: writer.finish()?, attachments, metadata, lost })
}
