//! One MCAP file in memory, so that it can take its name together with other files.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};

use super::topic::{Qos, TopicInfo};
use super::{BagError, cdr};
use crate::msg::Interface;

/// Writes an MCAP file without its folder and `metadata.yaml`, which any reader of single files takes.
pub struct InMemory {
    file: mcap::Writer<Cursor<Vec<u8>>>,
    /// What the file will be called, for errors.
    path: PathBuf,
    channels: BTreeMap<String, u16>,
}

impl InMemory {
    /// Begins a file; nothing is written at `path`.
    ///
    /// # Errors
    /// Never but where the library refuses.
    pub fn new(path: &Path) -> Result<Self, BagError> {
        let file = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("govtwin/", env!("CARGO_PKG_VERSION")))
            .compression_threads(0)
            .create(Cursor::new(Vec::new()))
            .map_err(BagError::mcap(path))?;
        Ok(Self { file, path: path.to_owned(), channels: BTreeMap::new() })
    }

    /// Adds a record about the whole file.
    ///
    /// # Errors
    /// Where the library refuses.
    pub fn describe(&mut self, name: &str, values: BTreeMap<String, String>) -> Result<(), BagError> {
        let record = Metadata { name: name.into(), metadata: values };
        self.file.write_metadata(&record).map_err(BagError::mcap(&self.path))
    }

    /// Writes a message to a topic, whose first message announces it.
    ///
    /// # Errors
    /// On a type whose definition the crate does not carry.
    pub fn write<T: Interface>(
        &mut self,
        topic: &str,
        qos: Qos,
        log_time_ns: i64,
        message: &T,
    ) -> Result<(), BagError> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => self.channel(&TopicInfo::of::<T>(topic, qos)?)?,
        };
        let data = cdr::encode(message)
            .map_err(|error| BagError::Encode { what: T::TYPE_NAME.to_owned(), problem: error.to_string() })?;
        let time_ns = u64::try_from(log_time_ns).unwrap_or_default();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        self.file.write_to_known_channel(&header, &data).map_err(BagError::mcap(&self.path))
    }

    fn channel(&mut self, info: &TopicInfo) -> Result<u16, BagError> {
        let refused = || BagError::mcap(&self.path);
        let schema_id = self.file.add_schema(&info.type_name, &info.schema_encoding, &info.schema).map_err(refused())?;
        let id =
            self.file.add_channel(schema_id, &info.name, &info.encoding, &info.channel_metadata()).map_err(refused())?;
        self.channels.insert(info.name.clone(), id);
        Ok(id)
    }

    /// The whole file.
    ///
    /// # Errors
    /// Where the library refuses.
    pub fn finish(mut self) -> Result<Vec<u8>, BagError> {
        self.file.finish().map_err(BagError::mcap(&self.path))?;
        Ok(self.file.into_inner().into_inner())
    }
}
