//! The face to be matched: its surface in the head frame, with what correspondences need.

use std::sync::OnceLock;

use nalgebra::SVector;

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
    /// Triangles at every vertex, where they are asked for.
    around: OnceLock<Vec<Vec<u32>>>,
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
            around: OnceLock::new(),
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

    /// The place near `start` that is most alike in place and in normal (unit length), and its
    /// own normal: least |q - point|^2 + reach^2 |n_q - normal|^2 over the surface, walked to
    /// from triangle to triangle. Where a surface bends, this tells how far along it a point
    /// has slid, which the closest place alone does not.
    ///
    /// - `reach`: distance that a difference of one between normals is worth (mm)
    pub(super) fn most_alike(
        &self,
        point: &Point,
        normal: &Vector,
        start: u32,
        reach: f64,
    ) -> (Point, Vector) {
        let around = self.around.get_or_init(|| {
            let mut around = vec![Vec::new(); self.positions.len()];
            for (k, t) in self.triangles.iter().enumerate() {
                for &v in t {
                    around[v as usize].push(k as u32);
                }
            }
            around
        });
        let sought = oriented(point, normal, reach);
        let closest = |t: u32| {
            closest_of_triangle(
                &sought,
                &self.triangles[t as usize].map(|v| {
                    oriented(
                        &self.positions[v as usize],
                        &self.normals[v as usize],
                        reach,
                    )
                }),
            )
        };
        let mut at = start;
        let (mut place, mut least) = closest(at);
        for _ in 0..MAX_WALK {
            let mut next = at;
            for &v in &self.triangles[at as usize] {
                for &t in &around[v as usize] {
                    let (other, distance) = closest(t);
                    if distance < least {
                        (place, least, next) = (other, distance, t);
                    }
                }
            }
            if next == at {
                break;
            }
            at = next;
        }
        let [x, y, z, nx, ny, nz]: [f64; 6] = place.into();
        (Point::new(x, y, z), Vector::new(nx, ny, nz) / reach)
    }
}

/// Triangles that a walk passes, at most.
const MAX_WALK: usize = 30;

/// A place and its normal (times a length) in one space.
type Oriented = SVector<f64, 6>;

fn oriented(p: &Point, n: &Vector, reach: f64) -> Oriented {
    let n = n * reach;
    Oriented::from([p.x, p.y, p.z, n.x, n.y, n.z])
}

/// The closest place of a triangle to `p`, and its squared distance.
fn closest_of_triangle(p: &Oriented, [a, b, c]: &[Oriented; 3]) -> (Oriented, f64) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d, e, f) = (ab.norm_squared(), ab.dot(&ac), ac.norm_squared());
    let (g, h) = (ab.dot(&ap), ac.dot(&ap));
    let det = d * f - e * e;
    if det > 1e-12 * d * f {
        let (s, t) = ((g * f - h * e) / det, (h * d - g * e) / det);
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            let place = a + ab * s + ac * t;
            return (place, (p - place).norm_squared());
        }
    }
    let on_side = |from: &Oriented, side: Oriented| {
        let share = (p - from).dot(&side) / side.norm_squared().max(f64::MIN_POSITIVE);
        let place = from + side * share.clamp(0.0, 1.0);
        (place, (p - place).norm_squared())
    };
    let sides = [on_side(a, ab), on_side(a, ac), on_side(b, c - b)];
    let nearer = |x: (Oriented, f64), y: (Oriented, f64)| if y.1 < x.1 { y } else { x };
    nearer(nearer(sides[0], sides[1]), sides[2])
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A cylinder of radius 30 about y, `count` columns, 40 high.
    fn cylinder(count: usize) -> Target {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for k in 0..count {
            let a = k as f64 / count as f64 * std::f64::consts::TAU;
            for y in [-20.0, 0.0, 20.0] {
                positions.push(Point::new(30.0 * a.sin(), y, 30.0 * a.cos()));
            }
            let (here, next) = (3 * k as u32, 3 * ((k + 1) % count) as u32);
            for r in 0..2 {
                triangles.push([here + r, next + r, next + r + 1]);
                triangles.push([here + r, next + r + 1, here + r + 1]);
            }
        }
        Target::new(positions, triangles).expect("surface")
    }

    #[test]
    fn a_normal_tells_how_far_a_point_has_slid() {
        let target = cylinder(90);
        // In front of the cylinder's front, looking 0.4 rad aside.
        let point = Point::new(0.0, 3.0, 32.0);
        let normal = Vector::new(0.4f64.sin(), 0.0, 0.4f64.cos());
        let start = target.surface.closest(&point).triangle;
        let angle = |reach: f64| {
            let (q, n) = target.most_alike(&point, &normal, start, reach);
            assert!((q.y - 3.0).abs() < 1e-9);
            assert!(n.normalize().dot(&Vector::new(q.x, 0.0, q.z).normalize()) > 0.999);
            q.x.atan2(q.z)
        };
        // On a cylinder both terms are circles: the least lies at the angle of their sum,
        // 30 * 32 (0, 1) + reach^2 (sin 0.4, cos 0.4).
        for reach in [1.0, 15.0, 60.0, 1e3] {
            let (a, b) = (30.0 * 32.0, reach * reach);
            let expected = (b * 0.4f64.sin()).atan2(a + b * 0.4f64.cos());
            assert!((angle(reach) - expected).abs() < 2e-3, "{reach}");
        }
    }

    #[test]
    fn the_closest_place_of_a_triangle_is_no_farther_than_any_other() {
        let corner = |x: [f64; 6]| Oriented::from(x);
        let t = [
            corner([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
            corner([4.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
            corner([1.0, 3.0, 0.0, 0.0, 0.0, 2.0]),
        ];
        for k in 0..60 {
            let p = Oriented::from_fn(|i, _| 4.0 * ((7 * k + 3 * i) as f64 * 0.9).sin());
            let (place, squared) = closest_of_triangle(&p, &t);
            assert!(((p - place).norm_squared() - squared).abs() < 1e-9);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (s, u) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let other = t[0] + (t[1] - t[0]) * s + (t[2] - t[0]) * u;
                    assert!(squared <= (p - other).norm_squared() + 1e-9);
                }
            }
        }
    }
}
