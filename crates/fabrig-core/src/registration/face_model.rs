//! What registration needs to know of a template: which of its vertices have a counterpart on
//! any face, where lips and lids part, and its surface for queries.

use super::RegistrationError;
use super::closest_grid::Sample;
use crate::mesh::{Surface, Topology, triangle_normals, vertex_normals};
use crate::template::{RegionId, Template};
use crate::{Point, Vector};

/// What lies farther than this from the nose tip is no part of the front of a face. (mm)
const FRONT_MM: f64 = 95.0;
/// Detail is judged within this distance. (mm)
const DETAIL_MM: f64 = 12.0;

/// How a template vertex takes part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    /// Inside the mouth, a socket, a nostril: follows by smoothness alone.
    Hidden,
    /// Skin that many faces lack or that hair covers: neck, scalp, ears.
    Outlying,
    /// The face proper.
    Face,
}

/// An opening whose two sides must be told apart.
#[derive(Debug, Clone)]
pub(super) struct Opening {
    pub(super) kind: OpeningKind,
    /// Vertices of the upper contact line, from the right corner (-X) to the left one (+X),
    /// corners included.
    pub(super) upper: Vec<u32>,
    /// Vertices of the lower contact line, likewise.
    pub(super) lower: Vec<u32>,
}

/// Which opening.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OpeningKind {
    Mouth,
    LeftEye,
    RightEye,
}

impl OpeningKind {
    pub(super) const ALL: [Self; 3] = [Self::Mouth, Self::LeftEye, Self::RightEye];

    /// Name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Mouth => "mouth",
            Self::LeftEye => "left_eye",
            Self::RightEye => "right_eye",
        }
    }

    /// Name in sentences.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Mouth => "mouth",
            Self::LeftEye => "left eye",
            Self::RightEye => "right eye",
        }
    }

    /// Number of one of its two sides.
    pub(super) fn side(self, is_upper: bool) -> u8 {
        2 * self as u8 + u8::from(!is_upper)
    }

    /// Region names: upper side, lower side, inside.
    pub(super) fn regions(self) -> [&'static str; 3] {
        match self {
            Self::Mouth => ["upper_lip", "lower_lip", "mouth_interior"],
            Self::LeftEye => ["upper_lid_l", "lower_lid_l", "socket_l"],
            Self::RightEye => ["upper_lid_r", "lower_lid_r", "socket_r"],
        }
    }
}

/// A template prepared for registration.
pub(super) struct FaceModel<'a> {
    pub(super) template: &'a Template,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) topology: Topology,
    pub(super) roles: Vec<Role>,
    pub(super) normals: Vec<Vector>,
    pub(super) surface: Surface,
    pub(super) openings: Vec<Opening>,
    pub(super) triangle_roles: Vec<Role>,
    unit_triangle_normals: Vec<Vector>,
}

impl<'a> FaceModel<'a> {
    pub(super) fn new(template: &'a Template) -> Result<Self, RegistrationError> {
        let lacks = |what: &str| RegistrationError::TemplateIncomplete {
            template: template.name.clone(),
            what: what.to_owned(),
        };
        let positions = template.skin.positions();
        if template.regions.vertex_regions.len() != positions.len() {
            return Err(lacks("a region for every skin vertex"));
        }
        let triangles = template.skin.triangles();
        // Quad diagonals are edges too: the smoothness terms see every triangle.
        let topology = Topology::from_triangles(positions.len(), &triangles);
        let roles: Vec<Role> = template
            .regions
            .vertex_regions
            .iter()
            .map(|r| role_of(&template.regions.regions[r.0 as usize].name))
            .collect();
        if roles.iter().filter(|r| **r == Role::Face).count() < 50 {
            return Err(lacks("regions of a face"));
        }
        let triangle_roles: Vec<Role> = triangles
            .iter()
            .map(|t| {
                t.map(|v| roles[v as usize])
                    .into_iter()
                    .min()
                    .unwrap_or(Role::Hidden)
            })
            .collect();
        let openings: Vec<Opening> = OpeningKind::ALL
            .into_iter()
            .filter_map(|kind| opening(template, &topology, kind))
            .collect();
        let surface = Surface::new(positions, &triangles)?;
        Ok(Self {
            template,
            normals: vertex_normals(positions, &triangles),
            surface,
            unit_triangle_normals: triangle_normals(positions, &triangles)
                .into_iter()
                .map(|n| n.try_normalize(0.0).unwrap_or_else(Vector::zeros))
                .collect(),
            triangle_roles,
            topology,
            triangles,
            roles,
            openings,
        })
    }

    pub(super) fn positions(&self) -> &[Point] {
        self.template.skin.positions()
    }

    /// Whether a vertex lies inside mouth, socket or nostril.
    pub(super) fn is_hidden(&self, vertex: u32) -> bool {
        self.roles[vertex as usize] == Role::Hidden
    }

    /// Region of a vertex.
    pub(super) fn region(&self, vertex: u32) -> RegionId {
        self.template.regions.vertex_regions[vertex as usize]
    }

    /// The most forward point of the face.
    pub(super) fn nose_tip(&self) -> Point {
        self.template.landmark("nose_tip").unwrap_or_else(|| {
            let best = (0..self.roles.len())
                .filter(|&v| self.roles[v] == Role::Face)
                .max_by(|&a, &b| self.positions()[a].z.total_cmp(&self.positions()[b].z));
            self.positions()[best.unwrap_or(0)]
        })
    }

    /// Vertices of the face proper.
    pub(super) fn face_vertices(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.roles.len() as u32).filter(|&v| self.roles[v as usize] == Role::Face)
    }

    /// About `count` vertices of the front of the face with what each tells, spread by
    /// farthest-point sampling from the nose tip on: a prefix of a longer list is the shorter
    /// one.
    pub(super) fn spread_vertices(&self, count: usize) -> Vec<(u32, f64)> {
        let candidates: Vec<u32> = self
            .face_vertices()
            .filter(|&v| {
                self.normals[v as usize].z > 0.1
                    && (self.positions()[v as usize] - self.nose_tip()).norm() < FRONT_MM
            })
            .collect();
        let mut distance: Vec<f64> = candidates
            .iter()
            .map(|&v| (self.positions()[v as usize] - self.nose_tip()).norm_squared())
            .collect();
        let mut chosen = Vec::new();
        while chosen.len() < count.min(candidates.len()) {
            let Some(k) =
                (0..candidates.len()).max_by(|&a, &b| distance[a].total_cmp(&distance[b]))
            else {
                break;
            };
            let vertex = candidates[k];
            let point = self.positions()[vertex as usize];
            let weight = 0.25 + (self.detail(vertex as usize) / 0.08).min(1.0);
            chosen.push((vertex, weight));
            for (d, &v) in distance.iter_mut().zip(&candidates) {
                *d = d.min((self.positions()[v as usize] - point).norm_squared());
            }
        }
        chosen
    }

    /// Vertices as samples.
    pub(super) fn samples(&self, vertices: &[(u32, f64)]) -> Vec<Sample> {
        vertices
            .iter()
            .map(|&(v, weight)| Sample {
                point: self.positions()[v as usize],
                normal: self.normals[v as usize],
                weight,
            })
            .collect()
    }

    /// How much normals vary around a vertex, 0 = flat: nose, lips and eyes tell more about
    /// where a face is than cheeks do.
    fn detail(&self, vertex: usize) -> f64 {
        let (p, n) = (self.positions()[vertex], self.normals[vertex]);
        let (mut sum, mut count) = (0.0, 0.0);
        for (q, m) in self
            .positions()
            .iter()
            .zip(&self.normals)
            .zip(&self.roles)
            .filter_map(|(place, role)| (*role == Role::Face).then_some(place))
        {
            if (q - p).norm_squared() < DETAIL_MM * DETAIL_MM {
                sum += 1.0 - n.dot(m);
                count += 1.0;
            }
        }
        sum / f64::max(count, 1.0)
    }

    /// The closest place of the template's face to a point of the head frame within `reach`
    /// whose normal agrees with `normal`.
    pub(super) fn closest_on_face(
        &self,
        point: &Point,
        reach: f64,
        normal: &Vector,
    ) -> Option<Point> {
        let at = self.surface.closest_where(point, reach, |at| {
            self.unit_triangle_normals[at.triangle as usize].dot(normal) > 0.4
        })?;
        (self.triangle_roles[at.triangle as usize] == Role::Face).then_some(at.point)
    }
}

/// What a region's name says about its vertices.
fn role_of(name: &str) -> Role {
    const HIDDEN: [&str; 6] = [
        "mouth_interior",
        "socket",
        "nostril",
        "ear_canal",
        "interior",
        "inside",
    ];
    const OUTLYING: [&str; 4] = ["neck", "scalp", "ear", "nape"];
    if HIDDEN.iter().any(|h| name.starts_with(h)) {
        Role::Hidden
    } else if OUTLYING
        .iter()
        .any(|o| name == *o || name.starts_with(&format!("{o}_")))
    {
        Role::Outlying
    } else {
        Role::Face
    }
}

/// The contact lines of an opening: skin vertices of each side that touch the inside.
fn opening(template: &Template, topology: &Topology, kind: OpeningKind) -> Option<Opening> {
    let [upper, lower, inside] = kind.regions();
    let regions = &template.regions;
    let (upper, lower) = (regions.find(upper)?, regions.find(lower)?);
    // One region inside, or one behind each side.
    let is_inside = |v: u32| {
        regions.regions[regions.vertex_regions[v as usize].0 as usize]
            .name
            .starts_with(inside)
    };
    let positions = template.skin.positions();
    let line = |side: RegionId| {
        let mut vertices: Vec<u32> = (0..positions.len() as u32)
            .filter(|&v| {
                regions.vertex_regions[v as usize] == side
                    && topology.neighbours(v).iter().any(|&n| is_inside(n))
            })
            .collect();
        vertices.sort_by(|&a, &b| {
            positions[a as usize]
                .x
                .total_cmp(&positions[b as usize].x)
                .then(a.cmp(&b))
        });
        vertices
    };
    let (upper, lower) = (line(upper), line(lower));
    (upper.len() >= 3 && lower.len() >= 3).then_some(Opening { kind, upper, lower })
}
