//! The messages of a recording as they are, for whoever passes them on.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::RecordingError;
use super::frame::topics;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedTopic {
    /// Its name.
    pub topic: String,
    /// Name of its message, such as `foxglove.SceneUpdate`.
    pub schema: String,
    /// What describes it: a `google.protobuf.FileDescriptorSet`.
    pub descriptors: Vec<u8>,
    /// What the channel says of itself.
    pub metadata: BTreeMap<String, String>,
}

/// A message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedMessage {
    /// Index in [`MessageReader::topics`].
    pub topic: usize,
    /// Simulated time. (ns)
    pub log_time: u64,
    /// The message, encoded.
    pub data: Vec<u8>,
}

/// Reads a recording message by message, in the order of the file.
pub struct MessageReader {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    is_recovering: bool,
    is_done: bool,
    schemas: BTreeMap<u16, (String, Vec<u8>)>,
    topics: Vec<RecordedTopic>,
    /// Index of a topic by the id of its channel.
    index_of: BTreeMap<u16, usize>,
    metadata: BTreeMap<String, String>,
    /// The message that was read on the way to the topics.
    first: Option<RecordedMessage>,
    messages: usize,
    /// Instants that a transform was read of: one a frame.
    frames: usize,
}

impl MessageReader {
    /// Opens a recording; all its topics are known then.
    ///
    /// - `is_recovering`: takes any unsound place as the end, as a killed recorder leaves one
    ///
    /// # Errors
    ///
    /// [`RecordingError::Io`], [`RecordingError::Container`] for a file that is no MCAP file,
    /// [`RecordingError::NotARecording`] for one without our metadata or without messages.
    pub fn open(path: impl AsRef<Path>, is_recovering: bool) -> Result<Self, RecordingError> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|source| RecordingError::Io {
            action: "open",
            path: path.to_owned(),
            source,
        })?;
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(is_recovering)
            .with_validate_chunk_crcs(true)
            // A length field gone wrong must not ask for all memory.
            .with_record_length_limit(1 << 30);
        let mut reader = Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 20, file),
            reader: LinearReader::new_with_options(options),
            is_recovering,
            is_done: false,
            schemas: BTreeMap::new(),
            topics: Vec::new(),
            index_of: BTreeMap::new(),
            metadata: BTreeMap::new(),
            first: None,
            messages: 0,
            frames: 0,
        };
        // Channels stand before all messages in what we write.
        reader.first = reader.next_message()?;
        let lacks = if reader.metadata.is_empty() {
            "it has no metadata record called `fabrig`"
        } else if reader.first.is_none() {
            "it has no messages"
        } else {
            return Ok(reader);
        };
        Err(RecordingError::NotARecording {
            path: path.to_owned(),
            reason: lacks.to_owned(),
        })
    }

    /// Topics in the order of the file.
    pub fn topics(&self) -> &[RecordedTopic] {
        &self.topics
    }

    /// What the recording says of itself: `rig`, `take`, `fps`, ...
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The next message; `None` after the last.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Truncated`] and [`RecordingError::Container`] after all messages that
    /// are whole.
    pub fn next_message(&mut self) -> Result<Option<RecordedMessage>, RecordingError> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        while !self.is_done {
            let event = match self.reader.next_event() {
                None => break,
                Some(Ok(event)) => event,
                Some(Err(error)) => return self.end_by(error),
            };
            let (opcode, data) = match event {
                LinearReadEvent::ReadRequest(need) => {
                    let count = self.file.read(self.reader.insert(need));
                    let count = count.map_err(|source| RecordingError::Io {
                        action: "read",
                        path: self.path.clone(),
                        source,
                    })?;
                    self.reader.notify_read(count);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            match mcap::parse_record(opcode, data) {
                Err(error) => return self.end_by(error),
                Ok(Record::Metadata(metadata)) if metadata.name == "fabrig" => {
                    self.metadata = metadata.metadata;
                }
                Ok(Record::Schema { header, data }) => {
                    let schema = (header.name, data.into_owned());
                    self.schemas.insert(header.id, schema);
                }
                Ok(Record::Channel(channel)) => {
                    let schema = self.schemas.get(&channel.schema_id).cloned();
                    let (schema, descriptors) = schema.unwrap_or_default();
                    let topics = &mut self.topics;
                    // The summary at the end repeats the channels.
                    self.index_of.entry(channel.id).or_insert_with(|| {
                        topics.push(RecordedTopic {
                            topic: channel.topic,
                            schema,
                            descriptors,
                            metadata: channel.metadata,
                        });
                        topics.len() - 1
                    });
                }
                Ok(Record::Message { header, data }) => {
                    let (sequence, channel) = (header.sequence, header.channel_id);
                    let Some(&topic) = self.index_of.get(&channel) else {
                        return self.end_by(McapError::UnknownChannel(sequence, channel));
                    };
                    self.messages += 1;
                    let first = self
                        .topics
                        .iter()
                        .position(|t| t.topic.ends_with(topics::TF));
                    self.frames += usize::from(first == Some(topic));
                    return Ok(Some(RecordedMessage {
                        topic,
                        log_time: header.log_time,
                        data: data.into_owned(),
                    }));
                }
                Ok(_) => {}
            }
        }
        self.is_done = true;
        Ok(None)
    }

    /// An unsound place: the end of what can be recovered, or an error.
    fn end_by(&mut self, error: McapError) -> Result<Option<RecordedMessage>, RecordingError> {
        self.is_done = true;
        if self.is_recovering && self.messages > 0 {
            return Ok(None);
        }
        let (path, frames) = (self.path.clone(), self.frames);
        Err(match error {
            McapError::UnexpectedEof => RecordingError::Truncated { path, frames },
            source => RecordingError::Container {
                path,
                frames,
                source,
            },
        })
    }
}
