//! Writing an MCAP file.

use std::{
    collections::{BTreeMap, HashMap},
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
};

use mcap::{
    Compression, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
};
use roscausal_core::{Error, Message, Result, Time};
use roscausal_msgs::{Definition, cdr};

use crate::settings;

/// Writes an MCAP file as ROS 2 does (profile `ros2`, messages in CDR, types as `ros2msg`). `ros2 bag` and Foxglove
/// open it. The same messages give the same bytes.
///
/// End it with [`McapWriter::finish`]. A file whose writer is dropped is also ended, but its errors are lost. A
/// file whose process is killed lacks about its last second, and its index.
pub struct McapWriter {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    /// Topic and address of its definition -> channel and the number of its last message.
    channels: HashMap<(String, usize), (u16, u32)>,
    messages: u64,
}

impl McapWriter {
    /// Creates the file; an existing one is overwritten.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::create(path).map_err(|error| Error::file(path, error))?;
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("roscausal ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0);
        let writer = options.create(BufWriter::new(file)).map_err(|error| Error::file(path, error))?;
        Ok(Self { path: path.to_owned(), writer, channels: HashMap::new(), messages: 0 })
    }

    /// Writes the settings that the recording is made with, `NODE.PARAMETER` to value; [`crate::settings`] reads them.
    /// Called before the first message, they outlast a file that is cut short.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn write_settings(&mut self, settings: &BTreeMap<String, String>) -> Result<()> {
        let record = Metadata { name: settings::NAME.to_owned(), metadata: settings.clone() };
        self.writer.write_metadata(&record).map_err(|error| Error::file(&self.path, error))
    }

    /// Writes a message, recorded at `stamp`.
    ///
    /// # Errors
    /// If the disk is full, or the message cannot be encoded.
    pub fn write<M: Message>(&mut self, topic: &str, stamp: Time, message: &M) -> Result<()> {
        let bytes = cdr::to_bytes(message)
            .map_err(|error| Error::Topic { topic: topic.to_owned(), reason: error.to_string() })?;
        self.write_bytes(topic, M::definition(), stamp, &bytes)
    }

    /// Writes a message that is already CDR.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn write_bytes(
        &mut self,
        topic: &str,
        definition: &'static Definition,
        stamp: Time,
        bytes: &[u8],
    ) -> Result<()> {
        let (channel_id, sequence) = self.channel(topic, definition)?;
        let time = u64::try_from(stamp.as_nanos()).unwrap_or(0);
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.messages += 1;
        self.writer.write_to_known_channel(&header, bytes).map_err(|error| Error::file(&self.path, error))
    }

    /// Messages written so far.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Writes the remaining messages and the index, and waits until they are on disk.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn finish(mut self) -> Result<()> {
        let fail = |error: &dyn std::fmt::Display| Error::file(&self.path, error);
        self.writer.finish().map_err(|error| fail(&error))?;
        let file = self.writer.into_inner().into_inner().map_err(|error| fail(&error))?;
        file.sync_all().map_err(|error| fail(&error))
    }

    fn channel(&mut self, topic: &str, definition: &'static Definition) -> Result<(u16, u32)> {
        let key = (topic.to_owned(), std::ptr::from_ref(definition).addr());
        if let Some((channel, sequence)) = self.channels.get_mut(&key) {
            *sequence = sequence.wrapping_add(1);
            return Ok((*channel, *sequence));
        }
        let text = definition.ros2_definition();
        let schema = self.writer.add_schema(&definition.ros2_type_name(), "ros2msg", text.as_bytes());
        let channel =
            schema.and_then(|schema| self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new()));
        let channel = channel.map_err(|error| Error::file(&self.path, error))?;
        self.channels.insert(key, (channel, 0));
        Ok((channel, 0))
    }
}
