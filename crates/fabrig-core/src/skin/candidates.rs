//! Which nodes a skin vertex may hang on.

use crate::anatomy::{Patch, PatchChart};
use crate::skin::FitOptions;
use crate::template::{RegionId, Template};
use crate::{Point, Vector};

/// A node that a vertex may hang on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Index over all nodes, patch after patch.
    pub node: u32,
    /// Distance from the vertex to the place on the skin above the node. (mm)
    pub distance: f64,
}

/// Normals further apart than this belong to different sheets of skin (cosine).
const LEAST_NORMAL_COSINE: f64 = -0.3;
/// Regions of inner skin, whose flesh is covered by outer skin: names start with these.
const CAVITIES: [&str; 3] = ["mouth_interior", "socket", "nostril"];
/// Inner skin looks for nodes this much further, since distance is to the outer skin.
const CAVITY_REACH: f64 = 2.0;
/// Inner skin is moved by more of the flesh around it: it takes this many times as many patches,
/// and as many times the nodes of each.
const CAVITY_CHOICE: usize = 2;

struct Anchor {
    /// The place on the skin above the node. (mm)
    point: Point,
    normal: Vector,
    region: RegionId,
}

/// Finds candidates near any skin vertex of the template.
pub struct CandidateFinder<'a> {
    template: &'a Template,
    charts: Vec<&'a PatchChart>,
    /// Patch after patch; `starts[p]` is the first of patch p.
    anchors: Vec<Anchor>,
    starts: Vec<usize>,
    bounds: Vec<(Point, Point)>,
    /// Patches a vertex may hang on at once.
    patch_limit: usize,
    /// Rings of the grid taken around the nearest node of a patch.
    rings: i64,
    candidate_limit: usize,
    /// No node further away than this is taken. (mm)
    reach: f64,
}

impl<'a> CandidateFinder<'a> {
    /// Prepares the patches as they lie on the template.
    ///
    /// - `normals`: of the template's skin vertices; `triangles`: of its skin
    /// - `options`: how far and how many
    pub fn new(
        template: &'a Template,
        triangles: &[[u32; 3]],
        normals: &[Vector],
        patches: &'a [Patch],
        options: &FitOptions,
    ) -> Self {
        let positions = template.skin.positions();
        let mut anchors = Vec::new();
        let mut starts = vec![0];
        let mut bounds = Vec::new();
        for patch in patches {
            let mut low = Point::from([f64::INFINITY; 3]);
            let mut high = Point::from([f64::NEG_INFINITY; 3]);
            for node in &patch.chart.nodes {
                let corners = triangles[node.triangle as usize].map(|v| v as usize);
                let mut point = Vector::zeros();
                let mut normal = Vector::zeros();
                for (&v, b) in corners.iter().zip(node.barycentric) {
                    point += b * positions[v].coords;
                    normal += b * normals[v];
                }
                let nearest = (0..3)
                    .max_by(|&a, &b| node.barycentric[a].total_cmp(&node.barycentric[b]))
                    .unwrap_or(0);
                low = low.inf(&point.into());
                high = high.sup(&point.into());
                anchors.push(Anchor {
                    point: point.into(),
                    normal: normal
                        .try_normalize(f64::EPSILON)
                        .unwrap_or_else(Vector::zeros),
                    region: template.regions.vertex_regions[corners[nearest]],
                });
            }
            starts.push(anchors.len());
            bounds.push((low, high));
        }
        Self {
            template,
            charts: patches.iter().map(|p| &p.chart).collect(),
            anchors,
            starts,
            bounds,
            patch_limit: options.patch_limit,
            rings: i64::from(options.rings),
            candidate_limit: options.candidate_limit,
            reach: options.reach,
        }
    }

    /// Nodes that a vertex of the template may hang on: of the nearest patches, the node
    /// nearest to it and the grid around that, all on its own side of lips and lids.
    ///
    /// Skin of a cavity (the inside of the cheeks, behind the lids, in the nostrils), or that
    /// faces away from all patches near it, hangs on the flesh between it and the outer skin.
    pub fn find(&self, vertex: usize, normal: &Vector) -> Vec<Candidate> {
        let region = self.template.regions.vertex_regions[vertex];
        if !self.is_cavity(region) {
            let outer = self.find_where(vertex, self.reach, 1, |anchor| {
                !self.template.regions.are_apart(region, anchor.region)
                    && anchor.normal.dot(normal) >= LEAST_NORMAL_COSINE
            });
            if outer.iter().any(|c| c.distance < 0.5 * self.reach) {
                return outer;
            }
        }
        self.find_where(vertex, CAVITY_REACH * self.reach, CAVITY_CHOICE, |anchor| {
            !self.is_opposite(region, anchor.region)
        })
    }

    pub(super) fn is_cavity(&self, region: RegionId) -> bool {
        let name = &self.template.regions.regions[region.0 as usize].name;
        CAVITIES.iter().any(|cavity| name.starts_with(cavity))
    }

    /// Whether two regions are apart for another reason than lying back to back.
    fn is_opposite(&self, a: RegionId, b: RegionId) -> bool {
        let side = |region: RegionId| {
            let name = &self.template.regions.regions[region.0 as usize].name;
            ["upper", "lower"]
                .into_iter()
                .find(|side| name.contains(side))
        };
        self.template.regions.are_apart(a, b)
            && (side(a).is_some() && side(b).is_some() || self.is_cavity(a) == self.is_cavity(b))
    }

    fn find_where(
        &self,
        vertex: usize,
        reach: f64,
        choice: usize,
        is_allowed: impl Fn(&Anchor) -> bool,
    ) -> Vec<Candidate> {
        let point = self.template.skin.positions()[vertex];
        let mut nearest: Vec<(f64, usize, usize)> = Vec::new();
        for patch in 0..self.charts.len() {
            let (low, high) = &self.bounds[patch];
            let outside = (low - point).sup(&(point - high)).sup(&Vector::zeros());
            if outside.norm() >= reach {
                continue;
            }
            let best = (self.starts[patch]..self.starts[patch + 1])
                .filter(|&a| is_allowed(&self.anchors[a]))
                .map(|a| ((self.anchors[a].point - point).norm_squared(), a))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((distance, anchor)) = best
                && distance < reach * reach
            {
                nearest.push((distance, patch, anchor));
            }
        }
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.truncate(choice * self.patch_limit);
        let mut found = Vec::new();
        for (_, patch, anchor) in nearest {
            for a in self.grid_around(patch, anchor - self.starts[patch], choice > 1) {
                let anchor = &self.anchors[a];
                let distance = (anchor.point - point).norm();
                if distance < reach && is_allowed(anchor) {
                    found.push(Candidate {
                        node: a as u32,
                        distance,
                    });
                }
            }
        }
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.node.cmp(&b.node)));
        // Around a short ring the same node comes from both sides.
        found.dedup_by_key(|c| c.node);
        found.truncate(choice * choice * self.candidate_limit);
        found.sort_by_key(|c| c.node);
        found
    }

    /// Total number of nodes.
    pub fn node_count(&self) -> usize {
        self.anchors.len()
    }

    /// Nodes around one: every grid line within the rings, and with `reaches_far` as many rings
    /// again at twice the step.
    fn grid_around(&self, patch: usize, node: usize, reaches_far: bool) -> Vec<usize> {
        let grid = self.charts[patch].grid;
        let (u_count, v_count) = (i64::from(grid.u_count), i64::from(grid.v_count));
        let (u, v) = (node as i64 % u_count, node as i64 / u_count);
        let mut offsets: Vec<i64> = (-self.rings..=self.rings).collect();
        if reaches_far {
            offsets.extend((self.rings / 2 + 1..=self.rings).flat_map(|k| [-2 * k, 2 * k]));
        }
        let mut around = Vec::new();
        for dv in &offsets {
            for du in &offsets {
                let (mut u, v) = (u + du, v + dv);
                if grid.is_periodic {
                    u = u.rem_euclid(u_count);
                }
                if (0..u_count).contains(&u) && (0..v_count).contains(&v) {
                    around.push(self.starts[patch] + grid.index(u as u32, v as u32));
                }
            }
        }
        around
    }
}
