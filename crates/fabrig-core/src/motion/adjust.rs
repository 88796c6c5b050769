//! Fitting a take to its performer: the neutral face taken off, gains, left and right.
//!
//! In this order:
//!
//! 1. left and right are exchanged: shapes, eyes, the head's yaw, roll and sideways place;
//! 2. the neutral `n` of each shape, its median over a stretch in which the performer rests,
//!    is taken off and the rest stretched to reach 1 again: `(w - n) / (1 - n)`, at least 0;
//! 3. weights are multiplied by gains, at most 1; a gain of `jawOpen` is `mouthClose`'s too
//!    unless that has its own;
//! 4. `mouthClose` is lowered to `jawOpen` where it is more. ARKit defines it as the closure of
//!    the lips independent of the jaw, measured with the jaw open; in real takes it follows
//!    `jawOpen` from below but for tracking noise (a range-of-motion take: at most 0.06 above).

use std::collections::BTreeMap;

use super::clip::ClipParts;
use super::{Clip, MotionError};
use crate::facs::{ARKIT_SHAPES, JAW_OPEN, MOUTH_CLOSE, match_shape, mirrored_shape, nearest_name};

/// A neutral this strong leaves nothing of a shape to be told from noise.
const MOST_NEUTRAL: f32 = 0.9;

/// How a take is fitted to its performer.
#[derive(Debug, Clone, PartialEq)]
pub struct Adjustment {
    /// Exchange left and right.
    pub swap_sides: bool,
    /// From when to when the performer's face is at rest. (s)
    pub neutral: Option<[f64; 2]>,
    /// Factors of weights, at least 0, by shape in any spelling; a name without a side means
    /// both, `all` every shape. Later ones win.
    pub gains: Vec<(String, f64)>,
    /// Keep `mouthClose` at most at `jawOpen`.
    pub limit_mouth_close: bool,
}

impl Default for Adjustment {
    fn default() -> Self {
        Self {
            swap_sides: false,
            neutral: None,
            gains: Vec::new(),
            limit_mouth_close: true,
        }
    }
}

impl Adjustment {
    /// Nothing is changed.
    pub fn none() -> Self {
        Self {
            limit_mouth_close: false,
            ..Self::default()
        }
    }

    /// Applies it to a clip; `name` stands for the take in errors.
    ///
    /// # Errors
    ///
    /// [`MotionError::Adjust`] where a gain names no shape or is no factor, where the neutral
    /// stretch has no frame, or where a shape is so strong in it that nothing is left.
    pub fn apply(&self, clip: Clip, name: &str) -> Result<Clip, MotionError> {
        let problem = |problem: String| MotionError::Adjust {
            name: name.to_owned(),
            problem,
        };
        let gains = self.gains_by_shape().map_err(problem)?;
        let mut parts = clip.into_parts();
        if self.swap_sides {
            swap_sides(&mut parts);
        }
        if let Some(stretch) = self.neutral {
            take_neutral_off(&mut parts, stretch).map_err(problem)?;
        }
        apply_gains(&mut parts, &gains);
        if self.limit_mouth_close {
            limit_mouth_close(&mut parts);
        }
        parts.into_clip().map_err(|source| MotionError::Clip {
            name: name.to_owned(),
            source,
        })
    }

    fn gains_by_shape(&self) -> Result<BTreeMap<usize, f64>, String> {
        let mut gains = BTreeMap::new();
        for (name, gain) in &self.gains {
            if !(gain.is_finite() && *gain >= 0.0) {
                return Err(format!(
                    "the gain {gain} of '{name}' is not a finite number of at least 0"
                ));
            }
            let shapes: Vec<usize> = match match_shape(name) {
                _ if name == "all" => (0..ARKIT_SHAPES.len()).collect(),
                Some(found) => found.shapes(),
                None => {
                    let nearest = nearest_name(name, ARKIT_SHAPES).unwrap_or_default();
                    return Err(format!(
                        "a gain is given for '{name}', which is no shape (nearest: '{nearest}')"
                    ));
                }
            };
            gains.extend(shapes.into_iter().map(|shape| (shape, *gain)));
        }
        if let Some(&gain) = gains.get(&JAW_OPEN) {
            gains.entry(MOUTH_CLOSE).or_insert(gain);
        }
        Ok(gains)
    }
}

/// For each channel the shape that it is.
fn shapes(parts: &ClipParts) -> Vec<Option<usize>> {
    let of = |name: &String| ARKIT_SHAPES.iter().position(|shape| shape == name);
    parts.channels.iter().map(of).collect()
}

fn swap_sides(parts: &mut ClipParts) {
    for (channel, shape) in shapes(parts).into_iter().enumerate() {
        if let Some(shape) = shape {
            parts.channels[channel] = ARKIT_SHAPES[mirrored_shape(shape)].to_owned();
        }
    }
    for head in &mut parts.tracks.head {
        head.yaw = -head.yaw;
        head.roll = -head.roll;
        head.translation.x = -head.translation.x;
    }
    for eyes in &mut parts.tracks.eyes {
        eyes.swap(0, 1);
        for eye in eyes {
            eye.yaw = -eye.yaw;
        }
    }
}

fn take_neutral_off(parts: &mut ClipParts, [from, to]: [f64; 2]) -> Result<(), String> {
    let start = parts.times[0];
    let frames: Vec<usize> = (0..parts.times.len())
        .filter(|&i| (from..=to).contains(&(parts.times[i] - start)))
        .collect();
    if frames.is_empty() {
        return Err(format!(
            "there is no frame from {from} s to {to} s to take the neutral face from; the take \
             is {:.3} s long",
            parts.times[parts.times.len() - 1] - start
        ));
    }
    let count = parts.channels.len();
    for channel in 0..count {
        let mut values: Vec<f32> = frames
            .iter()
            .map(|frame| parts.weights[frame * count + channel])
            .collect();
        values.sort_by(f32::total_cmp);
        let middle = values.len() / 2;
        let neutral = if values.len() % 2 == 1 {
            values[middle]
        } else {
            0.5 * (values[middle - 1] + values[middle])
        };
        let name = &parts.channels[channel];
        if neutral > MOST_NEUTRAL {
            return Err(format!(
                "'{name}' is {neutral:.2} where the face is said to be at rest; choose a \
                 stretch in which it rests"
            ));
        }
        if neutral > 0.0 {
            parts.notes.neutral.insert(name.clone(), neutral);
        }
        for row in parts.weights.chunks_mut(count) {
            row[channel] = ((row[channel] - neutral) / (1.0 - neutral)).clamp(0.0, 1.0);
        }
    }
    Ok(())
}

fn apply_gains(parts: &mut ClipParts, gains: &BTreeMap<usize, f64>) {
    let gains: Vec<f64> = shapes(parts)
        .into_iter()
        .map(|shape| shape.and_then(|s| gains.get(&s).copied()).unwrap_or(1.0))
        .collect();
    if gains.iter().all(|&g| g == 1.0) {
        return;
    }
    for row in parts.weights.chunks_mut(gains.len()) {
        for (weight, gain) in row.iter_mut().zip(&gains) {
            let scaled = f64::from(*weight) * gain;
            parts.notes.saturated_weights += usize::from(scaled > 1.0);
            *weight = scaled.min(1.0) as f32;
        }
    }
}

fn limit_mouth_close(parts: &mut ClipParts) {
    let place = |shape: usize| parts.channels.iter().position(|c| c == ARKIT_SHAPES[shape]);
    // Without a jaw channel there is nothing to say how far the jaw is open.
    let (Some(open), Some(close)) = (place(JAW_OPEN), place(MOUTH_CLOSE)) else {
        return;
    };
    for row in parts.weights.chunks_mut(parts.channels.len()) {
        if row[close] > row[open] {
            row[close] = row[open];
            parts.notes.limited_mouth_close += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{ClipTracks, EyeAngles, HeadPose};

    fn clip() -> Clip {
        let channels = ["eyeBlinkLeft", "jawOpen", "mouthClose"];
        Clip::new(
            vec![0.0, 0.1, 0.2],
            channels.map(str::to_owned).to_vec(),
            vec![0.2, 0.1, 0.0, 0.2, 0.1, 0.05, 0.6, 0.4, 0.5],
        )
        .unwrap()
        .with_tracks(ClipTracks {
            head: vec![
                HeadPose {
                    yaw: 0.1,
                    pitch: 0.2,
                    ..HeadPose::default()
                };
                3
            ],
            eyes: vec![
                [
                    EyeAngles {
                        yaw: 0.3,
                        pitch: 0.1
                    },
                    EyeAngles::default()
                ];
                3
            ],
            ..ClipTracks::default()
        })
        .unwrap()
    }

    fn close(found: &[f32], expected: &[f32]) {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn mouth_close_is_the_jaws_corrective() {
        let clip = Adjustment::default().apply(clip(), "x").unwrap();
        close(
            clip.weights(),
            &[0.2, 0.1, 0.0, 0.2, 0.1, 0.05, 0.6, 0.4, 0.4],
        );
        assert_eq!(clip.notes().limited_mouth_close, 1);
        let gained = Adjustment {
            gains: vec![("JawOpen".to_owned(), 0.5)],
            ..Adjustment::none()
        };
        let clip = gained.apply(self::clip(), "x").unwrap();
        close(&clip.weights()[6..], &[0.6, 0.2, 0.25]);
    }

    #[test]
    fn the_neutral_is_taken_off_and_the_rest_stretched() {
        let adjustment = Adjustment {
            neutral: Some([0.0, 0.15]),
            ..Adjustment::none()
        };
        let clip = adjustment.apply(clip(), "x").unwrap();
        close(&clip.weights()[..2], &[0.0, 0.0]);
        close(&clip.weights()[6..8], &[0.5, 0.3 / 0.9]);
        assert_eq!(clip.notes().neutral["eyeBlinkLeft"], 0.2);
    }

    #[test]
    fn sides_are_exchanged_wholly_and_back() {
        let swap = Adjustment {
            swap_sides: true,
            ..Adjustment::none()
        };
        let swapped = swap.apply(clip(), "x").unwrap();
        assert_eq!(swapped.channels()[0], "eyeBlinkRight");
        let head = swapped.tracks().head[0];
        assert_eq!((head.yaw, head.pitch), (-0.1, 0.2));
        assert_eq!(swapped.tracks().eyes[0][1].yaw, -0.3);
        assert_eq!(swap.apply(swapped, "x").unwrap(), clip());
    }

    #[test]
    fn what_cannot_be_done_is_said() {
        let cases = [
            (
                Adjustment {
                    gains: vec![("jawOpne".into(), 1.0)],
                    ..Adjustment::none()
                },
                "jawOpen",
            ),
            (
                Adjustment {
                    gains: vec![("jawOpen".into(), -1.0)],
                    ..Adjustment::none()
                },
                "-1",
            ),
            (
                Adjustment {
                    neutral: Some([5.0, 6.0]),
                    ..Adjustment::none()
                },
                "0.200 s long",
            ),
        ];
        for (adjustment, part) in cases {
            let error = adjustment.apply(clip(), "x").unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let strong = Clip::new(vec![0.0], vec!["jawOpen".into()], vec![0.95]).unwrap();
        let neutral = Adjustment {
            neutral: Some([0.0, 1.0]),
            ..Adjustment::none()
        };
        assert!(
            neutral
                .apply(strong, "x")
                .unwrap_err()
                .to_string()
                .contains("at rest")
        );
    }
}
