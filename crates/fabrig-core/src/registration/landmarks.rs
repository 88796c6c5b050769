//! Landmark files: a JSON of our names, or a detector's points in its own order.
//!
//! Points come as a JSON array of [x, y, z], as CSV or text with three numbers a line (a first
//! line of words is passed over), or as `.pts` (`n_points: N { ... }`). Their order is known by
//! their count or given. What each number means is data: `landmark_orders.toml`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::Deserialize;

use crate::Point;

/// Order of a detector's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LandmarkOrder {
    /// 68 points of iBUG 300-W and dlib.
    Ibug68,
    /// 468 or 478 points of MediaPipe's face mesh.
    MediaPipe,
}

impl LandmarkOrder {
    const ALL: [Self; 2] = [Self::Ibug68, Self::MediaPipe];

    /// Name in options and errors.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ibug68 => "ibug68",
            Self::MediaPipe => "mediapipe",
        }
    }

    fn table(self) -> &'static Table {
        match self {
            Self::Ibug68 => &TABLES.ibug68,
            Self::MediaPipe => &TABLES.mediapipe,
        }
    }

    /// Name of the template's landmark and number of the point, for all points that are used.
    pub fn points(self) -> &'static BTreeMap<String, usize> {
        &self.table().points
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    count: Vec<usize>,
    points: BTreeMap<String, usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tables {
    ibug68: Table,
    mediapipe: Table,
}

/// The text is part of the crate; a test reads it.
static TABLES: LazyLock<Tables> =
    LazyLock::new(|| toml::from_str(include_str!("landmark_orders.toml")).unwrap_or_default());

/// What can be wrong with a landmark file.
#[derive(Debug, thiserror::Error)]
pub enum LandmarkFileError {
    /// The file could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// It is neither names nor points.
    #[error(
        "{}: neither a JSON object of landmark name to [x, y, z] nor a list of points: {problem}",
        path.display()
    )]
    NotLandmarks {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A line of points is wrong.
    #[error("{}:{line}: expected three numbers x y z, found '{found}'", path.display())]
    BadPoint {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What stands there.
        found: String,
    },
    /// A point is NaN or infinite.
    #[error("{}: point {point} has a coordinate that is not a finite number", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The point, from 0.
        point: usize,
    },
    /// There are as many points as no known order has, or as the given one has not.
    #[error(
        "{}: {found} points; {expected} (or a JSON object of landmark name to [x, y, z])",
        path.display()
    )]
    PointCount {
        /// The file.
        path: PathBuf,
        /// How many there are.
        found: usize,
        /// What there could be.
        expected: String,
    },
    /// Names were given together with an order of points.
    #[error("{}: it names its landmarks, so it has no order {order} of points", path.display())]
    OrderOfNames {
        /// The file.
        path: PathBuf,
        /// The order given.
        order: &'static str,
    },
}

/// Reads landmarks by the template's names, in the mesh's own units.
///
/// - `order`: of points without names; by their count where it is `None`
///
/// # Errors
///
/// [`LandmarkFileError`].
pub fn read_landmarks(
    path: impl AsRef<Path>,
    order: Option<LandmarkOrder>,
) -> Result<BTreeMap<String, Point>, LandmarkFileError> {
    let path = path.as_ref();
    let text = std::fs::read_to_string(path).map_err(|source| LandmarkFileError::Read {
        path: path.to_owned(),
        source,
    })?;
    parse_landmarks(&text, path, order)
}

/// As [`read_landmarks`], from the text of the file; `path` only names it in errors.
///
/// # Errors
///
/// [`LandmarkFileError`].
pub fn parse_landmarks(
    text: &str,
    path: &Path,
    order: Option<LandmarkOrder>,
) -> Result<BTreeMap<String, Point>, LandmarkFileError> {
    let not_landmarks = |problem: String| LandmarkFileError::NotLandmarks {
        path: path.to_owned(),
        problem,
    };
    let text = text.trim_start_matches('\u{feff}').trim();
    let points: Vec<[f64; 3]> = match text.chars().next() {
        Some('{') => {
            let named: BTreeMap<String, [f64; 3]> =
                serde_json::from_str(text).map_err(|e| not_landmarks(e.to_string()))?;
            if let Some(order) = order {
                return Err(LandmarkFileError::OrderOfNames {
                    path: path.to_owned(),
                    order: order.name(),
                });
            }
            if named.is_empty() {
                return Err(not_landmarks("there are no landmarks in it".to_owned()));
            }
            return Ok(named
                .into_iter()
                .map(|(name, p)| (name, Point::from(p)))
                .collect());
        }
        Some('[') => serde_json::from_str(text).map_err(|e| not_landmarks(e.to_string()))?,
        Some(_) => lines_of_points(text, path)?,
        None => return Err(not_landmarks("it is empty".to_owned())),
    };
    if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(LandmarkFileError::NotFinite {
            path: path.to_owned(),
            point,
        });
    }
    let fits = |o: &LandmarkOrder| o.table().count.contains(&points.len());
    let known = match order {
        Some(order) => Some(order).filter(fits),
        None => LandmarkOrder::ALL.into_iter().find(fits),
    };
    let Some(known) = known else {
        return Err(LandmarkFileError::PointCount {
            path: path.to_owned(),
            found: points.len(),
            expected: expected_counts(order),
        });
    };
    Ok(known
        .points()
        .iter()
        .map(|(name, &k)| (name.clone(), Point::from(points[k])))
        .collect())
}

fn expected_counts(order: Option<LandmarkOrder>) -> String {
    let of = |o: LandmarkOrder| {
        let counts: Vec<String> = o.table().count.iter().map(usize::to_string).collect();
        format!("{} has {}", o.name(), counts.join(" or "))
    };
    match order {
        Some(order) => of(order),
        None => LandmarkOrder::ALL.map(of).join(", "),
    }
}

/// Three numbers a line, separated by commas, semicolons or blanks, after an optional heading.
fn lines_of_points(text: &str, path: &Path) -> Result<Vec<[f64; 3]>, LandmarkFileError> {
    let is_pts = text.starts_with("version");
    let mut is_inside = !is_pts;
    let mut points = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let content = line.trim();
        if is_pts && !is_inside {
            is_inside = content.starts_with('{');
            continue;
        }
        if is_pts && content.starts_with('}') {
            break;
        }
        let numbers: Vec<Option<f64>> = content
            .split(|c: char| c == ',' || c == ';' || c.is_whitespace())
            .filter(|word| !word.is_empty())
            .map(|word| word.parse().ok())
            .collect();
        match numbers[..] {
            [] => {}
            [Some(x), Some(y), Some(z)] => points.push([x, y, z]),
            // A heading of words.
            _ if index == 0 && numbers.iter().all(Option::is_none) => {}
            _ => {
                return Err(LandmarkFileError::BadPoint {
                    path: path.to_owned(),
                    line: index + 1,
                    found: content.chars().take(60).collect(),
                });
            }
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template;

    fn parse(
        text: &str,
        order: Option<LandmarkOrder>,
    ) -> Result<BTreeMap<String, Point>, LandmarkFileError> {
        parse_landmarks(text, Path::new("face.pts"), order)
    }

    #[test]
    fn every_landmark_of_the_tables_is_one_of_the_template_and_within_the_count() {
        for order in LandmarkOrder::ALL {
            assert!(order.points().len() >= 20, "{}", order.name());
            let least = order.table().count.iter().min().copied().unwrap_or(0);
            for (name, &k) in order.points() {
                assert!(template::human().landmarks.contains_key(name), "{name}");
                assert!(k < least, "{name}");
            }
            // Both sides or the mid plane.
            for name in order.points().keys() {
                if let Some(stem) = name.strip_suffix("_l") {
                    assert!(order.points().contains_key(&format!("{stem}_r")), "{name}");
                }
            }
        }
    }

    #[test]
    fn points_are_known_by_their_count_in_every_notation() {
        let at = |k: usize| [k as f64, 0.5, -1.0];
        for (count, order) in [
            (68, LandmarkOrder::Ibug68),
            (468, LandmarkOrder::MediaPipe),
            (478, LandmarkOrder::MediaPipe),
        ] {
            let points: Vec<[f64; 3]> = (0..count).map(at).collect();
            let line = |s: &str| -> Vec<String> {
                points
                    .iter()
                    .map(|p| format!("{}{s}{}{s}{}", p[0], p[1], p[2]))
                    .collect()
            };
            let json = serde_json::to_string(&points).unwrap();
            let csv = format!("x,y,z\r\n{}\r\n", line(",").join("\r\n"));
            let plain = line(" ").join("\n");
            let pts = format!("version: 1\nn_points: {count}\n{{\n{plain}\n}}\n");
            for text in [json, csv, plain, pts] {
                let found = parse(&text, None).unwrap();
                for (name, &k) in order.points() {
                    assert_eq!(found[name], Point::from(at(k)));
                }
                assert_eq!(found, parse(&text, Some(order)).unwrap());
            }
        }
    }

    #[test]
    fn wrong_files_say_what_is_wrong() {
        let names = r#"{"nose_tip": [0, 1, 2]}"#;
        assert_eq!(parse(names, None).unwrap()["nose_tip"].z, 2.0);
        assert!(matches!(
            parse(names, Some(LandmarkOrder::Ibug68)),
            Err(LandmarkFileError::OrderOfNames { .. })
        ));
        for text in ["", "{}", "[[1, 2]]", "{\"a\": 1}", "[[1, 2, 3]"] {
            assert!(
                matches!(
                    parse(text, None),
                    Err(LandmarkFileError::NotLandmarks { .. })
                ),
                "{text}"
            );
        }
        assert!(matches!(
            parse("1 2 3\n4 5\n", None),
            Err(LandmarkFileError::BadPoint { line: 2, .. })
        ));
        assert!(matches!(
            parse(&"1 2 nan\n".repeat(68), None),
            Err(LandmarkFileError::NotFinite { point: 0, .. })
        ));
        let message = parse("1 2 3\n4 5 6\n", None).unwrap_err().to_string();
        assert!(
            message.contains("2 points") && message.contains("468 or 478"),
            "{message}"
        );
        assert!(matches!(
            parse(&"1 2 3\n".repeat(68), Some(LandmarkOrder::MediaPipe)),
            Err(LandmarkFileError::PointCount { found: 68, .. })
        ));
    }
}
