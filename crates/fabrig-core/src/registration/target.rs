//! The face to be matched: its surface in the head frame, with what correspondences need.

use crate::mesh::{Surface, SurfaceError, SurfacePoint, Topology, vertex_normals};
use crate::{Point, Vector};

/// A match of one template point on the face.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    pub(super) place: SurfacePoint,
    /// Whether the place lies on the rim of the face's mesh: the true counterpart may be
    /// beyond it.
    pub(super) is_on_boundary: bool,
}

/// The face's main piece, placed in the head frame. (mm)
pub(super) struct Target {
    pub(super) positions: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) normals: Vec<Vector>,
    pub(super) surface: Surface,
    is_boundary: Vec<bool>,
}

impl Target {
    pub(super) fn new(
        positions: Vec<Point>,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, SurfaceError> {
        let topology = Topology::from_triangles(positions.len(), &triangles);
        Ok(Self {
            normals: vertex_normals(&positions, &triangles),
            surface: Surface::new(&positions, &triangles)?,
            is_boundary: topology.boundary_mask(),
            positions,
            triangles,
        })
    }

    /// The closest place within `reach` whose normal is within the angle of cosine `cos_limit`.
    pub(super) fn matching(
        &self,
        point: &Point,
        normal: &Vector,
        reach: f64,
        cos_limit: f64,
    ) -> Option<Match> {
        let place = self.surface.closest_where(point, reach, |at| {
            let n = self.surface.blend(at, &self.normals);
            // Blended normals are shorter than one; the comparison needs no root.
            let along = n.dot(normal);
            along > 0.0 && along * along > cos_limit * cos_limit * n.norm_squared()
        })?;
        let corners = self.triangles[place.triangle as usize];
        let is_on_boundary = (0..3)
            .all(|k| place.barycentric[k] < 1e-9 || self.is_boundary[corners[k] as usize])
            && place.barycentric.iter().any(|b| *b < 1e-9);
        Some(Match {
            place,
            is_on_boundary,
        })
    }
}

/// Robust scale of distances: 1.4826 times the median absolute deviation from the median, and
/// the median.
pub(super) fn median_and_deviation(values: &[f64]) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let middle = values.len() / 2;
    let mut sorted = values.to_vec();
    let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    for v in &mut sorted {
        *v = (*v - median).abs();
    }
    let deviation = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    (median, 1.4826 * deviation)
}

/// Geman-McClure weight of a residual `r` at scale `sigma`.
pub(super) fn geman_mcclure(r: f64, sigma: f64) -> f64 {
    let s = sigma * sigma;
    (s / (s + r * r)).powi(2)
}
