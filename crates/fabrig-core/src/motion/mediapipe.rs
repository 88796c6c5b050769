//! MediaPipe's face blendshapes: `categoryName` and `score`, 52 a frame.
//!
//! The JSON is a list of frames, a list under `frames`, or one object a line. A frame has its
//! time (`timestamp_ms` or `timestampMs`; `timestamp` or `time` in seconds) and the result of
//! the face landmarker under `faceBlendshapes` (also `face_blendshapes`, `blendshapes`): a
//! list of faces, of which the first counts, each a list of categories or an object with
//! `categories`; a single face's categories; or an object of name to score. A category has
//! `categoryName` (or `category_name`) and `score`. A frame without faces is a gap.
//!
//! `_neutral` is no shape. `tongueOut` is not among MediaPipe's shapes.

use std::collections::BTreeMap;

use serde_json::Value;

use super::frames::{FrameRow, Frames};
use super::read::WEIGHT_TOLERANCE;
use super::{Clip, ClipNotes, MotionError, ReadOptions};
use crate::facs::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};

/// MediaPipe's score for a face at rest.
const NEUTRAL: &str = "_neutral";

/// Scores of one frame, by category.
pub(super) struct ScoreFrame {
    /// Line or number of the frame, from 1.
    pub(super) line: usize,
    /// (s)
    pub(super) time: Option<f64>,
    /// `None` where no face was found.
    pub(super) scores: Option<BTreeMap<String, f64>>,
}

/// Reads MediaPipe's JSON.
pub(super) fn parse_json(
    text: &str,
    name: &str,
    options: &ReadOptions,
) -> Result<Clip, MotionError> {
    let problem = |frame: usize, problem: String| MotionError::Json {
        name: name.to_owned(),
        frame,
        problem,
    };
    let values = values(text).map_err(|message| problem(0, message))?;
    let frames: Vec<ScoreFrame> = values
        .iter()
        .enumerate()
        .map(|(i, value)| score_frame(i + 1, value).map_err(|e| problem(i + 1, e)))
        .collect::<Result<_, _>>()?;
    clip_from_scores(name, frames, options)
}

/// The frames of a document, whichever way they stand in it.
fn values(text: &str) -> Result<Vec<Value>, String> {
    let lines = || -> Result<Vec<Value>, serde_json::Error> {
        let lines = text.lines().filter(|line| !line.trim().is_empty());
        lines.map(serde_json::from_str).collect()
    };
    match serde_json::from_str(text) {
        Ok(Value::Array(frames)) => Ok(frames),
        Ok(Value::Object(mut document)) => match document.remove("frames") {
            Some(Value::Array(frames)) => Ok(frames),
            Some(_) => Err("'frames' is not a list".to_owned()),
            None => Ok(vec![Value::Object(document)]),
        },
        Ok(_) => Err("the document is neither a list of frames nor an object".to_owned()),
        Err(error) => lines().map_err(|_| error.to_string()),
    }
}

fn score_frame(line: usize, value: &Value) -> Result<ScoreFrame, String> {
    let time = [
        ("timestamp_ms", 1e-3),
        ("timestampMs", 1e-3),
        ("timestamp", 1.0),
        ("time", 1.0),
    ]
    .into_iter()
    .find_map(|(key, unit)| Some((key, value.get(key)?, unit)));
    let time = match time {
        None => None,
        Some((key, value, unit)) => {
            let number = value.as_f64().filter(|t| t.is_finite());
            Some(unit * number.ok_or_else(|| format!("'{key}' is not a number: {value}"))?)
        }
    };
    let shapes = ["faceBlendshapes", "face_blendshapes", "blendshapes"]
        .iter()
        .find_map(|key| value.get(*key));
    let scores = match shapes {
        Some(shapes) => scores(shapes)?,
        None if value.is_array() => scores(value)?,
        None => {
            return Err("it has no 'faceBlendshapes'".to_owned());
        }
    };
    Ok(ScoreFrame { line, time, scores })
}

fn scores(value: &Value) -> Result<Option<BTreeMap<String, f64>>, String> {
    match value {
        Value::Null => Ok(None),
        Value::Array(items) => match items.first() {
            None => Ok(None),
            Some(first) if category(first).is_some() => {
                let mut all = BTreeMap::new();
                for item in items {
                    let (name, score) = category(item)
                        .ok_or_else(|| format!("{item} has no categoryName and score"))?;
                    all.insert(name.to_owned(), score);
                }
                Ok(Some(all))
            }
            Some(first) => scores(first),
        },
        Value::Object(object) => match object.get("categories") {
            Some(categories) => scores(categories),
            None => object
                .iter()
                .map(|(name, score)| {
                    let score = score.as_f64();
                    let score =
                        score.ok_or_else(|| format!("the score of '{name}' is no number"))?;
                    Ok((name.clone(), score))
                })
                .collect::<Result<_, String>>()
                .map(Some),
        },
        other => Err(format!("expected categories, found {other}")),
    }
}

fn category(value: &Value) -> Option<(&str, f64)> {
    let name = value
        .get("categoryName")
        .or_else(|| value.get("category_name"))?;
    Some((name.as_str()?, value.get("score")?.as_f64()?))
}

/// The clip of scored frames.
pub(super) fn clip_from_scores(
    name: &str,
    frames: Vec<ScoreFrame>,
    options: &ReadOptions,
) -> Result<Clip, MotionError> {
    let mut notes = ClipNotes::default();
    let mut has_shape = [false; ARKIT_SHAPES.len()];
    let mut rows = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let time = match (frame.time, options.frame_rate) {
            (Some(time), _) => time,
            (None, Some(rate)) => index as f64 / rate,
            (None, None) => {
                return Err(MotionError::FrameRateNeeded {
                    name: name.to_owned(),
                });
            }
        };
        let mut weights = vec![0.0f32; ARKIT_SHAPES.len()];
        for (category, &score) in frame.scores.iter().flatten() {
            if category == NEUTRAL {
                continue;
            }
            let Some(ShapeMatch::One(shape)) = match_shape(category) else {
                if options.ignore_unknown_columns {
                    if !notes.ignored_columns.contains(category) {
                        notes.ignored_columns.push(category.clone());
                    }
                    continue;
                }
                return Err(MotionError::UnknownCategory {
                    name: name.to_owned(),
                    frame: frame.line,
                    found: category.clone(),
                    nearest: nearest_name(category, ARKIT_SHAPES)
                        .unwrap_or_default()
                        .to_owned(),
                });
            };
            let clamped = score.clamp(0.0, 1.0);
            if clamped != score {
                if !options.clamp_weights && (score - clamped).abs() > WEIGHT_TOLERANCE {
                    return Err(MotionError::WeightOutOfRange {
                        name: name.to_owned(),
                        row: frame.line,
                        column: category.clone(),
                        found: score,
                    });
                }
                notes.clamped_weights += 1;
            }
            weights[shape] = clamped as f32;
            has_shape[shape] = true;
        }
        rows.push(FrameRow {
            line: frame.line,
            time,
            is_lost: frame.scores.as_ref().is_none_or(BTreeMap::is_empty),
            weights,
            ..FrameRow::default()
        });
    }
    let used: Vec<usize> = (0..ARKIT_SHAPES.len()).filter(|&s| has_shape[s]).collect();
    for row in &mut rows {
        row.weights = used.iter().map(|&s| row.weights[s]).collect();
    }
    Frames {
        name,
        channels: used.iter().map(|&s| ARKIT_SHAPES[s].to_owned()).collect(),
        rows,
        notes,
    }
    .into_clip()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Clip, MotionError> {
        crate::motion::parse(text, "take.json", &ReadOptions::default())
    }

    const FACE: &str = r#"[{"categories":[{"index":0,"score":0.9,"categoryName":"_neutral"},
        {"index":25,"score":0.5,"categoryName":"jawOpen"}]}]"#;

    #[test]
    fn frames_stand_in_a_list_under_a_key_or_one_a_line() {
        let frame = |ms: u32| format!(r#"{{"timestamp_ms":{ms},"faceBlendshapes":{FACE}}}"#);
        let flat = |ms| frame(ms).replace('\n', " ");
        for text in [
            format!("[{},{}]", frame(0), frame(40)),
            format!("{{\"fps\":25,\"frames\":[{},{}]}}", frame(0), frame(40)),
            format!("{}\n{}\n", flat(0), flat(40)),
        ] {
            let clip = parse(&text).unwrap();
            assert_eq!(clip.channels(), ["jawOpen"]);
            assert_eq!(clip.weights(), [0.5, 0.5]);
            assert!((clip.duration() - 0.04).abs() < 1e-12);
        }
    }

    #[test]
    fn snake_case_and_plain_maps_are_read_and_missing_faces_are_gaps() {
        let clip = parse(
            r#"[{"time":0,"face_blendshapes":[[{"category_name":"jawOpen","score":0.2}]]},
                {"time":0.1,"blendshapes":[]},
                {"time":0.2,"blendshapes":{"jawOpen":0.6,"_neutral":0}}]"#,
        )
        .unwrap();
        assert!((clip.weights()[1] - 0.4).abs() < 1e-6);
        assert_eq!(clip.notes().gaps.len(), 1);
        assert_eq!(clip.notes().gaps[0].frames, 1);
    }

    #[test]
    fn tables_have_a_row_per_category_or_per_frame() {
        let long = "frame,timestamp_ms,categoryName,score\n0,0,_neutral,1\n0,0,jawOpen,0.1\n\
                    1,40,_neutral,1\n1,40,jawOpen,0.3\n";
        let wide = "timestamp_ms,_neutral,jawOpen\n0,1,0.1\n40,1,0.3\n";
        for text in [long, wide] {
            let clip = parse(text).unwrap();
            assert_eq!(clip.weights(), [0.1, 0.3]);
            assert!((clip.duration() - 0.04).abs() < 1e-12);
        }
    }

    #[test]
    fn errors_name_the_frame() {
        let cases = [
            ("[{\"time\":0}]", "no 'faceBlendshapes'"),
            (
                "[{\"time\":\"x\",\"blendshapes\":{}}]",
                "'time' is not a number",
            ),
            ("[{\"time\":0,\"blendshapes\":{\"jawOpne\":1}}]", "jawOpen"),
            (
                "[{\"time\":0,\"blendshapes\":{\"jawOpen\":7}}]",
                "outside [0, 1]",
            ),
            ("[{\"blendshapes\":{\"jawOpen\":1}}]", "frames per second"),
            ("[{\"time\":0,\"blendshapes\":[]}]", "no frame in which"),
            ("[1", "EOF"),
            ("[]", "no frames"),
        ];
        for (text, part) in cases {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
