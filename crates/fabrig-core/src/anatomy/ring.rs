//! Sphincters: rings from the margin of an opening outwards.

use super::error::AnatomyError;
use super::layout::PatchText;
use super::margin::Margin;
use super::patch::{GridShape, Resolution, SurfaceNode};
use super::places::{Places, SNAP_REACH, off_skin};
use super::sheet::depth_at;
use super::spline::{polyline_at, polyline_length, sample_by_length};
use crate::Point;
use crate::mesh::SurfacePoint;

/// How often a stretch between two rings is halved, each middle put on the skin.
const HALVINGS: u32 = 5;

/// Rounds of evening out between neighbours at standard resolution; the margin and the
/// outermost ring stay. Coarser grids have fewer, so that corners are not rounded off.
const EVENING_ROUNDS: f64 = 4.0;

/// First step from the margin, relative to an even step: rows are closer where lips and lids
/// move most.
const FIRST_STEP: f64 = 0.6;

/// Charts a sphincter. On the mid line the right half is left as it is computed, to be
/// replaced by the mirror image.
///
/// Column j stands at (j + 1/2) / `u_count` of the way round, from the corner towards -X over
/// the upper arc to the corner towards +X and back below, so that no node lies in a corner:
/// each belongs to the upper or to the lower lip or lid.
pub(super) fn chart_ring(
    places: &Places<'_>,
    text: &PatchText,
    grid: GridShape,
) -> Result<Vec<SurfaceNode>, AnatomyError> {
    let margin = Margin::find(places, text)?;
    let upper_closed = places.regions(&text.name, "upper_not_on", &text.upper_not_on)?;
    let lower_closed = places.regions(&text.name, "lower_not_on", &text.lower_not_on)?;
    let open = [
        places.open_triangles(&upper_closed),
        places.open_triangles(&lower_closed),
    ];
    let open_at_margin = places.open_triangles(&[]);
    let mut rings = Vec::new();
    for ring in &text.rings {
        let mut arcs = Vec::new();
        for arc in [&ring.upper, &ring.lower] {
            let mut points = Vec::new();
            for expression in arc {
                points.push(places.place(&text.name, "rings", expression)?.point);
            }
            arcs.push(sample_by_length(&points, 257));
        }
        rings.push(arcs);
    }

    let (u_count, v_count) = (grid.u_count as usize, grid.v_count as usize);
    let mut columns: Vec<Vec<SurfacePoint>> = vec![Vec::new(); u_count];
    for u in 0..u_count {
        let stop = Stop::of_column(u, u_count, text.is_pair);
        if stop.is_mirrored {
            continue;
        }
        let half = usize::from(stop.is_lower);
        let arc = if stop.is_lower {
            &margin.lower
        } else {
            &margin.upper
        };
        let first = Margin::place(places, arc, stop.share, &open_at_margin).ok_or_else(|| {
            AnatomyError::BadMargin {
                patch: text.name.clone(),
                key: "margin".to_owned(),
                reason: format!("an edge of column {u} has no open triangle"),
            }
        })?;
        let mut path = vec![first.point];
        for arcs in &rings {
            let to = polyline_at(&arcs[half], stop.share);
            let to = on_skin(places, text, &to, &open[half])?.point;
            walk(places, text, &mut path, to, &open[half], HALVINGS)?;
        }
        if polyline_length(&path) < 1e-3 {
            return Err(text.bad_value("rings", "a ring outside the margin", &path[0]));
        }
        columns[u].push(first);
        for v in 1..v_count {
            let x = v as f64 / (v_count - 1) as f64;
            let point = polyline_at(&path, x * (FIRST_STEP + (1.0 - FIRST_STEP) * x));
            columns[u].push(on_skin(places, text, &point, &open[half])?);
        }
    }
    let mut points = complete(&columns, text.is_pair);
    let finer = (f64::from(grid.u_count) / f64::from(Resolution::STANDARD.ring[0])).min(1.0);
    for _ in 0..(EVENING_ROUNDS * finer * finer).round() as usize {
        points = even_out(&points);
        for u in 0..u_count {
            let stop = Stop::of_column(u, u_count, text.is_pair);
            if stop.is_mirrored {
                continue;
            }
            for v in 1..v_count - 1 {
                let half = usize::from(stop.is_lower);
                columns[u][v] = on_skin(places, text, &points[u][v], &open[half])?;
            }
        }
        points = complete(&columns, text.is_pair);
    }

    let mut nodes = Vec::with_capacity(grid.node_count());
    for v in 0..v_count {
        let depth = depth_at(&text.depth, v as f64 / (v_count - 1) as f64);
        for u in 0..u_count {
            let source = if columns[u].is_empty() {
                mirror_column(u, u_count)
            } else {
                u
            };
            let place = &columns[source][v];
            nodes.push(SurfaceNode {
                triangle: place.triangle,
                barycentric: place.barycentric,
                depth,
            });
        }
    }
    Ok(nodes)
}

/// The column that is the mirror image of column `u` of a sphincter on the mid line.
fn mirror_column(u: usize, u_count: usize) -> usize {
    (u_count + u_count / 2 - 1 - u) % u_count
}

/// Where a column meets a ring.
struct Stop {
    is_lower: bool,
    /// Share of the length of the arc.
    share: f64,
    /// Whether it lies on the half that is not drawn.
    is_mirrored: bool,
}

impl Stop {
    fn of_column(u: usize, u_count: usize, is_pair: bool) -> Self {
        let turn = (u as f64 + 0.5) / u_count as f64;
        let is_lower = turn > 0.5;
        // 0 at the corner towards -X, 1 at that towards +X, on either arc.
        let across = if is_lower {
            2.0 - 2.0 * turn
        } else {
            2.0 * turn
        };
        if is_pair {
            Self {
                is_lower,
                share: across,
                is_mirrored: false,
            }
        } else {
            Self {
                is_lower,
                share: 2.0 * across - 1.0,
                is_mirrored: across < 0.5,
            }
        }
    }
}

fn on_skin(
    places: &Places<'_>,
    text: &PatchText,
    point: &Point,
    open: &[bool],
) -> Result<SurfacePoint, AnatomyError> {
    places
        .skin
        .closest(point, SNAP_REACH, &|t| open[t as usize])
        .ok_or_else(|| off_skin(&text.name, point))
}

/// Appends a curve on the skin from the path's end to `to`.
fn walk(
    places: &Places<'_>,
    text: &PatchText,
    path: &mut Vec<Point>,
    to: Point,
    open: &[bool],
    halvings: u32,
) -> Result<(), AnatomyError> {
    let from = path[path.len() - 1];
    if halvings == 0 {
        path.push(to);
        return Ok(());
    }
    let middle = on_skin(places, text, &nalgebra::center(&from, &to), open)?.point;
    walk(places, text, path, middle, open, halvings - 1)?;
    walk(places, text, path, to, open, halvings - 1)
}

/// Points of all columns, mirrored where they are not drawn.
fn complete(columns: &[Vec<SurfacePoint>], is_pair: bool) -> Vec<Vec<Point>> {
    (0..columns.len())
        .map(|u| {
            if is_pair || !columns[u].is_empty() {
                columns[u].iter().map(|p| p.point).collect()
            } else {
                columns[mirror_column(u, columns.len())]
                    .iter()
                    .map(|p| Point::new(-p.point.x, p.point.y, p.point.z))
                    .collect()
            }
        })
        .collect()
}

/// One round: every node but those of the first and last row moves halfway to the middle of
/// its neighbours around; along a column rows are uneven on purpose.
fn even_out(points: &[Vec<Point>]) -> Vec<Vec<Point>> {
    let u_count = points.len();
    let mut out = points.to_vec();
    for u in 0..u_count {
        let (before, after) = ((u + u_count - 1) % u_count, (u + 1) % u_count);
        for v in 1..points[u].len() - 1 {
            let around = (points[before][v].coords + points[after][v].coords) * 0.5;
            let mean = around + points[u][v].coords;
            out[u][v] = Point::from(mean * 0.5);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_pair_go_round_from_the_inner_corner_over_the_top() {
        let stops: Vec<Stop> = (0..4).map(|u| Stop::of_column(u, 4, true)).collect();
        let shares: Vec<(bool, f64)> = stops.iter().map(|s| (s.is_lower, s.share)).collect();
        assert_eq!(
            shares,
            vec![(false, 0.25), (false, 0.75), (true, 0.75), (true, 0.25)]
        );
        assert!(stops.iter().all(|s| !s.is_mirrored));
    }

    #[test]
    fn columns_on_the_mid_line_are_drawn_on_the_left_and_mirrored_on_the_right() {
        for u in 0..16 {
            let stop = Stop::of_column(u, 16, false);
            let image = mirror_column(u, 16);
            assert_eq!(mirror_column(image, 16), u);
            let other = Stop::of_column(image, 16, false);
            assert_ne!(stop.is_mirrored, other.is_mirrored);
            assert_eq!(stop.is_lower, other.is_lower);
            assert!((stop.share + other.share).abs() < 1e-12);
        }
    }
}
