//! Mouth and eyes of the face: where its lips and lids part, seen from the front.
//!
//! The face is probed by rays in columns from corner to corner of the opening, as the template
//! deformed so far places it. In a column of depths the parting is a gap (open mouth, an eye),
//! a step (the upper lip overhangs the lower one) or a valley (a crease of a closed surface).
//! The path of most evidence across the columns is found by dynamic programming. This works
//! alike for holes of the mesh, for mouths and sockets with an inside, and for fused scans.
//!
//! The template, as far as it has been deformed, is probed in the same way, so that what is
//! matched is the same thing on both: the places where one sees lips and lids part.

use super::face_model::{FaceModel, Opening, OpeningKind};
use super::nonrigid_icp::Pin;
use crate::mesh::Surface;
use crate::{Point, Vector};

/// Columns from corner to corner.
const COLUMN_COUNT: usize = 41;
/// Rays reach this far above and below the expected line, one every [`STEP_MM`]. (mm)
const HALF_HEIGHT_MM: f64 = 9.0;
const STEP_MM: f64 = 0.25;
/// Rows of a column.
const ROW_COUNT: usize = (2.0 * HALF_HEIGHT_MM / STEP_MM) as usize + 1;
/// What lies this far behind the skin beside it is inside the head. (mm)
const THROUGH_MM: f64 = 5.0;
/// Neighbouring rays that differ by more see two surfaces. (mm)
const JUMP_MM: f64 = 0.9;
/// A valley is judged against the skin this many rows above and below.
const VALLEY_ROWS: usize = 6;
/// Evidence below this is noise. (mm)
const MIN_EVIDENCE: f64 = 0.12;
/// Pins of lids that are shut where those of the template are still open weigh this much more:
/// no surface nearby tells how far they go.
const SHUT_GAIN: f64 = 20.0;

/// The parting of an opening.
#[derive(Debug, Clone)]
pub(super) struct Parting {
    pub(super) kind: OpeningKind,
    pub(super) columns: Vec<PartingColumn>,
    /// Whether one looks inside in most of the columns.
    pub(super) is_through: bool,
    /// From corner to corner. (mm)
    pub(super) width: f64,
    pub(super) up: Vector,
    /// From the right corner to the left one.
    pub(super) across: Vector,
}

/// Where lips or lids part at one place between the corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct PartingColumn {
    /// From the right corner (-X), 0, to the left one, 1.
    pub(super) fraction: f64,
    pub(super) upper: Hit,
    pub(super) lower: Hit,
    /// From 0 to 1.
    trust: f64,
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Along the view, towards the viewer. (mm)
    depth: f64,
    pub(super) point: Point,
    pub(super) triangle: u32,
    barycentric: [f64; 3],
}

/// Finds the partings of `openings` on a surface; `vertices` are the template's, as far as it
/// has been deformed.
pub(super) fn find_partings(
    openings: &[Opening],
    surface: &Surface,
    vertices: &[Point],
) -> Vec<Parting> {
    openings
        .iter()
        .filter_map(|opening| trace(opening, surface, vertices))
        .collect()
}

/// One column of rays: depth of each row along the view, from the lowest row up; `None` where
/// nothing is met.
struct Column {
    fraction: f64,
    hits: Vec<Option<Hit>>,
    evidence: Vec<f64>,
    is_gap: Vec<bool>,
    /// Gaps so deep that one looks inside.
    is_through: Vec<bool>,
}

fn trace(opening: &Opening, surface: &Surface, vertices: &[Point]) -> Option<Parting> {
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
            probe(surface, fraction, &middle, &up, &view)
        })
        .collect();
    for c in &mut columns {
        weigh(c);
    }
    let path = best_path(&columns);
    let found: Vec<PartingColumn> = columns
        .iter()
        .zip(&path)
        .filter_map(|(c, &row)| {
            let (upper, lower) = edges(c, row)?;
            (c.evidence[row] > MIN_EVIDENCE).then_some(PartingColumn {
                fraction: c.fraction,
                upper,
                lower,
                trust: c.evidence[row].min(1.0),
            })
        })
        .collect();
    if found.len() < COLUMN_COUNT / 4 {
        return None;
    }
    let through_count = columns
        .iter()
        .zip(&path)
        .filter(|(c, row)| c.is_through[**row])
        .count();
    Some(Parting {
        kind: opening.kind,
        columns: found,
        is_through: 2 * through_count > columns.len(),
        width: (left - right).norm(),
        up,
        across,
    })
}

fn probe(surface: &Surface, fraction: f64, middle: &Point, up: &Vector, view: &Vector) -> Column {
    const BEFORE_MM: f64 = 25.0;
    const BEHIND_MM: f64 = 20.0;
    let hits = (0..ROW_COUNT)
        .map(|row| {
            let height = row as f64 * STEP_MM - HALF_HEIGHT_MM;
            let origin = middle + up * height + view * BEFORE_MM;
            surface
                .cast_ray(&origin, &-view, BEFORE_MM + BEHIND_MM)
                .map(|hit| Hit {
                    depth: BEFORE_MM - hit.distance,
                    point: origin - view * hit.distance,
                    triangle: hit.triangle,
                    barycentric: hit.barycentric.map(|b| b.clamp(0.0, 1.0)),
                })
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
/// valley. (mm)
///
/// A gap is a run of rows between a drop and a rise, seen from below, that lies deeper than
/// the skin at both its ends; a crease slopes down without a drop.
fn weigh(column: &mut Column) {
    let depth = |row: usize| column.hits[row].map_or(-1e3, |h| h.depth);
    let mut behind = vec![0.0; ROW_COUNT];
    let mut start = None;
    for row in 0..ROW_COUNT - 1 {
        let step = depth(row + 1) - depth(row);
        if step < -JUMP_MM && start.is_none() {
            start = Some(row + 1);
        } else if step > JUMP_MM
            && let Some(first) = start.take()
        {
            let skin = depth(first - 1).min(depth(row + 1));
            for r in first..=row {
                behind[r] = (skin - depth(r)).max(0.0);
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
fn edges(column: &Column, row: usize) -> Option<(Hit, Hit)> {
    let place = |r: usize| column.hits.get(r).copied().flatten();
    if column.is_gap[row] {
        let up = (row..ROW_COUNT).find(|&r| !column.is_gap[r])?;
        let down = (0..row).rev().find(|&r| !column.is_gap[r])?;
        return Some((place(up)?, place(down)?));
    }
    let here = place(row)?;
    let next = place(row + 1)?;
    let is_step = match (column.hits[row], column.hits[row + 1]) {
        (Some(a), Some(b)) => (a.depth - b.depth).abs() > JUMP_MM,
        _ => true,
    };
    Some(if is_step { (next, here) } else { (here, here) })
}

/// Pins of the template's partings to those of the face, at equal fractions from corner to
/// corner.
///
/// - `own`: partings of the template as far as it has been deformed: under a heavy lid one sees
///   other skin at the parting than on the template itself
pub(super) fn parting_pins(
    model: &FaceModel<'_>,
    own: &[Parting],
    found: &[Parting],
    weight: f64,
) -> Vec<Pin> {
    let mut pins = Vec::new();
    for face in found {
        let Some(own) = own.iter().find(|o| o.kind == face.kind) else {
            continue;
        };
        let is_shut = face.kind != OpeningKind::Mouth && own.is_through && !face.is_through;
        let weight = if is_shut { SHUT_GAIN * weight } else { weight };
        for column in &own.columns {
            let Some(mate) = face.columns.iter().find(|c| c.fraction == column.fraction) else {
                continue;
            };
            for (from, to) in [(&column.upper, &mate.upper), (&column.lower, &mate.lower)] {
                let corners = model.triangles[from.triangle as usize];
                pins.push(Pin {
                    corners: [0, 1, 2].map(|k| (corners[k], from.barycentric[k])),
                    place: to.point,
                    weight: weight * column.trust * mate.trust,
                });
            }
        }
    }
    pins
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
                    depth(y).map(|z| Hit {
                        depth: z,
                        point: Point::new(0.0, y, z),
                        triangle: 0,
                        barycentric: [1.0, 0.0, 0.0],
                    })
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
        let (upper, lower) = edges(&c, row).expect("a parting");
        (upper.point, lower.point)
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
