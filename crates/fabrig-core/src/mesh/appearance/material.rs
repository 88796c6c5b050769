//! Materials and pictures as they are kept.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::AppearanceError;

/// Most that the pictures of a mesh may have together; further ones are left out with a note.
/// (bytes)
pub(super) const LARGEST_PICTURES: usize = 512 << 20;

/// A material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Linear red, green, blue, and opacity.
    pub color: [f64; 4],
    /// From 0, a mirror, to 1.
    pub roughness: f64,
    /// From 0 to 1, metal.
    pub metallic: f64,
    /// Index in [`Appearance::pictures`] of the one that colours it.
    pub picture: Option<usize>,
    /// As glTF writes it; textures by their index in [`Appearance::textures`].
    #[serde(with = "as_text")]
    pub gltf: Value,
}

impl Material {
    /// - `texture`: index of a texture and of its picture
    pub fn new(
        name: &str,
        color: [f64; 4],
        roughness: f64,
        metallic: f64,
        texture: Option<(usize, usize)>,
    ) -> Self {
        let mut gltf = json!({
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": color,
                "metallicFactor": metallic,
                "roughnessFactor": roughness,
            },
        });
        if let Some((texture, _)) = texture {
            gltf["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": texture});
        }
        if color[3] < 1.0 {
            gltf["alphaMode"] = json!("BLEND");
        }
        Self {
            name: name.to_owned(),
            color,
            roughness,
            metallic,
            picture: texture.map(|(_, picture)| picture),
            gltf,
        }
    }
}

/// A picture that materials use, as it is in its file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Picture {
    /// Name without extension.
    pub name: String,
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// The whole file.
    #[serde(with = "as_bytes")]
    pub bytes: Vec<u8>,
}

impl Picture {
    /// The extension of a file with it.
    pub fn extension(&self) -> &'static str {
        if self.mime == "image/jpeg" {
            "jpg"
        } else {
            "png"
        }
    }
}

/// What a picture is, by its first bytes.
pub(super) fn mime_of(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some("image/png")
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        Some("image/jpeg")
    } else {
        None
    }
}

/// What a mesh looks like.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Appearance {
    /// Its materials.
    pub materials: Vec<Material>,
    /// Pictures that they use.
    pub pictures: Vec<Picture>,
    /// glTF's textures: a picture (`source`) and how it is sampled.
    #[serde(with = "as_text")]
    pub textures: Vec<Value>,
    /// glTF's samplers.
    #[serde(with = "as_text")]
    pub samplers: Vec<Value>,
    /// Extensions of glTF that the materials use.
    pub extensions: Vec<String>,
    /// Index of the material of each polygon; empty where there are no materials.
    pub of_polygon: Vec<u32>,
}

impl Appearance {
    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty()
    }

    /// Names of the materials in order.
    pub fn names(&self) -> Vec<String> {
        self.materials.iter().map(|m| m.name.clone()).collect()
    }

    /// Adds a picture, unless there are too many bytes of them already; returns its index.
    pub(super) fn keep(&mut self, picture: Picture, notes: &mut Vec<String>) -> Option<usize> {
        let kept: usize = self.pictures.iter().map(|p| p.bytes.len()).sum();
        if kept + picture.bytes.len() > LARGEST_PICTURES {
            notes.push(format!(
                "picture {} is left out: all pictures together have more than {} MB",
                picture.name,
                LARGEST_PICTURES >> 20
            ));
            return None;
        }
        self.pictures.push(picture);
        Some(self.pictures.len() - 1)
    }

    /// Refuses numbers that name nothing, as a damaged file may have them.
    ///
    /// # Errors
    ///
    /// [`AppearanceError::PolygonCount`], [`AppearanceError::IndexOutOfRange`].
    pub fn check(&self, polygon_count: usize) -> Result<(), AppearanceError> {
        let expected = if self.is_empty() { 0 } else { polygon_count };
        if self.of_polygon.len() != expected {
            return Err(AppearanceError::PolygonCount {
                expected,
                found: self.of_polygon.len(),
            });
        }
        let number = |value: &Value| -> Option<usize> {
            // One that is too large for this machine names nothing either.
            value
                .as_u64()
                .map(|n| usize::try_from(n).unwrap_or(usize::MAX))
        };
        let of_polygon = self.of_polygon.iter().map(|m| Some(*m as usize));
        let of_material = self.materials.iter().map(|m| m.picture);
        let of_texture = |key: &'static str| self.textures.iter().map(move |t| number(&t[key]));
        let pictures = self.pictures.len();
        within("polygon", "material", self.materials.len(), of_polygon)?;
        within("material", "picture", pictures, of_material)?;
        within("texture", "picture", pictures, of_texture("source"))?;
        within(
            "texture",
            "sampler",
            self.samplers.len(),
            of_texture("sampler"),
        )
    }
}

/// Refuses the first of some things that names one of another kind that is not there.
fn within(
    what: &'static str,
    kind: &'static str,
    count: usize,
    named: impl Iterator<Item = Option<usize>>,
) -> Result<(), AppearanceError> {
    let mut named = named.enumerate();
    match named.find_map(|(index, found)| Some((index, found.filter(|f| *f >= count)?))) {
        None => Ok(()),
        Some((index, found)) => Err(AppearanceError::IndexOutOfRange {
            what,
            index,
            kind,
            found,
            count,
        }),
    }
}

/// Linear colour of an sRGB one, opaque.
pub fn linear_color(color: [u8; 3]) -> [f64; 4] {
    let [r, g, b] = color.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    });
    [r, g, b, 1.0]
}

/// JSON inside a format that does not describe itself: as text.
mod as_text {
    use serde::de::{DeserializeOwned, Error as _};
    use serde::ser::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<T: Serialize, S: Serializer>(
        value: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let text = serde_json::to_string(value).map_err(S::Error::custom)?;
        serializer.serialize_str(&text)
    }

    pub(super) fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<T, D::Error> {
        let text = String::deserialize(deserializer)?;
        serde_json::from_str(&text).map_err(D::Error::custom)
    }
}

/// Bytes in one piece, instead of number by number.
mod as_bytes {
    use serde::de::Visitor;
    use serde::{Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(bytes)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<u8>, D::Error> {
        struct Bytes;
        impl<'de> Visitor<'de> for Bytes {
            type Value = Vec<u8>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("bytes")
            }

            fn visit_bytes<E>(self, bytes: &[u8]) -> Result<Vec<u8>, E> {
                Ok(bytes.to_vec())
            }
        }
        deserializer.deserialize_bytes(Bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted() -> Appearance {
        Appearance {
            materials: vec![
                Material::new("skin", [1.0; 4], 0.5, 0.0, Some((0, 0))),
                Material::new("lips", [0.5, 0.1, 0.1, 0.5], 0.3, 0.0, None),
            ],
            pictures: vec![Picture {
                name: "pores".to_owned(),
                mime: "image/jpeg".to_owned(),
                bytes: vec![0xff, 0xd8, 0xff, 0],
            }],
            textures: vec![json!({"source": 0, "sampler": 0})],
            samplers: vec![json!({"wrapS": 33071})],
            extensions: vec!["KHR_materials_sheen".to_owned()],
            of_polygon: vec![0, 1, 1],
        }
    }

    #[test]
    fn it_survives_a_format_that_does_not_describe_itself() {
        let bytes = postcard::to_allocvec(&painted()).unwrap();
        let back: Appearance = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(back, painted());
    }

    #[test]
    fn numbers_that_name_nothing_are_refused() {
        painted().check(3).unwrap();
        Appearance::default().check(7).unwrap();
        let refused = |change: &dyn Fn(&mut Appearance)| {
            let mut appearance = painted();
            change(&mut appearance);
            appearance.check(3).unwrap_err().to_string()
        };
        for (error, says) in [
            (refused(&|a| a.of_polygon.truncate(2)), "expected 3"),
            (
                refused(&|a| a.of_polygon[2] = 2),
                "polygon 2 names material 2",
            ),
            (
                refused(&|a| a.materials[1].picture = Some(1)),
                "material 1 names",
            ),
            (
                refused(&|a| a.textures[0]["source"] = json!(4)),
                "picture 4",
            ),
            (
                refused(&|a| a.textures[0]["sampler"] = json!(1)),
                "sampler 1",
            ),
        ] {
            assert!(error.contains(says), "{error}");
        }
    }
}
