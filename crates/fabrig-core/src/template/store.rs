//! A template written back into the files of a pack.

use std::fmt::Write as _;
use std::path::Path;

use super::description::mirrored_name;
use super::geometry::{
    StoredGeometry, StoredMesh, StoredPart, StoredShape, encode, pack, to_steps,
};
use super::identity::{reflect, store_modes};
use super::{Region, Template, TemplateError, WholeFaceShape};
use crate::Vector;
use crate::atomic_file::write_atomically;
use crate::mesh::Mesh;

impl Template {
    /// Writes the pack into a folder, which is made where it is missing: everything that
    /// [`Template::load`] reads. Lengths are rounded to whole steps of 2^-10 mm.
    ///
    /// # Errors
    ///
    /// [`TemplateError::Write`] naming the file; files are only replaced by whole ones.
    pub fn save(&self, folder: &Path) -> Result<(), TemplateError> {
        std::fs::create_dir_all(folder).map_err(|source| TemplateError::Write {
            path: folder.to_owned(),
            source,
        })?;
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            write_atomically(&path, |file| file.write_all(bytes))
                .map_err(|source| TemplateError::Write { path, source })
        };
        write("template.toml", self.description().as_bytes())?;
        write("geometry.bin", &encode(&self.stored_geometry())?)?;
        if !self.identity_modes.is_empty() {
            write("identity.bin", &self.stored_modes()?)?;
        }
        write("patches.toml", self.patch_layout.as_bytes())?;
        write("action_units.toml", self.action_units.as_bytes())?;
        write("materials.toml", self.materials.as_bytes())?;
        write("skin_weights.bin", &self.skin_weights)
    }

    /// The text of `template.toml`: landmarks and regions of the right half follow by mirror.
    fn description(&self) -> String {
        let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "name = {}\nversion = {}\ncredit = {}\n\n[landmarks]\n",
            quoted(&self.name),
            self.version,
            quoted(&self.credit)
        );
        for (name, meaning) in &self.landmark_meanings {
            if let Some(vertex) = self.landmarks.get(name) {
                let meaning = quoted(meaning);
                let _ = writeln!(
                    text,
                    "{name} = {{ vertex = {vertex}, meaning = {meaning} }}"
                );
            }
        }
        for region in self.regions.regions.iter().filter(|r| !self.is_image(r)) {
            let _ = write!(text, "\n[[regions]]\nname = {}\n", quoted(&region.name));
            let apart = region.apart_from.iter();
            let apart: Vec<String> = apart
                .map(|other| quoted(&self.regions.regions[other.0 as usize].name))
                .collect();
            if !apart.is_empty() {
                let _ = writeln!(text, "apart_from = [{}]", apart.join(", "));
            }
        }
        text
    }

    /// Whether a region follows by mirror from one on the left.
    fn is_image(&self, region: &Region) -> bool {
        region.name.ends_with("_r")
            && mirrored_name(&region.name).is_some_and(|left| self.regions.find(&left).is_some())
    }

    fn stored_geometry(&self) -> StoredGeometry {
        StoredGeometry {
            skin: stored_mesh(&self.skin),
            mirror: self.mirror.clone(),
            vertex_regions: self.regions.vertex_regions.iter().map(|r| r.0).collect(),
            parts: self
                .rigid_parts
                .iter()
                .map(|part| StoredPart {
                    name: part.name.clone(),
                    follows: part.follows,
                    mesh: stored_mesh(&part.mesh),
                })
                .collect(),
            shapes: self.shapes.iter().map(stored_shape).collect(),
            part_deltas: self
                .part_deltas
                .iter()
                .map(|(shape, part, deltas)| (*shape, *part, deltas.iter().map(to_steps).collect()))
                .collect(),
            jaw: self.jaw,
            eyes: self.eyes,
        }
    }

    fn stored_modes(&self) -> Result<Vec<u8>, TemplateError> {
        let is_symmetric = |mode: &&Vec<Vector>| {
            let pairs = mode.iter().zip(&self.mirror);
            pairs
                .into_iter()
                .all(|(d, &image)| mode[image as usize] == reflect(*d))
        };
        let (symmetric, antisymmetric): (Vec<&Vec<Vector>>, Vec<&Vec<Vector>>) =
            self.identity_modes.iter().partition(is_symmetric);
        let own = |modes: Vec<&Vec<Vector>>| modes.into_iter().cloned().collect::<Vec<_>>();
        pack(&store_modes(
            &self.mirror,
            &own(symmetric),
            &own(antisymmetric),
        ))
    }
}

fn stored_mesh(mesh: &Mesh) -> StoredMesh {
    StoredMesh {
        positions: mesh
            .positions()
            .iter()
            .map(|p| to_steps(&p.coords))
            .collect(),
        faces: mesh.polygons().iter().map(<[u32]>::to_vec).collect(),
    }
}

fn stored_shape(shape: &WholeFaceShape) -> (String, StoredShape) {
    let mut next = 0u32;
    let mut gaps = Vec::new();
    for (vertex, delta) in &shape.deltas {
        let steps = to_steps(delta);
        if steps != [0; 3] {
            gaps.push((vertex - next, steps));
            next = vertex + 1;
        }
    }
    (shape.name.clone(), StoredShape::Deltas(gaps))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::human;

    #[test]
    fn a_saved_pack_loads_as_what_it_was() {
        let folder = std::env::temp_dir().join(format!("fabrig-pack-{}", std::process::id()));
        human().save(&folder).unwrap();
        let again = Template::load(&folder).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(again.identity_modes, human().identity_modes);
        assert_eq!(again.regions, human().regions);
        assert_eq!(again.landmarks, human().landmarks);
        assert_eq!(again.shapes, human().shapes);
        assert!(&again == human());
    }
}
