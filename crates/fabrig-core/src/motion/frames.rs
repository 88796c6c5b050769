//! What every reader of frames does last: times checked, lost frames filled, a clip made.

use super::clip::Gap;
use super::{Clip, ClipNotes, ClipTracks, EyeAngles, HeadPose, MotionError};

/// Frames per second that a take may have; beyond them its times are taken for wrong ones.
pub(super) const RATES: [f64; 2] = [1.0, 240.0];

/// One frame as a file has it.
#[derive(Debug, Clone, Default)]
pub(super) struct FrameRow {
    /// Line of the file, or number of the frame; from 1.
    pub(super) line: usize,
    /// (s), from any start
    pub(super) time: f64,
    /// The tracker lost the face: what the frame says is not to be used.
    pub(super) is_lost: bool,
    /// One weight per channel; may be empty where the face is lost.
    pub(super) weights: Vec<f32>,
    pub(super) head: Option<HeadPose>,
    pub(super) eyes: Option<[EyeAngles; 2]>,
}

/// Frames of one file on their way to a clip.
pub(super) struct Frames<'a> {
    pub(super) name: &'a str,
    pub(super) channels: Vec<String>,
    pub(super) rows: Vec<FrameRow>,
    pub(super) notes: ClipNotes,
}

impl Frames<'_> {
    /// Makes the clip: times from 0, of rows at the same time the last, lost frames filled
    /// from those around them.
    pub(super) fn into_clip(mut self) -> Result<Clip, MotionError> {
        if self.rows.is_empty() {
            return Err(self.empty("there are no frames"));
        }
        self.keep_rising()?;
        let times: Vec<f64> = self.rows.iter().map(|row| row.time).collect();
        if let Some(rate) = usual_rate(&times) {
            // A hundredth of room for times that were rounded.
            if !(0.99 * RATES[0]..=1.01 * RATES[1]).contains(&rate) {
                return Err(MotionError::RateOutOfRange {
                    name: self.name.to_owned(),
                    found: rate,
                });
            }
        }
        self.notes.dropped_frames = dropped_frames(&times);
        self.notes.gaps = gaps(&self.rows);
        let found: Vec<&FrameRow> = self.rows.iter().filter(|row| !row.is_lost).collect();
        if found.is_empty() {
            return Err(self.empty("there is no frame in which the face was found"));
        }
        let tracks = ClipTracks {
            head: found.iter().filter_map(|row| row.head).collect(),
            eyes: found.iter().filter_map(|row| row.eyes).collect(),
            wind: Vec::new(),
        };
        let weights = found.iter().flat_map(|row| row.weights.iter().copied());
        let clip = Clip::new(
            found.iter().map(|row| row.time).collect(),
            self.channels,
            weights.collect(),
        );
        let clip = clip.and_then(|clip| clip.with_tracks(tracks));
        let clip = clip.map_err(|source| MotionError::Clip {
            name: self.name.to_owned(),
            source,
        })?;
        let clip = if found.len() == times.len() {
            clip
        } else {
            clip.sampled_at(times)
        };
        Ok(clip.with_notes(self.notes))
    }

    fn empty(&self, missing: &'static str) -> MotionError {
        MotionError::Empty {
            name: self.name.to_owned(),
            missing,
        }
    }

    fn keep_rising(&mut self) -> Result<(), MotionError> {
        let start = self.rows[0].time;
        let mut kept: Vec<FrameRow> = Vec::with_capacity(self.rows.len());
        for mut row in std::mem::take(&mut self.rows) {
            row.time -= start;
            match kept.last() {
                Some(last) if row.time < last.time => {
                    return Err(MotionError::TimeBackwards {
                        name: self.name.to_owned(),
                        row: row.line,
                        time: row.time,
                        previous: last.time,
                    });
                }
                Some(last) if row.time == last.time => {
                    kept.pop();
                    self.notes.duplicate_rows += 1;
                }
                _ => {}
            }
            kept.push(row);
        }
        self.rows = kept;
        Ok(())
    }
}

/// Runs of lost frames.
fn gaps(rows: &[FrameRow]) -> Vec<Gap> {
    rows.chunk_by(|a, b| a.is_lost == b.is_lost)
        .filter(|run| run[0].is_lost)
        .map(|run| Gap {
            start: run[0].time,
            end: run[run.len() - 1].time,
            frames: run.len(),
        })
        .collect()
}

fn usual_step(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len().saturating_sub(1) / 2).copied()
}

/// The usual number of frames per second; `None` for a single frame.
pub(super) fn usual_rate(times: &[f64]) -> Option<f64> {
    usual_step(times).map(|step| 1.0 / step)
}

/// Frames missing from a capture with an even step, judged by the median step.
fn dropped_frames(times: &[f64]) -> usize {
    let Some(usual) = usual_step(times) else {
        return 0;
    };
    times
        .windows(2)
        .map(|w| ((w[1] - w[0]) / usual).round() as usize)
        .map(|steps| steps.saturating_sub(1))
        .sum()
}
