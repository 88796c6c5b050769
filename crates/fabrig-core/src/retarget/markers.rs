//! Markers on a face: where each is on the skin.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Similarity3, Translation3};

use super::{RetargetError, Site};
use crate::Point;
use crate::facs::nearest_name;
use crate::mesh::Surface;
use crate::motion::MarkerTake;
use crate::registration::umeyama;
use crate::rig::Rig;

/// Farther from the skin than this, points are no markers on it. (mm)
const FAR: f64 = 12.0;

/// Rounds of moving the markers onto the skin as a rigid whole.
const SETTLING_ROUNDS: usize = 20;

/// How markers are bound.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerOptions {
    /// From when to when the face is neutral. (s)
    pub neutral: [f64; 2],
    /// Where markers are on the face at rest, by name [mm, head frame]; without them the
    /// markers are expected in the space of the rig's mesh or in the head frame.
    pub places: BTreeMap<String, Point>,
}

impl Default for MarkerOptions {
    fn default() -> Self {
        Self {
            neutral: [0.0, 0.2],
            places: BTreeMap::new(),
        }
    }
}

/// Markers on a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundMarkers {
    /// Names of those that are bound; others are never seen while the face is neutral.
    pub names: Vec<String>,
    /// Where each is on the skin.
    pub sites: Vec<Site>,
    /// Distance of each from the skin. (mm)
    pub distances: Vec<f64>,
    /// Each when the face is neutral. [mm, head frame]
    pub neutral: Vec<Point>,
    /// Each in every frame. [mm, head frame]
    pub positions: Vec<Vec<Option<Point>>>,
}

/// Finds the skin under the markers of a take while the face is neutral.
///
/// # Errors
///
/// [`RetargetError`] where no marker is seen while the face is neutral, where a place names no
/// marker, or where the markers are far from the face.
pub fn bind_markers(
    take: &MarkerTake,
    rig: &Rig,
    options: &MarkerOptions,
) -> Result<BoundMarkers, RetargetError> {
    let (markers, neutral) = neutral_positions(take, options)?;
    let surface = skin_surface(rig)?;
    let to_head = to_head(take, rig, &surface, &markers, &neutral, options)?;
    let neutral: Vec<Point> = neutral.iter().map(|p| to_head * p).collect();
    let places: Vec<_> = neutral.iter().map(|p| surface.closest(p)).collect();
    let distances: Vec<f64> = places.iter().map(|place| place.distance).collect();
    let median = median(&distances);
    if median > FAR {
        return Err(RetargetError::FarFromFace {
            distance: median,
            limit: FAR,
        });
    }
    let triangles = surface.triangles();
    let positions = (0..take.times.len()).map(|frame| {
        let frame = take.frame(frame);
        markers
            .iter()
            .map(|&m| frame[m].map(|p| to_head * p))
            .collect()
    });
    Ok(BoundMarkers {
        names: markers.iter().map(|&m| take.names[m].clone()).collect(),
        sites: places
            .iter()
            .map(|place| Site {
                vertices: triangles[place.triangle as usize],
                shares: place.barycentric,
            })
            .collect(),
        distances,
        neutral,
        positions: positions.collect(),
    })
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Markers seen in a neutral frame, and their mean places there; the head may move meanwhile.
fn neutral_positions(
    take: &MarkerTake,
    options: &MarkerOptions,
) -> Result<(Vec<usize>, Vec<Point>), RetargetError> {
    let [from, to] = options.neutral;
    let frames: Vec<usize> = (0..take.times.len())
        .filter(|&i| (from..=to).contains(&take.times[i]))
        .collect();
    // Markers that the best neutral frame shows; the others cannot be placed.
    let seen = |frame: &usize| take.frame(*frame).iter().flatten().count();
    let Some(&reference) = frames.iter().max_by_key(|f| (seen(f), usize::MAX - **f)) else {
        return Err(RetargetError::Empty {
            what: "there is no frame at the time when the face is said to be neutral",
        });
    };
    let markers: Vec<usize> = (0..take.names.len())
        .filter(|&m| take.frame(reference)[m].is_some())
        .collect();
    if markers.is_empty() {
        return Err(RetargetError::Empty {
            what: "no marker is seen when the face is said to be neutral",
        });
    }
    let mut sums = vec![(nalgebra::Vector3::zeros(), 0.0); markers.len()];
    for &frame in &frames {
        let mut pairs = Vec::new();
        for (k, &m) in markers.iter().enumerate() {
            if let (Some(now), Some(first)) = (take.frame(frame)[m], take.frame(reference)[m]) {
                pairs.push((k, now, first));
            }
        }
        let from: Vec<Point> = pairs.iter().map(|p| p.1).collect();
        let to: Vec<Point> = pairs.iter().map(|p| p.2).collect();
        let still = rigid(&from, &to).unwrap_or_else(Isometry3::identity);
        for (k, now, _) in pairs {
            sums[k].0 += (still * now).coords;
            sums[k].1 += 1.0;
        }
    }
    let mean = sums.iter().map(|(sum, count)| Point::from(sum / *count));
    Ok((markers, mean.collect()))
}

/// The user's skin at rest without its rigid pieces. [mm, head frame]
fn skin_surface(rig: &Rig) -> Result<Surface, RetargetError> {
    let mut is_rigid = vec![false; rig.face.vertex_count()];
    for part in &rig.parts {
        for &v in &part.vertices {
            is_rigid[v as usize] = true;
        }
    }
    let mut triangles = rig.face.triangles();
    triangles.retain(|t| !t.iter().any(|&v| is_rigid[v as usize]));
    let rest = rig.face_in_head();
    Ok(Surface::new(&rest, &triangles)?)
}

/// From the markers' space to the head frame.
fn to_head(
    take: &MarkerTake,
    rig: &Rig,
    surface: &Surface,
    markers: &[usize],
    neutral: &[Point],
    options: &MarkerOptions,
) -> Result<Similarity3<f64>, RetargetError> {
    let start = if options.places.is_empty() {
        let median_distance = |to_head: &Similarity3<f64>| {
            let distances = neutral
                .iter()
                .map(|p| surface.closest(&(to_head * p)).distance);
            median(&distances.collect::<Vec<_>>())
        };
        // Markers in millimetres beside a mesh in metres are usual.
        let candidates = [
            Similarity3::identity(),
            rig.to_head,
            rig.to_head * Similarity3::from_scaling(1.0 / rig.to_head.scaling()),
        ];
        let best = candidates
            .into_iter()
            .min_by(|a, b| median_distance(a).total_cmp(&median_distance(b)));
        best.unwrap_or_else(Similarity3::identity)
    } else {
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for (name, place) in &options.places {
            let marker = take.names.iter().position(|n| n == name);
            let Some(marker) = marker else {
                let names = take.names.iter().map(String::as_str);
                return Err(RetargetError::UnknownName {
                    what: "marker",
                    found: name.clone(),
                    nearest: nearest_name(name, names).unwrap_or_default().to_owned(),
                });
            };
            if let Some(k) = markers.iter().position(|&m| m == marker) {
                from.push(neutral[k]);
                to.push(*place);
            }
        }
        let motion = rigid(&from, &to).ok_or(RetargetError::Empty {
            what: "fewer than three placed markers are seen in the neutral face, or they lie on \
                   a line",
        })?;
        nalgebra::convert(motion)
    };
    Ok(settle(start, surface, neutral))
}

/// Moves the markers rigidly to lie on the skin, as far as that takes them all nearer.
fn settle(start: Similarity3<f64>, surface: &Surface, neutral: &[Point]) -> Similarity3<f64> {
    let mut to_head = start;
    for _ in 0..SETTLING_ROUNDS {
        let from: Vec<Point> = neutral.iter().map(|p| to_head * p).collect();
        let places: Vec<_> = from.iter().map(|p| surface.closest(p)).collect();
        let near = 2.0 * median(&places.iter().map(|p| p.distance).collect::<Vec<_>>()) + 0.1;
        let pairs = from.iter().zip(&places).filter(|(_, p)| p.distance <= near);
        let (from, to): (Vec<Point>, Vec<Point>) = pairs.map(|(f, p)| (*f, p.point)).unzip();
        let Some(step) = rigid(&from, &to) else { break };
        to_head = nalgebra::convert::<_, Similarity3<f64>>(step) * to_head;
        if step.translation.vector.norm() < 1e-3 && step.rotation.angle() < 1e-5 {
            break;
        }
    }
    to_head
}

/// The rigid motion that takes `from` to `to` best; `None` for fewer than three points or
/// points on a line.
pub(super) fn rigid(from: &[Point], to: &[Point]) -> Option<Isometry3<f64>> {
    let fitted = umeyama(from, to, &vec![1.0; from.len()])?;
    let rotation = fitted.isometry.rotation;
    let count = from.len() as f64;
    let mean = |points: &[Point]| points.iter().map(|p| p.coords).sum::<crate::Vector>() / count;
    let shift = mean(to) - rotation * mean(from);
    Some(Isometry3::from_parts(Translation3::from(shift), rotation))
}
