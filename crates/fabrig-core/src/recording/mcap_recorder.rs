//! The writer: frames in, one MCAP file out.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use super::background::BackgroundWriter;
use super::container::ContainerWriter;
use super::frame::{NORMAL_STEP, POSITION_STEP, UNITS_PER_MM, topics};
use super::frame_encoder::log_message;
use super::{
    Frame, FrameEncoder, LogEvent, LogLevel, RecordingError, RecordingInfo, RecordingOptions,
    RecordingReport, TopicReport, foxglove_layout,
};

/// One topic of the file being written.
struct Channel {
    id: u16,
    /// Place of its face among the encoders.
    face: usize,
    topic: &'static str,
    /// With the face's name before it.
    full_topic: String,
    messages: u64,
    raw_bytes: u64,
}

/// Writes a recording frame by frame.
///
/// The file grows as `<path>.partial` and takes its name when it is finished, so what stands
/// at `path` is always whole. Dropping a recorder that was not finished closes the partial file
/// properly and leaves it there if it has frames; a killed process leaves a partial file of
/// which all flushed chunks can be read with [`super::RecordingReader::with_recovery`].
///
/// A thread of the recorder compresses and writes. What it fails at is returned by the next
/// call that hands it something, at the latest by [`Self::finish`].
pub struct McapRecorder {
    writer: Option<BackgroundWriter<BufWriter<File>>>,
    path: PathBuf,
    partial_path: PathBuf,
    /// One a face.
    encoders: Vec<FrameEncoder>,
    flush_secs: f64,
    channels: Vec<Channel>,
    last_flush_nanos: u64,
}

impl McapRecorder {
    /// Opens a recording.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Info`] for an announcement that makes no sense, and
    /// [`RecordingError::Io`] when the file cannot be made.
    pub fn create(
        path: impl AsRef<Path>,
        info: RecordingInfo,
        options: RecordingOptions,
    ) -> Result<Self, RecordingError> {
        Self::create_with(path, vec![info], options)
    }

    /// Opens a recording of several faces, each with a [`RecordingInfo::face`] of its own, at one
    /// frame rate. Frames are written with [`Self::record_face`], one of each face in turn.
    ///
    /// # Errors
    ///
    /// As [`Self::create`].
    pub fn create_with(
        path: impl AsRef<Path>,
        faces: Vec<RecordingInfo>,
        options: RecordingOptions,
    ) -> Result<Self, RecordingError> {
        check_faces(&faces)?;
        let encoders = faces
            .into_iter()
            .map(|info| FrameEncoder::new(info, options))
            .collect::<Result<Vec<_>, _>>()?;
        let path = path.as_ref().to_owned();
        let partial_path = partial_path(&path)?;
        let io_error = |action, source| RecordingError::Io {
            action,
            path: partial_path.clone(),
            source,
        };
        let file = File::create(&partial_path).map_err(|e| io_error("create", e))?;
        let file = BufWriter::with_capacity(1 << 20, file);
        let mut channels = Vec::new();
        let writer = open_topics(&encoders, &options, &mut channels, file)
            .and_then(|container| BackgroundWriter::new(container, options.chunk_bytes))
            .map_err(|e| io_error("write", e))?;
        Ok(Self {
            writer: Some(writer),
            path,
            partial_path,
            encoders,
            flush_secs: options.flush_secs,
            channels,
            last_flush_nanos: 0,
        })
    }

    /// Simulated time of the next frame. (ns)
    pub fn log_time_nanos(&self) -> u64 {
        self.encoders.last().map_or(0, FrameEncoder::log_time_nanos)
    }

    /// Frames recorded so far.
    pub fn frame_count(&self) -> u64 {
        self.encoders.last().map_or(0, FrameEncoder::frame_count)
    }

    /// Writes one frame.
    ///
    /// # Errors
    ///
    /// [`RecordingError::FrameShape`] and [`RecordingError::NotFinite`] for a frame that does
    /// not fit, of which nothing is written; [`RecordingError::Io`] and
    /// [`RecordingError::Container`] when writing fails.
    pub fn record(&mut self, frame: &Frame<'_>) -> Result<(), RecordingError> {
        self.record_face(0, frame)
    }

    /// Writes one frame of one face.
    ///
    /// # Errors
    ///
    /// As [`Self::record`]; [`RecordingError::Info`] for a face that was not announced, or out of
    /// turn.
    pub fn record_face(&mut self, face: usize, frame: &Frame<'_>) -> Result<(), RecordingError> {
        let now = self.log_time_nanos();
        let count = self.encoders.len();
        let Self {
            writer,
            channels,
            partial_path,
            encoders,
            ..
        } = self;
        let Some(encoder) = encoders.get_mut(face).filter(|e| e.log_time_nanos() == now) else {
            return Err(RecordingError::Info {
                reason: format!("it is not the turn of face {face} of {count}"),
            });
        };
        encoder.encode(frame, &mut |topic, now, data| {
            send(writer.as_mut(), channels, (face, topic), now, data).map_err(|source| {
                RecordingError::Io {
                    action: "write",
                    path: partial_path.clone(),
                    source,
                }
            })
        })?;
        let is_last = face + 1 == count;
        if is_last && (now - self.last_flush_nanos) as f64 >= self.flush_secs * 1e9 {
            self.last_flush_nanos = now;
            let flushed = match &mut self.writer {
                Some(writer) => writer.flush(),
                None => Err(closed()),
            };
            flushed.map_err(|error| self.io_error("write", error))?;
        }
        Ok(())
    }

    /// Closes the file and gives it its name.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Io`], [`RecordingError::Container`]; the partial file stays.
    pub fn finish(mut self) -> Result<RecordingReport, RecordingError> {
        self.close()?;
        fs::rename(&self.partial_path, &self.path)
            .map_err(|source| self.io_error("rename", source))?;
        let bytes = fs::metadata(&self.path).map_err(|source| self.io_error("read", source))?;
        let used = self.channels.iter().filter(|channel| channel.messages > 0);
        Ok(RecordingReport {
            bytes: bytes.len(),
            frames: self.frame_count(),
            duration_secs: self.log_time_nanos() as f64 / 1e9,
            position_error_um: POSITION_STEP / UNITS_PER_MM * 0.5e3,
            normal_error: f64::from(NORMAL_STEP) / 2.0,
            topics: used
                .map(|channel| TopicReport {
                    topic: channel.full_topic.clone(),
                    messages: channel.messages,
                    raw_bytes: channel.raw_bytes,
                })
                .collect(),
        })
    }

    /// Gives up: removes what was written.
    pub fn discard(mut self) {
        self.writer = None;
        // What cannot be removed is a partial file, named as one.
        let _ = fs::remove_file(&self.partial_path);
    }

    fn close(&mut self) -> Result<(), RecordingError> {
        // One message a frame after the last makes the duration cover the last frame.
        let event = LogEvent {
            level: LogLevel::Info,
            message: format!("end after {} frames", self.frame_count()),
        };
        let now = self.log_time_nanos();
        let data = log_message(now, &event);
        send(
            self.writer.as_mut(),
            &mut self.channels,
            (0, topics::LOG),
            now,
            &data,
        )
        .map_err(|error| self.io_error("write", error))?;
        let closed = match self.writer.take() {
            Some(writer) => writer.finish().and_then(|file| file.get_ref().sync_all()),
            None => Err(closed()),
        };
        closed.map_err(|error| self.io_error("write", error))
    }

    fn io_error(&self, action: &'static str, source: io::Error) -> RecordingError {
        RecordingError::Io {
            action,
            path: self.partial_path.clone(),
            source,
        }
    }
}

impl Drop for McapRecorder {
    fn drop(&mut self) {
        if self.writer.is_none() {
            return;
        }
        // An error here has no one to go to; the flushed chunks are on the disk.
        let _ = self.close();
        self.writer = None;
        if self.frame_count() == 0 {
            let _ = fs::remove_file(&self.partial_path);
        }
    }
}

/// Refuses faces that could not be told apart.
fn check_faces(faces: &[RecordingInfo]) -> Result<(), RecordingError> {
    let refuse = |reason: String| Err(RecordingError::Info { reason });
    let Some(first) = faces.first() else {
        return refuse("a recording needs a face".to_owned());
    };
    for (index, info) in faces.iter().enumerate() {
        if faces.len() > 1 && info.face.is_empty() {
            return refuse(format!("face {index} of {} has no name", faces.len()));
        }
        if faces[..index].iter().any(|other| other.face == info.face) {
            return refuse(format!("two faces are called `{}`", info.face));
        }
        if info.fps != first.fps {
            return refuse(format!(
                "`{}` has {} frames a second, `{}` has {}",
                info.face, info.fps, first.face, first.fps
            ));
        }
    }
    Ok(())
}

/// What a recording says of itself. Where faces differ in something, each says it with its name
/// before.
fn metadata_of(encoders: &[FrameEncoder]) -> BTreeMap<String, String> {
    let [first, others @ ..] = encoders else {
        return BTreeMap::new();
    };
    if others.is_empty() {
        return first.metadata();
    }
    let each: Vec<_> = encoders
        .iter()
        .map(|e| (&e.info().face, e.metadata()))
        .collect();
    let names: Vec<&str> = each.iter().map(|(face, _)| face.as_str()).collect();
    let mut metadata = BTreeMap::from([("faces".to_owned(), names.join(","))]);
    for (face, own) in &each {
        for (key, value) in own {
            let is_shared = each.iter().all(|(_, other)| other.get(key) == Some(value));
            let key = if is_shared {
                key.clone()
            } else {
                format!("{face}/{key}")
            };
            metadata.insert(key, value.clone());
        }
    }
    metadata
}

/// Begins a file with everything but messages.
fn open_topics(
    encoders: &[FrameEncoder],
    options: &RecordingOptions,
    channels: &mut Vec<Channel>,
    file: BufWriter<File>,
) -> io::Result<ContainerWriter<BufWriter<File>>> {
    let library = concat!("fabrig/", env!("CARGO_PKG_VERSION"));
    let frame_bytes = encoders.iter().map(FrameEncoder::frame_bytes).sum();
    let mut writer = ContainerWriter::new(file, library, frame_bytes)?;
    writer.add_metadata("fabrig", &metadata_of(encoders))?;
    let infos: Vec<&RecordingInfo> = encoders.iter().map(FrameEncoder::info).collect();
    let layout = foxglove_layout(&infos, options).into_bytes();
    writer.attach("fabrig.foxglove.json", "application/json", &layout)?;
    for (face, encoder) in encoders.iter().enumerate() {
        for topic in encoder.topics() {
            let schema = writer.add_schema(topic.schema, &topic.descriptors)?;
            let full_topic = encoder.info().topic(topic.topic);
            channels.push(Channel {
                id: writer.add_channel(schema, &full_topic, &topic.metadata)?,
                face,
                topic: topic.topic,
                full_topic,
                messages: 0,
                raw_bytes: 0,
            });
        }
    }
    Ok(writer)
}

/// Hands a message over; one of a topic that was not asked for goes nowhere.
fn send(
    writer: Option<&mut BackgroundWriter<BufWriter<File>>>,
    channels: &mut [Channel],
    topic: (usize, &str),
    now: u64,
    data: &[u8],
) -> io::Result<()> {
    let Some(channel) = channels.iter_mut().find(|c| (c.face, c.topic) == topic) else {
        return Ok(());
    };
    let writer = writer.ok_or_else(closed)?;
    let (id, sequence) = (channel.id, channel.messages as u32);
    channel.messages += 1;
    channel.raw_bytes += data.len() as u64;
    writer.message(id, sequence, now, data)
}

fn closed() -> io::Error {
    io::Error::other("the recording is closed")
}

/// `take.mcap` grows as `take.mcap.partial`.
fn partial_path(path: &Path) -> Result<PathBuf, RecordingError> {
    let Some(name) = path.file_name() else {
        return Err(RecordingError::Info {
            reason: format!("`{}` names no file", path.display()),
        });
    };
    let mut name = name.to_owned();
    name.push(".partial");
    Ok(path.with_file_name(name))
}
