//! Lips and lids: which side a vertex moves with, and whether the sides pass through each other.

use nalgebra::Point3;
use rayon::prelude::*;

use super::places::Places;
use crate::Vector;
use crate::collision::{Sheet, crossings};
use crate::mesh::{SurfacePoint, Topology, triangle_edges};

/// Upper side, lower side, and what lines each, of mouth, left eye and right eye.
const OPENINGS: [[&str; 4]; 3] = [
    [
        "upper_lip",
        "lower_lip",
        "mouth_interior_upper",
        "mouth_interior_lower",
    ],
    ["upper_lid_l", "lower_lid_l", "", ""],
    ["upper_lid_r", "lower_lid_r", "", ""],
];
/// Sides that the template parts by less tell nothing. (mm)
const PARTING: f64 = 2.5;
/// A vertex is on the wrong side where it is this many times nearer to the other side's motion.
const NEARER: f64 = 2.0;
/// An edge is torn that becomes this many times as long, and longer by this. (mm)
const TORN_RATIO: f32 = 4.0;
const TORN_LENGTH: f32 = 6.0;
/// How far behind a sheet is looked. (mm)
const REACH: f32 = 6.0;
/// How far behind the lips their lining takes part. (mm)
const LINING: f32 = 8.0;

/// A vertex of lip or lid: its own place and the nearest one on the other side.
struct SeamVertex {
    vertex: u32,
    opening: usize,
    own: SurfacePoint,
    other: SurfacePoint,
}

/// Both sides of an opening as surfaces.
struct Pair {
    sheets: [Sheet; 2],
    /// How far each vertex of each sheet stands in the other at rest, negative. (mm)
    allowed: [Vec<f32>; 2],
    edges: Vec<[u32; 2]>,
    topology: Topology,
    triangles: Vec<[u32; 3]>,
    /// Which side a vertex is of: 0 none, 1 upper, 2 lower.
    side: Vec<u8>,
    /// Crossings at rest.
    at_rest: Vec<(u32, u32)>,
}

/// What crosses.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Crossed {
    pub(super) pairs: usize,
    /// (mm)
    pub(super) depth: f64,
    /// A vertex where it is deepest.
    pub(super) vertex: Option<u32>,
}

/// Everything about seams that does not depend on the pose.
pub(super) struct Seams {
    vertices: Vec<SeamVertex>,
    /// Mouth, left eye, right eye.
    pairs: Vec<Option<Pair>>,
}

impl Seams {
    /// - `rest`: the mesh with all weights zero (mm)
    pub(super) fn new(places: &Places<'_>, rest: &[Point3<f32>]) -> Self {
        let regions = &places.template.regions;
        let mut vertices = Vec::new();
        for (opening, [upper, lower, ..]) in OPENINGS.into_iter().enumerate() {
            let (Some(upper), Some(lower)) = (regions.find(upper), regions.find(lower)) else {
                continue;
            };
            let found: Vec<SeamVertex> = places
                .regions
                .par_iter()
                .enumerate()
                .filter_map(|(v, region)| {
                    let other = match (*region)? {
                        r if r == upper => lower,
                        r if r == lower => upper,
                        _ => return None,
                    };
                    let point = rest[v].cast::<f64>();
                    let other = places.surface.closest_where(&point, f64::INFINITY, |at| {
                        let corners = places.template_triangles[at.triangle as usize];
                        let of = |c: &u32| regions.vertex_regions[*c as usize] == other;
                        corners.iter().filter(|c| of(c)).count() >= 2
                    })?;
                    Some(SeamVertex {
                        vertex: v as u32,
                        opening,
                        own: places.of_vertex[v]?,
                        other,
                    })
                })
                .collect();
            vertices.extend(found);
        }
        let pairs = OPENINGS.map(|names| Pair::new(places, names, rest));
        Self {
            vertices,
            pairs: pairs.into(),
        }
    }

    /// Vertices that move with the other side.
    ///
    /// - `drawn`: what the template does (mm); `motion`: what the mesh does (mm)
    ///
    /// - `is_open`: whether each opening has sides that can move apart: mouth, left eye, right eye
    pub(super) fn wrong_side(
        &self,
        is_open: [bool; 3],
        places: &Places<'_>,
        drawn: &[Vector],
        motion: &dyn Fn(u32) -> Vector,
    ) -> Vec<u32> {
        let is_wrong = |seam: &&SeamVertex| {
            let (own, other) = (places.at(&seam.own, drawn), places.at(&seam.other, drawn));
            if !is_open[seam.opening] || (own - other).norm() < PARTING {
                return false;
            }
            let motion = motion(seam.vertex);
            (motion - own).norm() > NEARER * (motion - other).norm()
        };
        let wrong = self.vertices.iter().filter(is_wrong);
        wrong.map(|seam| seam.vertex).collect()
    }

    /// What crosses in the mouth (0), the left eye (1) and the right eye (2).
    pub(super) fn crossed(&mut self, opening: usize, now: &[Point3<f32>]) -> Crossed {
        match &mut self.pairs[opening] {
            Some(pair) => pair.crossed(now),
            None => Crossed::default(),
        }
    }
}

/// Edges in view that a pose tears, as indices into `places.edges`.
pub(super) fn torn_edges(
    places: &Places<'_>,
    rest: &[Point3<f32>],
    now: &[Point3<f32>],
) -> Vec<usize> {
    let length = |p: &[Point3<f32>], [a, b]: [u32; 2]| (p[a as usize] - p[b as usize]).norm();
    let edges = places.edges.par_iter().enumerate();
    edges
        .filter(|(_, edge)| {
            if edge.iter().any(|&v| !places.is_in_view[v as usize]) {
                return false;
            }
            let (before, after) = (length(rest, **edge), length(now, **edge));
            after > TORN_RATIO * before && after > before + TORN_LENGTH
        })
        .map(|(e, _)| e)
        .collect()
}

impl Pair {
    fn new(places: &Places<'_>, names: [&str; 4], rest: &[Point3<f32>]) -> Option<Self> {
        let regions = &places.template.regions;
        let mut side = vec![0u8; rest.len()];
        for (k, number) in [(0, 1u8), (1, 2)] {
            let lip = regions.find(names[k])?;
            let lining = regions.find(names[k + 2]);
            let of = |region| {
                let labels = places.regions.iter().enumerate();
                labels
                    .filter(move |(_, r)| **r == Some(region))
                    .map(|(v, _)| v)
            };
            let contour: Vec<Point3<f32>> = of(lip).map(|v| rest[v]).collect();
            of(lip).for_each(|v| side[v] = number);
            let near = |p: &Point3<f32>| {
                contour
                    .iter()
                    .any(|q| (q - p).norm_squared() < LINING * LINING)
            };
            for v in lining.into_iter().flat_map(of) {
                if near(&rest[v]) {
                    side[v] = number;
                }
            }
        }
        let of_side = |number: u8| -> Vec<[u32; 3]> {
            let own = places.triangles.iter().copied();
            own.filter(|t| t.iter().all(|&v| side[v as usize] == number))
                .collect()
        };
        let (upper, lower) = (of_side(1), of_side(2));
        if upper.is_empty() || lower.is_empty() {
            return None;
        }
        let triangles = [upper.as_slice(), &lower].concat();
        let sheets = [upper, lower].map(|own| Sheet::new(own, rest));
        let mut pair = Self {
            sheets,
            allowed: [Vec::new(), Vec::new()],
            edges: triangle_edges(&triangles),
            topology: Topology::from_triangles(rest.len(), &triangles),
            triangles,
            side,
            at_rest: Vec::new(),
        };
        pair.at_rest = pair.exact(rest);
        pair.allowed = [0, 1].map(|own| {
            let depths = pair.depths(own, rest);
            depths.into_iter().map(|d| d.min(0.0)).collect()
        });
        Some(pair)
    }

    /// Edges of one side that pass through triangles of the other.
    fn exact(&self, now: &[Point3<f32>]) -> Vec<(u32, u32)> {
        let side = |v: u32| self.side[v as usize];
        let found = crossings(now, &self.edges, &self.triangles, |e, t| {
            side(self.edges[e as usize][0]) != side(self.triangles[t as usize][0])
        });
        found.iter().map(|c| (c.edge, c.triangle)).collect()
    }

    /// How far the vertices of a side are before the other side, negative behind; infinite where
    /// there is no behind. (mm)
    fn depths(&self, own: usize, now: &[Point3<f32>]) -> Vec<f32> {
        let (own, other) = (&self.sheets[own], &self.sheets[1 - own]);
        let pairs = own.vertices().iter().zip(own.normals());
        pairs
            .map(|(&v, normal)| {
                let place = other.nearest(&now[v as usize], REACH, now);
                // Skin that looks the same way is beside the other side, not behind its front.
                let place = place.filter(|p| !p.is_border && normal.dot(&p.normal) < 0.0);
                place.map_or(f32::INFINITY, |p| p.distance)
            })
            .collect()
    }

    fn crossed(&mut self, now: &[Point3<f32>]) -> Crossed {
        let found = self.exact(now);
        let is_new = |pair: &&(u32, u32)| self.at_rest.binary_search(pair).is_err();
        let new: Vec<(u32, u32)> = found.iter().filter(is_new).copied().collect();
        if new.is_empty() {
            return Crossed::default();
        }
        self.sheets.iter_mut().for_each(|sheet| sheet.refit(now));
        let mut lack = vec![0.0f32; now.len()];
        for own in [0, 1] {
            let depths = self.depths(own, now);
            let pairs = depths.iter().zip(&self.allowed[own]);
            for (&v, (depth, allowed)) in self.sheets[own].vertices().iter().zip(pairs) {
                lack[v as usize] = allowed - depth;
            }
        }
        // Only what is behind and hangs together with a crossing went through.
        let touched = new.iter().flat_map(|&(edge, triangle)| {
            let edge = self.edges[edge as usize];
            edge.into_iter().chain(self.triangles[triangle as usize])
        });
        let mut open: Vec<u32> = touched.collect();
        let mut deepest = (0.0f32, None);
        while let Some(v) = open.pop() {
            let own = std::mem::replace(&mut lack[v as usize], 0.0);
            if own <= 0.0 {
                continue;
            }
            if own > deepest.0 {
                deepest = (own, Some(v));
            }
            open.extend(self.topology.neighbours(v));
        }
        let first = self.edges[new[0].0 as usize][0];
        Crossed {
            pairs: new.len(),
            depth: f64::from(deepest.0),
            vertex: Some(deepest.1.unwrap_or(first)),
        }
    }
}
