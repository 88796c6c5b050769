//! A take in memory: frames at rising times, and what lies between them.

use super::frames::{RATES, usual_rate};
use super::interpolate::{Tangents, find_span, interpolate};
use super::pose::{EyeAngles, HeadPose};
use crate::Vector;

/// A clip's parts do not fit together.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ClipError {
    /// There is no frame.
    #[error("a clip needs at least one frame")]
    Empty,
    /// A list has not one entry per frame (or per frame and channel).
    #[error("expected {expected} {what}, got {found}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// Times must be finite and rise.
    #[error("frame {frame} is at {time} s, which does not come after {previous} s")]
    TimeNotRising {
        /// The frame, from 0.
        frame: usize,
        /// Its time. (s)
        time: f64,
        /// The time of the frame before it. (s)
        previous: f64,
    },
    /// A weight is NaN, infinite, or outside [0, 1].
    #[error("frame {frame} has the weight {found} for '{channel}'; weights lie in [0, 1]")]
    WeightOutOfRange {
        /// The frame, from 0.
        frame: usize,
        /// The channel.
        channel: String,
        /// Its weight.
        found: f32,
    },
    /// Two channels have the same name.
    #[error("channel '{channel}' appears twice")]
    DuplicateChannel {
        /// Its name.
        channel: String,
    },
    /// A cut that leaves nothing of the clip.
    #[error("the take lasts from {start} to {end} s; nothing of it is from {from} to {to} s")]
    Cut {
        /// Where the cut begins. (s)
        from: f64,
        /// Where it ends. (s)
        to: f64,
        /// Where the clip begins. (s)
        start: f64,
        /// Where it ends. (s)
        end: f64,
    },
    /// A frame rate that no take has.
    #[error("{found} frames per second are asked for; a take has 1 to 240")]
    Rate {
        /// The rate. (1/s)
        found: f64,
    },
    /// A speed at which no take can be played.
    #[error("a take that starts at {start} s cannot be played {speed} times as fast")]
    Speed {
        /// Where it was to start. (s)
        start: f64,
        /// How fast.
        speed: f64,
    },
    /// A head, eye or wind value is not finite.
    #[error("frame {frame} has a {what} value that is not finite")]
    NotFinite {
        /// The frame, from 0.
        frame: usize,
        /// `head`, `eye` or `wind`.
        what: &'static str,
    },
}

/// What reading a take had to decide; nothing of it happens unsaid.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ClipNotes {
    /// Weights a little outside [0, 1] that were clamped.
    pub clamped_weights: usize,
    /// Rows that repeated the time of the row before them and replaced it.
    pub duplicate_rows: usize,
    /// Frames that the capture dropped, judged by the usual step; the clip bridges them.
    pub dropped_frames: usize,
    /// Columns that were passed over: on request, or because others say the same better.
    pub ignored_columns: Vec<String>,
    /// Frames in which the face was lost, filled from those around them.
    pub gaps: Vec<Gap>,
    /// Rows of faces other than the first.
    pub other_faces: usize,
    /// Weights that a gain took beyond 1.
    pub saturated_weights: usize,
    /// Weights of `mouthClose` that were lowered to `jawOpen`'s.
    pub limited_mouth_close: usize,
    /// The rest of the captured face that was taken off, by shape; empty where none was.
    pub neutral: std::collections::BTreeMap<String, f32>,
}

/// Frames in which the tracker lost the face.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gap {
    /// Time of the first of them. (s)
    pub start: f64,
    /// Time of the last. (s)
    pub end: f64,
    /// How many there are.
    pub frames: usize,
}

/// Parts of a clip beside its weights. Each list is empty or has one entry per frame.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ClipTracks {
    /// Pose of the head.
    pub head: Vec<HeadPose>,
    /// Left eye, right eye.
    pub eyes: Vec<[EyeAngles; 2]>,
    /// Velocity of the air in the world frame. (mm/s)
    pub wind: Vec<Vector>,
}

/// Weights of named shapes over time, with head, eyes and wind where the take has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    times: Vec<f64>,
    channels: Vec<String>,
    weights: Vec<f32>,
    tracks: ClipTracks,
    notes: ClipNotes,
}

/// A clip taken apart.
pub(super) struct ClipParts {
    pub(super) times: Vec<f64>,
    pub(super) channels: Vec<String>,
    pub(super) weights: Vec<f32>,
    pub(super) tracks: ClipTracks,
    pub(super) notes: ClipNotes,
}

impl ClipParts {
    /// The clip again.
    pub(super) fn into_clip(self) -> Result<Clip, ClipError> {
        let clip = Clip::new(self.times, self.channels, self.weights)?;
        Ok(clip.with_tracks(self.tracks)?.with_notes(self.notes))
    }
}

/// The values of a clip at one time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sample {
    /// One weight per channel, in [0, 1].
    pub weights: Vec<f32>,
    /// Their rates of change. (1/s)
    pub rates: Vec<f32>,
    /// Pose of the head; at rest where the take has none.
    pub head: HeadPose,
    /// Left eye, right eye, where the take has them.
    pub eyes: Option<[EyeAngles; 2]>,
    /// Velocity of the air in the world frame. (mm/s)
    pub wind: Vector,
}

impl Clip {
    /// Checks and takes frames.
    ///
    /// - `times`: rising. (s), shape `[frame_count]`
    /// - `channels`: names of shapes
    /// - `weights`: row-major, shape [frame_count, channel_count], in [0, 1]
    ///
    /// # Errors
    ///
    /// [`ClipError`] with the frame and channel.
    pub fn new(
        times: Vec<f64>,
        channels: Vec<String>,
        weights: Vec<f32>,
    ) -> Result<Self, ClipError> {
        if times.is_empty() {
            return Err(ClipError::Empty);
        }
        for (frame, &time) in times.iter().enumerate() {
            let previous = if frame == 0 {
                f64::NEG_INFINITY
            } else {
                times[frame - 1]
            };
            if !time.is_finite() || time <= previous {
                return Err(ClipError::TimeNotRising {
                    frame,
                    time,
                    previous,
                });
            }
        }
        for (i, channel) in channels.iter().enumerate() {
            if channels[..i].contains(channel) {
                return Err(ClipError::DuplicateChannel {
                    channel: channel.clone(),
                });
            }
        }
        let expected = times.len() * channels.len();
        if weights.len() != expected {
            return Err(ClipError::Count {
                what: "weights, one per frame and channel",
                expected,
                found: weights.len(),
            });
        }
        if let Some(i) = weights.iter().position(|w| !(0.0..=1.0).contains(w)) {
            return Err(ClipError::WeightOutOfRange {
                frame: i / channels.len(),
                channel: channels[i % channels.len()].clone(),
                found: weights[i],
            });
        }
        Ok(Self {
            times,
            channels,
            weights,
            tracks: ClipTracks::default(),
            notes: ClipNotes::default(),
        })
    }

    /// Adds head, eyes and wind.
    ///
    /// Head angles are unwrapped: a step of more than half a turn becomes the short way.
    ///
    /// # Errors
    ///
    /// [`ClipError`] when a list has not one finite entry per frame.
    pub fn with_tracks(mut self, mut tracks: ClipTracks) -> Result<Self, ClipError> {
        for (what, found) in [
            ("head poses, one per frame", tracks.head.len()),
            ("pairs of eye angles, one per frame", tracks.eyes.len()),
            ("wind velocities, one per frame", tracks.wind.len()),
        ] {
            if found != 0 && found != self.times.len() {
                return Err(ClipError::Count {
                    what,
                    expected: self.times.len(),
                    found,
                });
            }
        }
        let head = tracks.head.iter().position(|h| {
            !(h.yaw.is_finite()
                && h.pitch.is_finite()
                && h.roll.is_finite()
                && h.translation.iter().all(|c| c.is_finite()))
        });
        let eyes = tracks.eyes.iter().position(|pair| {
            pair.iter()
                .any(|e| !(e.yaw.is_finite() && e.pitch.is_finite()))
        });
        let wind = tracks
            .wind
            .iter()
            .position(|w| !w.iter().all(|c| c.is_finite()));
        for (what, bad) in [("head", head), ("eye", eyes), ("wind", wind)] {
            if let Some(frame) = bad {
                return Err(ClipError::NotFinite { frame, what });
            }
        }
        for k in 1..tracks.head.len() {
            let before = tracks.head[k - 1];
            let pose = &mut tracks.head[k];
            pose.yaw = unwrapped(pose.yaw, before.yaw);
            pose.pitch = unwrapped(pose.pitch, before.pitch);
            pose.roll = unwrapped(pose.roll, before.roll);
        }
        self.tracks = tracks;
        Ok(self)
    }

    /// Adds what reading had to decide.
    pub fn with_notes(mut self, notes: ClipNotes) -> Self {
        self.notes = notes;
        self
    }

    /// Times of the frames. (s), rising
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Names of the shapes.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// Weights, row-major, shape [frame_count, channel_count].
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Head, eyes and wind.
    pub fn tracks(&self) -> &ClipTracks {
        &self.tracks
    }

    /// What reading had to decide.
    pub fn notes(&self) -> &ClipNotes {
        &self.notes
    }

    /// How many frames there are.
    pub fn frame_count(&self) -> usize {
        self.times.len()
    }

    /// Time from the first to the last frame. (s)
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }

    /// The usual number of frames per second; `None` for a single frame.
    pub fn frame_rate(&self) -> Option<f64> {
        usual_rate(&self.times)
    }

    /// The clip at even times, `rate` frames per second, by its own interpolation: weights
    /// stay in [0, 1], notes stay.
    ///
    /// # Errors
    ///
    /// [`ClipError::Rate`] where `rate` is not from 1 to 240.
    pub fn resampled(&self, rate: f64) -> Result<Self, ClipError> {
        if !(RATES[0]..=RATES[1]).contains(&rate) {
            return Err(ClipError::Rate { found: rate });
        }
        // Room for rounding, so that a clip of whole frames keeps its last one.
        let steps = (self.duration() * rate + 1e-6).floor() as usize;
        let start = self.times[0];
        Ok(self.sampled_at((0..=steps).map(|i| start + i as f64 / rate).collect()))
    }

    /// The part of the clip from `from` to `to` (s on the clip's own time axis, as far as it
    /// goes): its frames there, and one at each end.
    ///
    /// # Errors
    ///
    /// [`ClipError::Cut`] where that is less than two frames of a clip that has them.
    pub fn cut(&self, from: f64, to: f64) -> Result<Self, ClipError> {
        let (start, end) = (self.times[0], self.times[self.times.len() - 1]);
        let (first, last) = (from.max(start), to.min(end));
        // False for NaN too.
        let is_something = first < last;
        if !is_something {
            return Err(ClipError::Cut {
                from,
                to,
                start,
                end,
            });
        }
        let inner = self.times.iter().copied();
        let inner = inner.filter(|time| first < *time && *time < last);
        let times = std::iter::once(first).chain(inner).chain([last]);
        Ok(self.sampled_at(times.collect()))
    }

    /// The clip with its first frame at `start` (s), played `speed` times as fast; the take's own
    /// wind stays what it is.
    ///
    /// # Errors
    ///
    /// [`ClipError::Speed`] where `speed` is not a positive number or `start` not finite.
    pub fn retimed(&self, start: f64, speed: f64) -> Result<Self, ClipError> {
        if !(speed.is_finite() && speed > 0.0 && start.is_finite()) {
            return Err(ClipError::Speed { start, speed });
        }
        let first = self.times[0];
        let times = self.times.iter().map(|time| start + (time - first) / speed);
        Ok(Self {
            times: times.collect(),
            ..self.clone()
        })
    }

    /// The clip's values at other times (rising).
    pub(super) fn sampled_at(&self, times: Vec<f64>) -> Self {
        let mut sample = Sample::default();
        let mut weights = Vec::with_capacity(times.len() * self.channels.len());
        let mut tracks = ClipTracks::default();
        for &time in &times {
            self.sample_into(time, &mut sample);
            weights.extend_from_slice(&sample.weights);
            if !self.tracks.head.is_empty() {
                tracks.head.push(sample.head);
            }
            tracks.eyes.extend(sample.eyes);
            if !self.tracks.wind.is_empty() {
                tracks.wind.push(sample.wind);
            }
        }
        // Interpolation is in f64; a weight may round to just outside.
        for weight in &mut weights {
            *weight = weight.clamp(0.0, 1.0);
        }
        Self {
            times,
            channels: self.channels.clone(),
            weights,
            tracks,
            notes: self.notes.clone(),
        }
    }

    /// The clip with its channels, weights and tracks taken out, to be changed and put back
    /// by [`Self::new`].
    pub(super) fn into_parts(self) -> ClipParts {
        ClipParts {
            times: self.times,
            channels: self.channels,
            weights: self.weights,
            tracks: self.tracks,
            notes: self.notes,
        }
    }

    /// For each of `names` the channel that drives it.
    pub fn channel_indices(&self, names: &[&str]) -> Vec<Option<usize>> {
        names
            .iter()
            .map(|name| self.channels.iter().position(|channel| channel == name))
            .collect()
    }

    /// The values at `time` (s) on the clip's own time axis; before the first and after the
    /// last frame those hold.
    pub fn sample(&self, time: f64) -> Sample {
        let mut sample = Sample::default();
        self.sample_into(time, &mut sample);
        sample
    }

    /// [`Self::sample`] without allocating.
    ///
    /// Weights are cubic Hermite with limited tangents, so they stay in [0, 1]; head and eyes
    /// go through three frames, so that a turning head has no corners.
    pub fn sample_into(&self, time: f64, sample: &mut Sample) {
        let span = find_span(&self.times, time);
        let channel_count = self.channels.len();
        sample.weights.resize(channel_count, 0.0);
        sample.rates.resize(channel_count, 0.0);
        for channel in 0..channel_count {
            let value = |frame: usize| f64::from(self.weights[frame * channel_count + channel]);
            let w = interpolate(&self.times, value, span, Tangents::Limited);
            sample.weights[channel] = w.value as f32;
            sample.rates[channel] = w.rate as f32;
        }
        let smooth = |value: &dyn Fn(usize) -> f64| {
            interpolate(&self.times, value, span, Tangents::Parabolic).value
        };
        let ClipTracks { head, eyes, wind } = &self.tracks;
        sample.head = if head.is_empty() {
            HeadPose::default()
        } else {
            HeadPose {
                yaw: smooth(&|k| head[k].yaw),
                pitch: smooth(&|k| head[k].pitch),
                roll: smooth(&|k| head[k].roll),
                translation: Vector::from_fn(|axis, _| smooth(&|k| head[k].translation[axis])),
            }
        };
        sample.eyes = (!eyes.is_empty()).then(|| {
            [0, 1].map(|eye| EyeAngles {
                yaw: smooth(&|k| eyes[k][eye].yaw),
                pitch: smooth(&|k| eyes[k][eye].pitch),
            })
        });
        sample.wind = if wind.is_empty() {
            Vector::zeros()
        } else {
            // Limited: a gust does not blow backwards before it starts.
            Vector::from_fn(|axis, _| {
                interpolate(&self.times, |k| wind[k][axis], span, Tangents::Limited).value
            })
        };
    }
}

/// The angle equal to `angle` up to whole turns that is nearest to `reference`.
fn unwrapped(angle: f64, reference: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * ((angle - reference) / turn).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip() -> Clip {
        Clip::new(
            vec![0.0, 0.1, 0.2],
            vec!["jawOpen".into(), "mouthPucker".into()],
            vec![0.0, 1.0, 0.5, 1.0, 0.25, 0.0],
        )
        .unwrap()
    }

    #[test]
    fn samples_meet_the_frames() {
        let clip = clip();
        assert_eq!(clip.sample(0.1).weights, [0.5, 1.0]);
        assert_eq!(clip.sample(7.0).weights, [0.25, 0.0]);
        let between = clip.sample(0.05);
        assert!(between.weights[0] > 0.2 && between.weights[0] < 0.4);
        assert!(between.rates[0] > 0.0 && between.rates[1] == 0.0);
        assert_eq!(between.head, HeadPose::default());
        assert!(clip.frame_rate().is_some_and(|f| (f - 10.0).abs() < 1e-9));
        assert_eq!(
            clip.channel_indices(&["mouthPucker", "tongueOut"]),
            [Some(1), None]
        );
    }

    #[test]
    fn resampling_meets_the_clip_and_keeps_its_end() {
        let clip = clip()
            .with_tracks(ClipTracks {
                wind: vec![Vector::zeros(), Vector::x(), Vector::zeros()],
                ..ClipTracks::default()
            })
            .unwrap();
        let fine = clip.resampled(60.0).unwrap();
        assert_eq!(fine.frame_count(), 13);
        assert_eq!(fine.sample(0.05).weights, clip.sample(0.05).weights);
        assert_eq!(fine.weights()[24..], [0.25, 0.0]);
        assert_eq!(fine.tracks().wind[6], Vector::x());
        for rate in [0.5, 241.0, f64::NAN] {
            assert!(matches!(clip.resampled(rate), Err(ClipError::Rate { .. })));
        }
    }

    #[test]
    fn head_angles_take_the_short_way_round() {
        let pose = |yaw| HeadPose {
            yaw,
            ..HeadPose::default()
        };
        let clip = clip()
            .with_tracks(ClipTracks {
                head: vec![pose(3.1), pose(-3.1), pose(-3.0)],
                ..ClipTracks::default()
            })
            .unwrap();
        let yaw = clip.sample(0.05).head.yaw;
        assert!(yaw > 3.1 && yaw < 3.2, "{yaw}");
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let new = |times: &[f64], weights: &[f32]| {
            Clip::new(times.to_vec(), vec!["jawOpen".into()], weights.to_vec())
        };
        assert_eq!(new(&[], &[]), Err(ClipError::Empty));
        for times in [[0.0, 0.0], [1.0, 0.5], [0.0, f64::NAN]] {
            assert!(matches!(
                new(&times, &[0.0, 0.0]),
                Err(ClipError::TimeNotRising { frame: 1, .. })
            ));
        }
        assert!(matches!(new(&[0.0], &[]), Err(ClipError::Count { .. })));
        for bad in [f32::NAN, -0.01, 1.01] {
            assert!(matches!(
                new(&[0.0, 1.0], &[0.0, bad]),
                Err(ClipError::WeightOutOfRange { frame: 1, .. })
            ));
        }
        assert!(matches!(
            Clip::new(vec![0.0], vec!["a".into(), "a".into()], vec![0.0; 2]),
            Err(ClipError::DuplicateChannel { .. })
        ));
        assert!(matches!(
            clip().with_tracks(ClipTracks {
                wind: vec![Vector::zeros(); 2],
                ..ClipTracks::default()
            }),
            Err(ClipError::Count {
                expected: 3,
                found: 2,
                ..
            })
        ));
    }
}
