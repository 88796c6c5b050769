//! The writer: frames in, one MCAP file out.

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use super::background::BackgroundWriter;
use super::container::ContainerWriter;
use super::frame::{NORMAL_STEP, POSITION_STEP, UNITS_PER_MM, topics};
use super::frame_encoder::log_message;
use super::{
    Frame, FrameEncoder, LogEvent, LogLevel, RecordingError, RecordingInfo, RecordingOptions,
    RecordingReport, TopicReport,
};

/// One topic of the file being written.
struct Channel {
    id: u16,
    topic: &'static str,
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
    encoder: FrameEncoder,
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
        let encoder = FrameEncoder::new(info, options)?;
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
        let writer = open_topics(&encoder, &mut channels, file)
            .and_then(|container| BackgroundWriter::new(container, options.chunk_bytes))
            .map_err(|e| io_error("write", e))?;
        Ok(Self {
            writer: Some(writer),
            path,
            partial_path,
            encoder,
            flush_secs: options.flush_secs,
            channels,
            last_flush_nanos: 0,
        })
    }

    /// Simulated time of the next frame. (ns)
    pub fn log_time_nanos(&self) -> u64 {
        self.encoder.log_time_nanos()
    }

    /// Frames recorded so far.
    pub fn frame_count(&self) -> u64 {
        self.encoder.frame_count()
    }

    /// Writes one frame.
    ///
    /// # Errors
    ///
    /// [`RecordingError::FrameShape`] and [`RecordingError::NotFinite`] for a frame that does
    /// not fit, of which nothing is written; [`RecordingError::Io`] and
    /// [`RecordingError::Container`] when writing fails.
    pub fn record(&mut self, frame: &Frame<'_>) -> Result<(), RecordingError> {
        let now = self.log_time_nanos();
        let Self {
            writer,
            channels,
            partial_path,
            encoder,
            ..
        } = self;
        encoder.encode(frame, &mut |topic, now, data| {
            send(writer.as_mut(), channels, topic, now, data).map_err(|source| RecordingError::Io {
                action: "write",
                path: partial_path.clone(),
                source,
            })
        })?;
        if (now - self.last_flush_nanos) as f64 >= self.flush_secs * 1e9 {
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
                    topic: channel.topic.to_owned(),
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
            topics::LOG,
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

/// Begins a file with everything but messages.
fn open_topics(
    encoder: &FrameEncoder,
    channels: &mut Vec<Channel>,
    file: BufWriter<File>,
) -> io::Result<ContainerWriter<BufWriter<File>>> {
    let library = concat!("fabrig/", env!("CARGO_PKG_VERSION"));
    let mut writer = ContainerWriter::new(file, library, encoder.frame_bytes())?;
    writer.add_metadata("fabrig", &encoder.metadata())?;
    let layout = encoder.layout().into_bytes();
    writer.attach("fabrig.foxglove.json", "application/json", &layout)?;
    for topic in encoder.topics() {
        let schema = writer.add_schema(topic.schema, &topic.descriptors)?;
        channels.push(Channel {
            id: writer.add_channel(schema, topic.topic, &topic.metadata)?,
            topic: topic.topic,
            messages: 0,
            raw_bytes: 0,
        });
    }
    Ok(writer)
}

/// Hands a message over; one of a topic that was not asked for goes nowhere.
fn send(
    writer: Option<&mut BackgroundWriter<BufWriter<File>>>,
    channels: &mut [Channel],
    topic: &str,
    now: u64,
    data: &[u8],
) -> io::Result<()> {
    let Some(channel) = channels.iter_mut().find(|c| c.topic == topic) else {
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
