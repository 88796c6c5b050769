//! A take as a few keys in a text file that a person writes.
//!
//! ```text
//! fabrig-keys 1
//! fps 60                                   # frames per second of the clip; 60 if absent
//! 0.5  mouthSmile=0                        # time (s), then channel=value ...
//! 0.9  mouthSmile=0.8 jawOpen=0.2          # a name without its side sets both sides
//! 1.4  mouthSmile=0.8 hold                 # how the segment that ends here goes
//! 2.0  mouthSmile=0 jawOpen=0 linear
//! 2.5  head.yaw=12 head.pitch=-4           # degrees
//! 3.0  wind.x=9                            # metres per second
//! 9.0  end                                 # holds everything until here
//! ```
//!
//! Channels are ARKit's shapes in any spelling and FACS action units, `AU12` or one side of it
//! `AU12.l` (0 to 1; what units do to the shapes adds to the shapes' own), `head.yaw`, `head.pitch`,
//! `head.roll` (degrees, signs as in [`HeadPose`]), `head.x`, `head.y`, `head.z` (mm) and
//! `wind.x`, `wind.y`, `wind.z` (m/s, head frame axes at rest). Every channel is at 0 at time
//! 0 unless a key says otherwise, and holds its last value. A segment is `smooth` (3s² - 2s³)
//! unless the line of the key that ends it says `linear`, or `hold`: the old value stays and
//! the new one comes at the key.

use std::collections::BTreeMap;

use super::read::ReadOptions;
use super::units::UnitChannels;
use super::{Clip, ClipTracks, HeadPose, MotionError};
use crate::Vector;
use crate::facs::{ARKIT_SHAPES, Side, match_shape, match_unit, nearest_name};

/// First word of every keyed take.
pub(super) const MAGIC: &str = "fabrig-keys";

const VERSION: &str = "1";
const DEFAULT_RATE: f64 = 60.0;
/// Longer clips are refused: a mistyped time should not take all memory.
const MAX_FRAMES: f64 = 1e6;
const MM_PER_M: f64 = 1000.0;

/// Channels beside the shapes, in the order of [`Channel::Other`].
const OTHER_CHANNELS: [&str; 9] = [
    "head.yaw",
    "head.pitch",
    "head.roll",
    "head.x",
    "head.y",
    "head.z",
    "wind.x",
    "wind.y",
    "wind.z",
];
/// Where the wind begins in [`OTHER_CHANNELS`].
const FIRST_WIND: usize = 6;

/// Shapes sort before the others, in ARKit's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Channel {
    Shape(usize),
    /// Number of an action unit, and whether this is its right side.
    Unit(u32, bool),
    Other(usize),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ease {
    Smooth,
    Linear,
    Hold,
}

impl Ease {
    fn parse(word: &str) -> Option<Self> {
        match word {
            "smooth" => Some(Self::Smooth),
            "linear" => Some(Self::Linear),
            "hold" => Some(Self::Hold),
            _ => None,
        }
    }

    fn apply(self, s: f64) -> f64 {
        match self {
            Self::Smooth => s * s * (3.0 - 2.0 * s),
            Self::Linear => s,
            Self::Hold => 0.0,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Key {
    time: f64,
    value: f64,
    /// How the segment that ends at this key goes.
    ease: Ease,
}

/// Reads a keyed take; `name` stands for the file in errors.
///
/// # Errors
///
/// [`MotionError::Keys`] with the line.
pub fn parse_keys(text: &str, name: &str) -> Result<Clip, MotionError> {
    parse_keys_with(text, name, &ReadOptions::default())
}

/// [`parse_keys`] with the action units of the options.
pub(super) fn parse_keys_with(
    text: &str,
    name: &str,
    options: &ReadOptions,
) -> Result<Clip, MotionError> {
    let mut take = KeyedTake::default();
    let mut has_header = false;
    let mut last_line = 0;
    for (index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        last_line = index + 1;
        let result = if has_header {
            take.line(content)
        } else {
            has_header = true;
            check_header(content)
        };
        result.map_err(|problem| MotionError::Keys {
            name: name.to_owned(),
            line: index + 1,
            problem,
        })?;
    }
    take.into_clip(name, last_line, options)
}

fn check_header(content: &str) -> Result<(), String> {
    let mut words = content.split_whitespace();
    if words.next() != Some(MAGIC) {
        return Err(format!("the first line must be '{MAGIC} {VERSION}'"));
    }
    match words.next() {
        Some(VERSION) => Ok(()),
        Some(found) => Err(format!(
            "version {found} is not known; this reads version {VERSION}"
        )),
        None => Err(format!("the first line must be '{MAGIC} {VERSION}'")),
    }
}

#[derive(Default)]
struct KeyedTake {
    rate: Option<f64>,
    end: f64,
    keys: BTreeMap<Channel, Vec<Key>>,
}

impl KeyedTake {
    fn line(&mut self, content: &str) -> Result<(), String> {
        let mut words = content.split_whitespace();
        let first = words.next().unwrap_or_default();
        if first == "fps" {
            let value = words.next().unwrap_or_default();
            let rate: f64 = value
                .parse()
                .map_err(|_| format!("fps '{value}' is not a number"))?;
            if !(rate.is_finite() && rate > 0.0) {
                return Err(format!("fps {rate} is not a frame rate"));
            }
            self.rate = Some(rate);
            return Ok(());
        }
        let time: f64 = first
            .parse()
            .map_err(|_| format!("'{first}' is not a time in seconds"))?;
        if !(time.is_finite() && time >= 0.0) {
            return Err(format!("the time {first} is not finite and at least 0"));
        }
        self.end = self.end.max(time);
        let words: Vec<&str> = words.collect();
        let mut ease = Ease::Smooth;
        for word in &words {
            if let Some(found) = Ease::parse(word) {
                ease = found;
            }
        }
        for word in words {
            if word == "end" || Ease::parse(word).is_some() {
                continue;
            }
            let (channel, value) = word.split_once('=').ok_or_else(|| {
                format!("'{word}' is neither channel=value nor smooth, linear, hold or end")
            })?;
            let value: f64 = value
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| format!("'{value}' is not a finite number"))?;
            for channel in channels(channel)? {
                self.add(channel, Key { time, value, ease })?;
            }
        }
        Ok(())
    }

    fn add(&mut self, channel: Channel, key: Key) -> Result<(), String> {
        let is_weight = !matches!(channel, Channel::Other(_));
        if is_weight && !(0.0..=1.0).contains(&key.value) {
            return Err(format!(
                "{} = {}: weights lie in [0, 1]",
                channel_name(channel),
                key.value
            ));
        }
        let rest = Key {
            time: 0.0,
            value: 0.0,
            ease: Ease::Smooth,
        };
        let keys = self.keys.entry(channel).or_default();
        match keys.last() {
            None if key.time > 0.0 => keys.push(rest),
            Some(last) if last.time >= key.time => {
                return Err(format!(
                    "{} already has a key at {} s, not before {} s",
                    channel_name(channel),
                    last.time,
                    key.time
                ));
            }
            _ => {}
        }
        keys.push(key);
        Ok(())
    }

    fn into_clip(
        self,
        name: &str,
        last_line: usize,
        options: &ReadOptions,
    ) -> Result<Clip, MotionError> {
        let problem = |problem: String| MotionError::Keys {
            name: name.to_owned(),
            line: last_line,
            problem,
        };
        if self.keys.is_empty() {
            return Err(problem("the take has no keys".to_owned()));
        }
        let rate = self.rate.unwrap_or(DEFAULT_RATE);
        let step_count = (self.end * rate).ceil();
        if step_count >= MAX_FRAMES {
            return Err(problem(format!(
                "{} s at {rate} frames per second are more than {MAX_FRAMES} frames",
                self.end
            )));
        }
        let times: Vec<f64> = (0..=step_count as usize).map(|i| i as f64 / rate).collect();
        let units = self.units(name, options, &problem)?;
        let mut shapes: Vec<usize> = self
            .keys
            .keys()
            .filter_map(|channel| match channel {
                Channel::Shape(shape) => Some(*shape),
                Channel::Unit(..) | Channel::Other(_) => None,
            })
            .chain(units.iter().flat_map(|(channels, _)| channels.shapes()))
            .collect();
        shapes.sort_unstable();
        shapes.dedup();
        let has = |range: std::ops::Range<usize>| {
            self.keys
                .keys()
                .any(|c| matches!(c, Channel::Other(o) if range.contains(o)))
        };
        let has_head = has(0..FIRST_WIND);
        let has_wind = has(FIRST_WIND..OTHER_CHANNELS.len());

        let mut weights = Vec::with_capacity(times.len() * shapes.len());
        let mut tracks = ClipTracks::default();
        for &time in &times {
            let mut others = [0.0; OTHER_CHANNELS.len()];
            let mut row = [0.0f32; ARKIT_SHAPES.len()];
            if let Some((channels, bound)) = &units {
                let mut intensities = channels.rest();
                for (channel, unit, side) in bound {
                    let value = value_at(&self.keys[channel], time) as f32;
                    UnitChannels::set(&mut intensities[*unit], Some(*side), value);
                }
                row.copy_from_slice(&channels.weights(name, &intensities)?);
            }
            for (channel, keys) in &self.keys {
                let value = value_at(keys, time);
                match channel {
                    Channel::Shape(shape) => row[*shape] = (row[*shape] + value as f32).min(1.0),
                    Channel::Unit(..) => {}
                    Channel::Other(other) => others[*other] = value,
                }
            }
            weights.extend(shapes.iter().map(|&shape| row[shape]));
            let [yaw, pitch, roll, x, y, z, wind @ ..] = others;
            if has_head {
                tracks.head.push(HeadPose {
                    yaw: yaw.to_radians(),
                    pitch: pitch.to_radians(),
                    roll: roll.to_radians(),
                    translation: Vector::new(x, y, z),
                });
            }
            if has_wind {
                tracks.wind.push(Vector::from(wind) * MM_PER_M);
            }
        }
        let channels = shapes.iter().map(|&s| ARKIT_SHAPES[s].to_owned()).collect();
        Clip::new(times, channels, weights)
            .and_then(|clip| clip.with_tracks(tracks))
            .map_err(|source| MotionError::Clip {
                name: name.to_owned(),
                source,
            })
    }
}

/// The units of a take: each channel with its unit in the table and its side.
type BoundUnits = (UnitChannels, Vec<(Channel, usize, Side)>);

impl KeyedTake {
    fn units(
        &self,
        name: &str,
        options: &ReadOptions,
        problem: &dyn Fn(String) -> MotionError,
    ) -> Result<Option<BoundUnits>, MotionError> {
        let keyed: Vec<Channel> = (self.keys.keys().copied())
            .filter(|channel| matches!(channel, Channel::Unit(..)))
            .collect();
        if keyed.is_empty() {
            return Ok(None);
        }
        let mut channels = UnitChannels::new(name, options)?;
        let mut bound = Vec::with_capacity(keyed.len());
        for channel in keyed {
            let Channel::Unit(number, is_right) = channel else {
                continue;
            };
            let Some(unit) = channels.unit(number) else {
                return Err(problem(format!(
                    "AU{number} is not in the table of action units (nearest: '{}')",
                    channels.nearest(&format!("AU{number}"))
                )));
            };
            let side = if is_right { Side::Right } else { Side::Left };
            bound.push((channel, unit, side));
        }
        Ok(Some((channels, bound)))
    }
}

fn channel_name(channel: Channel) -> String {
    match channel {
        Channel::Shape(shape) => ARKIT_SHAPES[shape].to_owned(),
        Channel::Unit(number, is_right) => {
            format!("AU{number}.{}", if is_right { 'r' } else { 'l' })
        }
        Channel::Other(other) => OTHER_CHANNELS[other].to_owned(),
    }
}

fn channels(name: &str) -> Result<Vec<Channel>, String> {
    if let Some(other) = OTHER_CHANNELS.iter().position(|o| *o == name) {
        return Ok(vec![Channel::Other(other)]);
    }
    if let Some(unit) = match_unit(name).filter(|unit| unit.suffix != "c") {
        let sides = match unit.side {
            Some(Side::Left) => vec![false],
            Some(Side::Right) => vec![true],
            None => vec![false, true],
        };
        let channel = |is_right| Channel::Unit(unit.number, is_right);
        return Ok(sides.into_iter().map(channel).collect());
    }
    match match_shape(name) {
        Some(found) => Ok(found.shapes().into_iter().map(Channel::Shape).collect()),
        None => {
            let known = ARKIT_SHAPES.into_iter().chain(OTHER_CHANNELS);
            let nearest = nearest_name(name, known).unwrap_or_default();
            Err(format!("'{name}' is no channel (nearest: '{nearest}')"))
        }
    }
}

/// Value of rising keys at `time`.
fn value_at(keys: &[Key], time: f64) -> f64 {
    let next = keys.partition_point(|key| key.time <= time);
    if next == 0 {
        return keys.first().map_or(0.0, |key| key.value);
    }
    let from = keys[next - 1];
    let Some(to) = keys.get(next) else {
        return from.value;
    };
    let s = (time - from.time) / (to.time - from.time);
    from.value + (to.value - from.value) * to.ease.apply(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_ease_hold_and_end() {
        let clip = parse_keys(
            "# a take\nfabrig-keys 1\nfps 100\n\
             1.0 mouthSmile=0.8 head.yaw=90 wind.z=-2\n\
             2.0 mouthSmileLeft=0.4 linear\n\
             3.0 mouthSmileLeft=1 hold   # jumps at 3 s\n\
             4.0 end\n",
            "take.keys",
        )
        .unwrap();
        assert_eq!(clip.channels(), ["mouthSmileLeft", "mouthSmileRight"]);
        assert_eq!((clip.frame_count(), clip.duration()), (401, 4.0));
        let at = |time: f64| clip.sample(time).weights;
        assert!((at(0.25)[0] - 0.8 * (0.1875 - 0.03125)).abs() < 1e-6);
        assert!((at(1.5)[0] - 0.6).abs() < 1e-6);
        assert_eq!(at(2.99)[0], 0.4);
        assert_eq!(at(3.0)[0], 1.0);
        assert_eq!(at(4.0), [1.0, 0.8]);
        let head = clip.sample(0.5).head;
        assert!((head.yaw - 45f64.to_radians()).abs() < 1e-9);
        assert!((clip.sample(1.0).wind.z + 2000.0).abs() < 1e-9);
    }

    #[test]
    fn action_units_have_sides_and_add_to_shapes() {
        let clip = parse_keys(
            "fabrig-keys 1\nfps 10\n0 AU12=0.5 AU6.l=1 mouthSmileLeft=0.25\n1 AU12.R=1 linear\n",
            "x",
        )
        .unwrap();
        let at = |shape: &str, time: f64| {
            let channel = clip.channel_indices(&[shape])[0].unwrap();
            clip.sample(time).weights[channel]
        };
        assert_eq!(at("mouthSmileLeft", 1.0), 0.75);
        assert!((at("mouthSmileRight", 0.5) - 0.75).abs() < 1e-6);
        assert_eq!(
            (at("cheekSquintLeft", 0.0), at("cheekSquintRight", 0.0)),
            (1.0, 0.0)
        );
        let error = parse_keys("fabrig-keys 1\n0 AU99=1\n", "x").unwrap_err();
        assert!(error.to_string().contains("AU99"), "{error}");
    }

    #[test]
    fn a_key_at_zero_replaces_rest() {
        let clip = parse_keys("fabrig-keys 1\n0 jawOpen=1\n1 jawOpen=0\n", "x").unwrap();
        assert_eq!(clip.weights()[0], 1.0);
        assert_eq!(clip.frame_count(), 61);
    }

    #[test]
    fn errors_name_the_line() {
        let cases = [
            ("jawOpen=1\n", 1, "first line"),
            ("fabrig-keys 2\n", 1, "version 2"),
            ("fabrig-keys 1\nfps 0\n0 jawOpen=1\n", 2, "frame rate"),
            ("fabrig-keys 1\n\nx jawOpen=1\n", 3, "not a time"),
            ("fabrig-keys 1\n-1 jawOpen=1\n", 2, "at least 0"),
            ("fabrig-keys 1\n0 jawOpne=1\n", 2, "nearest: 'jawOpen'"),
            ("fabrig-keys 1\n0 jaw=1\n", 2, "no channel"),
            ("fabrig-keys 1\n0 jawOpen=2\n", 2, "[0, 1]"),
            ("fabrig-keys 1\n0 jawOpen=nan\n", 2, "finite"),
            ("fabrig-keys 1\n0 jawOpen\n", 2, "channel=value"),
            (
                "fabrig-keys 1\n1 jawOpen=1\n1 jawOpen=0\n",
                3,
                "already has a key",
            ),
            ("fabrig-keys 1\n1e9 jawOpen=1\n", 2, "frames"),
            ("fabrig-keys 1\n# nothing\n", 1, "no keys"),
        ];
        for (text, expected_line, part) in cases {
            match parse_keys(text, "x") {
                Err(MotionError::Keys { line, problem, .. }) => {
                    assert_eq!(line, expected_line, "{text}");
                    assert!(problem.contains(part), "{problem}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
