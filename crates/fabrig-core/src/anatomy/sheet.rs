//! Linear muscles and fat pads: a sheet of fibres through authored ribs.

use super::error::AnatomyError;
use super::layout::PatchText;
use super::patch::{GridShape, SurfaceNode};
use super::places::{Places, SNAP_REACH, off_skin};
use super::spline::{catmull_rom_at, polyline_at, polyline_length, sample_by_length};
use crate::mesh::SurfacePoint;
use crate::{Point, Vector};

/// Samples along each rib and along each fibre before fibres are cut to the grid's columns.
const FIBRE_SAMPLES: usize = 65;

/// Charts the drawn side of a sheet. On the mid line that is the left half of the rows; the
/// other half is left as it is computed, to be replaced by the mirror image.
///
/// Ribs are splines through their points; across them runs another spline, by their mean
/// distance. Each fibre is then projected onto the skin along blended normals and cut into
/// even steps.
pub(super) fn chart_sheet(
    places: &Places<'_>,
    text: &PatchText,
    grid: GridShape,
) -> Result<Vec<SurfaceNode>, AnatomyError> {
    let mut ribs = Vec::new();
    for rib in &text.ribs {
        let mut points = Vec::new();
        for expression in rib {
            points.push(places.place(&text.name, "ribs", expression)?.point);
        }
        ribs.push(rib_on_skin(places, text, &points)?);
    }
    if !text.is_pair {
        complete_across_mid_line(text, &mut ribs)?;
    }
    let normals: Vec<Vec<Vector>> = ribs
        .iter()
        .map(|rib| rib.iter().map(|p| places.normal(p)).collect())
        .collect();

    let mut knots = vec![0.0];
    for pair in ribs.windows(2) {
        let sum: f64 = (0..FIBRE_SAMPLES)
            .map(|k| (pair[1][k].point - pair[0][k].point).norm())
            .sum();
        knots.push(knots[knots.len() - 1] + sum / FIBRE_SAMPLES as f64);
    }
    let width = knots[knots.len() - 1];
    if knots.windows(2).any(|k| k[1] - k[0] < 1e-3) {
        return Err(text.bad_value("ribs", "ribs apart from each other", &knots));
    }

    let open = places.open_triangles(&[]);
    let accept = |t: u32| open[t as usize];
    let mut nodes = Vec::with_capacity(grid.node_count());
    for v in 0..grid.v_count {
        let at = width * f64::from(v) / f64::from(grid.v_count - 1);
        let mut fibre = Vec::with_capacity(FIBRE_SAMPLES);
        for k in 0..FIBRE_SAMPLES {
            let column: Vec<Point> = ribs.iter().map(|rib| rib[k].point).collect();
            let point = catmull_rom_at(&column, &knots, at);
            let normal = blend_normals(&normals, &knots, at, k);
            let place = places
                .skin
                .project(&point, &normal, SNAP_REACH, &accept)
                .ok_or_else(|| off_skin(&text.name, &point))?;
            fibre.push(place.point);
        }
        for u in 0..grid.u_count {
            let share = f64::from(u) / f64::from(grid.u_count - 1);
            let point = polyline_at(&fibre, share);
            let place = places
                .skin
                .closest(&point, SNAP_REACH, &accept)
                .ok_or_else(|| off_skin(&text.name, &point))?;
            nodes.push(SurfaceNode {
                triangle: place.triangle,
                barycentric: place.barycentric,
                depth: depth_at(&text.depth, share),
            });
        }
    }
    Ok(nodes)
}

/// Depth at a share of the way, linear between equal steps of a profile.
pub(super) fn depth_at(profile: &[f64], share: f64) -> f64 {
    let last = profile.len() - 1;
    let x = share.clamp(0.0, 1.0) * last as f64;
    let k = (x as usize).min(last.saturating_sub(1));
    let next = (k + 1).min(last);
    profile[k] + (profile[next] - profile[k]) * (x - k as f64)
}

/// Even samples of a rib, each on the skin.
fn rib_on_skin(
    places: &Places<'_>,
    text: &PatchText,
    points: &[Point],
) -> Result<Vec<SurfacePoint>, AnatomyError> {
    if polyline_length(points) < 1e-3 {
        return Err(text.bad_value("ribs", "a rib longer than nothing", &points));
    }
    sample_by_length(points, FIBRE_SAMPLES)
        .iter()
        .map(|p| places.snap(&text.name, p))
        .collect()
}

/// Appends the mirror images of all ribs but the last, which lies on the mid line.
fn complete_across_mid_line(
    text: &PatchText,
    ribs: &mut Vec<Vec<SurfacePoint>>,
) -> Result<(), AnatomyError> {
    let last = ribs.len() - 1;
    for place in &mut ribs[last] {
        // Half a millimetre is far more than rounding and far less than a wrong point.
        if place.point.x.abs() > 0.5 {
            return Err(text.bad_value("ribs", "the last rib on the mid line", &place.point));
        }
        place.point.x = 0.0;
    }
    let images: Vec<Vec<SurfacePoint>> = ribs[..last].iter().rev().cloned().collect();
    for mut image in images {
        for place in &mut image {
            place.point.x = -place.point.x;
        }
        ribs.push(image);
    }
    Ok(())
}

/// Normal between ribs, linear in the distance across.
fn blend_normals(normals: &[Vec<Vector>], knots: &[f64], at: f64, sample: usize) -> Vector {
    let last = knots.len() - 1;
    let k = knots[1..last].iter().filter(|knot| **knot <= at).count();
    let s = ((at - knots[k]) / (knots[k + 1] - knots[k])).clamp(0.0, 1.0);
    let (a, b) = (normals[k][sample], normals[k + 1][sample]);
    (a * (1.0 - s) + b * s).try_normalize(0.0).unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_runs_linearly_between_equal_steps() {
        assert_eq!(depth_at(&[3.0], 0.7), 3.0);
        assert_eq!(depth_at(&[8.0, 4.0], 0.25), 7.0);
        assert_eq!(depth_at(&[8.0, 4.0, 2.0], 0.75), 3.0);
        assert_eq!(depth_at(&[8.0, 4.0, 2.0], 1.0), 2.0);
    }
}
