//! The reader: frames back from a file, one at a time.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use prost::Message;

use super::encode::FrameNames;
use super::frame::{UNITS_PER_MM, topics};
use super::messages::{Color, FrameTransforms, SceneUpdate};
use super::{RecordingError, SurfaceInfo};

/// A surface at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedSurface {
    /// Its name, colour and triangles.
    pub info: SurfaceInfo,
    /// Vertices in the head frame, rounded as the recording is. (mm)
    pub positions: Vec<Point3<f64>>,
}

/// One instant of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedFrame {
    /// Simulated time. (s)
    pub time_secs: f64,
    /// The skin.
    pub skin: Option<RecordedSurface>,
    /// Patches.
    pub patches: Vec<RecordedSurface>,
    /// Eyeballs, teeth, tongue.
    pub parts: Vec<RecordedSurface>,
    /// Colliders.
    pub colliders: Vec<RecordedSurface>,
    /// Where things touch: one surface of arrows, if contact was on.
    pub contacts: Option<RecordedSurface>,
    /// Where the head is. (mm)
    pub head: Isometry3<f64>,
}

/// Reads a recording from its start to its end.
pub struct RecordingReader {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    is_recovering: bool,
    is_done: bool,
    metadata: BTreeMap<String, String>,
    /// The face that is read, where there are several; empty where there is one.
    face: String,
    topics: HashMap<u16, String>,
    pending: Option<(u64, RecordedFrame)>,
    frames: usize,
}

impl RecordingReader {
    /// Opens a recording and reads what it says of itself.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Io`], [`RecordingError::Container`] for a file that is no MCAP file,
    /// [`RecordingError::NotARecording`] for one without our metadata,
    /// [`RecordingError::SeveralFaces`] for one of several.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        Self::start(path.as_ref(), false, None)
    }

    /// Opens a recording of several faces to read one of them.
    ///
    /// # Errors
    ///
    /// As [`Self::open`]; [`RecordingError::NoSuchFace`].
    pub fn open_face(path: impl AsRef<Path>, face: &str) -> Result<Self, RecordingError> {
        Self::start(path.as_ref(), false, Some(face))
    }

    /// A reader for each face of a recording, in their order.
    ///
    /// # Errors
    ///
    /// As [`Self::open`], but for several faces.
    pub fn open_all(path: impl AsRef<Path>) -> Result<Vec<Self>, RecordingError> {
        let path = path.as_ref();
        let first = Self::begin(path, false)?;
        if first.faces().next().is_none() {
            return Ok(vec![first]);
        }
        let faces = first.faces();
        faces.map(|face| Self::open_face(path, face)).collect()
    }

    /// Name of the face that is read; empty where the recording has one alone.
    pub fn face(&self) -> &str {
        &self.face
    }

    /// Opens what a killed recorder left: the end of the file, wherever it is, ends the frames.
    ///
    /// # Errors
    ///
    /// As [`Self::open`].
    pub fn with_recovery(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        Self::start(path.as_ref(), true, None)
    }

    /// As [`Self::with_recovery`], one of several faces.
    ///
    /// # Errors
    ///
    /// As [`Self::open_face`].
    pub fn face_with_recovery(path: impl AsRef<Path>, face: &str) -> Result<Self, RecordingError> {
        Self::start(path.as_ref(), true, Some(face))
    }

    /// Reads what a recording says of itself, and no face yet.
    fn begin(path: &Path, is_recovering: bool) -> Result<Self, RecordingError> {
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
            metadata: BTreeMap::new(),
            face: String::new(),
            topics: HashMap::new(),
            pending: None,
            frames: 0,
        };
        while reader.metadata.is_empty() {
            if reader.step()?.is_none() {
                return Err(RecordingError::NotARecording {
                    path: reader.path,
                    reason: "it has no metadata record called `fabrig`".to_owned(),
                });
            }
        }
        Ok(reader)
    }

    /// Begins, and chooses the face.
    fn start(path: &Path, is_recovering: bool, face: Option<&str>) -> Result<Self, RecordingError> {
        let mut reader = Self::begin(path, is_recovering)?;
        reader.face = face.unwrap_or_default().to_owned();
        let known: Vec<&str> = reader.faces().collect();
        if known.contains(&reader.face.as_str()) || known.is_empty() && face.is_none() {
            return Ok(reader);
        }
        let faces = known.join(", ");
        Err(match face {
            None => RecordingError::SeveralFaces {
                path: path.to_owned(),
                faces,
            },
            Some(found) => RecordingError::NoSuchFace {
                path: path.to_owned(),
                found: found.to_owned(),
                faces: if known.is_empty() {
                    "one without a name".to_owned()
                } else {
                    faces
                },
            },
        })
    }

    /// Names of its faces, where it has several; none where it has one.
    pub fn faces(&self) -> impl Iterator<Item = &str> {
        let names = self.metadata.get("faces").into_iter();
        names.flat_map(|names| names.split(','))
    }

    /// What the recording says of itself: `rig`, `template`, `fps`, `seed`, `version`, ...
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The next instant at which a surface was written; `None` after the last.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Truncated`] and [`RecordingError::Container`] after all frames that
    /// are whole, [`RecordingError::Message`] for a message that does not follow its schema.
    pub fn next_frame(&mut self) -> Result<Option<RecordedFrame>, RecordingError> {
        loop {
            match self.step() {
                Ok(Some(Some(frame))) => return Ok(Some(frame)),
                Ok(Some(None)) => {}
                Ok(None) => return Ok(self.take_pending()),
                Err(error) => {
                    self.is_done = true;
                    return Err(error);
                }
            }
        }
    }

    fn take_pending(&mut self) -> Option<RecordedFrame> {
        let (_, frame) = self.pending.take()?;
        let has_surface =
            frame.skin.is_some() || !frame.patches.is_empty() || !frame.parts.is_empty();
        if has_surface {
            self.frames += 1;
        }
        has_surface.then_some(frame)
    }

    /// Reads one record. `None` at the end, `Some(Some(frame))` when it completed a frame.
    #[allow(clippy::type_complexity)]
    fn step(&mut self) -> Result<Option<Option<RecordedFrame>>, RecordingError> {
        if self.is_done {
            return Ok(None);
        }
        let event = match self.reader.next_event() {
            None => {
                self.is_done = true;
                return Ok(None);
            }
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
                return Ok(Some(None));
            }
            LinearReadEvent::Record { opcode, data } => (opcode, data),
        };
        let record = match mcap::parse_record(opcode, data) {
            Ok(record) => record,
            Err(error) => return self.end_by(error),
        };
        let (header, data) = match record {
            Record::Metadata(metadata) if metadata.name == "fabrig" => {
                self.metadata = metadata.metadata;
                return Ok(Some(None));
            }
            Record::Channel(channel) => {
                self.topics.insert(channel.id, channel.topic);
                return Ok(Some(None));
            }
            Record::Message { header, data } => (header, data.into_owned()),
            _ => return Ok(Some(None)),
        };
        let Some(topic) = self.topics.get(&header.channel_id).cloned() else {
            return self.end_by(McapError::UnknownChannel(
                header.sequence,
                header.channel_id,
            ));
        };
        let done = match &self.pending {
            Some((time, _)) if *time != header.log_time => self.take_pending(),
            _ => None,
        };
        self.accept(&topic, header.log_time, header.sequence, &data)?;
        Ok(Some(done))
    }

    /// An unsound place: the end of what can be recovered, or an error.
    #[allow(clippy::type_complexity)]
    fn end_by(
        &mut self,
        error: McapError,
    ) -> Result<Option<Option<RecordedFrame>>, RecordingError> {
        self.is_done = true;
        if self.is_recovering && !self.metadata.is_empty() {
            return Ok(None);
        }
        Err(match error {
            McapError::UnexpectedEof => RecordingError::Truncated {
                path: self.path.clone(),
                frames: self.frames,
            },
            source => RecordingError::Container {
                path: self.path.clone(),
                frames: self.frames,
                source,
            },
        })
    }

    fn accept(
        &mut self,
        topic: &str,
        nanos: u64,
        sequence: u32,
        data: &[u8],
    ) -> Result<(), RecordingError> {
        let own = match self.face.as_str() {
            "" => Some(topic),
            face => topic.strip_prefix('/').and_then(|t| t.strip_prefix(face)),
        };
        // What is of other faces goes by; their names may begin alike.
        let Some(own) = own.filter(|own| own.starts_with('/')) else {
            return Ok(());
        };
        let (_, frame) = self.pending.get_or_insert_with(|| {
            let frame = RecordedFrame {
                time_secs: nanos as f64 / 1e9,
                skin: None,
                patches: Vec::new(),
                parts: Vec::new(),
                colliders: Vec::new(),
                contacts: None,
                head: Isometry3::identity(),
            };
            (nanos, frame)
        });
        let message_error = |source| RecordingError::Message {
            path: self.path.clone(),
            topic: topic.to_owned(),
            sequence,
            source,
        };
        match own {
            topics::TF => {
                let message = FrameTransforms::decode(data).map_err(message_error)?;
                if let Some(head) = head_of(&message, &FrameNames::of(&self.face)) {
                    frame.head = head;
                }
            }
            topics::SKIN
            | topics::PATCHES
            | topics::PARTS
            | topics::COLLIDERS
            | topics::CONTACTS => {
                let scene = SceneUpdate::decode(data).map_err(message_error)?;
                let surfaces =
                    surfaces_of(scene).map_err(|reason| RecordingError::NotARecording {
                        path: self.path.clone(),
                        reason: format!("message {sequence} on `{topic}`: {reason}"),
                    })?;
                match own {
                    topics::SKIN => frame.skin = surfaces.into_iter().next(),
                    topics::PATCHES => frame.patches = surfaces,
                    topics::COLLIDERS => frame.colliders = surfaces,
                    topics::CONTACTS => frame.contacts = surfaces.into_iter().next(),
                    _ => frame.parts = surfaces,
                }
            }
            _ => {}
        }
        Ok(())
    }
}

fn head_of(message: &FrameTransforms, names: &FrameNames) -> Option<Isometry3<f64>> {
    let head = message
        .transforms
        .iter()
        .find(|t| t.child_frame_id == names.head)?;
    let (t, q) = (head.translation.as_ref()?, head.rotation.as_ref()?);
    Some(Isometry3::from_parts(
        Translation3::new(t.x / UNITS_PER_MM, t.y / UNITS_PER_MM, t.z / UNITS_PER_MM),
        UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z)),
    ))
}

/// Surfaces of a scene in millimetres; the error says what does not fit.
fn surfaces_of(scene: SceneUpdate) -> Result<Vec<RecordedSurface>, String> {
    let mut surfaces = Vec::new();
    for entity in scene.entities {
        for list in entity.triangles {
            let count = list.points.len();
            let triangles: Vec<[u32; 3]> = list
                .indices
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect();
            if let Some(v) = list.indices.iter().find(|&&v| v as usize >= count) {
                return Err(format!("`{}` references vertex {v} of {count}", entity.id));
            }
            let srgb = |color: &Color| {
                [color.r, color.g, color.b, color.a]
                    .map(|c| (c * 255.0).round().clamp(0.0, 255.0) as u8)
            };
            let color = srgb(&list.color.unwrap_or_default());
            surfaces.push(RecordedSurface {
                info: SurfaceInfo {
                    name: entity.id.clone(),
                    color,
                    vertex_count: count,
                    triangles,
                    vertex_colors: list.colors.iter().map(srgb).collect(),
                },
                positions: list
                    .points
                    .iter()
                    .map(|p| Point3::new(p.x, p.y, p.z) / UNITS_PER_MM)
                    .collect(),
            });
        }
    }
    Ok(surfaces)
}
