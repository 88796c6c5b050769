//! The build itself, step after step.

use std::collections::BTreeMap;
use std::path::Path;

use super::aperture::Aperture;
use super::corrections::{Corrections, Hold};
use super::crop::{Head, crop_head};
use super::fairing::Fairing;
use super::identity::{dense, identity, symmetric_left, symmetrize};
use super::lids::Lids;
use super::linings::Linings;
use super::lips::{LipVertices, Lips};
use super::regions::{EdgeGraph, paint_regions};
use super::rigid::{PARTS, Part, fit_hinge, fit_sphere, mean, part};
use super::sides::Sides;
use super::source::{BaseMesh, read_face_target};
use crate::atomic_file::write_atomically;
use crate::mesh::Polygons;
use crate::template::description::{BuildRecipe, Description, mirrored_name};
use crate::template::geometry::{
    StoredGeometry, StoredMesh, StoredPart, StoredShape, encode, to_point, to_steps,
};
use crate::template::load::{landmarks, region_list};
use crate::template::{EyeSocket, JawHinge, TemplateError};
use crate::{Point, Vector};

/// What a build made.
#[derive(Debug, Clone)]
pub struct BuildReport {
    /// Vertices of the skin.
    pub vertex_count: usize,
    /// Faces of the skin.
    pub face_count: usize,
    /// Size of `geometry.bin`. (bytes)
    pub byte_count: usize,
    /// The jaw as fitted.
    pub jaw: JawHinge,
    /// The eyes as fitted.
    pub eyes: [EyeSocket; 2],
    /// Largest movement of a vertex, shape by shape. (mm)
    pub amplitudes: Vec<(String, f64)>,
}

/// Reads `folder/template.toml`, builds from `data` (the `data` folder of the source) and
/// writes `folder/geometry.bin`.
///
/// # Errors
///
/// [`TemplateError`]; `geometry.bin` is only replaced by a whole file.
pub fn build_template(data: &Path, folder: &Path) -> Result<BuildReport, TemplateError> {
    let path = folder.join("template.toml");
    let text =
        std::fs::read_to_string(&path).map_err(|source| TemplateError::Read { path, source })?;
    let (bytes, report) = build_geometry(data, &text)?;
    let path = folder.join("geometry.bin");
    write_atomically(&path, |file| file.write_all(&bytes))
        .map_err(|source| TemplateError::Write { path, source })?;
    Ok(report)
}

/// The bytes of `geometry.bin` for the text of a `template.toml`.
///
/// # Errors
///
/// [`TemplateError`] when the source or the recipe does not fit.
pub fn build_geometry(
    data: &Path,
    description: &str,
) -> Result<(Vec<u8>, BuildReport), TemplateError> {
    let description = Description::parse(description)?;
    let recipe = description
        .build
        .as_ref()
        .ok_or_else(|| TemplateError::Missing {
            what: "the builder".to_owned(),
            name: "[build]".to_owned(),
        })?;
    let base = BaseMesh::read(data)?;
    let head = crop_head(&base, recipe.neck_vertex)?;
    let landmarks = landmarks(&description, &head.mirror)?;
    let origin = *landmarks
        .get(&recipe.origin)
        .ok_or_else(|| TemplateError::Missing {
            what: "the origin of the head frame".to_owned(),
            name: recipe.origin.clone(),
        })?;
    let frame = frame(data, &base, recipe, head.source[origin as usize])?;
    let parts = PARTS
        .iter()
        .map(|(name, group, _)| part(&base, name, group))
        .collect::<Result<Vec<_>, _>>()?;

    let take =
        |source: &[u32]| -> Vec<Point> { source.iter().map(|&s| frame[s as usize]).collect() };
    let skin = stored_mesh(&take(&head.source), &head.faces);
    let shapes = Shapes {
        data,
        base: &base,
        recipe,
    };
    let eyes = eyes(&take(&parts[0].source), recipe)?;
    let jaw = jaw(&shapes, &parts[3], &frame)?;
    let positions: Vec<Point> = skin.positions.iter().map(to_point).collect();
    let graph = EdgeGraph::new(&head.faces, positions.len());
    let lids = Lids::new(
        &recipe.lids,
        &positions,
        &head.mirror,
        &graph,
        &landmarks,
        (eyes[0].center, eyes[0].radius),
    )?;
    let labels = paint_regions(
        &description,
        &landmarks,
        &positions,
        &head.faces,
        &head.mirror,
    )?;
    let region_names = region_list(&description)?;
    let corner = *landmarks
        .get("lip_corner_l")
        .ok_or_else(|| TemplateError::Missing {
            what: "the lips".to_owned(),
            name: "lip_corner_l".to_owned(),
        })?;
    let region_of = |v: u32| region_names[labels[v as usize] as usize].name.as_str();
    let triangles = Polygons::from_faces(&head.faces).triangles();
    let corrections = Corrections {
        recipe,
        rest: &positions,
        triangles: &triangles,
        fairing: Fairing::new(&positions, &triangles),
        sides: Sides {
            rest: &positions,
            mirror: &head.mirror,
            blend: recipe.side_blend,
        },
        lids,
        linings: Linings::new(&recipe.linings, &positions, &region_of),
        aperture: Aperture::new(
            &recipe.aperture,
            &positions,
            &triangles,
            &graph,
            &landmarks,
            &region_of,
        )?,
        lips: Lips::new(
            &recipe.lips,
            &positions,
            &triangles,
            &LipVertices {
                region_of: &region_of,
                back: positions[corner as usize].z - recipe.lips.lining,
            },
        ),
        hold: Hold::new(&positions, &region_of),
    };
    let (stored_shapes, amplitudes) = stored_shapes(&shapes, &head, &corrections)?;
    let geometry = StoredGeometry {
        vertex_regions: labels.clone(),
        skin,
        mirror: head.mirror.clone(),
        parts: PARTS
            .iter()
            .zip(&parts)
            .map(|((name, _, follows), part)| StoredPart {
                name: (*name).to_owned(),
                follows: *follows,
                mesh: stored_mesh(&take(&part.source), &part.faces),
            })
            .collect(),
        shapes: stored_shapes,
        part_deltas: tongue(&shapes, &parts[4])?,
        jaw,
        eyes,
    };
    let bytes = encode(&geometry)?;
    let report = BuildReport {
        vertex_count: geometry.skin.positions.len(),
        face_count: geometry.skin.faces.len(),
        byte_count: bytes.len(),
        jaw,
        eyes,
        amplitudes,
    };
    Ok((bytes, report))
}

/// The identity in the head frame, every vertex of the source. (mm)
fn frame(
    data: &Path,
    base: &BaseMesh,
    recipe: &BuildRecipe,
    origin: u32,
) -> Result<Vec<Point>, TemplateError> {
    let mut positions = identity(data, base, &recipe.identity)?;
    symmetrize(&mut positions, &base.mirror);
    let origin = positions[origin as usize];
    let shift = Vector::new(0.0, origin.y, origin.z);
    Ok(positions
        .iter()
        .map(|p| (p - shift) * recipe.millimetres_per_unit)
        .collect())
}

fn stored_mesh(positions: &[Point], faces: &[Vec<u32>]) -> StoredMesh {
    StoredMesh {
        positions: positions.iter().map(|p| to_steps(&p.coords)).collect(),
        faces: faces.to_vec(),
    }
}

/// Where whole-face shapes come from.
struct Shapes<'a> {
    data: &'a Path,
    base: &'a BaseMesh,
    recipe: &'a BuildRecipe,
}

impl Shapes<'_> {
    /// One delta per source vertex; a left shape is the mean of itself and its partner's
    /// mirror image, a shape without sides is its own partner. (mm)
    fn symmetric(&self, name: &str) -> Result<Vec<Vector>, TemplateError> {
        let own = dense(name, &read_face_target(self.data, name)?, self.base)?;
        let other = match mirrored_name(name) {
            Some(other) => dense(&other, &read_face_target(self.data, &other)?, self.base)?,
            None => own.clone(),
        };
        let mut deltas = symmetric_left(&own, &other, &self.base.mirror);
        let gain = self.recipe.gain.get(name).copied().unwrap_or(1.0);
        for delta in &mut deltas {
            *delta *= gain * self.recipe.millimetres_per_unit;
        }
        Ok(deltas)
    }
}

fn take(deltas: &[Vector], source: &[u32]) -> Vec<Vector> {
    source.iter().map(|&s| deltas[s as usize]).collect()
}

type NamedShapes = (Vec<(String, StoredShape)>, Vec<(String, f64)>);

fn stored_shapes(
    shapes: &Shapes<'_>,
    head: &Head,
    corrections: &Corrections<'_>,
) -> Result<NamedShapes, TemplateError> {
    let mut done: BTreeMap<String, Vec<Vector>> = BTreeMap::new();
    let mut stored: Vec<(String, StoredShape)> = Vec::new();
    let mut amplitudes: Vec<(String, f64)> = Vec::new();
    for name in &shapes.recipe.shapes {
        let partner =
            mirrored_name(name).and_then(|other| stored.iter().position(|(n, _)| *n == other));
        let (shape, amplitude) = match partner {
            Some(other) => (StoredShape::MirrorOf(other as u32), amplitudes[other].1),
            None => {
                let drawn = take(&shapes.symmetric(name)?, &head.source);
                let deltas = corrections.correct(name, drawn, &done);
                let amplitude = deltas.iter().map(|d| d.norm()).fold(0.0, f64::max);
                let shape = StoredShape::Deltas(sparse(&deltas));
                done.insert(name.clone(), deltas);
                (shape, amplitude)
            }
        };
        stored.push((name.clone(), shape));
        amplitudes.push((name.clone(), amplitude));
    }
    Ok((stored, amplitudes))
}

fn sparse(deltas: &[Vector]) -> Vec<(u32, [i32; 3])> {
    let mut next = 0u32;
    let mut sparse = Vec::new();
    for (vertex, delta) in (0u32..).zip(deltas) {
        let steps = to_steps(delta);
        if steps != [0; 3] {
            sparse.push((vertex - next, steps));
            next = vertex + 1;
        }
    }
    sparse
}

fn eyes(left: &[Point], recipe: &BuildRecipe) -> Result<[EyeSocket; 2], TemplateError> {
    let (center, radius) = fit_sphere(left)?;
    let socket = EyeSocket {
        center: to_point(&to_steps(&center.coords)),
        radius,
        look_angles: recipe.look_degrees.map(f64::to_radians),
    };
    let c = socket.center;
    let other = EyeSocket {
        center: Point::new(0.0 - c.x, c.y, c.z),
        ..socket
    };
    Ok([socket, other])
}

fn jaw(shapes: &Shapes<'_>, teeth: &Part, frame: &[Point]) -> Result<JawHinge, TemplateError> {
    let of = |name: &str| -> Result<Vec<Vector>, TemplateError> {
        Ok(take(&shapes.symmetric(name)?, &teeth.source))
    };
    let rest: Vec<Point> = teeth.source.iter().map(|&s| frame[s as usize]).collect();
    let open: Vec<Point> = rest
        .iter()
        .zip(of(&shapes.recipe.jaw_shapes[0])?)
        .map(|(p, d)| p + d)
        .collect();
    let (open_angle, center) = fit_hinge(&rest, &open)?;
    Ok(JawHinge {
        center,
        axis: Vector::x(),
        open_angle,
        forward: mean(&of(&shapes.recipe.jaw_shapes[1])?),
        left: mean(&of(&shapes.recipe.jaw_shapes[2])?),
    })
}

type StoredPartDeltas = Vec<(u32, u32, Vec<[i32; 3]>)>;

/// Only `tongueOut` deforms a part: the jaw carries the tongue otherwise.
fn tongue(shapes: &Shapes<'_>, tongue: &Part) -> Result<StoredPartDeltas, TemplateError> {
    let name = &shapes.recipe.tongue_shape;
    let shape = shapes
        .recipe
        .shapes
        .iter()
        .position(|n| n == name)
        .ok_or_else(|| TemplateError::Missing {
            what: "the tongue".to_owned(),
            name: name.clone(),
        })?;
    let deltas = take(&shapes.symmetric(name)?, &tongue.source);
    let part = PARTS.len() as u32 - 1;
    Ok(vec![(
        shape as u32,
        part,
        deltas.iter().map(to_steps).collect(),
    )])
}
