//! Which format an output is in.

use std::path::Path;

use super::ExportError;

/// A format to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ExportFormat {
    /// glTF 2.0 in one binary file.
    Glb,
    /// glTF 2.0 as JSON with its buffer beside it.
    Gltf,
    /// USD as text.
    Usda,
    /// NumPy arrays.
    Npz,
    /// A PC2 point cache.
    Pc2,
    /// An MDD point cache.
    Mdd,
    /// A folder of OBJ files.
    Obj,
}

impl ExportFormat {
    /// The format of an output by its extension; what has none is a folder of OBJ files.
    ///
    /// # Errors
    ///
    /// [`ExportError::UnknownFormat`].
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        if path.is_dir() {
            return Ok(Self::Obj);
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        Ok(match extension.to_ascii_lowercase().as_str() {
            "glb" => Self::Glb,
            "gltf" => Self::Gltf,
            "usda" => Self::Usda,
            "npz" => Self::Npz,
            "pc2" => Self::Pc2,
            "mdd" => Self::Mdd,
            "" => Self::Obj,
            _ => {
                return Err(ExportError::UnknownFormat {
                    path: path.to_owned(),
                    extension: extension.into_owned(),
                });
            }
        })
    }

    /// Its name, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Glb => "GLB",
            Self::Gltf => "glTF",
            Self::Usda => "USD",
            Self::Npz => "npz",
            Self::Pc2 => "PC2",
            Self::Mdd => "MDD",
            Self::Obj => "OBJ",
        }
    }

    /// Whether it holds moving points alone, no shapes.
    pub fn is_point_cache(self) -> bool {
        matches!(self, Self::Pc2 | Self::Mdd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_go_by_extension_and_others_are_refused() {
        let of = |name: &str| ExportFormat::of(Path::new(name));
        assert_eq!(of("a/Face.GLB").unwrap(), ExportFormat::Glb);
        assert_eq!(of("shapes/").unwrap(), ExportFormat::Obj);
        assert_eq!(of("take.pc2").unwrap(), ExportFormat::Pc2);
        let error = of("face.fbx").unwrap_err();
        assert!(error.to_string().contains("'fbx'"), "{error}");
    }
}
