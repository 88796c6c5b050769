//! How a template's displacements become a face's: the offset modes.
//!
//! - `global` (the paper): a displacement stays as it is, and one amplitude a patch scales it.
//! - `frame`: a displacement goes through the local map from the template to the face, the
//!   affine map that fits the skin around a vertex best, so it turns with the skin and grows
//!   with it along and across.
//! - `deformation_transfer`: the face takes over how each triangle of the template turns and
//!   stretches (Sumner & Popovic 2004), in the form of a Poisson problem over the skin's edges
//!   (Botsch, Sumner, Pauly & Gross 2006).

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::TransferError;
use super::blendshape::smoothed_normals;
use super::poisson::PoissonTransfer;
use crate::mesh::Topology;
use crate::template::Template;
use crate::{Point, Vector};

/// How a template's displacements are put on a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OffsetMode {
    /// As they are, scaled by an amplitude a patch.
    #[default]
    Global,
    /// Turned and stretched with the skin around.
    Frame,
    /// By what the shape does to every triangle.
    DeformationTransfer,
}

/// Rounds of averaging over neighbours of what a local map is fitted to, on the template some
/// 4 mm each: single edges carry the noise of registration.
const FRAME_ROUNDS: usize = 16;
/// Weight of the normal in the fit of a local map, against the mean edge.
const NORMAL_WEIGHT: f64 = 0.1;
/// No local map stretches by more, or less, than this.
const STRETCH_LIMITS: [f64; 2] = [0.25, 4.0];

/// The template's shapes on a face, before any amplitude.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceOffsets {
    /// Displacements of the template's skin vertices by each of its shapes at weight 1, shape
    /// `[shape_count][vertex_count]`. [mm, head frame]
    pub deltas: Vec<Vec<Vector>>,
    /// The linear map that displacements went through at each vertex; `None` where they are the
    /// template's, or no local map says what became of them.
    pub maps: Option<Vec<Matrix3<f64>>>,
}

/// Puts the displacements of all shapes of a template on a face.
///
/// - `positions`: the face in the template's topology (mm)
///
/// # Errors
///
/// [`TransferError::PositionCount`]; [`TransferError::Unsolvable`] where the face's triangles
/// allow no deformation transfer.
pub fn offsets_on_face(
    template: &Template,
    positions: &[Point],
    mode: OffsetMode,
) -> Result<FaceOffsets, TransferError> {
    let count = template.skin.vertex_count();
    if positions.len() != count {
        return Err(TransferError::PositionCount {
            expected: count,
            found: positions.len(),
        });
    }
    let shapes = template.shapes.iter();
    match mode {
        OffsetMode::Global => Ok(FaceOffsets {
            deltas: shapes.map(|shape| shape.spread(count)).collect(),
            maps: None,
        }),
        OffsetMode::Frame => Ok(FaceOffsets {
            deltas: shapes.map(|shape| shape.spread(count)).collect(),
            maps: None,
        }
        .mapped(local_maps(template, positions))),
        OffsetMode::DeformationTransfer => {
            let mut poisson = PoissonTransfer::new(template, positions)?;
            let deltas = shapes.map(|shape| poisson.put(&shape.spread(count)));
            Ok(FaceOffsets {
                deltas: deltas.collect::<Result<_, _>>()?,
                maps: None,
            })
        }
    }
}

impl FaceOffsets {
    /// Takes every displacement through a further map, one a vertex.
    #[must_use]
    pub fn mapped(mut self, maps: Vec<Matrix3<f64>>) -> Self {
        for shape in &mut self.deltas {
            for (delta, map) in shape.iter_mut().zip(&maps) {
                *delta = map * *delta;
            }
        }
        self.maps = Some(match self.maps {
            None => maps,
            Some(before) => before.iter().zip(&maps).map(|(b, m)| m * b).collect(),
        });
        self
    }
}

/// At each vertex the matrix J that minimizes `sum |J e - e'|^2` over the edges `e` around it
/// on the template and `e'` on the face, with the normals, which grow as the root of area.
fn local_maps(template: &Template, positions: &[Point]) -> Vec<Matrix3<f64>> {
    let rest = template.skin.positions();
    let triangles = template.skin.triangles();
    let topology = Topology::from_mesh(&template.skin);
    let from_normals = smoothed_normals(rest, &triangles, 3);
    let to_normals = smoothed_normals(positions, &triangles, 3);
    let moments = (0..rest.len())
        .map(|v| {
            let mut moment = Moment::default();
            let (mut from_size, mut to_size) = (0.0, 0.0);
            for &n in topology.neighbours(v as u32) {
                let from = rest[n as usize] - rest[v];
                let to = positions[n as usize] - positions[v];
                moment.add(&from, &to, 1.0);
                from_size += from.norm_squared();
                to_size += to.norm_squared();
            }
            let size = if from_size > 0.0 {
                (to_size / from_size).sqrt()
            } else {
                1.0
            };
            moment.add(
                &from_normals[v],
                &(to_normals[v] * size),
                NORMAL_WEIGHT * from_size,
            );
            moment
        })
        .collect();
    let spread = spread_moments(template, &topology, moments, FRAME_ROUNDS);
    spread.iter().map(|moment| limited(moment.map())).collect()
}

/// What a linear map `J` with `J x = y` is fitted to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moment {
    /// `sum y x^T`
    to: Matrix3<f64>,
    /// `sum x x^T`
    from: Matrix3<f64>,
}

impl Moment {
    pub(super) fn add(&mut self, from: &Vector, to: &Vector, weight: f64) {
        self.to += weight * to * from.transpose();
        self.from += weight * from * from.transpose();
    }

    /// Draws the map to the identity.
    pub(super) fn ridged(mut self, ridge: f64) -> Self {
        self.to += Matrix3::identity() * ridge;
        self.from += Matrix3::identity() * ridge;
        self
    }

    /// `J`; the identity where directions are missing.
    pub(super) fn map(&self) -> Matrix3<f64> {
        self.from
            .try_inverse()
            .map_or_else(Matrix3::identity, |inverse| self.to * inverse)
    }
}

/// Averages moments over neighbours, `rounds` times, but not across lips or lids.
pub(super) fn spread_moments(
    template: &Template,
    topology: &Topology,
    mut moments: Vec<Moment>,
    rounds: usize,
) -> Vec<Moment> {
    let regions = &template.regions;
    let region = |v: usize| regions.vertex_regions[v];
    for _ in 0..rounds {
        moments = (0..moments.len())
            .map(|v| {
                let ring = topology.neighbours(v as u32).iter().map(|&n| n as usize);
                let mut sum = moments[v];
                let mut count = 1.0;
                for n in ring.filter(|&n| !regions.are_apart(region(v), region(n))) {
                    sum.to += moments[n].to;
                    sum.from += moments[n].from;
                    count += 1.0;
                }
                Moment {
                    to: sum.to / count,
                    from: sum.from / count,
                }
            })
            .collect();
    }
    moments
}

/// The map with its principal stretches clamped to [`STRETCH_LIMITS`]; the identity where it
/// would turn the skin inside out.
pub(super) fn limited(map: Matrix3<f64>) -> Matrix3<f64> {
    if !map.iter().all(|x| x.is_finite()) || map.determinant() <= 0.0 {
        return Matrix3::identity();
    }
    let mut svd = map.svd(true, true);
    let [low, high] = STRETCH_LIMITS;
    if svd.singular_values.iter().all(|s| (low..=high).contains(s)) {
        return map;
    }
    svd.singular_values.apply(|s| *s = s.clamp(low, high));
    svd.recompose().unwrap_or_else(|_| Matrix3::identity())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::human;

    /// Largest distance between two sets of shapes over all vertices. (mm)
    fn farthest(a: &[Vec<Vector>], b: &[Vec<Vector>]) -> f64 {
        let pairs = a.iter().flatten().zip(b.iter().flatten());
        pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn every_mode_gives_the_template_its_own_shapes() {
        let template = human();
        let rest = template.skin.positions();
        let own = offsets_on_face(template, rest, OffsetMode::Global)
            .unwrap()
            .deltas;
        for mode in [OffsetMode::Frame, OffsetMode::DeformationTransfer] {
            let put = offsets_on_face(template, rest, mode).unwrap().deltas;
            let error = farthest(&own, &put);
            assert!(error < 1e-4, "{mode:?} is off by {error} mm");
        }
    }

    #[test]
    fn a_turned_and_stretched_head_takes_its_shapes_along() {
        let template = human();
        let turn = nalgebra::Rotation3::from_euler_angles(0.2, -0.4, 0.1).into_inner();
        let map = turn * Matrix3::from_diagonal(&Vector::new(1.3, 0.8, 1.1));
        let positions: Vec<Point> = template
            .skin
            .positions()
            .iter()
            .map(|p| Point::from(map * p.coords))
            .collect();
        let own = offsets_on_face(template, template.skin.positions(), OffsetMode::Global)
            .unwrap()
            .deltas;
        let want: Vec<Vec<Vector>> = own
            .iter()
            .map(|shape| shape.iter().map(|d| map * d).collect())
            .collect();
        let put = offsets_on_face(template, &positions, OffsetMode::Frame)
            .unwrap()
            .deltas;
        // Normals do not map as vectors do where the stretch is uneven, so nearly is the best
        // there is; on flat skin nothing else tells what becomes of that direction.
        let squares = |a: &[Vec<Vector>], b: &[Vec<Vector>]| -> f64 {
            let pairs = a.iter().flatten().zip(b.iter().flatten());
            pairs.map(|(a, b)| (a - b).norm_squared()).sum()
        };
        let (left, unmapped) = (squares(&want, &put), squares(&want, &own));
        assert!(left < 0.05 * unmapped, "{left} of {unmapped} mm^2 are left");
    }

    #[test]
    fn a_larger_head_moves_in_proportion() {
        let template = human();
        let positions: Vec<Point> = template.skin.positions().iter().map(|p| p * 1.5).collect();
        let own = offsets_on_face(template, template.skin.positions(), OffsetMode::Global)
            .unwrap()
            .deltas;
        let want: Vec<Vec<Vector>> = own
            .iter()
            .map(|shape| shape.iter().map(|d| d * 1.5).collect())
            .collect();
        for mode in [OffsetMode::Frame, OffsetMode::DeformationTransfer] {
            let put = offsets_on_face(template, &positions, mode).unwrap().deltas;
            let error = farthest(&want, &put);
            assert!(error < 2e-4, "{mode:?} is off by {error} mm");
        }
    }

    #[test]
    fn too_few_positions_are_refused() {
        let template = human();
        let error = offsets_on_face(template, &[], OffsetMode::Frame).unwrap_err();
        assert!(matches!(error, TransferError::PositionCount { .. }));
    }
}
