//! Mouth and eyes of the face: where its lips and lids part, seen from the front.
//!
//! The face is probed by rays in columns from corner to corner of the opening, as the template
//! deformed so far places it. In a column of depths the parting is a gap (open mouth, an eye),
//! a step (the upper lip overhangs the lower one) or a valley (a crease of a closed surface).
//! The path of most evidence across the columns is found by dynamic programming. This works
//! alike for holes of the mesh, for mouths and sockets with an inside, and for fused scans.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::face_model::{FaceModel, Opening, OpeningKind};
use super::nonrigid_icp::Pin;
use super::report::OpeningState;
use super::target::Target;
use crate::mesh::Topology;
use crate::{Point, Vector};

/// Columns from corner to corner.
const COLUMN_COUNT: usize = 41;
/// Rays reach this far above and below the expected line, one every [`STEP_MM`]. [mm]
const HALF_HEIGHT_MM: f64 = 9.0;
const STEP_MM: f64 = 0.25;
/// Rows of a column.
const ROW_COUNT: usize = (2.0 * HALF_HEIGHT_MM / STEP_MM) as usize + 1;
/// What lies this far behind the skin beside it is inside the head. [mm]
const THROUGH_MM: f64 = 5.0;
/// Neighbouring rays that differ by more see two surfaces. [mm]
const JUMP_MM: f64 = 0.9;
/// A valley is judged against the skin this many rows above and below.
const VALLEY_ROWS: usize = 6;
/// Evidence below this is noise. [mm]
const MIN_EVIDENCE: f64 = 0.12;

/// The parting of an opening of the face.
#[derive(Debug, Clone)]
pub(super) struct FaceOpening {
    pub(super) kind: OpeningKind,
    pub(super) state: OpeningState,
    pub(super) columns: Vec<FoundColumn>,
}

/// Fraction from the right corner (-X) to the left one, upper place, lower place, trust.
type FoundColumn = (f64, Point, Point, f64);

/// Finds the partings of all openings, given the template deformed so far.
pub(super) fn find_openings(
    model: &FaceModel<'_>,
    target: &Target,
    vertices: &[Point],
) -> Vec<FaceOpening> {
    model
        .openings
        .iter()
        .filter_map(|opening| trace(opening, target, vertices))
        .collect()
}

/// One column of rays: depth of each row along the view, from the lowest row up; `None` where
/// nothing is met.
struct Column {
    fraction: f64,
    hits: Vec<Option<(f64, Point)>>,
    evidence: Vec<f64>,
    is_gap: Vec<bool>,
    /// Gaps so deep that one looks inside.
    is_through: Vec<bool>,
}

fn trace(opening: &Opening, target: &Target, vertices: &[Point]) -> Option<FaceOpening> {
    let line =
        |side: &[u32]| -> Vec<Point> { side.iter().map(|&v| vertices[v as usize]).collect() };
    let (upper, lower) = (line(&opening.upper), line(&opening.lower));
    let (right, left) = (
        nalgebra::center(&upper[0], &lower[0]),
        nalgebra::center(&upper[upper.len() - 1], &lower[lower.len() - 1]),
    );
    let across = (left - right).try_normalize(1e-9)?;
    let view = across.cross(&Vector::y()).try_normalize(1e-9)?;
    let up = view.cross(&across);

    let mut columns: Vec<Column> = (1..COLUMN_COUNT - 1)
        .map(|k| {
            let fraction = k as f64 / (COLUMN_COUNT - 1) as f64;
            let middle = nalgebra::center(
                &at_fraction(&upper, fraction),
                &at_fraction(&lower, fraction),
            );
            probe(target, fraction, &middle, &up, &view)
        })
        .collect();
    for c in &mut columns {
        weigh(c);
    }
    let path = best_path(&columns);
    let found: Vec<FoundColumn> = columns
        .iter()
        .zip(&path)
        .filter_map(|(c, &row)| {
            let trust = c.evidence[row];
            let (up_place, low_place) = edges(c, row)?;
            (trust > MIN_EVIDENCE).then_some((c.fraction, up_place, low_place, trust.min(1.0)))
        })
        .collect();
    if found.len() < COLUMN_COUNT / 4 {
        return None;
    }
    let state = state_of(target, &columns, &path, &found, &up, (left - right).norm());
    Some(FaceOpening {
        kind: opening.kind,
        state,
        columns: found,
    })
}

fn probe(target: &Target, fraction: f64, middle: &Point, up: &Vector, view: &Vector) -> Column {
    const BEFORE_MM: f64 = 25.0;
    const BEHIND_MM: f64 = 20.0;
    let hits = (0..ROW_COUNT)
        .map(|row| {
            let height = row as f64 * STEP_MM - HALF_HEIGHT_MM;
            let origin = middle + up * height + view * BEFORE_MM;
            target
                .surface
                .cast_ray(&origin, &-view, BEFORE_MM + BEHIND_MM)
                .map(|hit| (BEFORE_MM - hit.distance, origin - view * hit.distance))
        })
        .collect();
    Column {
        fraction,
        hits,
        evidence: vec![0.0; ROW_COUNT],
        is_gap: vec![false; ROW_COUNT],
        is_through: vec![false; ROW_COUNT],
    }
}

/// Evidence for a parting at each row: 3 in a gap, the height of a step, twice the depth of a
/// valley. [mm]
///
/// A gap is a run of rows between a drop and a rise, seen from below, that lies deeper than
/// the skin at both its ends; a crease slopes down without a drop.
fn weigh(column: &mut Column) {
    let depth = |row: usize| column.hits[row].map_or(-1e3, |h| h.0);
    let mut behind = vec![0.0; ROW_COUNT];
    let mut start = None;
    for row in 0..ROW_COUNT - 1 {
        let step = depth(row + 1) - depth(row);
        if step < -JUMP_MM && start.is_none() {
            start = Some(row + 1);
        } else if step > JUMP_MM {
            if let Some(first) = start.take() {
                let skin = depth(first - 1).min(depth(row + 1));
                for r in first..=row {
                    behind[r] = (skin - depth(r)).max(0.0);
                }
            }
        }
    }
    let mut evidence = vec![0.0; ROW_COUNT];
    for row in 1..ROW_COUNT - 1 {
        let jump = (depth(row + 1) - depth(row)).abs();
        evidence[row] = if behind[row] > JUMP_MM {
            3.0
        } else if jump > JUMP_MM {
            jump.min(3.0)
        } else if (VALLEY_ROWS..ROW_COUNT - VALLEY_ROWS).contains(&row) {
            let beside = (depth(row - VALLEY_ROWS) + depth(row + VALLEY_ROWS)) / 2.0;
            (2.0 * (beside - depth(row))).clamp(0.0, 2.0)
        } else {
            0.0
        };
    }
    column.is_gap = behind.iter().map(|b| *b > JUMP_MM).collect();
    column.is_through = behind.iter().map(|b| *b > THROUGH_MM).collect();
    column.evidence = evidence;
}

/// Row of each column: most evidence, least movement from column to column, close to where it
/// is expected.
fn best_path(columns: &[Column]) -> Vec<usize> {
    const MOVE_COST: f64 = 0.25;
    const PLACE_COST: f64 = 0.004;
    let middle = (ROW_COUNT / 2) as f64;
    let own = |c: &Column, row: usize| c.evidence[row] - PLACE_COST * (row as f64 - middle).abs();
    let mut score: Vec<f64> = (0..ROW_COUNT).map(|r| own(&columns[0], r)).collect();
    let mut from: Vec<Vec<usize>> = Vec::new();
    for c in &columns[1..] {
        let mut next = vec![f64::NEG_INFINITY; ROW_COUNT];
        let mut back = vec![0; ROW_COUNT];
        for row in 0..ROW_COUNT {
            for previous in row.saturating_sub(4)..(row + 5).min(ROW_COUNT) {
                let s = score[previous] - MOVE_COST * row.abs_diff(previous) as f64;
                if s > next[row] {
                    next[row] = s;
                    back[row] = previous;
                }
            }
            next[row] += own(c, row);
        }
        score = next;
        from.push(back);
    }
    let mut row = (0..ROW_COUNT)
        .max_by(|&a, &b| score[a].total_cmp(&score[b]))
        .unwrap_or(0);
    let mut path = vec![row];
    for back in from.iter().rev() {
        row = back[row];
        path.push(row);
    }
    path.reverse();
    path
}

/// Upper and lower place of a parting at `row`: the ends of the gap, the two sides of the
/// step, or the same place twice.
fn edges(column: &Column, row: usize) -> Option<(Point, Point)> {
    let place = |r: usize| column.hits.get(r).copied().flatten().map(|h| h.1);
    if column.is_gap[row] {
        let up = (row..ROW_COUNT).find(|&r| !column.is_gap[r])?;
        let down = (0..row).rev().find(|&r| !column.is_gap[r])?;
        return Some((place(up)?, place(down)?));
    }
    let here = place(row)?;
    let next = place(row + 1)?;
    let is_step = match (column.hits[row], column.hits[row + 1]) {
        (Some(a), Some(b)) => (a.0 - b.0).abs() > JUMP_MM,
        _ => true,
    };
    Some(if is_step { (next, here) } else { (here, here) })
}

/// Open where a gap is seen between the sides, or where the way from side to side along the
/// surface is nearly as long as the way round a corner; closed and fused otherwise.
fn state_of(
    target: &Target,
    columns: &[Column],
    path: &[usize],
    found: &[FoundColumn],
    up: &Vector,
    width: f64,
) -> OpeningState {
    const BESIDE_MM: f64 = 2.0;
    let through_count = columns
        .iter()
        .zip(path)
        .filter(|(c, row)| c.is_through[**row])
        .count();
    if 2 * through_count > columns.len() {
        return OpeningState::Open;
    }
    let topology = Topology::from_triangles(target.positions.len(), &target.triangles);
    let middle: Vec<_> = found.iter().filter(|c| (c.0 - 0.5).abs() < 0.13).collect();
    let open_count = middle
        .iter()
        .filter(|column| {
            let above = nearest_vertex(target, &(column.1 + up * BESIDE_MM));
            let below = nearest_vertex(target, &(column.2 - up * BESIDE_MM));
            let direct =
                (target.positions[above as usize] - target.positions[below as usize]).norm();
            !is_within(target, &topology, above, below, direct + 0.55 * width)
        })
        .count();
    if 2 * open_count > middle.len() {
        OpeningState::Open
    } else {
        OpeningState::Fused
    }
}

fn nearest_vertex(target: &Target, point: &Point) -> u32 {
    let at = target.surface.closest(point);
    let corners = target.triangles[at.triangle as usize];
    let k = (0..3)
        .max_by(|&a, &b| at.barycentric[a].total_cmp(&at.barycentric[b]))
        .unwrap_or(0);
    corners[k]
}

/// Whether `to` can be reached from `from` along edges within `limit`.
fn is_within(target: &Target, topology: &Topology, from: u32, to: u32, limit: f64) -> bool {
    let mut distance = std::collections::BTreeMap::from([(from, 0.0f64)]);
    let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
    while let Some(Reverse((bits, v))) = queue.pop() {
        if v == to {
            return true;
        }
        let d = f64::from_bits(bits);
        if distance.get(&v).is_some_and(|&known| d > known) {
            continue;
        }
        for &n in topology.neighbours(v) {
            let step = d + (target.positions[n as usize] - target.positions[v as usize]).norm();
            if step <= limit && distance.get(&n).is_none_or(|&known| step < known) {
                distance.insert(n, step);
                queue.push(Reverse((step.to_bits(), n)));
            }
        }
    }
    false
}

/// Pins of the template's contact lines to the partings of the face, at equal fractions of
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
        for (line, is_upper) in [(&opening.upper, true), (&opening.lower, false)] {
            let own: Vec<Point> = line.iter().map(|&v| vertices[v as usize]).collect();
            let total = length_of(&own);
            let mut walked = 0.0;
            for (k, &vertex) in line.iter().enumerate() {
                if k > 0 {
                    walked += (own[k] - own[k - 1]).norm();
                }
                let fraction = if total > 0.0 { walked / total } else { 0.0 };
                if let Some((place, trust)) = place_at(face, fraction, is_upper) {
                    pins.push(Pin {
                        vertex,
                        place,
                        weight: weight * trust,
                    });
                }
            }
        }
    }
    pins
}

/// Place of one side between the columns around a fraction; `None` where columns are missing.
fn place_at(face: &FaceOpening, fraction: f64, is_upper: bool) -> Option<(Point, f64)> {
    let k = face.columns.partition_point(|c| c.0 < fraction);
    let (a, b) = (face.columns.get(k.checked_sub(1)?)?, face.columns.get(k)?);
    if b.0 - a.0 > 3.0 / (COLUMN_COUNT - 1) as f64 {
        return None;
    }
    let t = (fraction - a.0) / (b.0 - a.0);
    let (p, q) = if is_upper { (a.1, b.1) } else { (a.2, b.2) };
    Some((p + (q - p) * t, a.3 + (b.3 - a.3) * t))
}

fn length_of(line: &[Point]) -> f64 {
    line.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// The point at a fraction of a line's length.
fn at_fraction(line: &[Point], fraction: f64) -> Point {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall z = depth(y) with a parting at y = `at`.
    fn column(depth: impl Fn(f64) -> Option<f64>) -> Column {
        let mut c = Column {
            fraction: 0.5,
            hits: (0..ROW_COUNT)
                .map(|r| {
                    let y = r as f64 * STEP_MM - HALF_HEIGHT_MM;
                    depth(y).map(|z| (z, Point::new(0.0, y, z)))
                })
                .collect(),
            evidence: Vec::new(),
            is_gap: Vec::new(),
            is_through: Vec::new(),
        };
        weigh(&mut c);
        c
    }

    fn parting(c: Column) -> (Point, Point) {
        let row = best_path(std::slice::from_ref(&c))[0];
        edges(&c, row).expect("a parting")
    }

    #[test]
    fn gap_step_and_valley_are_found_where_they_are() {
        let (up, low) = parting(column(|y| {
            if (y - 1.0).abs() < 2.0 {
                None
            } else {
                Some(-0.1 * y.abs())
            }
        }));
        assert!((up.y - 3.0).abs() <= STEP_MM && (low.y + 1.0).abs() <= STEP_MM);
        let (up, low) = parting(column(|y| Some(if y > -2.1 { 2.0 } else { 0.0 })));
        assert!((up.y + 2.1).abs() <= STEP_MM && (low.y + 2.1).abs() <= STEP_MM);
        assert!(up.y > low.y && up.z > low.z);
        let (up, low) = parting(column(|y| Some(-(1.5 - (y - 3.0).abs()).max(0.0))));
        assert_eq!(up, low);
        assert!((up.y - 3.0).abs() <= STEP_MM);
    }

    #[test]
    fn a_smooth_wall_has_no_parting() {
        let c = column(|y| Some(-0.01 * y * y));
        assert!(c.evidence.iter().all(|e| *e < MIN_EVIDENCE));
    }
}
