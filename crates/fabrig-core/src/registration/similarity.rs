//! Similarity between matched points in closed form, and from named landmarks.
//!
//! Source: Umeyama 1991, Least-Squares Estimation of Transformation Parameters Between Two
//! Point Patterns, eqs. 34-43.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, Similarity3, Translation3, UnitQuaternion};

use super::RegistrationError;
use crate::template::Template;
use crate::{Point, Vector};

/// How many landmarks fix a similarity with something left to check it by.
pub const MIN_LANDMARK_COUNT: usize = 4;

/// Landmarks that fix a head best, in the order in which to ask for them.
const USEFUL_LANDMARKS: [&str; 8] = [
    "eye_outer_l",
    "eye_outer_r",
    "eye_inner_l",
    "eye_inner_r",
    "nose_tip",
    "lip_corner_l",
    "lip_corner_r",
    "pogonion",
];

/// Weighted least-squares similarity that takes `from` to `to`.
///
/// Returns `None` for fewer than three points, points on one line, or weights that sum to zero.
pub(crate) fn umeyama(from: &[Point], to: &[Point], weights: &[f64]) -> Option<Similarity3<f64>> {
    let sum: f64 = weights.iter().sum();
    if from.len() < 3 || sum <= 0.0 {
        return None;
    }
    let mean = |points: &[Point]| {
        points
            .iter()
            .zip(weights)
            .map(|(p, w)| p.coords * *w)
            .sum::<Vector>()
            / sum
    };
    let (from_mean, to_mean) = (mean(from), mean(to));
    let mut covariance = Matrix3::zeros();
    let mut variance = 0.0;
    for ((a, b), w) in from.iter().zip(to).zip(weights) {
        let (a, b) = (a.coords - from_mean, b.coords - to_mean);
        covariance += b * a.transpose() * (*w / sum);
        variance += a.norm_squared() * w / sum;
    }
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let s = svd.singular_values;
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| s[b].total_cmp(&s[a]));
    // One direction only: the rotation about it is free.
    if variance <= 0.0 || s[order[1]] <= 1e-9 * s[order[0]] {
        return None;
    }
    let mut sign = Vector::repeat(1.0);
    if (u * v_t).determinant() < 0.0 {
        sign[order[2]] = -1.0;
    }
    let rotation = u * Matrix3::from_diagonal(&sign) * v_t;
    let scale = s.dot(&sign) / variance;
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let translation = to_mean - rotation * from_mean * scale;
    Some(Similarity3::from_parts(
        Translation3::from(translation),
        rotation,
        scale,
    ))
}

/// Landmarks matched by name: positions on the user's mesh and on the template.
pub(super) struct MatchedLandmarks {
    pub(super) names: Vec<String>,
    /// In the mesh's own units.
    pub(super) face: Vec<Point>,
    /// Vertex of the template's skin.
    pub(super) vertices: Vec<u32>,
}

/// Looks the names up and checks the numbers.
pub(super) fn match_landmarks(
    template: &Template,
    landmarks: &BTreeMap<String, Point>,
) -> Result<MatchedLandmarks, RegistrationError> {
    let mut matched = MatchedLandmarks {
        names: Vec::new(),
        face: Vec::new(),
        vertices: Vec::new(),
    };
    for (name, point) in landmarks {
        let Some(&vertex) = template.landmarks.get(name) else {
            return Err(RegistrationError::UnknownLandmark {
                name: name.clone(),
                nearest: nearest_names(name, template.landmarks.keys()),
            });
        };
        if !point.iter().all(|c| c.is_finite()) {
            return Err(RegistrationError::LandmarkNotFinite { name: name.clone() });
        }
        matched.names.push(name.clone());
        matched.face.push(*point);
        matched.vertices.push(vertex);
    }
    if !landmarks.is_empty() && landmarks.len() < MIN_LANDMARK_COUNT {
        return Err(RegistrationError::TooFewLandmarks {
            found: landmarks.len(),
            expected: MIN_LANDMARK_COUNT,
            useful: useful_landmarks(template),
        });
    }
    Ok(matched)
}

/// Similarity from the user's landmarks to the template's.
pub(super) fn from_landmarks(
    template: &Template,
    matched: &MatchedLandmarks,
) -> Result<Similarity3<f64>, RegistrationError> {
    let to: Vec<Point> = matched
        .vertices
        .iter()
        .map(|&v| template.skin.positions()[v as usize])
        .collect();
    let weights = vec![1.0; to.len()];
    let degenerate = || RegistrationError::LandmarksDegenerate {
        found: matched.names.len(),
    };
    let straight = umeyama(&matched.face, &to, &weights).ok_or_else(degenerate)?;
    let flipped: Vec<Point> = matched
        .face
        .iter()
        .map(|p| Point::new(-p.x, p.y, p.z))
        .collect();
    let mirrored = umeyama(&flipped, &to, &weights).ok_or_else(degenerate)?;
    let rms = |s: &Similarity3<f64>, from: &[Point]| {
        let sum: f64 = from
            .iter()
            .zip(&to)
            .map(|(a, b)| (s.transform_point(a) - b).norm_squared())
            .sum();
        (sum / to.len() as f64).sqrt()
    };
    let (straight_mm, mirrored_mm) = (rms(&straight, &matched.face), rms(&mirrored, &flipped));
    // Near-planar sets fit both ways; only a clear difference is a mistake of sides.
    if mirrored_mm * 3.0 < straight_mm && straight_mm > 10.0 {
        return Err(RegistrationError::LandmarksMirrored {
            mirrored_mm,
            straight_mm,
        });
    }
    Ok(straight)
}

/// Landmarks worth asking for, those that the template has.
pub(super) fn useful_landmarks(template: &Template) -> Vec<String> {
    let known: Vec<String> = USEFUL_LANDMARKS
        .iter()
        .filter(|n| template.landmarks.contains_key(**n))
        .map(|n| (*n).to_owned())
        .collect();
    if known.len() >= MIN_LANDMARK_COUNT {
        known
    } else {
        template.landmarks.keys().take(8).cloned().collect()
    }
}

fn nearest_names<'a>(name: &str, known: impl Iterator<Item = &'a String>) -> Vec<String> {
    let mut scored: Vec<(usize, &String)> = known.map(|k| (edit_distance(name, k), k)).collect();
    scored.sort();
    scored.into_iter().take(3).map(|(_, k)| k.clone()).collect()
}

/// Levenshtein distance, ignoring case.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.to_lowercase().chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let cost = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = cost.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_similarity_comes_back_from_its_own_points() {
        let truth = Similarity3::new(
            Vector::new(3.0, -200.0, 7.0),
            Vector::new(2.0, -1.0, 0.5),
            0.013,
        );
        let from: Vec<Point> = (0..9)
            .map(|k| {
                let k = f64::from(k);
                Point::new((k * 1.7).sin() * 50.0, k * 9.0, (k * 0.9).cos() * 30.0)
            })
            .collect();
        let to: Vec<Point> = from.iter().map(|p| truth.transform_point(p)).collect();
        let weights: Vec<f64> = (0..9).map(|k| 0.5 + f64::from(k)).collect();
        let found = umeyama(&from, &to, &weights).expect("similarity");
        for (a, b) in from.iter().zip(&to) {
            assert!((found.transform_point(a) - b).norm() < 1e-10);
        }
        assert!((found.scaling() - 0.013).abs() < 1e-12);
    }

    #[test]
    fn a_mirrored_set_gives_a_rotation_all_the_same() {
        let from: Vec<Point> = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]]
            .iter()
            .map(|c| Point::new(c[0], c[1], c[2]))
            .collect();
        let to: Vec<Point> = from.iter().map(|p| Point::new(-p.x, p.y, p.z)).collect();
        let found = umeyama(&from, &to, &[1.0; 4]).expect("similarity");
        let r = found.isometry.rotation.to_rotation_matrix();
        assert!((r.matrix().determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_line_fix_nothing() {
        let line: Vec<Point> = (0..5).map(|k| Point::new(f64::from(k), 0.0, 0.0)).collect();
        assert!(umeyama(&line, &line, &[1.0; 5]).is_none());
    }

    #[test]
    fn names_are_suggested_by_likeness() {
        let known = ["nose_tip", "pogonion", "eye_inner_l", "eye_inner_r"].map(str::to_owned);
        assert_eq!(nearest_names("noseTip", known.iter())[0], "nose_tip");
        assert_eq!(nearest_names("eye_iner_r", known.iter())[0], "eye_inner_r");
    }
}
