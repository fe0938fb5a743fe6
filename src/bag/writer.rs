//! Writing a bag folder as rosbag2 does: one MCAP file and `metadata.yaml`, whole or not at all.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};

use super::metadata::{self, Summary, TopicSummary};
use super::topic::{Qos, RawMessage, TopicInfo};
use super::{BagError, cdr};
use crate::msg::{Interface, definition, type_hash};

/// How a bag is to be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriterOptions {
    /// Replace a bag that is there. Anything else in the way is never touched.
    pub replace: bool,
    /// Keep what was written when the writer is dropped before [`Writer::finish`], as a recorder must.
    pub keep_unfinished: bool,
}

/// A topic of a [`Writer`] with the type of its messages.
#[derive(Debug)]
pub struct Topic<T> {
    channel: usize,
    message: PhantomData<fn(&T)>,
}

impl<T> Clone for Topic<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Topic<T> {}

/// One topic of the file.
#[derive(Debug)]
struct Channel {
    id: u16,
    info: TopicInfo,
    message_count: u64,
}

/// Writes a bag folder `DIR` with `DIR_0.mcap` and `metadata.yaml`.
///
/// Until [`Writer::finish`] everything stands in `.DIR.unfinished` beside it; then it takes its name
/// at once. Chunks are closed by size, and by [`Writer::flush`], which the caller calls on a timer so
/// that a crash loses at most the open chunk.
pub struct Writer {
    file: Option<mcap::Writer<BufWriter<File>>>,
    path: PathBuf,
    unfinished: PathBuf,
    file_name: String,
    options: WriterOptions,
    channels: Vec<Channel>,
    times_ns: Option<(i64, i64)>,
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("path", &self.path).field("channels", &self.channels).finish_non_exhaustive()
    }
}

impl Writer {
    /// Begins a bag at `dir`, whose parent must exist.
    ///
    /// # Errors
    /// Where something is in the way, or the operating system refuses.
    pub fn create(dir: &Path, options: WriterOptions) -> Result<Self, BagError> {
        if dir.exists() && !(options.replace && is_bag_or_empty(dir)) {
            return Err(BagError::InTheWay { path: dir.to_owned() });
        }
        let name = dir.file_name().unwrap_or(dir.as_os_str()).to_string_lossy().into_owned();
        let unfinished = dir.with_file_name(format!(".{name}.unfinished"));
        if unfinished.exists() {
            fs::remove_dir_all(&unfinished).map_err(BagError::io(&unfinished, "remove"))?;
        }
        fs::create_dir_all(&unfinished).map_err(BagError::io(&unfinished, "create"))?;
        let file_name = format!("{name}_0.mcap");
        let path = unfinished.join(&file_name);
        let file = File::create(&path).map_err(BagError::io(&path, "create"))?;
        let file = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("govtwin/", env!("CARGO_PKG_VERSION")))
            .compression_threads(0)
            .create(BufWriter::new(file))
            .map_err(BagError::mcap(&path))?;
        Ok(Self {
            file: Some(file),
            path: dir.to_owned(),
            unfinished,
            file_name,
            options,
            channels: vec![],
            times_ns: None,
        })
    }

    /// Announces a topic; announcing it again gives the same one.
    ///
    /// # Errors
    /// On a type whose definition the crate does not carry.
    pub fn topic<T: Interface>(&mut self, name: &str, qos: Qos) -> Result<Topic<T>, BagError> {
        let info = TopicInfo {
            name: name.to_owned(),
            type_name: T::TYPE_NAME.to_owned(),
            encoding: "cdr".to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: definition::schema_of(T::TYPE_NAME)?.into_bytes(),
            offered_qos_profiles: qos.to_yaml(),
            type_hash: type_hash::type_hash(T::TYPE_NAME)?,
        };
        Ok(Topic { channel: self.channel(&info)?, message: PhantomData })
    }

    /// Writes a message, little endian.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn write<T: Interface>(&mut self, topic: Topic<T>, log_time_ns: i64, message: &T) -> Result<(), BagError> {
        let data = cdr::encode(message).map_err(|error| BagError::Encode {
            topic: self.channels.get(topic.channel).map(|channel| channel.info.name.clone()).unwrap_or_default(),
            problem: error.to_string(),
        })?;
        self.put(topic.channel, log_time_ns, log_time_ns, 0, &data)
    }

    /// Writes a message as it stands in another bag, with its topic, schema and times.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn copy(&mut self, message: &RawMessage) -> Result<(), BagError> {
        let channel = self.channel(&message.topic)?;
        self.put(channel, message.log_time_ns, message.publish_time_ns, message.sequence, &message.data)
    }

    /// Closes the open chunk and hands everything to the operating system.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn flush(&mut self) -> Result<(), BagError> {
        let path = self.unfinished.join(&self.file_name);
        self.file.as_mut().map_or(Ok(()), mcap::Writer::flush).map_err(BagError::mcap(&path))
    }

    /// Completes the bag, puts it in its place, and gives the path of its folder.
    ///
    /// # Errors
    /// Where the operating system refuses; then nothing is left at the bag's place.
    pub fn finish(mut self) -> Result<PathBuf, BagError> {
        let file_path = self.unfinished.join(&self.file_name);
        let yaml =
            self.summary().to_yaml().map_err(|problem| BagError::Metadata { path: file_path.clone(), problem })?;
        let Some(mut file) = self.file.take() else { return Ok(self.path.clone()) };
        let record = Metadata {
            name: "rosbag2".into(),
            metadata: BTreeMap::from([("serialized_metadata".into(), yaml.clone())]),
        };
        file.write_metadata(&record).map_err(BagError::mcap(&file_path))?;
        file.finish().map_err(BagError::mcap(&file_path))?;
        let file =
            file.into_inner().into_inner().map_err(|error| BagError::io(&file_path, "write")(error.into_error()))?;
        file.sync_all().map_err(BagError::io(&file_path, "write"))?;
        let yaml_path = self.unfinished.join(metadata::FILE_NAME);
        fs::write(&yaml_path, yaml).map_err(BagError::io(&yaml_path, "write"))?;
        if self.path.exists() {
            fs::remove_dir_all(&self.path).map_err(BagError::io(&self.path, "replace"))?;
        }
        fs::rename(&self.unfinished, &self.path).map_err(BagError::io(&self.path, "create"))?;
        Ok(self.path.clone())
    }

    fn channel(&mut self, info: &TopicInfo) -> Result<usize, BagError> {
        if let Some(index) = self.channels.iter().position(|channel| channel.info == *info) {
            return Ok(index);
        }
        let path = self.unfinished.join(&self.file_name);
        let Some(file) = self.file.as_mut() else { return Ok(0) };
        let schema_id = if info.type_name.is_empty() {
            0
        } else {
            file.add_schema(&info.type_name, &info.schema_encoding, &info.schema).map_err(BagError::mcap(&path))?
        };
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), info.offered_qos_profiles.clone()),
            ("topic_type_hash".to_owned(), info.type_hash.clone()),
        ]);
        let id = file.add_channel(schema_id, &info.name, &info.encoding, &metadata).map_err(BagError::mcap(&path))?;
        self.channels.push(Channel { id, info: info.clone(), message_count: 0 });
        Ok(self.channels.len() - 1)
    }

    fn put(
        &mut self,
        channel: usize,
        log_ns: i64,
        publish_ns: i64,
        sequence: u32,
        data: &[u8],
    ) -> Result<(), BagError> {
        let path = self.unfinished.join(&self.file_name);
        let (Some(file), Some(channel)) = (self.file.as_mut(), self.channels.get_mut(channel)) else { return Ok(()) };
        let header = MessageHeader {
            channel_id: channel.id,
            sequence,
            log_time: u64::try_from(log_ns).unwrap_or_default(),
            publish_time: u64::try_from(publish_ns).unwrap_or_default(),
        };
        file.write_to_known_channel(&header, data).map_err(BagError::mcap(&path))?;
        channel.message_count += 1;
        let (first_ns, last_ns) = self.times_ns.unwrap_or((log_ns, log_ns));
        self.times_ns = Some((first_ns.min(log_ns), last_ns.max(log_ns)));
        Ok(())
    }

    fn summary(&self) -> Summary {
        let (first_ns, last_ns) = self.times_ns.unwrap_or_default();
        let topic = |channel: &Channel| TopicSummary {
            name: channel.info.name.clone(),
            type_name: channel.info.type_name.clone(),
            offered_qos_profiles: channel.info.offered_qos_profiles.clone(),
            type_hash: channel.info.type_hash.clone(),
            message_count: channel.message_count,
        };
        Summary {
            file_name: self.file_name.clone(),
            starting_time_ns: first_ns,
            duration_ns: last_ns - first_ns,
            message_count: self.channels.iter().map(|channel| channel.message_count).sum(),
            topics: self.channels.iter().map(topic).collect(),
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // `finish` took the file out; what is still here was given up.
        if self.file.take().is_some() && !self.options.keep_unfinished {
            // Nobody is left to hear of a failure to clean up.
            let _ = fs::remove_dir_all(&self.unfinished);
        }
    }
}

/// Only a bag is ever replaced.
fn is_bag_or_empty(dir: &Path) -> bool {
    dir.join(metadata::FILE_NAME).is_file() || fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_none())
}
