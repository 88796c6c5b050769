//! Distances of many pairs, eight beside each other.
//!
//! What is found is a plane between the elements of a pair: its direction comes from their
//! closest places, but how far they are apart is what the plane shows. So the lower bound holds
//! however badly closest places are conditioned (needles, parallel edges) in single precision;
//! and it is the distance itself where they are not.
//!
//! Source: as [`super::distance`], without branches.

use nalgebra::Point3;

use super::certificate::ROUNDING;
use super::distance::PairKind;
use crate::machine::{F32x8, Real, Vec3, vectorized};

/// What planes between the elements of pairs show, one entry each.
#[derive(Debug, Clone, Default)]
pub(super) struct Partings {
    /// How far they are apart: no more than their distance. (mm)
    pub(super) now: Vec<f32>,
    /// The same all the way from there to where they are wanted. (mm)
    pub(super) ever: Vec<f32>,
}

impl Partings {
    /// Looks at pairs.
    ///
    /// - `nodes`: of each pair, all of one kind
    /// - `states`: positions, and where nodes go straight from there; without the second,
    ///   nothing is said of [`Self::ever`] (mm)
    pub(super) fn part(
        &mut self,
        kind: PairKind,
        nodes: &[[u32; 4]],
        from: &[Point3<f32>],
        to: Option<&[Point3<f32>]>,
    ) {
        self.now.clear();
        self.ever.clear();
        vectorized(Part {
            kind,
            nodes,
            from,
            to,
            out: self,
        });
    }
}

struct Part<'a> {
    kind: PairKind,
    nodes: &'a [[u32; 4]],
    from: &'a [Point3<f32>],
    to: Option<&'a [Point3<f32>]>,
    out: &'a mut Partings,
}

impl pulp::NullaryFnOnce for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        match self.kind {
            PairKind::VertexTriangle => self.all::<false>(),
            PairKind::EdgeEdge => self.all::<true>(),
        }
    }
}

impl Part<'_> {
    #[inline(always)]
    fn all<const ARE_EDGES: bool>(self) {
        let (eights, rest) = self.nodes.as_chunks::<8>();
        let mut last = [[0; 4]; 8];
        for (slot, nodes) in last.iter_mut().zip(rest) {
            *slot = *nodes;
        }
        let last = (!rest.is_empty()).then_some((&last, rest.len()));
        for (eight, count) in eights.iter().map(|eight| (eight, 8)).chain(last) {
            let at = gather(eight, self.from);
            let (normal, now) = parting::<_, ARE_EDGES>(&at);
            let rounding = F32x8::splat(f64::from(ROUNDING));
            self.out.now.extend_from_slice(&(now - rounding).0[..count]);
            if let Some(to) = self.to {
                let to = gather(eight, to);
                let ever = apart_all_the_way::<_, ARE_EDGES>(&at, &to, normal);
                let ever = (ever - rounding).0;
                self.out.ever.extend_from_slice(&ever[..count]);
            }
        }
    }
}

/// Nodes 1, 2 and 3 of eight pairs against their node 0.
#[inline(always)]
fn gather(eight: &[[u32; 4]; 8], positions: &[Point3<f32>]) -> [Vec3<F32x8>; 3] {
    let x = [
        gather_one::<0>(eight, positions),
        gather_one::<1>(eight, positions),
        gather_one::<2>(eight, positions),
        gather_one::<3>(eight, positions),
    ];
    [x[1] - x[0], x[2] - x[0], x[3] - x[0]]
}

/// One node of each of eight pairs.
#[inline(always)]
fn gather_one<const K: usize>(eight: &[[u32; 4]; 8], positions: &[Point3<f32>]) -> Vec3<F32x8> {
    let [a, b, c, d, e, f, g, h] = eight;
    let p = [
        positions[a[K] as usize],
        positions[b[K] as usize],
        positions[c[K] as usize],
        positions[d[K] as usize],
        positions[e[K] as usize],
        positions[f[K] as usize],
        positions[g[K] as usize],
        positions[h[K] as usize],
    ];
    let [a, b, c, d, e, f, g, h] = &p;
    Vec3::new(
        F32x8([a.x, b.x, c.x, d.x, e.x, f.x, g.x, h.x]),
        F32x8([a.y, b.y, c.y, d.y, e.y, f.y, g.y, h.y]),
        F32x8([a.z, b.z, c.z, d.z, e.z, f.z, g.z, h.z]),
    )
}

/// Direction of the plane between two elements, and how far it shows them apart.
#[inline(always)]
fn parting<R: Real, const ARE_EDGES: bool>(x: &[Vec3<R>; 3]) -> (Vec3<R>, R) {
    let r = if ARE_EDGES {
        between_edges(x)
    } else {
        from_triangle(x)
    };
    let squared = r.dot(r);
    // Nothing is divided by nothing; what is nearer than a nanometre touches.
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let tiny = R::splat(1e-12);
    let scale = R::select_less(tiny, squared, one / squared.max(tiny).sqrt(), zero);
    let normal = r * scale;
    (normal, apart::<R, ARE_EDGES>(&heights(x, normal)))
}

#[inline(always)]
fn heights<R: Real>(x: &[Vec3<R>; 3], normal: Vec3<R>) -> [R; 3] {
    [x[0].dot(normal), x[1].dot(normal), x[2].dot(normal)]
}

#[inline(always)]
fn least<R: Real>(a: R, b: R) -> R {
    R::select_less(b, a, b, a)
}

/// How far elements are apart whose nodes 1, 2 and 3 stand this high above node 0.
#[inline(always)]
fn apart<R: Real, const ARE_EDGES: bool>(h: &[R; 3]) -> R {
    let zero = R::splat(0.0);
    if ARE_EDGES {
        least(zero, h[0]) - h[1].max(h[2])
    } else {
        zero - h[0].max(h[1]).max(h[2])
    }
}

/// The same for nodes that go straight from `at` to `to`.
#[inline(always)]
fn apart_all_the_way<R: Real, const ARE_EDGES: bool>(
    at: &[Vec3<R>; 3],
    to: &[Vec3<R>; 3],
    normal: Vec3<R>,
) -> R {
    let (now, next) = (heights(at, normal), heights(to, normal));
    let first = if ARE_EDGES {
        least(now[0], next[0])
    } else {
        now[0].max(next[0])
    };
    apart::<R, ARE_EDGES>(&[first, now[1].max(next[1]), now[2].max(next[2])])
}

/// `a / b` between 0 and 1; b is not negative.
#[inline(always)]
fn share<R: Real>(a: R, b: R) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    least(one, (a / b.max(R::splat(1e-30))).max(zero))
}

#[inline(always)]
fn select<R: Real>(a: R, b: R, yes: Vec3<R>, no: Vec3<R>) -> Vec3<R> {
    Vec3::new(
        R::select_less(a, b, yes.x, no.x),
        R::select_less(a, b, yes.y, no.y),
        R::select_less(a, b, yes.z, no.z),
    )
}

/// The place of an edge that is closest to the origin.
#[inline(always)]
fn on_edge<R: Real>(p: Vec3<R>, q: Vec3<R>) -> Vec3<R> {
    let along = q - p;
    p + along * share(R::splat(0.0) - p.dot(along), along.dot(along))
}

/// From the closest place of a triangle to the origin.
#[inline(always)]
fn from_triangle<R: Real>(&[a, b, c]: &[Vec3<R>; 3]) -> Vec3<R> {
    let zero = R::splat(0.0);
    let (ab, bc, ca) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
    let best = select(bc.dot(bc), ab.dot(ab), bc, ab);
    let best = select(ca.dot(ca), best.dot(best), ca, best);
    let normal = (b - a).cross(c - a);
    let squared = normal.dot(normal).max(R::splat(1e-30));
    let within = least(
        least(a.cross(b).dot(normal), b.cross(c).dot(normal)),
        c.cross(a).dot(normal),
    );
    let foot = normal * (a.dot(normal) / squared);
    Vec3::zero() - select(zero, within, foot, best)
}

/// From the closest place of the second edge to that of the first, which begins at the origin.
#[inline(always)]
fn between_edges<R: Real>(&[d1, p2, q2]: &[Vec3<R>; 3]) -> Vec3<R> {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let d2 = q2 - p2;
    let (a, e, b) = (d1.dot(d1), d2.dot(d2), d1.dot(d2));
    let (c, f) = (zero - d1.dot(p2), zero - d2.dot(p2));
    let denominator = a * e - b * b;
    // Of nearly parallel edges any place will do: the ends below find a close one.
    let is_less = R::splat(1e-6) * a * e;
    let s = R::select_less(
        is_less,
        denominator,
        share(b * f - c * e, denominator),
        zero,
    );
    let t = (b * s + f) / e.max(R::splat(1e-30));
    let s = R::select_less(t, zero, share(zero - c, a), s);
    let s = R::select_less(one, t, share(b - c, a), s);
    let t = least(one, t.max(zero));
    d1 * s - p2 - d2 * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vector;
    use crate::collision::distance::{closest_weights, weighted, wide};
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    const KINDS: [PairKind; 2] = [PairKind::VertexTriangle, PairKind::EdgeEdge];

    fn distance(kind: PairKind, x: [Vector; 4]) -> f64 {
        weighted(&closest_weights(kind, &x), &x).norm()
    }

    /// Places of four nodes for many pairs, and where they go; every third pair is nearly flat.
    fn pairs(count: usize, size: f32) -> [Vec<Point3<f32>>; 2] {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(29);
        let mut from = Vec::new();
        let mut to = Vec::new();
        for pair in 0..count {
            let flat = if pair % 3 == 0 { 1e-6 } else { 1.0 };
            let mut at = |size: f32| {
                let mut c = || random.random_range(-size..size);
                Vector3::new(c(), c(), flat * c())
            };
            let middle = at(1.0) * 80.0;
            let common = at(1.0);
            for _ in 0..4 {
                let p = Point3::from(middle + at(size));
                from.push(p);
                to.push(p + common + at(0.1 * size));
            }
        }
        [from, to]
    }

    #[test]
    fn planes_show_the_distance_and_never_more_than_there_is() {
        let count = 3003;
        let [from, to] = pairs(count, 1.5);
        let nodes: Vec<[u32; 4]> = (0..count as u32)
            .map(|p| [0, 1, 2, 3].map(|k| 4 * p + k))
            .collect();
        let mut found = Partings::default();
        for kind in KINDS {
            found.part(kind, &nodes, &from, Some(&to));
            assert_eq!([found.now.len(), found.ever.len()], [count; 2]);
            let mut exact = 0;
            for (nodes, (&now, &ever)) in nodes.iter().zip(found.now.iter().zip(&found.ever)) {
                let at = |t: f32| {
                    nodes.map(|n| {
                        let n = n as usize;
                        wide(&(from[n] + (to[n] - from[n]) * t))
                    })
                };
                let start = distance(kind, at(0.0));
                assert!(f64::from(now) <= start, "{kind:?} {now} {start}");
                exact += usize::from(f64::from(now) > start - 1e-3);
                for k in 0..=8 {
                    assert!(f64::from(ever) <= distance(kind, at(k as f32 / 8.0)));
                }
            }
            assert!(exact * 100 > count * 97, "{kind:?}: {exact} of {count}");
        }
    }

    #[test]
    fn elements_without_size_are_parted_too() {
        let points = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]].map(Point3::from);
        let mut found = Partings::default();
        for kind in KINDS {
            let nodes = match kind {
                PairKind::VertexTriangle => [0, 2, 3, 2],
                PairKind::EdgeEdge => [0, 1, 2, 3],
            };
            found.part(kind, &[nodes, [0; 4]], &points, None);
            assert!((found.now[0] - 1.0).abs() < 1e-3, "{kind:?} {found:?}");
            assert!(found.now[1] <= 0.0 && found.ever.is_empty());
        }
    }
}
