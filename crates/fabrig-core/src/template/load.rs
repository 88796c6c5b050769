//! From the files of a pack to a checked [`Template`].

use std::path::Path;
use std::sync::LazyLock;

use super::description::{Description, mirrored_name};
use super::geometry::{StoredGeometry, StoredMesh, StoredShape, decode, to_point, to_vector};
use super::identity::load_modes;
use super::{
    Landmarks, Region, RegionId, Regions, RigidPart, Template, TemplateError, WholeFaceShape,
};
use crate::mesh::{Mesh, Polygons};

/// The files of a pack in memory.
#[derive(Debug, Clone, Copy)]
pub struct PackFiles<'a> {
    /// `template.toml`
    pub description: &'a str,
    /// `geometry.bin`
    pub geometry: &'a [u8],
    /// `identity.bin`; empty for a pack that has none
    pub identity: &'a [u8],
    /// `patches.toml`
    pub patch_layout: &'a str,
    /// `action_units.toml`
    pub action_units: &'a str,
    /// `materials.toml`
    pub materials: &'a str,
    /// `skin_weights.bin`; empty for a pack that has none
    pub skin_weights: &'a [u8],
}

/// The files of the bundled pack.
pub(crate) fn human_files() -> PackFiles<'static> {
    PackFiles {
        description: include_str!("../../../../templates/human/template.toml"),
        geometry: include_bytes!("../../../../templates/human/geometry.bin"),
        identity: include_bytes!("../../../../templates/human/identity.bin"),
        patch_layout: include_str!("../../../../templates/human/patches.toml"),
        action_units: include_str!("../../../../templates/human/action_units.toml"),
        materials: include_str!("../../../../templates/human/materials.toml"),
        skin_weights: include_bytes!("../../../../templates/human/skin_weights.bin"),
    }
}

static HUMAN: LazyLock<Template> = LazyLock::new(|| {
    match Template::from_files(&human_files()) {
        Ok(template) => template,
        // The pack is part of the binary and a test loads it: a build that fails here is not
        // shipped.
        Err(error) => panic!("the embedded template is damaged: {error}"),
    }
});

/// The template that comes with fabrig, decoded on first use.
pub fn human() -> &'static Template {
    &HUMAN
}

impl Template {
    /// Reads a pack from its folder (`template.toml`, `geometry.bin`, `patches.toml`,
    /// `action_units.toml`, `materials.toml`, and `identity.bin` and `skin_weights.bin` where it
    /// has them).
    ///
    /// # Errors
    ///
    /// [`TemplateError`] naming the file and what is wrong in it.
    pub fn load(folder: &Path) -> Result<Self, TemplateError> {
        let bytes = |name: &str| {
            let path = folder.join(name);
            std::fs::read(&path).map_err(|source| TemplateError::Read { path, source })
        };
        let text = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path).map_err(|source| TemplateError::Read { path, source })
        };
        Self::from_files(&PackFiles {
            description: &text("template.toml")?,
            geometry: &bytes("geometry.bin")?,
            identity: &if folder.join("identity.bin").exists() {
                bytes("identity.bin")?
            } else {
                Vec::new()
            },
            patch_layout: &text("patches.toml")?,
            action_units: &text("action_units.toml")?,
            materials: &text("materials.toml")?,
            skin_weights: &match bytes("skin_weights.bin") {
                Err(TemplateError::Read { source, .. })
                    if source.kind() == std::io::ErrorKind::NotFound =>
                {
                    Vec::new()
                }
                other => other?,
            },
        })
    }

    /// From files in memory; see [`Self::load`].
    ///
    /// # Errors
    ///
    /// [`TemplateError`] for anything that is not whole and consistent.
    pub fn from_files(files: &PackFiles<'_>) -> Result<Self, TemplateError> {
        let description = Description::parse(files.description)?;
        let stored = decode(files.geometry)?;
        assemble(&description, &stored, files)
    }
}

fn assemble(
    description: &Description,
    stored: &StoredGeometry,
    files: &PackFiles<'_>,
) -> Result<Template, TemplateError> {
    let skin = mesh(&stored.skin, "skin")?;
    check_mirror(&skin, &stored.mirror)?;
    let rigid_parts = stored
        .parts
        .iter()
        .map(|part| {
            Ok(RigidPart {
                name: part.name.clone(),
                follows: part.follows,
                mesh: mesh(&part.mesh, &part.name)?,
            })
        })
        .collect::<Result<Vec<_>, TemplateError>>()?;
    let shapes = shapes(stored)?;
    Ok(Template {
        name: description.name.clone(),
        version: description.version,
        credit: description.credit.trim().to_owned(),
        landmark_meanings: description
            .landmarks
            .iter()
            .map(|(name, entry)| (name.clone(), entry.meaning.clone()))
            .collect(),
        landmarks: landmarks(description, &stored.mirror)?,
        regions: regions(description, &stored.vertex_regions, skin.vertex_count())?,
        part_deltas: part_deltas(stored, &rigid_parts)?,
        identity_modes: if files.identity.is_empty() {
            Vec::new()
        } else {
            load_modes(files.identity, &stored.mirror)?
        },
        mirror: stored.mirror.clone(),
        skin,
        rigid_parts,
        shapes,
        jaw: stored.jaw,
        eyes: stored.eyes,
        patch_layout: files.patch_layout.to_owned(),
        action_units: files.action_units.to_owned(),
        materials: files.materials.to_owned(),
        skin_weights: files.skin_weights.to_owned(),
    })
}

pub(super) fn mesh(stored: &StoredMesh, part: &str) -> Result<Mesh, TemplateError> {
    Mesh::new(
        stored.positions.iter().map(to_point).collect(),
        Polygons::from_faces(&stored.faces),
    )
    .map_err(|source| TemplateError::Mesh {
        part: part.to_owned(),
        source,
    })
}

fn check_mirror(skin: &Mesh, mirror: &[u32]) -> Result<(), TemplateError> {
    let positions = skin.positions();
    check_length("the mirror", mirror.len(), positions.len())?;
    for (vertex, &image) in mirror.iter().enumerate() {
        let is_image = mirror.get(image as usize) == Some(&(vertex as u32)) && {
            let (p, q) = (positions[vertex], positions[image as usize]);
            p.x == -q.x && p.y == q.y && p.z == q.z
        };
        if !is_image {
            return Err(TemplateError::Mirror {
                vertex: vertex as u32,
                mirror: image,
            });
        }
    }
    Ok(())
}

/// Left and mid landmarks as written, right ones by mirror.
pub(super) fn landmarks(
    description: &Description,
    mirror: &[u32],
) -> Result<Landmarks, TemplateError> {
    let mut landmarks = Landmarks::new();
    for (name, entry) in &description.landmarks {
        let image =
            *mirror
                .get(entry.vertex as usize)
                .ok_or_else(|| TemplateError::OutOfRange {
                    what: format!("landmark {name:?}"),
                    found: entry.vertex as usize,
                    count: mirror.len(),
                })?;
        let other = mirrored_name(name);
        if other.is_none() && image != entry.vertex {
            return Err(TemplateError::Mirror {
                vertex: entry.vertex,
                mirror: image,
            });
        }
        for (name, vertex) in
            std::iter::once((name.clone(), entry.vertex)).chain(other.map(|other| (other, image)))
        {
            if landmarks.insert(name.clone(), vertex).is_some() {
                return Err(TemplateError::Duplicate {
                    what: "landmark",
                    name,
                });
            }
        }
    }
    Ok(landmarks)
}

/// Names of all regions, mirrored ones after the one they mirror.
pub(super) fn region_list(description: &Description) -> Result<Vec<Region>, TemplateError> {
    let mut named: Vec<(String, Vec<String>)> = Vec::new();
    for entry in &description.regions {
        named.push((entry.name.clone(), entry.apart_from.clone()));
        if let Some(other) = mirrored_name(&entry.name) {
            let apart = entry
                .apart_from
                .iter()
                .map(|a| mirrored_name(a).unwrap_or_else(|| a.clone()))
                .collect();
            named.push((other, apart));
        }
    }
    let find = |of: &str, name: &str| {
        named
            .iter()
            .position(|(n, _)| n == name)
            .map(|i| RegionId(i as u8))
            .ok_or_else(|| TemplateError::Missing {
                what: format!("region {of:?}"),
                name: name.to_owned(),
            })
    };
    if named.len() > 255 {
        return Err(TemplateError::OutOfRange {
            what: "a region".to_owned(),
            found: named.len(),
            count: 255,
        });
    }
    named
        .iter()
        .enumerate()
        .map(|(i, (name, apart))| {
            if named[..i].iter().any(|(n, _)| n == name) {
                return Err(TemplateError::Duplicate {
                    what: "region",
                    name: name.clone(),
                });
            }
            Ok(Region {
                name: name.clone(),
                apart_from: apart
                    .iter()
                    .map(|a| find(name, a))
                    .collect::<Result<_, _>>()?,
            })
        })
        .collect()
}

fn regions(
    description: &Description,
    labels: &[u8],
    vertex_count: usize,
) -> Result<Regions, TemplateError> {
    let regions = region_list(description)?;
    check_length("the region labels", labels.len(), vertex_count)?;
    if let Some(vertex) = labels.iter().position(|&l| l as usize >= regions.len()) {
        return Err(TemplateError::OutOfRange {
            what: format!("the region label of vertex {vertex}"),
            found: labels[vertex] as usize,
            count: regions.len(),
        });
    }
    Ok(Regions {
        regions,
        vertex_regions: labels.iter().map(|&l| RegionId(l)).collect(),
    })
}

fn shapes(stored: &StoredGeometry) -> Result<Vec<WholeFaceShape>, TemplateError> {
    let vertex_count = stored.skin.positions.len();
    let mut shapes: Vec<WholeFaceShape> = Vec::with_capacity(stored.shapes.len());
    for (index, (name, shape)) in stored.shapes.iter().enumerate() {
        let what = || format!("shape {name:?}");
        if shapes.iter().any(|s| &s.name == name) {
            return Err(TemplateError::Duplicate {
                what: "shape",
                name: name.clone(),
            });
        }
        let deltas = match shape {
            StoredShape::Deltas(gaps) => {
                let mut next = 0usize;
                let mut deltas = Vec::with_capacity(gaps.len());
                for (gap, delta) in gaps {
                    let vertex = next + *gap as usize;
                    if vertex >= vertex_count {
                        return Err(TemplateError::OutOfRange {
                            what: what(),
                            found: vertex,
                            count: vertex_count,
                        });
                    }
                    deltas.push((vertex as u32, to_vector(delta)));
                    next = vertex + 1;
                }
                deltas
            }
            StoredShape::MirrorOf(other) => {
                let source =
                    shapes
                        .get(*other as usize)
                        .ok_or_else(|| TemplateError::OutOfRange {
                            what: what(),
                            found: *other as usize,
                            count: index,
                        })?;
                mirrored_deltas(&source.deltas, &stored.mirror)
            }
        };
        shapes.push(WholeFaceShape {
            name: name.clone(),
            deltas,
        });
    }
    Ok(shapes)
}

fn mirrored_deltas(deltas: &[(u32, crate::Vector)], mirror: &[u32]) -> Vec<(u32, crate::Vector)> {
    let mut mirrored: Vec<_> = deltas
        .iter()
        .map(|(v, d)| (mirror[*v as usize], crate::Vector::new(0.0 - d.x, d.y, d.z)))
        .collect();
    mirrored.sort_by_key(|(v, _)| *v);
    mirrored
}

type PartDeltas = Vec<(u32, u32, Vec<crate::Vector>)>;

fn part_deltas(stored: &StoredGeometry, parts: &[RigidPart]) -> Result<PartDeltas, TemplateError> {
    stored
        .part_deltas
        .iter()
        .map(|(shape, part, deltas)| {
            let out_of_range = |found: u32, count: usize| TemplateError::OutOfRange {
                what: "a shape of a rigid part".to_owned(),
                found: found as usize,
                count,
            };
            if *shape as usize >= stored.shapes.len() {
                return Err(out_of_range(*shape, stored.shapes.len()));
            }
            let mesh = &parts
                .get(*part as usize)
                .ok_or_else(|| out_of_range(*part, parts.len()))?
                .mesh;
            check_length("a shape of a rigid part", deltas.len(), mesh.vertex_count())?;
            Ok((*shape, *part, deltas.iter().map(to_vector).collect()))
        })
        .collect()
}

fn check_length(what: &str, found: usize, expected: usize) -> Result<(), TemplateError> {
    if found == expected {
        return Ok(());
    }
    Err(TemplateError::Length {
        what: what.to_owned(),
        found,
        expected,
    })
}
