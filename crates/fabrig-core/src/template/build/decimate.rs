//! Fewer triangles by edge collapse with quadric errors.
//!
//! The vertices that remain stand at new places (each collapse goes to the point of least
//! error), so the result shares neither vertices nor edges with what went in. Borders are held
//! by planes through them, square to the surface. A collapse that would fold the surface over
//! or join sheets is not made.
//!
//! Source: Garland & Heckbert 1997.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use nalgebra::{Matrix3, Matrix4, Vector4};

use crate::{Point, Vector};

/// How much a border plane counts beside a surface plane.
const BORDER_WEIGHT: f64 = 10.0;
/// How much triangle shape counts: small, it only decides on flat ground.
const SHAPE_WEIGHT: f64 = 1e-3;

/// A collapse that could be made, cheapest first.
struct Candidate {
    cost: f64,
    edge: (u32, u32),
    versions: (u32, u32),
    place: Point,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost
            .total_cmp(&other.cost)
            .then(self.edge.cmp(&other.edge))
            .then(self.versions.cmp(&other.versions))
    }
}

struct Decimation {
    positions: Vec<Point>,
    quadrics: Vec<Matrix4<f64>>,
    versions: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    is_alive: Vec<bool>,
    around: Vec<BTreeSet<u32>>,
    heap: BinaryHeap<Reverse<Candidate>>,
}

/// Collapses edges until at most `vertex_count` vertices are left, or none can go.
pub(crate) fn decimate(
    positions: &[Point],
    triangles: &[[u32; 3]],
    vertex_count: usize,
) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut work = Decimation::new(positions, triangles);
    let mut left = work.around.iter().filter(|a| !a.is_empty()).count();
    while left > vertex_count {
        let Some(Reverse(candidate)) = work.heap.pop() else {
            break;
        };
        if work.is_current(&candidate) && work.may_collapse(&candidate) {
            work.collapse(&candidate);
            left -= 1;
        }
    }
    work.compact()
}

impl Decimation {
    fn new(positions: &[Point], triangles: &[[u32; 3]]) -> Self {
        let mut around = vec![BTreeSet::new(); positions.len()];
        let mut quadrics = vec![Matrix4::zeros(); positions.len()];
        let mut edges: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
        for (t, triangle) in (0u32..).zip(triangles) {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let quadric = plane((b - a).cross(&(c - a)), &a, 1.0);
            for (k, &v) in triangle.iter().enumerate() {
                around[v as usize].insert(t);
                quadrics[v as usize] += quadric;
                let next = triangle[(k + 1) % 3];
                edges.entry((v.min(next), v.max(next))).or_default().push(t);
            }
        }
        for (&(a, b), sides) in &edges {
            if let [only] = sides[..] {
                let [p, q, r] = triangles[only as usize].map(|v| positions[v as usize]);
                let normal = (q - p).cross(&(r - p));
                let along = positions[b as usize] - positions[a as usize];
                let quadric = plane(normal.cross(&along), &positions[a as usize], BORDER_WEIGHT)
                    * along.norm_squared();
                quadrics[a as usize] += quadric;
                quadrics[b as usize] += quadric;
            }
        }
        let mut work = Self {
            positions: positions.to_vec(),
            quadrics,
            versions: vec![0; positions.len()],
            triangles: triangles.to_vec(),
            is_alive: vec![true; triangles.len()],
            around,
            heap: BinaryHeap::new(),
        };
        for &(a, b) in edges.keys() {
            work.push(a, b);
        }
        work
    }

    fn push(&mut self, a: u32, b: u32) {
        let edge = (a.min(b), a.max(b));
        let (p, q) = (self.positions[a as usize], self.positions[b as usize]);
        let quadric = self.quadrics[a as usize] + self.quadrics[b as usize];
        let cost_at = |x: &Point| {
            let h = Vector4::new(x.x, x.y, x.z, 1.0);
            (h.transpose() * quadric * h)[0].max(0.0)
        };
        let middle = Point::from((p.coords + q.coords) / 2.0);
        let a3: Matrix3<f64> = quadric.fixed_view::<3, 3>(0, 0).into_owned();
        let right: Vector = -quadric.fixed_view::<3, 1>(0, 3).into_owned();
        // A point far off the edge means that the planes are nearly parallel.
        let best = a3
            .try_inverse()
            .map(|inverse| Point::from(inverse * right))
            .filter(|x| (x - middle).norm() <= (p - q).norm())
            .unwrap_or(middle);
        let length = (p - q).norm_squared();
        self.heap.push(Reverse(Candidate {
            cost: cost_at(&best) + SHAPE_WEIGHT * length * length,
            edge,
            versions: (
                self.versions[edge.0 as usize],
                self.versions[edge.1 as usize],
            ),
            place: best,
        }));
    }

    fn is_current(&self, candidate: &Candidate) -> bool {
        let (a, b) = candidate.edge;
        candidate.versions == (self.versions[a as usize], self.versions[b as usize])
            && !self.around[a as usize].is_empty()
            && !self.around[b as usize].is_empty()
    }

    fn neighbours(&self, v: u32) -> BTreeSet<u32> {
        self.around[v as usize]
            .iter()
            .flat_map(|&t| self.triangles[t as usize])
            .filter(|&n| n != v)
            .collect()
    }

    /// A vertex is on the border if it has more neighbours than triangles.
    fn is_border(&self, v: u32) -> bool {
        self.neighbours(v).len() != self.around[v as usize].len()
    }

    fn may_collapse(&self, candidate: &Candidate) -> bool {
        let (a, b) = candidate.edge;
        let shared_triangles = self.around[a as usize]
            .intersection(&self.around[b as usize])
            .count();
        let shared = self.neighbours(a).intersection(&self.neighbours(b)).count();
        // The link condition: otherwise sheets would be joined or edges doubled.
        if shared != shared_triangles || shared_triangles == 0 {
            return false;
        }
        if shared_triangles == 2 && self.is_border(a) && self.is_border(b) {
            return false;
        }
        [a, b].into_iter().all(|v| {
            self.around[v as usize].iter().all(|&t| {
                let triangle = self.triangles[t as usize];
                if triangle.contains(&a) && triangle.contains(&b) {
                    return true;
                }
                let before = triangle.map(|n| self.positions[n as usize]);
                let after = triangle.map(|n| {
                    if n == v {
                        candidate.place
                    } else {
                        self.positions[n as usize]
                    }
                });
                let normal = |p: [Point; 3]| (p[1] - p[0]).cross(&(p[2] - p[0]));
                let (n0, n1) = (normal(before), normal(after));
                n0.dot(&n1) > 0.3 * n0.norm() * n1.norm()
            })
        })
    }

    fn collapse(&mut self, candidate: &Candidate) {
        let (keep, gone) = candidate.edge;
        self.positions[keep as usize] = candidate.place;
        let quadric = self.quadrics[gone as usize];
        self.quadrics[keep as usize] += quadric;
        for t in std::mem::take(&mut self.around[gone as usize]) {
            let triangle = self.triangles[t as usize];
            if triangle.contains(&keep) {
                self.is_alive[t as usize] = false;
                for v in triangle {
                    self.around[v as usize].remove(&t);
                }
            } else {
                self.triangles[t as usize] = triangle.map(|v| if v == gone { keep } else { v });
                self.around[keep as usize].insert(t);
            }
        }
        self.versions[keep as usize] += 1;
        self.versions[gone as usize] += 1;
        for neighbour in self.neighbours(keep) {
            self.push(keep, neighbour);
        }
    }

    /// Renumbers what is left; triangles keep their order, vertices come in order of first use.
    fn compact(self) -> (Vec<Point>, Vec<[u32; 3]>) {
        let mut renumbered = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for (triangle, _) in self
            .triangles
            .iter()
            .zip(&self.is_alive)
            .filter(|(_, alive)| **alive)
        {
            triangles.push(triangle.map(|v| {
                let new = &mut renumbered[v as usize];
                if *new == u32::MAX {
                    *new = positions.len() as u32;
                    positions.push(self.positions[v as usize]);
                }
                *new
            }));
        }
        (positions, triangles)
    }
}

/// The squared distance to a plane as a quadratic form, weighted by area.
fn plane(normal: Vector, through: &Point, weight: f64) -> Matrix4<f64> {
    let area = normal.norm();
    if area == 0.0 {
        return Matrix4::zeros();
    }
    let n = normal / area;
    let p = Vector4::new(n.x, n.y, n.z, -n.dot(&through.coords));
    // Border planes come with their own scale.
    let scale = if weight == 1.0 { area } else { weight };
    p * p.transpose() * scale
}
