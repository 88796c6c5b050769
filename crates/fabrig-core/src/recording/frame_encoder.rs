//! Frames as messages on topics, whoever they go to: a file or a viewer.

use std::collections::BTreeMap;

use nalgebra::Point3;
use prost::Message;

use super::contact::ContactEncoder;
use super::encode::{FrameNames, SurfaceEncoder, series, transforms};
use super::frame::{NORMAL_STEP, POSITION_STEP, UNITS_PER_MM, field_name, stride, topics};
use super::layout::plotted_weights;
use super::messages::{Log, timestamp};
use super::schema::{foxglove_descriptors, series_descriptors};
use super::strain::{FULL_SCALE, strain_color};
use super::{
    Frame, LogEvent, LogLevel, RecordingError, RecordingInfo, RecordingOptions, SurfaceInfo,
    foxglove_layout,
};

/// A topic with what its messages are. Where a recording has several faces, the name of each
/// goes before its topics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicInfo {
    /// Its name, one of [`topics`].
    pub topic: &'static str,
    /// Name of the message, such as `foxglove.SceneUpdate`.
    pub schema: &'static str,
    /// What describes it: a `google.protobuf.FileDescriptorSet`.
    pub descriptors: Vec<u8>,
    /// `fields` of a series, and which of them plots show (`plotted`).
    pub metadata: BTreeMap<String, String>,
}

/// Takes an encoded message: its topic, time (ns) and content.
pub type MessageSink<'a> =
    &'a mut dyn FnMut(&'static str, u64, &[u8]) -> Result<(), RecordingError>;

/// Encodes frames of one face as protobuf messages.
///
/// What does not change from frame to frame is encoded once.
pub struct FrameEncoder {
    info: RecordingInfo,
    options: RecordingOptions,
    names: FrameNames,
    skin: SurfaceEncoder,
    patches: SurfaceEncoder,
    strained: SurfaceEncoder,
    parts: SurfaceEncoder,
    contact: Option<ContactEncoder>,
    frames: u64,
}

impl FrameEncoder {
    /// # Errors
    ///
    /// [`RecordingError::Info`] for an announcement that makes no sense.
    pub fn new(info: RecordingInfo, options: RecordingOptions) -> Result<Self, RecordingError> {
        info.check()?;
        let names = FrameNames::of(&info.face);
        let (head, contact) = (&names.head.clone(), info.colliders.as_deref());
        Ok(Self {
            skin: SurfaceEncoder::new(std::slice::from_ref(&info.skin), head),
            patches: SurfaceEncoder::new(&info.patches, head),
            strained: SurfaceEncoder::colored_later(&info.patches, head),
            parts: SurfaceEncoder::new(&info.parts, head),
            contact: contact.map(|colliders| ContactEncoder::new(colliders, head)),
            names,
            info,
            options,
            frames: 0,
        })
    }

    /// Size of a frame with everything in it. (bytes)
    pub(super) fn frame_bytes(&self) -> usize {
        let encoders = [&self.skin, &self.patches, &self.parts];
        encoders.map(SurfaceEncoder::frame_bytes).iter().sum()
    }

    /// What it was made with.
    pub fn info(&self) -> &RecordingInfo {
        &self.info
    }

    /// The layout for Foxglove and Lichtblick, as JSON.
    pub fn layout(&self) -> String {
        foxglove_layout(&[&self.info], &self.options)
    }

    /// The topics that there will be messages on; those that were not asked for are not there.
    pub fn topics(&self) -> Vec<TopicInfo> {
        let RecordingOptions {
            skin_hz,
            patches_hz,
            points_hz,
            magnets_hz,
            ..
        } = self.options;
        let (info, options) = (&self.info, &self.options);
        let has_patches = !info.patches.is_empty();
        let has_colliders = info.colliders.as_ref().is_some_and(|c| !c.is_empty());
        let (scene, cloud) = ("foxglove.SceneUpdate", "foxglove.PointCloud");
        let plan = [
            (topics::TF, "foxglove.FrameTransforms", true),
            (topics::SKIN, scene, skin_hz > 0.0),
            (topics::PATCHES, scene, patches_hz > 0.0 && has_patches),
            (
                topics::PARTS,
                scene,
                skin_hz > 0.0 && !info.parts.is_empty(),
            ),
            (topics::SKIN_POINTS, cloud, points_hz > 0.0),
            (topics::PATCH_POINTS, cloud, points_hz > 0.0 && has_patches),
            (topics::MAGNETS, cloud, magnets_hz > 0.0 && has_patches),
            (
                topics::WEIGHTS,
                "fabrig.Weights",
                options.weights && !info.weight_names.is_empty(),
            ),
            (topics::STATS, "fabrig.Stats", !info.stat_names.is_empty()),
            (topics::LOG, "foxglove.Log", true),
            (topics::STRAIN, scene, self.records_strain()),
            (topics::COLLIDERS, scene, options.colliders && has_colliders),
            (
                topics::CONTACTS,
                scene,
                options.contacts && info.colliders.is_some(),
            ),
        ];
        let listed = |names: &[String]| {
            let fields: Vec<String> = names.iter().map(|name| field_name(name)).collect();
            fields.join(",")
        };
        let shared = foxglove_descriptors();
        let present = plan.into_iter().filter(|(.., is_there)| *is_there);
        present
            .map(|(topic, schema, _)| {
                // Viewers' helpers read the names here without decoding the schema.
                let mut metadata = BTreeMap::new();
                let mut tell = |key: &str, names: &[String]| {
                    metadata.insert(key.to_owned(), listed(names));
                };
                let descriptors = match topic {
                    topics::WEIGHTS => {
                        tell("fields", &info.weight_names);
                        tell("plotted", &plotted_weights(info));
                        series_descriptors("Weights", &info.weight_names)
                    }
                    topics::STATS => {
                        tell("fields", &info.stat_names);
                        series_descriptors("Stats", &info.stat_names)
                    }
                    _ => shared.clone(),
                };
                TopicInfo {
                    topic,
                    schema,
                    descriptors,
                    metadata,
                }
            })
            .collect()
    }

    /// What a recording says of itself.
    pub fn metadata(&self) -> BTreeMap<String, String> {
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
            (
                "position_error_um",
                format!("{:.1}", POSITION_STEP / UNITS_PER_MM * 0.5e3),
            ),
            ("normal_error", format!("{:.4}", NORMAL_STEP / 2.0)),
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

    /// Frames encoded so far.
    pub fn frame_count(&self) -> u64 {
        self.frames
    }

    /// Encodes one frame: what is due of it, at [`Self::log_time_nanos`].
    ///
    /// # Errors
    ///
    /// [`RecordingError::FrameShape`] and [`RecordingError::NotFinite`] for a frame that does
    /// not fit, of which nothing is given to `sink`; what `sink` returns.
    pub fn encode(
        &mut self,
        frame: &Frame<'_>,
        sink: MessageSink<'_>,
    ) -> Result<(), RecordingError> {
        self.check(frame)?;
        let now = self.log_time_nanos();
        let due = |hz: f64| {
            stride(self.info.fps, hz).is_some_and(|stride| self.frames.is_multiple_of(stride))
        };
        let (skin_due, patches_due, strain_due, points_due, magnets_due) = (
            due(self.options.skin_hz),
            due(self.options.patches_hz),
            due(self.options.strain_hz),
            due(self.options.points_hz),
            due(self.options.magnets_hz),
        );
        // Contact is looked at beside whichever mesh there is.
        let contact_due = skin_due || patches_due && self.options.skin_hz == 0.0;
        sink(
            topics::TF,
            now,
            &transforms(now, &self.names, &frame.head).encode_to_vec(),
        )?;
        if skin_due {
            let scene = self.skin.scene(now, &[frame.skin]);
            sink(topics::SKIN, now, &scene)?;
            if !frame.parts.is_empty() {
                let scene = self.parts.scene(now, frame.parts);
                sink(topics::PARTS, now, &scene)?;
            }
        }
        if let (true, Some(encoder), Some(contact)) = (contact_due, &self.contact, &frame.contact) {
            if self.options.colliders && !contact.colliders.is_empty() {
                sink(topics::COLLIDERS, now, &encoder.colliders(now, contact))?;
            }
            if self.options.contacts {
                sink(topics::CONTACTS, now, &encoder.arrows(now, contact))?;
            }
        }
        if patches_due && !frame.patches.is_empty() {
            let scene = self.patches.scene(now, frame.patches);
            sink(topics::PATCHES, now, &scene)?;
        }
        if strain_due && self.records_strain() {
            let colors = frame.strains.iter().map(|strains| {
                let strains = strains.iter();
                strains.map(|&strain| strain_color(strain)).collect()
            });
            let colors: Vec<Vec<[u8; 4]>> = colors.collect();
            let scene = self.strained.colored_scene(now, frame.patches, &colors);
            sink(topics::STRAIN, now, &scene)?;
        }
        if points_due {
            let cloud = self.skin.cloud(now, &[frame.skin]).encode_to_vec();
            sink(topics::SKIN_POINTS, now, &cloud)?;
            if !frame.patches.is_empty() {
                let cloud = self.patches.cloud(now, frame.patches).encode_to_vec();
                sink(topics::PATCH_POINTS, now, &cloud)?;
            }
        }
        if magnets_due && !frame.patches.is_empty() {
            let cloud = self.patches.cloud(now, frame.magnets).encode_to_vec();
            sink(topics::MAGNETS, now, &cloud)?;
        }
        if self.options.weights && !frame.weights.is_empty() {
            let values = series(frame.weights.iter().map(|&w| f64::from(w)));
            sink(topics::WEIGHTS, now, &values)?;
        }
        if !frame.stats.is_empty() {
            sink(topics::STATS, now, &series(frame.stats.iter().copied()))?;
        }
        for event in frame.events {
            sink(topics::LOG, now, &log_message(now, event))?;
        }
        self.frames += 1;
        Ok(())
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
        if self.options.magnets_hz > 0.0 {
            shape("magnets", self.info.patches.len(), frame.magnets.len())?;
            for (info, positions) in self.info.patches.iter().zip(frame.magnets) {
                surface(info, positions)?;
            }
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
}

/// An event as a message.
pub(super) fn log_message(now: u64, event: &LogEvent) -> Vec<u8> {
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
    message.encode_to_vec()
}
