//! The writer: frames in, one MCAP file out.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use nalgebra::Point3;
use prost::Message;

use super::background::BackgroundWriter;
use super::contact::ContactEncoder;
use super::container::ContainerWriter;
use super::encode::{SurfaceEncoder, series, transforms};
use super::frame::{POSITION_STEP, UNITS_PER_MM, field_name, stride, topics};
use super::layout::plotted_weights;
use super::messages::{Log, timestamp};
use super::schema::{foxglove_descriptors, series_descriptors};
use super::strain::{FULL_SCALE, strain_color};
use super::{
    Frame, LogEvent, LogLevel, RecordingError, RecordingInfo, RecordingOptions, RecordingReport,
    SurfaceInfo, TopicReport, foxglove_layout,
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
    info: RecordingInfo,
    options: RecordingOptions,
    skin: SurfaceEncoder,
    patches: SurfaceEncoder,
    strained: SurfaceEncoder,
    parts: SurfaceEncoder,
    contact: Option<ContactEncoder>,
    channels: Vec<Channel>,
    frames: u64,
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
        info.check()?;
        let path = path.as_ref().to_owned();
        let partial_path = partial_path(&path)?;
        let file = File::create(&partial_path).map_err(|source| RecordingError::Io {
            action: "create",
            path: partial_path.clone(),
            source,
        })?;
        let skin = SurfaceEncoder::new(std::slice::from_ref(&info.skin));
        let patches = SurfaceEncoder::new(&info.patches);
        let strained = SurfaceEncoder::colored_later(&info.patches);
        let parts = SurfaceEncoder::new(&info.parts);
        let contact = info.colliders.as_deref().map(ContactEncoder::new);
        let mut recorder = Self {
            writer: None,
            skin,
            patches,
            strained,
            parts,
            contact,
            path,
            partial_path,
            info,
            options,
            channels: Vec::new(),
            frames: 0,
            last_flush_nanos: 0,
        };
        let opened = recorder.open_topics(BufWriter::with_capacity(1 << 20, file));
        recorder.writer = Some(opened.map_err(|e| recorder.io_error("write", e))?);
        Ok(recorder)
    }

    fn open_topics(
        &mut self,
        file: BufWriter<File>,
    ) -> io::Result<BackgroundWriter<BufWriter<File>>> {
        let encoders = [&self.skin, &self.patches, &self.parts];
        let period_bytes = encoders.map(SurfaceEncoder::frame_bytes).iter().sum();
        let library = concat!("fabrig/", env!("CARGO_PKG_VERSION"));
        let mut writer = ContainerWriter::new(file, library, period_bytes)?;
        let shared = foxglove_descriptors();
        let weights = series_descriptors("Weights", &self.info.weight_names);
        let stats = series_descriptors("Stats", &self.info.stat_names);
        let mut plan: Vec<(&'static str, &str, &[u8])> = vec![
            (topics::TF, "foxglove.FrameTransforms", &shared),
            (topics::SKIN, "foxglove.SceneUpdate", &shared),
            (topics::PATCHES, "foxglove.SceneUpdate", &shared),
            (topics::PARTS, "foxglove.SceneUpdate", &shared),
            (topics::SKIN_POINTS, "foxglove.PointCloud", &shared),
            (topics::PATCH_POINTS, "foxglove.PointCloud", &shared),
            (topics::WEIGHTS, "fabrig.Weights", &weights),
            (topics::STATS, "fabrig.Stats", &stats),
            (topics::LOG, "foxglove.Log", &shared),
        ];
        if self.records_strain() {
            plan.push((topics::STRAIN, "foxglove.SceneUpdate", &shared));
        }
        if let Some(colliders) = &self.info.colliders {
            if !colliders.is_empty() {
                plan.push((topics::COLLIDERS, "foxglove.SceneUpdate", &shared));
            }
            plan.push((topics::CONTACTS, "foxglove.SceneUpdate", &shared));
        }
        let listed = |names: &[String]| {
            let fields: Vec<String> = names.iter().map(|name| field_name(name)).collect();
            fields.join(",")
        };
        let series = [
            (topics::WEIGHTS, listed(&self.info.weight_names)),
            (topics::STATS, listed(&self.info.stat_names)),
        ];
        let plotted = listed(&plotted_weights(&self.info));
        let layout = foxglove_layout(&self.info, &self.options).into_bytes();
        writer.add_metadata("fabrig", &self.metadata())?;
        writer.attach("fabrig.foxglove.json", "application/json", &layout)?;
        for (topic, schema, descriptors) in plan {
            let schema = writer.add_schema(schema, descriptors)?;
            // Viewers' helpers read the plotted names here without decoding the schema.
            let mut metadata = BTreeMap::new();
            if let Some((_, names)) = series.iter().find(|(t, _)| *t == topic) {
                metadata.insert("fields".to_owned(), names.clone());
            }
            if topic == topics::WEIGHTS {
                metadata.insert("plotted".to_owned(), plotted.clone());
            }
            let id = writer.add_channel(schema, topic, &metadata)?;
            self.channels.push(Channel {
                id,
                topic,
                messages: 0,
                raw_bytes: 0,
            });
        }
        BackgroundWriter::new(writer, self.options.chunk_bytes)
    }

    fn metadata(&self) -> BTreeMap<String, String> {
        let info = &self.info;
        let mut metadata: BTreeMap<String, String> = info.extra.iter().cloned().collect();
        for (key, value) in [
            ("rig", info.rig.clone()),
            ("template", info.template.clone()),
            ("fps", info.fps.to_string()),
            ("seed", info.seed.to_string()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("units", "decimetre".to_owned()),
            (
                "position_rounding_um",
                format!("{:.1}", POSITION_STEP / UNITS_PER_MM * 1e3),
            ),
        ] {
            metadata.insert(key.to_owned(), value);
        }
        if self.records_strain() {
            metadata.insert("strain_full_scale".to_owned(), FULL_SCALE.to_string());
        }
        metadata
    }

    fn records_strain(&self) -> bool {
        self.options.strain_hz > 0.0 && !self.info.patches.is_empty()
    }

    /// Simulated time of the next frame. (ns)
    pub fn log_time_nanos(&self) -> u64 {
        self.frames * self.info.step_nanos()
    }

    /// Frames recorded so far.
    pub fn frame_count(&self) -> u64 {
        self.frames
    }

    /// Writes one frame.
    ///
    /// # Errors
    ///
    /// [`RecordingError::FrameShape`] and [`RecordingError::NotFinite`] for a frame that does
    /// not fit, of which nothing is written; [`RecordingError::Io`] and
    /// [`RecordingError::Container`] when writing fails.
    pub fn record(&mut self, frame: &Frame<'_>) -> Result<(), RecordingError> {
        self.check(frame)?;
        let now = self.log_time_nanos();
        let due = |hz: f64| {
            stride(self.info.fps, hz).is_some_and(|stride| self.frames.is_multiple_of(stride))
        };
        let (skin_due, patches_due, strain_due, points_due) = (
            due(self.options.skin_hz),
            due(self.options.patches_hz),
            due(self.options.strain_hz),
            due(self.options.points_hz),
        );
        self.send(
            topics::TF,
            now,
            &transforms(now, &frame.head).encode_to_vec(),
        )?;
        if skin_due {
            let scene = self.skin.scene(now, &[frame.skin]);
            self.send(topics::SKIN, now, &scene)?;
            if !frame.parts.is_empty() {
                let scene = self.parts.scene(now, frame.parts);
                self.send(topics::PARTS, now, &scene)?;
            }
        }
        if let (true, Some(encoder), Some(contact)) = (skin_due, &self.contact, &frame.contact) {
            let colliders = encoder.colliders(now, contact);
            self.send(topics::COLLIDERS, now, &colliders)?;
            self.send(topics::CONTACTS, now, &ContactEncoder::arrows(now, contact))?;
        }
        if patches_due && !frame.patches.is_empty() {
            let scene = self.patches.scene(now, frame.patches);
            self.send(topics::PATCHES, now, &scene)?;
        }
        if strain_due && self.records_strain() {
            let colors = frame.strains.iter().map(|strains| {
                let strains = strains.iter();
                strains.map(|&strain| strain_color(strain)).collect()
            });
            let colors: Vec<Vec<[u8; 4]>> = colors.collect();
            let scene = self.strained.colored_scene(now, frame.patches, &colors);
            self.send(topics::STRAIN, now, &scene)?;
        }
        if points_due {
            let cloud = self.skin.cloud(now, &[frame.skin]).encode_to_vec();
            self.send(topics::SKIN_POINTS, now, &cloud)?;
            if !frame.patches.is_empty() {
                let cloud = self.patches.cloud(now, frame.patches).encode_to_vec();
                self.send(topics::PATCH_POINTS, now, &cloud)?;
            }
        }
        if !frame.weights.is_empty() {
            let values = series(frame.weights.iter().map(|&w| f64::from(w)));
            self.send(topics::WEIGHTS, now, &values)?;
        }
        if !frame.stats.is_empty() {
            self.send(topics::STATS, now, &series(frame.stats.iter().copied()))?;
        }
        for event in frame.events {
            self.log(now, event)?;
        }
        self.frames += 1;
        if (now - self.last_flush_nanos) as f64 >= self.options.flush_secs * 1e9 {
            self.last_flush_nanos = now;
            self.with_writer(|writer| writer.flush())?;
        }
        Ok(())
    }

    fn log(&mut self, now: u64, event: &LogEvent) -> Result<(), RecordingError> {
        let message = Log {
            timestamp: Some(timestamp(now)),
            level: match event.level {
                LogLevel::Info => 2,
                LogLevel::Warning => 3,
                LogLevel::Error => 4,
            },
            message: event.message.clone(),
            name: "fabrig".to_owned(),
        };
        self.send(topics::LOG, now, &message.encode_to_vec())
    }

    fn check(&self, frame: &Frame<'_>) -> Result<(), RecordingError> {
        let shape = |what: &str, expected: usize, found: usize| {
            if expected == found {
                return Ok(());
            }
            Err(RecordingError::FrameShape {
                frame: self.frames,
                what: what.to_owned(),
                expected,
                found,
            })
        };
        let finite = |what: &str, is_bad: Option<usize>| match is_bad {
            None => Ok(()),
            Some(index) => Err(RecordingError::NotFinite {
                frame: self.frames,
                what: what.to_owned(),
                index,
            }),
        };
        let surface = |surface: &SurfaceInfo, positions: &[Point3<f32>]| {
            let what = format!("vertices of `{}`", surface.name);
            shape(&what, surface.vertex_count, positions.len())?;
            let is_bad = |p: &Point3<f32>| !p.iter().all(|c| c.is_finite());
            finite(&what, positions.iter().position(is_bad))
        };
        shape("patches", self.info.patches.len(), frame.patches.len())?;
        shape("parts", self.info.parts.len(), frame.parts.len())?;
        shape("weights", self.info.weight_names.len(), frame.weights.len())?;
        shape("stats", self.info.stat_names.len(), frame.stats.len())?;
        surface(&self.info.skin, frame.skin)?;
        let patches = self.info.patches.iter().zip(frame.patches);
        for (info, positions) in patches.chain(self.info.parts.iter().zip(frame.parts)) {
            surface(info, positions)?;
        }
        if let Some(colliders) = &self.info.colliders {
            let placed = frame.contact.map_or(&[][..], |contact| contact.colliders);
            shape("colliders", colliders.len(), placed.len())?;
            for (info, positions) in colliders.iter().zip(placed) {
                surface(info, positions)?;
            }
            let arrows = frame.contact.map_or(&[][..], |contact| contact.arrows);
            let is_bad = |a: &super::ContactArrow| {
                !a.position.iter().chain(&a.normal).all(|c| c.is_finite())
            };
            finite("contact", arrows.iter().position(is_bad))?;
        }
        if self.records_strain() {
            shape(
                "patch strains",
                self.info.patches.len(),
                frame.strains.len(),
            )?;
            for (info, strains) in self.info.patches.iter().zip(frame.strains) {
                let what = format!("strains of `{}`", info.name);
                shape(&what, info.vertex_count, strains.len())?;
                finite(&what, strains.iter().position(|s| !s.is_finite()))?;
            }
        }
        let weights = frame.weights.iter().position(|w| !w.is_finite());
        finite("weight", weights)?;
        finite("stat", frame.stats.iter().position(|s| !s.is_finite()))?;
        let head = frame.head.to_homogeneous();
        finite("head transform", head.iter().position(|c| !c.is_finite()))
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
            frames: self.frames,
            duration_secs: self.log_time_nanos() as f64 / 1e9,
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
            message: format!("end after {} frames", self.frames),
        };
        self.log(self.log_time_nanos(), &event)?;
        let closed = match self.writer.take() {
            Some(writer) => writer.finish().and_then(|file| file.get_ref().sync_all()),
            None => Err(io::Error::other("the recording is closed")),
        };
        closed.map_err(|error| self.io_error("write", error))
    }

    fn send(&mut self, topic: &'static str, now: u64, data: &[u8]) -> Result<(), RecordingError> {
        let Some(index) = self.channels.iter().position(|c| c.topic == topic) else {
            return Ok(());
        };
        let channel = &mut self.channels[index];
        let (id, sequence) = (channel.id, channel.messages as u32);
        channel.messages += 1;
        channel.raw_bytes += data.len() as u64;
        self.with_writer(|writer| writer.message(id, sequence, now, data))
    }

    fn with_writer<T>(
        &mut self,
        act: impl FnOnce(&mut BackgroundWriter<BufWriter<File>>) -> io::Result<T>,
    ) -> Result<T, RecordingError> {
        let result = match &mut self.writer {
            Some(writer) => act(writer),
            None => Err(io::Error::other("the recording is closed")),
        };
        result.map_err(|error| self.io_error("write", error))
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
        if self.frames == 0 {
            let _ = fs::remove_file(&self.partial_path);
        }
    }
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
