//! Mouth and eyes of the face: found, split into an upper and a lower line from corner to
//! corner, and matched to the template's contact lines.

use super::face_model::{FaceModel, Opening, OpeningKind};
use super::nonrigid_icp::Pin;
use super::target::Target;
use crate::{Point, Vector};

/// Upper and lower line of an opening of the face, from the right corner (-X) to the left one.
#[derive(Debug, Clone)]
pub(super) struct FaceOpening {
    pub(super) kind: OpeningKind,
    pub(super) upper: Vec<Point>,
    pub(super) lower: Vec<Point>,
}

/// Finds the openings that are holes of the mesh, given the template deformed so far.
pub(super) fn find_openings(
    model: &FaceModel<'_>,
    target: &Target,
    vertices: &[Point],
) -> Vec<FaceOpening> {
    model
        .openings
        .iter()
        .filter_map(|opening| find_opening(opening, target, vertices))
        .collect()
}

fn find_opening(opening: &Opening, target: &Target, vertices: &[Point]) -> Option<FaceOpening> {
    let ring: Vec<Point> = opening
        .upper
        .iter()
        .chain(opening.lower.iter().rev())
        .map(|&v| vertices[v as usize])
        .collect();
    let (center, length) = (middle(&ring), perimeter(&ring));
    let chain = target
        .boundary_loops
        .iter()
        .filter_map(|chain| {
            let points: Vec<Point> = chain
                .iter()
                .map(|&v| target.positions[v as usize])
                .collect();
            let ratio = perimeter(&points) / length;
            let apart = (middle(&points) - center).norm();
            ((0.4..2.5).contains(&ratio) && apart < 0.35 * length).then_some((apart, points))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?
        .1;
    split(opening.kind, &chain)
}

/// Cuts a closed chain at its corners. A corner is where the chain reaches farthest to its
/// side; of the two parts the one with the higher middle is the upper line.
fn split(kind: OpeningKind, chain: &[Point]) -> Option<FaceOpening> {
    let right = (0..chain.len()).min_by(|&a, &b| chain[a].x.total_cmp(&chain[b].x))?;
    let left = (0..chain.len()).max_by(|&a, &b| chain[a].x.total_cmp(&chain[b].x))?;
    let walk = |from: usize, to: usize| {
        let mut points = vec![chain[from]];
        let mut at = from;
        while at != to {
            at = (at + 1) % chain.len();
            points.push(chain[at]);
        }
        points
    };
    let one = walk(right, left);
    let mut other = walk(left, right);
    other.reverse();
    if one.len() < 3 || other.len() < 3 {
        return None;
    }
    let height = |line: &[Point]| resample(line, 9).iter().map(|p| p.y).sum::<f64>();
    let (upper, lower) = if height(&one) >= height(&other) {
        (one, other)
    } else {
        (other, one)
    };
    Some(FaceOpening { kind, upper, lower })
}

/// Pins of the template's contact lines to the lines of the face, at equal fractions of
/// their lengths from corner to corner.
pub(super) fn opening_pins(
    model: &FaceModel<'_>,
    found: &[FaceOpening],
    vertices: &[Point],
    weight: f64,
) -> Vec<Pin> {
    let mut pins = Vec::new();
    for face in found {
        let Some(opening) = model.openings.iter().find(|o| o.kind == face.kind) else {
            continue;
        };
        for (line, points) in [(&opening.upper, &face.upper), (&opening.lower, &face.lower)] {
            let own: Vec<Point> = line.iter().map(|&v| vertices[v as usize]).collect();
            let total = length_of(&own);
            let mut walked = 0.0;
            for (k, &vertex) in line.iter().enumerate() {
                if k > 0 {
                    walked += (own[k] - own[k - 1]).norm();
                }
                let fraction = if total > 0.0 { walked / total } else { 0.0 };
                pins.push(Pin {
                    vertex,
                    place: at_fraction(points, fraction),
                    weight,
                });
            }
        }
    }
    pins
}

fn middle(points: &[Point]) -> Point {
    Point::from(points.iter().map(|p| p.coords).sum::<Vector>() / points.len().max(1) as f64)
}

fn length_of(line: &[Point]) -> f64 {
    line.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

fn perimeter(ring: &[Point]) -> f64 {
    match (ring.first(), ring.last()) {
        (Some(a), Some(b)) => length_of(ring) + (b - a).norm(),
        _ => 0.0,
    }
}

/// The point at a fraction of a line's length.
pub(super) fn at_fraction(line: &[Point], fraction: f64) -> Point {
    let mut left = fraction.clamp(0.0, 1.0) * length_of(line);
    for w in line.windows(2) {
        let step = (w[1] - w[0]).norm();
        if left <= step && step > 0.0 {
            return w[0] + (w[1] - w[0]) * (left / step);
        }
        left -= step;
    }
    line[line.len() - 1]
}

fn resample(line: &[Point], count: usize) -> Vec<Point> {
    (0..count)
        .map(|k| at_fraction(line, k as f64 / (count - 1) as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_split_at_its_corners_whatever_its_start_and_direction() {
        let ring: Vec<Point> = (0..20)
            .map(|k| {
                let a = f64::from(k) / 20.0 * std::f64::consts::TAU;
                Point::new(20.0 * a.cos(), 5.0 * a.sin(), 100.0)
            })
            .collect();
        for turn in [0, 7, 13] {
            let mut chain = ring.clone();
            chain.rotate_left(turn);
            for _ in 0..2 {
                chain.reverse();
                let found = split(OpeningKind::Mouth, &chain).expect("two lines");
                assert!((found.upper[0].x + 20.0).abs() < 1e-9);
                assert!((found.lower[0].x + 20.0).abs() < 1e-9);
                assert!(
                    (at_fraction(&found.upper, 0.5) - Point::new(0.0, 5.0, 100.0)).norm() < 1e-9
                );
                assert!(
                    (at_fraction(&found.lower, 0.5) - Point::new(0.0, -5.0, 100.0)).norm() < 1e-9
                );
            }
        }
    }
}
