//! Materials of a glTF file, taken over as they are, extensions of materials and all.

use std::path::Path;

use serde_json::Value;

use super::material::mime_of;
use super::{Appearance, AppearanceError, Material, Picture};
use crate::mesh::io::{GltfFile, MeshWithShapes};

/// Reads the materials of a glTF file and the one of each polygon.
pub(super) fn read(
    path: &Path,
    file: &MeshWithShapes,
    notes: &mut Vec<String>,
) -> Result<Appearance, AppearanceError> {
    let source = GltfFile::read(path)?;
    let list =
        |name: &str| -> Vec<Value> { source.root[name].as_array().cloned().unwrap_or_default() };
    let mut appearance = Appearance {
        textures: list("textures"),
        samplers: list("samplers"),
        extensions: list("extensionsUsed")
            .iter()
            .filter_map(Value::as_str)
            // Those of meshes and buffers do not hold for what is written.
            .filter(|name| name.starts_with("KHR_materials") || *name == "KHR_texture_transform")
            .map(str::to_owned)
            .collect(),
        ..Appearance::default()
    };
    if list("materials").is_empty() {
        notes.push(format!("{} has no materials", path.display()));
        return Ok(Appearance::default());
    }
    let mut kept = Vec::new();
    for (index, image) in list("images").iter().enumerate() {
        let name = image["name"]
            .as_str()
            .map_or_else(|| format!("image_{index}"), str::to_owned);
        let bytes = source.image(index);
        let picture = bytes.and_then(|bytes| {
            let mime = mime_of(&bytes).ok_or_else(|| "neither PNG nor JPEG".to_owned())?;
            Ok(Picture {
                name: name.clone(),
                mime: mime.to_owned(),
                bytes,
            })
        });
        match picture {
            Ok(picture) => {
                kept.push(appearance.keep(picture, notes));
            }
            Err(reason) => {
                notes.push(format!("picture {name} is left out: {reason}"));
                kept.push(None);
            }
        }
    }
    let picture_of = |texture: &Value| -> Option<usize> {
        let image = texture["source"].as_u64()?;
        *kept.get(usize::try_from(image).ok()?)?
    };
    let pictures: Vec<Option<usize>> = appearance.textures.iter().map(picture_of).collect();
    for (texture, picture) in appearance.textures.iter_mut().zip(&pictures) {
        if let (Some(object), Some(picture)) = (texture.as_object_mut(), picture) {
            object.insert("source".to_owned(), Value::from(*picture));
            object.remove("extensions");
        }
    }
    for (index, mut gltf) in list("materials").into_iter().enumerate() {
        let mut dropped = 0;
        drop_textures(&mut gltf, &pictures, &mut dropped);
        let name = gltf["name"]
            .as_str()
            .map_or_else(|| format!("material_{index}"), str::to_owned);
        if dropped > 0 {
            notes.push(format!(
                "{dropped} textures of {name} are left out: their picture or their second set of \
                 texture coordinates is not kept"
            ));
        }
        let surface = &gltf["pbrMetallicRoughness"];
        let number = |value: &Value, default: f64| value.as_f64().unwrap_or(default);
        let color = std::array::from_fn(|c| number(&surface["baseColorFactor"][c], 1.0));
        let texture = surface["baseColorTexture"]["index"].as_u64();
        let texture = texture.and_then(|t| usize::try_from(t).ok());
        appearance.materials.push(Material {
            color,
            roughness: number(&surface["roughnessFactor"], 1.0),
            metallic: number(&surface["metallicFactor"], 1.0),
            picture: texture.and_then(|t| *pictures.get(t)?),
            name,
            gltf,
        });
    }
    // Textures without a picture are no longer named; the list keeps their places.
    if pictures.iter().any(Option::is_none) {
        for (texture, picture) in appearance.textures.iter_mut().zip(&pictures) {
            if picture.is_none() {
                *texture = serde_json::json!({});
            }
        }
    }
    let mut of_polygon = vec![None; file.mesh.face_count()];
    for (group, material) in file.mesh.groups().iter().zip(&file.group_materials) {
        of_polygon[group.faces.clone()].fill(*material);
    }
    let count = appearance.materials.len();
    let is_known = |m: &usize| *m < count;
    let of_polygon: Vec<u32> = of_polygon
        .into_iter()
        .map(|material| material.filter(is_known).unwrap_or(count) as u32)
        .collect();
    if of_polygon.contains(&(count as u32)) {
        // What glTF gives a primitive without one.
        let white = Material::new("default", [1.0; 4], 1.0, 1.0, None);
        appearance.materials.push(white);
    }
    appearance.of_polygon = of_polygon;
    Ok(appearance)
}

/// Takes off textures that no longer have a picture, or stand on other texture coordinates than
/// the first.
fn drop_textures(value: &mut Value, pictures: &[Option<usize>], dropped: &mut usize) {
    let Some(object) = value.as_object_mut() else {
        return;
    };
    object.retain(|key, inner| {
        let is_texture = key.ends_with("Texture") && inner.get("index").is_some();
        let index = inner["index"]
            .as_u64()
            .and_then(|i| usize::try_from(i).ok());
        let has_picture = index.and_then(|i| *pictures.get(i)?).is_some();
        let is_kept = !is_texture || has_picture && inner["texCoord"].as_u64().unwrap_or(0) == 0;
        *dropped += usize::from(!is_kept);
        is_kept
    });
    for inner in object.values_mut() {
        drop_textures(inner, pictures, dropped);
    }
}
