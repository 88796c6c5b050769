//! Faces of other people from the same source: test faces, and the one the demo rigs.
//!
//! Such a face is meant to be a stranger to the template: another identity, not symmetric, its
//! mouth and sockets open behind the rims instead of closed bags, new triangles throughout,
//! eyeballs and teeth as loose parts, in another unit, place and orientation.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Rotation3;
use serde::Deserialize;

use super::crop::crop_head;
use super::decimate::decimate;
use super::identity::identity;
use super::rigid::{PARTS, fit_sphere, part};
use super::source::BaseMesh;
use super::subdivide::catmull_clark;
use crate::atomic_file::write_atomically;
use crate::mesh::{Mesh, Polygons};
use crate::template::demo::{StoredFace, assemble};

use crate::template::geometry::{pack, to_steps};
use crate::template::people::store_people;
use crate::template::{Template, TemplateError};
use crate::{Point, Vector};

/// The text of a list of faces.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaceList {
    /// Source vertex at the front of the neck cut.
    neck_vertex: u32,
    /// Length of one source unit. (mm)
    millimetres_per_unit: f64,
    /// The faces by name.
    faces: BTreeMap<String, FaceRecipe>,
}

/// How one face is made.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct FaceRecipe {
    /// Skin vertices to keep, about.
    skin_vertex_count: usize,
    /// Edge steps of mouth and socket lining kept behind lips and lids.
    rim: u32,
    /// Length of one unit of the face. (mm)
    unit_mm: f64,
    /// Turns about x, then y, then z. (degrees)
    turn_degrees: [f64; 3],
    /// Where the middle between the eyes goes, in the face's unit.
    place: [f64; 3],
    /// Targets and how much of each makes the identity.
    identity: BTreeMap<String, f64>,
}

impl FaceList {
    /// Reads the text of a list of faces.
    ///
    /// # Errors
    ///
    /// [`TemplateError::Text`] with line and column.
    pub fn parse(text: &str) -> Result<Self, TemplateError> {
        toml::from_str(text).map_err(|source| TemplateError::Text {
            file: "faces.toml",
            source: Box::new(source),
        })
    }

    /// Names of the faces.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.faces.keys().map(String::as_str)
    }

    /// Builds one face from `data`; `template` says what is lining of mouth and sockets.
    ///
    /// # Errors
    ///
    /// [`TemplateError`] when there is no such face or the source does not fit.
    pub fn build(
        &self,
        data: &Path,
        template: &Template,
        name: &str,
    ) -> Result<Mesh, TemplateError> {
        assemble(&self.stored(data, template, name)?)
    }

    /// Builds one face and writes it the way the demo's face is kept.
    ///
    /// # Errors
    ///
    /// [`TemplateError`]; the file is only replaced by a whole one.
    pub fn write(
        &self,
        data: &Path,
        template: &Template,
        name: &str,
        path: &Path,
    ) -> Result<(), TemplateError> {
        let bytes = pack(&self.stored(data, template, name)?)?;
        write_atomically(path, |file| file.write_all(&bytes)).map_err(|source| {
            TemplateError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }

    /// Writes everyone on the list in the template's topology, the way
    /// [`crate::template::people`] are kept.
    ///
    /// # Errors
    ///
    /// [`TemplateError`]; the file is only replaced by a whole one.
    pub fn write_people(
        &self,
        data: &Path,
        template: &Template,
        path: &Path,
    ) -> Result<(), TemplateError> {
        let people = self
            .faces
            .iter()
            .map(|(name, recipe)| Ok((name.clone(), self.person(data, template, recipe)?)))
            .collect::<Result<Vec<_>, TemplateError>>()?;
        let bytes = pack(&store_people(template, &people))?;
        write_atomically(path, |file| file.write_all(&bytes)).map_err(|source| {
            TemplateError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }

    /// The template's skin vertices on another person, eyes about where the template's are. [mm]
    fn person(
        &self,
        data: &Path,
        template: &Template,
        recipe: &FaceRecipe,
    ) -> Result<Vec<Point>, TemplateError> {
        let base = BaseMesh::read(data)?;
        let positions = identity(data, &base, &recipe.identity)?;
        let take = |source: &[u32]| -> Vec<Point> {
            source
                .iter()
                .map(|&s| positions[s as usize] * self.millimetres_per_unit)
                .collect()
        };
        let mut shift = Vector::zeros();
        for ((name, group, _), eye) in PARTS.iter().zip(&template.eyes) {
            let (center, _) = fit_sphere(&take(&part(&base, name, group)?.source))?;
            shift += (eye.center - center) / 2.0;
        }
        let head = crop_head(&base, self.neck_vertex)?;
        if head.source.len() != template.skin.vertex_count() {
            return Err(TemplateError::Source {
                reason: "the head is not cut where the template's is".to_owned(),
            });
        }
        Ok(take(&head.source).iter().map(|p| p + shift).collect())
    }

    fn stored(
        &self,
        data: &Path,
        template: &Template,
        name: &str,
    ) -> Result<StoredFace, TemplateError> {
        let recipe = self.faces.get(name).ok_or_else(|| TemplateError::Missing {
            what: "the list of faces".to_owned(),
            name: name.to_owned(),
        })?;
        let base = BaseMesh::read(data)?;
        let positions = identity(data, &base, &recipe.identity)?;
        let take = |source: &[u32]| -> Vec<Point> {
            source
                .iter()
                .map(|&s| positions[s as usize] * self.millimetres_per_unit)
                .collect()
        };
        let mut groups = Vec::new();
        let mut eyes = Vec::new();
        for (name, group, _) in &PARTS {
            let part = part(&base, name, group)?;
            let rest = take(&part.source);
            let (positions, triangles) = if name.starts_with("eye") {
                let (center, radius) = fit_sphere(&rest)?;
                eyes.push(center);
                sphere(&center, radius)
            } else {
                let (fine, quads) = catmull_clark(&rest, &part.faces);
                let count = fine.len() * 2 / 3;
                decimate(&fine, &Polygons::from_faces(&quads).triangles(), count)
            };
            groups.push(((*name).to_owned(), positions, triangles));
        }
        let middle = (eyes[0].coords + eyes[1].coords) / 2.0;

        let head = crop_head(&base, self.neck_vertex)?;
        let faces = without_linings(&head.faces, template, recipe.rim)?;
        let (fine, quads) = catmull_clark(&take(&head.source), &faces);
        let (fine, quads) = catmull_clark(&fine, &quads);
        let (skin, triangles) = decimate(
            &fine,
            &Polygons::from_faces(&quads).triangles(),
            recipe.skin_vertex_count,
        );
        groups.insert(0, ("skin".to_owned(), skin, triangles));

        let [x, y, z] = recipe.turn_degrees.map(f64::to_radians);
        let turn = Rotation3::from_axis_angle(&Vector::z_axis(), z)
            * Rotation3::from_axis_angle(&Vector::y_axis(), y)
            * Rotation3::from_axis_angle(&Vector::x_axis(), x);
        Ok(StoredFace {
            groups: groups
                .into_iter()
                .map(|(name, positions, triangles)| {
                    let steps = positions.iter().map(|p| to_steps(&(p.coords - middle)));
                    (name, steps.collect(), triangles)
                })
                .collect(),
            rotation: turn.into_inner().into(),
            millimetres_per_unit: recipe.unit_mm,
            place: recipe.place,
        })
    }
}

/// Faces that are not deep inside mouth or sockets.
fn without_linings(
    faces: &[Vec<u32>],
    template: &Template,
    rim: u32,
) -> Result<Vec<Vec<u32>>, TemplateError> {
    let labels = &template.regions.vertex_regions;
    if faces.iter().flatten().any(|&v| v as usize >= labels.len()) {
        return Err(TemplateError::Source {
            reason: "the head is not cut where the template's is".to_owned(),
        });
    }
    let is_lining: Vec<bool> = template
        .regions
        .regions
        .iter()
        .map(|r| r.name.starts_with("socket") || r.name.starts_with("mouth_interior"))
        .collect();
    let mut depth: Vec<u32> = labels
        .iter()
        .map(|l| if is_lining[l.0 as usize] { u32::MAX } else { 0 })
        .collect();
    for step in 1..=rim {
        for face in faces {
            if face.iter().any(|&v| depth[v as usize] == step - 1) {
                for &v in face {
                    let d = &mut depth[v as usize];
                    *d = (*d).min(step);
                }
            }
        }
    }
    Ok(faces
        .iter()
        .filter(|face| face.iter().all(|&v| depth[v as usize] != u32::MAX))
        .cloned()
        .collect())
}

/// A sphere of latitudes and longitudes, poles along z (the pupil is a pole).
fn sphere(center: &Point, radius: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
    const RINGS: u32 = 15;
    const SECTORS: u32 = 24;
    let mut positions = vec![center + Vector::new(0.0, 0.0, radius)];
    for ring in 1..RINGS {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(RINGS);
        for sector in 0..SECTORS {
            let around = std::f64::consts::TAU * f64::from(sector) / f64::from(SECTORS);
            let direction = Vector::new(
                polar.sin() * around.cos(),
                polar.sin() * around.sin(),
                polar.cos(),
            );
            positions.push(center + direction * radius);
        }
    }
    positions.push(center - Vector::new(0.0, 0.0, radius));
    let last = positions.len() as u32 - 1;
    let at = |ring: u32, sector: u32| 1 + (ring - 1) * SECTORS + sector % SECTORS;
    let mut triangles = Vec::new();
    for s in 0..SECTORS {
        triangles.push([0, at(1, s), at(1, s + 1)]);
        for ring in 1..RINGS - 1 {
            triangles.push([at(ring, s), at(ring + 1, s), at(ring + 1, s + 1)]);
            triangles.push([at(ring, s), at(ring + 1, s + 1), at(ring, s + 1)]);
        }
        triangles.push([at(RINGS - 1, s), last, at(RINGS - 1, s + 1)]);
    }
    (positions, triangles)
}
