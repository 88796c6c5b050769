//! Fused lips and lids cut along the registered line, on request.
//!
//! The line runs from corner to corner of the opening: through the places where the face was
//! seen to part, between the registered corners. [`crate::mesh::slit`] cuts the user's mesh
//! along it. What then shows behind is the template's own lining of mouth or socket, taken from
//! the registered face and joined to both sides of the cut; an eye also gets the template's
//! eyeball. Vertices of the mesh keep index and place, all new ones follow them.

use nalgebra::Similarity3;
use serde::{Deserialize, Serialize};

use super::clean::clean;
use super::face_model::{FaceModel, Opening, OpeningKind};
use super::lining::{Lining, lining};
use super::mapping::{map_vertices, triangle_sides};
use super::openings::{Parting, find_partings};
use super::parts::{RigidComponent, eyeball};
use super::report::OpeningState;
use super::{Registration, RegistrationError};
use crate::mesh::{
    CornerUvs, FaceGroup, Mesh, Polygons, SlitField, SlitMesh, Surface, SurfacePoint, VertexOrigin,
    slit, vertex_normals,
};
use crate::template::{RegionId, Template};
use crate::{Point, Vector};

/// The cut ends this far from the corners, over the width of the opening.
const END_SHARE: f64 = 0.03;
/// The line is looked for within this distance of where it is seen, over the same width.
const REACH_SHARE: f64 = 0.5;

/// Which fused openings are cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CutSeams {
    /// The lips.
    pub mouth: bool,
    /// The lids of both eyes.
    pub eyes: bool,
}

impl CutSeams {
    /// Whether nothing is asked for.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }
}

/// What one cut did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeamCut {
    /// `mouth`, `left_eye` or `right_eye`.
    pub opening: String,
    /// Length of the cut at true head size. (mm)
    pub length_mm: f64,
    /// First of the vertices that this cut appended.
    pub first_new_vertex: usize,
    /// How many of them lie on the cut.
    pub seam_vertices: usize,
    /// How many line what is behind.
    pub lining_vertices: usize,
    /// How many are an eyeball.
    pub eyeball_vertices: usize,
    /// Polygons of the mesh that were split.
    pub split_faces: usize,
}

/// A face that was cut, and its registration.
#[derive(Debug, Clone)]
pub struct CutFace {
    /// The user's mesh with the cuts: original vertices first, in their order.
    pub mesh: Mesh,
    /// Registration of that mesh.
    pub registration: Registration,
    /// How many vertices the mesh had.
    pub original_vertex_count: usize,
    /// For each appended vertex the place it comes from; `None` for lining and eyeballs.
    pub vertex_origins: Vec<Option<VertexOrigin>>,
    /// For each polygon the one of the user's mesh it is or is part of; `None` for lining and
    /// eyeballs.
    pub face_origins: Vec<Option<u32>>,
}

/// Cuts the openings that are asked for and fused; those that are two sides already are left
/// alone, which the report says.
///
/// # Errors
///
/// [`RegistrationError::SeamNotFound`] where no line runs from corner to corner.
pub fn cut_seams(
    face: &Mesh,
    template: &Template,
    registration: &Registration,
    which: CutSeams,
) -> Result<CutFace, RegistrationError> {
    let model = FaceModel::new(template)?;
    let mut cut = CutFace {
        mesh: face.clone(),
        registration: registration.clone(),
        original_vertex_count: face.vertex_count(),
        vertex_origins: Vec::new(),
        face_origins: (0..face.face_count() as u32).map(Some).collect(),
    };
    let measures = registration.report.openings;
    let asked = [
        (OpeningKind::Mouth, which.mouth, measures.mouth.state),
        (OpeningKind::LeftEye, which.eyes, measures.eyes[0].state),
        (OpeningKind::RightEye, which.eyes, measures.eyes[1].state),
    ];
    let mut pinned: Vec<(u32, SurfacePoint, RegionId)> = Vec::new();
    let mut places = clean(face).from_user;
    for (kind, is_asked, state) in asked {
        if !is_asked {
            continue;
        }
        if state != OpeningState::Fused {
            cut.registration.report.warnings.push(format!(
                "the {} was not cut: its sides are two already",
                kind.words()
            ));
            continue;
        }
        cut_one(&model, &mut cut, &mut places, kind, &mut pinned)?;
    }
    map_again(&model, &mut cut, &pinned)?;
    Ok(cut)
}

fn cut_one(
    model: &FaceModel<'_>,
    cut: &mut CutFace,
    places: &mut Vec<u32>,
    kind: OpeningKind,
    pinned: &mut Vec<(u32, SurfacePoint, RegionId)>,
) -> Result<(), RegistrationError> {
    let not_found = || RegistrationError::SeamNotFound {
        opening: kind.words(),
    };
    let opening = model
        .openings
        .iter()
        .find(|o| o.kind == kind)
        .ok_or_else(not_found)?;
    let to_head = cut.registration.to_head;
    let positions: Vec<Point> = cut.mesh.positions().iter().map(|p| to_head * p).collect();
    let triangles = cut.mesh.triangles();
    let line = SeamLine::find(opening, &positions, &triangles, &cut.registration.positions)?
        .ok_or_else(not_found)?;
    let heights: Vec<Option<f64>> = positions.iter().map(|p| line.height(p)).collect();
    let along: Vec<f64> = positions.iter().map(|p| line.along(p)).collect();
    let field = SlitField {
        places,
        heights: &heights,
        along: &along,
        range: [END_SHARE * line.width, (1.0 - END_SHARE) * line.width],
        start: to_head.inverse() * line.middle(),
    };
    let slit_mesh = slit(&cut.mesh, &field)?.ok_or_else(not_found)?;
    let reached: Vec<f64> = [
        slit_mesh.upper[0],
        slit_mesh.upper[slit_mesh.upper.len() - 1],
    ]
    .iter()
    .map(|&v| line.along(&(to_head * slit_mesh.mesh.positions()[v as usize])))
    .collect();
    if reached[1] - reached[0] < 0.6 * line.width {
        return Err(not_found());
    }

    let first_new_vertex = cut.mesh.vertex_count();
    let split_faces = slit_mesh.face_origins.len() - cut.mesh.face_count();
    let length_mm = slit_mesh
        .upper
        .windows(2)
        .map(|w| {
            let [a, b] = [w[0], w[1]].map(|v| slit_mesh.mesh.positions()[v as usize]);
            (b - a).norm() * to_head.scaling()
        })
        .sum();
    cut.face_origins = slit_mesh
        .face_origins
        .iter()
        .map(|&f| cut.face_origins[f as usize])
        .collect();
    cut.vertex_origins
        .extend(slit_mesh.origins.iter().copied().map(Some));
    let seam_vertices = slit_mesh.origins.len();
    cut.mesh = slit_mesh.mesh.clone();
    pin_rims(model, cut, kind, &slit_mesh, pinned)?;

    let skin = Surface::new(&positions, &triangles)?;
    let mut lined = lining(
        model,
        opening,
        &cut.registration.positions,
        &slit_mesh,
        &to_head,
    );
    for p in &mut lined.positions {
        let place = to_head * *p;
        let excess = in_front_by(&skin, &place, &line.view);
        if excess > 0.0 {
            *p = to_head.inverse() * (place - line.view * excess);
        }
    }
    let lining_vertices = lined.vertices.len();
    let start = cut.mesh.vertex_count() as u32;
    for (k, &v) in lined.vertices.iter().enumerate() {
        pinned.push((
            start + k as u32,
            place_of_vertex(model, v, &cut.registration.positions)?,
            model.region(v),
        ));
    }
    append(cut, &lined, &format!("{}_lining", kind.name()))?;

    let mut eyeball_vertices = 0;
    if let Some((body, mesh)) = eyeball(model, &cut.registration.positions, kind) {
        let first = cut.mesh.vertex_count() as u32;
        eyeball_vertices = mesh.vertex_count();
        let excess = mesh
            .positions()
            .iter()
            .map(|p| in_front_by(&skin, p, &line.view))
            .fold(0.0, f64::max);
        let back = to_head.inverse();
        let ball = Lining {
            vertices: Vec::new(),
            positions: mesh
                .positions()
                .iter()
                .map(|p| back * (p - line.view * excess))
                .collect(),
            polygons: mesh
                .polygons()
                .iter()
                .map(|f| f.iter().map(|v| v + first).collect())
                .collect(),
        };
        append(cut, &ball, &format!("{}_ball", kind.name()))?;
        cut.registration.rigid_components.push(RigidComponent {
            vertices: (first..first + eyeball_vertices as u32).collect(),
            body,
        });
    }

    // Places of what was appended are their own.
    let next = places.iter().max().map_or(0, |m| m + 1);
    let missing = (cut.mesh.vertex_count() - places.len()) as u32;
    places.extend(next..next + missing);
    let report = &mut cut.registration.report;
    let subject = match kind {
        OpeningKind::Mouth => "the lips are",
        OpeningKind::LeftEye => "the lids of the left eye are",
        OpeningKind::RightEye => "the lids of the right eye are",
    };
    report.warnings.retain(|w| !w.starts_with(subject));
    report.warnings.push(format!(
        "{subject} cut apart, as asked: {} vertices from number {first_new_vertex} on are new \
         ({seam_vertices} on the cut, {lining_vertices} of lining behind it)",
        cut.mesh.vertex_count() - first_new_vertex
    ));
    report.cuts.push(SeamCut {
        opening: kind.name().to_owned(),
        length_mm,
        first_new_vertex,
        seam_vertices,
        lining_vertices,
        eyeball_vertices,
        split_faces,
    });
    Ok(())
}

/// How far a point must move back against `view` to lie behind the skin it would show through;
/// zero where it does. (mm)
fn in_front_by(skin: &Surface, point: &Point, view: &Vector) -> f64 {
    const BEFORE_MM: f64 = 20.0;
    const BEHIND_MM: f64 = 0.4;
    skin.cast_ray(&(point + view * BEFORE_MM), &-view, BEFORE_MM + BEHIND_MM)
        .map_or(0.0, |hit| hit.distance - BEFORE_MM + BEHIND_MM)
        .clamp(0.0, BEFORE_MM)
}

/// The line of a cut in the frame of its opening.
struct SeamLine {
    right: Point,
    across: Vector,
    up: Vector,
    view: Vector,
    width: f64,
    /// (along, height, depth), rising along.
    knots: Vec<[f64; 3]>,
}

impl SeamLine {
    /// `positions` and `triangles`: the face in the head frame; `registered`: the template on
    /// it.
    fn find(
        opening: &Opening,
        positions: &[Point],
        triangles: &[[u32; 3]],
        registered: &[Point],
    ) -> Result<Option<Self>, RegistrationError> {
        let surface = Surface::new(positions, triangles)?;
        let found = find_partings(std::slice::from_ref(opening), &surface, registered);
        let at = |v: u32| registered[v as usize];
        let ends = |side: &[u32]| [at(side[0]), at(side[side.len() - 1])];
        let ([ur, ul], [lr, ll]) = (ends(&opening.upper), ends(&opening.lower));
        let (right, left) = (nalgebra::center(&ur, &lr), nalgebra::center(&ul, &ll));
        let Some(across) = (left - right).try_normalize(1e-9) else {
            return Ok(None);
        };
        let Some(view) = across.cross(&Vector::y()).try_normalize(1e-9) else {
            return Ok(None);
        };
        let mut line = Self {
            right,
            across,
            up: view.cross(&across),
            view,
            width: (left - right).norm(),
            knots: Vec::new(),
        };
        let mut knots = vec![line.coordinates(&right), line.coordinates(&left)];
        match found.first() {
            Some(parting) => knots.extend(seen(parting).map(|p| line.coordinates(&p))),
            // Nothing stands out: the registered line is all there is.
            None => knots.extend(
                [&opening.upper, &opening.lower]
                    .into_iter()
                    .flatten()
                    .map(|&v| line.coordinates(&at(v))),
            ),
        }
        knots.sort_by(|a, b| a[0].total_cmp(&b[0]));
        knots.retain(|k| (0.0..=line.width).contains(&k[0]));
        for _ in 0..3 {
            let before = knots.clone();
            for k in 1..knots.len().saturating_sub(1) {
                for c in 1..3 {
                    knots[k][c] = (before[k - 1][c] + 2.0 * before[k][c] + before[k + 1][c]) / 4.0;
                }
            }
        }
        line.knots = knots;
        Ok((line.knots.len() >= 4).then_some(line))
    }

    fn coordinates(&self, p: &Point) -> [f64; 3] {
        let d = p - self.right;
        [d.dot(&self.across), d.dot(&self.up), d.dot(&self.view)]
    }

    fn along(&self, p: &Point) -> f64 {
        self.coordinates(p)[0]
    }

    /// Height and depth of the line at `along`.
    fn at(&self, along: f64) -> [f64; 2] {
        let k = self.knots.partition_point(|k| k[0] <= along);
        if k == 0 || k == self.knots.len() {
            let knot = self.knots[k.min(self.knots.len() - 1)];
            return [knot[1], knot[2]];
        }
        let (a, b) = (self.knots[k - 1], self.knots[k]);
        let t = if b[0] > a[0] {
            (along - a[0]) / (b[0] - a[0])
        } else {
            0.0
        };
        [a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
    }

    /// Height of a point over the line, `None` far from it.
    fn height(&self, p: &Point) -> Option<f64> {
        let [along, height, depth] = self.coordinates(p);
        let [h, d] = self.at(along);
        let reach = REACH_SHARE * self.width;
        let is_near = (-reach..=self.width + reach).contains(&along)
            && (height - h).abs() < reach
            && (depth - d).abs() < reach;
        is_near.then_some(height - h)
    }

    fn middle(&self) -> Point {
        let along = 0.5 * self.width;
        let [h, d] = self.at(along);
        self.right + self.across * along + self.up * h + self.view * d
    }
}

/// Where a parting is seen, from the right corner on.
fn seen(parting: &Parting) -> impl Iterator<Item = Point> + '_ {
    parting
        .columns
        .iter()
        .map(|c| nalgebra::center(&c.upper.point, &c.lower.point))
}

/// Ties both rims of a slit to their own side of the template.
fn pin_rims(
    model: &FaceModel<'_>,
    cut: &CutFace,
    kind: OpeningKind,
    slit: &SlitMesh,
    pinned: &mut Vec<(u32, SurfacePoint, RegionId)>,
) -> Result<(), RegistrationError> {
    let registered = &cut.registration.positions;
    let surface = Surface::new(registered, &model.triangles)?;
    let sides = triangle_sides(model);
    for (k, rim) in [&slit.upper, &slit.lower].into_iter().enumerate() {
        let side = kind.side(k == 0);
        for &v in &rim[1..rim.len() - 1] {
            let p = cut.registration.to_head * slit.mesh.positions()[v as usize];
            let place = surface.closest_where(&p, f64::INFINITY, |at| {
                let triangle = at.triangle as usize;
                // The lining lies behind the skin here; the rim belongs to the lip or lid.
                sides[triangle] == Some(side)
                    && model.triangles[triangle]
                        .iter()
                        .any(|&c| !model.is_hidden(c))
            });
            if let Some(place) = place {
                let corners = model.triangles[place.triangle as usize];
                let nearest = (0..3)
                    .max_by(|&a, &b| place.barycentric[a].total_cmp(&place.barycentric[b]))
                    .unwrap_or(0);
                pinned.push((v, place, model.region(corners[nearest])));
            }
        }
    }
    Ok(())
}

fn place_of_vertex(
    model: &FaceModel<'_>,
    vertex: u32,
    registered: &[Point],
) -> Result<SurfacePoint, RegistrationError> {
    let (triangle, corner) = model
        .triangles
        .iter()
        .enumerate()
        .find_map(|(t, c)| Some((t, c.iter().position(|&v| v == vertex)?)))
        .ok_or_else(|| RegistrationError::TemplateIncomplete {
            template: model.template.name.clone(),
            what: format!("a triangle at vertex {vertex}"),
        })?;
    let mut barycentric = [0.0; 3];
    barycentric[corner] = 1.0;
    Ok(SurfacePoint {
        triangle: triangle as u32,
        barycentric,
        point: registered[vertex as usize],
        distance: 0.0,
    })
}

/// Appends vertices and polygons to the mesh as a group of their own.
fn append(cut: &mut CutFace, more: &Lining, name: &str) -> Result<(), RegistrationError> {
    let mesh = &cut.mesh;
    let is_inside_out = cut.registration.report.cleaning.was_inside_out;
    let mut positions = mesh.positions().to_vec();
    positions.extend_from_slice(&more.positions);
    let mut polygons: Polygons = mesh.polygons().clone();
    let first_face = polygons.len();
    let mut added_corners = 0;
    for polygon in &more.polygons {
        let mut polygon: Vec<u32> = polygon.clone();
        if is_inside_out {
            polygon.reverse();
        }
        added_corners += polygon.len();
        polygons.push(&polygon);
    }
    let mut groups = mesh.groups().to_vec();
    groups.push(FaceGroup {
        name: name.to_owned(),
        faces: first_face..polygons.len(),
    });
    let mut longer = Mesh::new(positions, polygons)?.with_groups(groups);
    if let Some(uvs) = mesh.uvs() {
        let mut uvs: CornerUvs = uvs.clone();
        let blank = uvs.coordinates.len() as u32;
        uvs.coordinates.push([0.0, 0.0]);
        uvs.corners
            .extend(std::iter::repeat_n(blank, added_corners));
        longer = longer.with_uvs(uvs)?;
    }
    cut.vertex_origins
        .extend(std::iter::repeat_n(None, more.positions.len()));
    cut.face_origins
        .extend(std::iter::repeat_n(None, more.polygons.len()));
    cut.mesh = longer;
    Ok(())
}

/// Places all vertices of the cut mesh on the template, `pinned` ones where they belong.
fn map_again(
    model: &FaceModel<'_>,
    cut: &mut CutFace,
    pinned: &[(u32, SurfacePoint, RegionId)],
) -> Result<(), RegistrationError> {
    let registration = &mut cut.registration;
    let to_head: Similarity3<f64> = registration.to_head;
    let positions: Vec<Point> = cut.mesh.positions().iter().map(|p| to_head * p).collect();
    let mut triangles = cut.mesh.triangles();
    if registration.report.cleaning.was_inside_out {
        for t in &mut triangles {
            t.swap(1, 2);
        }
    }
    let normals = vertex_normals(&positions, &triangles);
    let (mut points, mut regions) = map_vertices(
        model,
        &cut.mesh,
        &positions,
        &normals,
        &registration.positions,
    )?;
    for &(v, place, region) in pinned {
        points[v as usize] = place;
        regions[v as usize] = region;
    }
    registration.face_points = points;
    registration.face_regions = regions;
    Ok(())
}
