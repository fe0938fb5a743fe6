//! Writing a bag folder as rosbag2 does: one MCAP file and `metadata.yaml`, whole or not at all.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mcap::records::{MessageHeader, Metadata};

use super::extras::AttachedFile;
use super::metadata::{self, Summary, TopicSummary};
use super::reserve::Reserved;
use super::topic::{Qos, RawMessage, TopicInfo};
use super::unfinished::{self, Unfinished};
use super::{BagError, cdr};
use crate::msg::Interface;
use govtwin_files::fault::step;
use govtwin_files::{hold, write_atomically};

/// How a bag is to be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriterOptions {
    /// The name of a metadata record that marks the bag. A bag in its place with the same mark and nothing beside it is replaced;
    /// anything else in the way is never touched.
    pub mark: Option<&'static str>,
    /// Keep the messages that were written when the writer is dropped before [`Writer::finish`], as a recorder must.
    ///
    /// They then stand in `.DIR.unfinished`, a readable bag without `metadata.yaml`, and the next recording to `DIR` is refused until it
    /// is moved away. Without a message nothing stays. Room for the bag's end is kept on the disk as long as it is written, so that it can
    /// be completed where the disk is full ([`Writer::is_full`]).
    pub keep_unfinished: bool,
}

/// A topic of a [`Writer`] with the type of its messages.
#[derive(Debug)]
pub struct Topic<T> {
    id: u16,
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
struct TopicChannel {
    info: TopicInfo,
    message_count: u64,
}

/// Writes a bag folder `DIR` with `DIR_0.mcap` and `metadata.yaml`.
///
/// Everything is written beside `DIR` under another name; [`Writer::finish`] gives it its name at
/// once. Chunks are closed by size, and by [`Writer::flush`], which the caller calls on a timer so
/// that a crash loses at most the open chunk.
pub struct Writer {
    // Dropped in this order: the file is closed before its folder goes.
    file: mcap::Writer<BufWriter<Reserved>>,
    folder: Unfinished,
    file_name: String,
    file_path: PathBuf,
    channels: BTreeMap<u16, TopicChannel>,
    by_topic: BTreeMap<TopicInfo, u16>,
    /// By the address of what copied messages of one topic share, which is kept so that nothing else gets that address.
    by_address: BTreeMap<usize, (Arc<TopicInfo>, u16)>,
    times_ns: Option<(i64, i64)>,
    /// What `metadata.yaml` is to hold of the recording's user.
    pub(super) custom_data: Option<serde_yaml::Value>,
    full: Arc<AtomicBool>,
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("folder", &self.folder).field("channels", &self.channels).finish_non_exhaustive()
    }
}

/// A bag that is whole, under a temporary name. Dropped, it is gone, unless it is to be kept.
#[derive(Debug)]
pub struct Sealed {
    /// Open, and so held, until the bag has its name.
    _file: File,
    folder: Unfinished,
}

impl Sealed {
    /// The bag's folder as it is called now, and as it will be.
    pub fn moves(&self) -> (PathBuf, PathBuf) {
        (self.folder.path().to_owned(), self.folder.place().to_owned())
    }

    /// Puts the bag in its place, and gives the path of its folder.
    ///
    /// # Errors
    /// As [`Writer::finish`].
    pub fn place(self) -> Result<PathBuf, BagError> {
        self.folder.complete()
    }

    /// Puts the bag in its place, from which [`Sealed::take_back`] takes it as long as this exists.
    ///
    /// # Errors
    /// As [`Writer::finish`].
    pub fn put(&mut self) -> Result<(), BagError> {
        self.folder.put()
    }

    /// Takes the bag out of its place again, and restores the older one.
    pub fn take_back(&mut self) {
        self.folder.take_back();
    }
}

impl Writer {
    /// Begins a bag at `dir`; missing folders on the way are made.
    ///
    /// # Errors
    /// Where something is in the way, or the operating system refuses.
    #[expect(clippy::disallowed_methods, reason = "inside a folder that takes its name only when it is whole")]
    pub fn create(dir: &Path, options: WriterOptions) -> Result<Self, BagError> {
        let folder = Unfinished::create(dir, options)?;
        let file_name = format!("{}_0.mcap", folder.name());
        let file_path = folder.path().join(&file_name);
        let file = step().and_then(|()| File::create(&file_path)).map_err(BagError::io(&file_path, "create"))?;
        // Held as long as it is written, so that it is not taken for a leftover.
        hold(&file).map_err(BagError::io(&file_path, "lock"))?;
        let file = if options.keep_unfinished {
            Reserved::with_room(file, folder.path()).map_err(BagError::io(dir, "keep 8 MiB of room for"))?
        } else {
            Reserved::without(file)
        };
        let full = file.is_full();
        let file = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("govtwin/", env!("CARGO_PKG_VERSION")))
            // Compress in the calling thread: a recorder's threads are counted.
            .compression_threads(0)
            .create(BufWriter::new(file))
            .map_err(BagError::mcap(&file_path))?;
        let mut writer = Self {
            file,
            folder,
            file_name,
            file_path,
            channels: BTreeMap::new(),
            by_topic: BTreeMap::new(),
            by_address: BTreeMap::new(),
            times_ns: None,
            custom_data: None,
            full,
        };
        if let Some(mark) = options.mark {
            let by = concat!("govtwin ", env!("CARGO_PKG_VERSION")).to_owned();
            writer.describe(mark, BTreeMap::from([("generator".to_owned(), by)]))?;
        }
        Ok(writer)
    }

    /// Whether [`Writer::create`] would begin a bag at `dir`: the place is free, or holds what may be replaced.
    ///
    /// # Errors
    /// Where something is in the way.
    pub fn check(dir: &Path, options: WriterOptions) -> Result<(), BagError> {
        unfinished::check(dir, options)
    }

    /// Announces a topic; announcing it again gives the same one.
    ///
    /// # Errors
    /// On a type whose definition the crate does not carry.
    pub fn topic<T: Interface>(&mut self, name: &str, qos: Qos) -> Result<Topic<T>, BagError> {
        Ok(Topic { id: self.channel(&TopicInfo::of::<T>(name, qos)?)?, message: PhantomData })
    }

    /// Writes a message, little endian. A time before 1970 is written as 1970: MCAP knows no other.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn write<T: Interface>(&mut self, topic: Topic<T>, log_time_ns: i64, message: &T) -> Result<(), BagError> {
        let data = cdr::encode(message)
            .map_err(|error| BagError::Encode { what: T::TYPE_NAME.to_owned(), problem: error.to_string() })?;
        self.put(topic.id, log_time_ns, log_time_ns, 0, &data)
    }

    /// Writes a message of another bag unchanged, with its topic, schema and times.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn copy(&mut self, message: &RawMessage) -> Result<(), BagError> {
        let address = Arc::as_ptr(&message.topic).addr();
        let id = if let Some((_, id)) = self.by_address.get(&address) {
            *id
        } else {
            let id = self.channel(&message.topic)?;
            self.by_address.insert(address, (Arc::clone(&message.topic), id));
            id
        };
        self.put(id, message.log_time_ns, message.publish_time_ns, message.sequence, &message.data)
    }

    /// Adds a record about the whole bag, which a reader shows beside its topics.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn describe(&mut self, name: &str, values: BTreeMap<String, String>) -> Result<(), BagError> {
        let record = Metadata { name: name.into(), metadata: values };
        self.file.write_metadata(&record).map_err(BagError::mcap(&self.file_path))
    }

    /// Adds a file that another bag holds beside its messages.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub(super) fn attach(&mut self, file: &AttachedFile) -> Result<(), BagError> {
        let AttachedFile { log_time_ns, create_time_ns, name, media_type, data } = file;
        let attachment = mcap::Attachment {
            log_time: *log_time_ns,
            create_time: *create_time_ns,
            name: name.clone(),
            media_type: media_type.clone(),
            data: data.as_slice().into(),
        };
        self.file.attach(&attachment).map_err(BagError::mcap(&self.file_path))
    }

    /// Closes the open chunk and hands everything to the operating system.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn flush(&mut self) -> Result<(), BagError> {
        self.file.flush().map_err(BagError::mcap(&self.file_path))
    }

    /// Whether the disk is full, so that the bag should be completed in the room that was kept for it: more messages will hardly fit.
    pub fn is_full(&self) -> bool {
        self.full.load(Ordering::Relaxed)
    }

    /// Announces a topic as another bag or a sender describes it, whether it will have messages or not.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn announce(&mut self, info: &TopicInfo) -> Result<(), BagError> {
        self.channel(info).map(|_| ())
    }

    /// Completes the bag, puts it in its place, and gives the path of its folder.
    ///
    /// # Errors
    /// Where the operating system refuses, or something came into the bag's place meanwhile; then nothing is changed there, and a
    /// bag that is to be kept stays where it was written.
    pub fn finish(self) -> Result<PathBuf, BagError> {
        self.seal()?.place()
    }

    /// Completes the bag, but leaves it under its temporary name, so that several can be placed together.
    ///
    /// # Errors
    /// Where the operating system refuses.
    pub fn seal(self) -> Result<Sealed, BagError> {
        let yaml = self.summary().to_yaml();
        let yaml = yaml.map_err(|problem| BagError::Encode { what: metadata::FILE_NAME.to_owned(), problem })?;
        let Self { mut file, folder, file_path, .. } = self;
        let record = Metadata {
            name: "rosbag2".into(),
            metadata: BTreeMap::from([("serialized_metadata".into(), yaml.clone())]),
        };
        file.write_metadata(&record).map_err(BagError::mcap(&file_path))?;
        file.finish().map_err(BagError::mcap(&file_path))?;
        let file = file.into_inner().into_inner();
        let file = file.map_err(|error| BagError::io(&file_path, "write")(error.into_error()))?.into_file();
        step().and_then(|()| file.sync_all()).map_err(BagError::io(&file_path, "write"))?;
        let yaml_path = folder.path().join(metadata::FILE_NAME);
        write_atomically(&yaml_path, yaml.as_bytes()).map_err(BagError::io(&yaml_path, "write"))?;
        Ok(Sealed { _file: file, folder })
    }

    fn channel(&mut self, info: &TopicInfo) -> Result<u16, BagError> {
        if let Some(id) = self.by_topic.get(info) {
            return Ok(*id);
        }
        let refused = || BagError::mcap(&self.file_path);
        let schema_id = if info.type_name.is_empty() {
            0
        } else {
            self.file.add_schema(&info.type_name, &info.schema_encoding, &info.schema).map_err(refused())?
        };
        let id =
            self.file.add_channel(schema_id, &info.name, &info.encoding, &info.channel_metadata()).map_err(refused())?;
        self.by_topic.insert(info.clone(), id);
        self.channels.insert(id, TopicChannel { info: info.clone(), message_count: 0 });
        Ok(id)
    }

    fn put(&mut self, id: u16, log_ns: i64, publish_ns: i64, sequence: u32, data: &[u8]) -> Result<(), BagError> {
        let header = MessageHeader {
            channel_id: id,
            sequence,
            log_time: u64::try_from(log_ns).unwrap_or_default(),
            publish_time: u64::try_from(publish_ns).unwrap_or_default(),
        };
        self.file.write_to_known_channel(&header, data).map_err(BagError::mcap(&self.file_path))?;
        self.folder.has_messages();
        if let Some(channel) = self.channels.get_mut(&id) {
            channel.message_count += 1;
        }
        let (first_ns, last_ns) = self.times_ns.unwrap_or((log_ns, log_ns));
        self.times_ns = Some((first_ns.min(log_ns), last_ns.max(log_ns)));
        Ok(())
    }

    fn summary(&self) -> Summary {
        let (first_ns, last_ns) = self.times_ns.unwrap_or_default();
        let topic = |channel: &TopicChannel| TopicSummary {
            name: channel.info.name.clone(),
            type_name: channel.info.type_name.clone(),
            encoding: channel.info.encoding.clone(),
            offered_qos_profiles: channel.info.offered_qos_profiles.clone(),
            type_hash: channel.info.type_hash.clone(),
            message_count: channel.message_count,
        };
        Summary {
            file_name: self.file_name.clone(),
            starting_time_ns: first_ns,
            duration_ns: last_ns.saturating_sub(first_ns),
            message_count: self.channels.values().map(|channel| channel.message_count).sum(),
            topics: self.channels.values().map(topic).collect(),
            custom_data: self.custom_data.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::EsvState;
    use govtwin_files::fault::refuse_each;

    fn write(dir: &Path, options: WriterOptions, messages: i64) -> Result<PathBuf, BagError> {
        let mut writer = Writer::create(dir, options)?;
        let topic = writer.topic::<EsvState>("/esv", Qos::DEFAULT)?;
        for time_ns in 0..messages {
            writer.write(topic, time_ns, &EsvState::default())?;
        }
        writer.finish()
    }

    #[test]
    fn whatever_step_is_refused_a_bag_is_the_new_one_or_the_old_one() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().join("run");
        let count = || super::super::survey(&place).map_or(0, |survey| survey.messages);
        let options = WriterOptions { mark: Some("test"), keep_unfinished: false };
        for (old, new) in [(0, 10), (10, 20)] {
            let refused = refuse_each(
                || write(&place, options, new).is_ok(),
                |went_well| {
                    assert_eq!(count(), if went_well { new.cast_unsigned() } else { old });
                    let entries = usize::from(went_well || old > 0);
                    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), entries, "nothing else stays");
                },
            );
            assert!(refused >= 9, "{refused}");
        }
    }

    #[test]
    fn whatever_step_is_refused_a_recording_is_kept() {
        let options = WriterOptions { mark: None, keep_unfinished: true };
        let dir = tempfile::tempdir().unwrap();
        let [place, kept] = ["run", ".run.unfinished"].map(|name| dir.path().join(name));
        let refused = refuse_each(
            || write(&place, options, 10).is_ok(),
            |went_well| {
                assert_eq!(place.exists(), went_well);
                assert!(!(kept.exists() && went_well));
                // Moved away, as the message suggests; a write that finds the disk full goes well in the room that was kept.
                let _ = std::fs::remove_dir_all(&kept);
                let _ = std::fs::remove_dir_all(&place);
            },
        );
        assert!(refused >= 8, "{refused}");
    }

    #[test]
    fn where_the_disk_is_full_a_recording_is_completed_in_the_room_that_was_kept() {
        let options = WriterOptions { mark: None, keep_unfinished: true };
        let dir = tempfile::tempdir().unwrap();
        let [place, kept] = ["run", ".run.unfinished"].map(|name| dir.path().join(name));
        let completed = std::cell::Cell::new(0);
        let attempt = || -> Result<(), BagError> {
            let mut writer = Writer::create(&place, options)?;
            let topic = writer.topic::<EsvState>("/esv", Qos::DEFAULT)?;
            for time_ns in 0..10 {
                writer.write(topic, time_ns, &EsvState::default())?;
            }
            writer.flush()?;
            let is_full = writer.is_full();
            writer.finish()?;
            completed.set(completed.get() + usize::from(is_full));
            Ok(())
        };
        refuse_each(
            || attempt().is_ok(),
            |went_well| {
                if went_well {
                    let survey = super::super::survey(&place).unwrap();
                    assert_eq!((survey.messages, survey.warnings), (10, vec![]));
                    assert!(!place.join(super::super::reserve::FILE_NAME).exists());
                    std::fs::remove_dir_all(&place).unwrap();
                }
                let _ = std::fs::remove_dir_all(&kept);
            },
        );
        assert!(completed.get() > 0, "a write that was refused was tried again");
    }
}
