//! A folder of OBJ files: the neutral face with one file a shape, or one file a frame.

use std::path::{Path, PathBuf};

use super::ExportError;
use super::face::ExportFace;
use crate::Point;
use crate::mesh::io::write_obj;
use crate::mesh::{FaceGroup, Mesh};

/// Files on their way into a folder. A folder that is new takes its name once it is complete.
pub(super) struct ObjFolder {
    mesh: Mesh,
    output: PathBuf,
    /// Where files go meanwhile; none where the folder was there before.
    partial: Option<tempfile::TempDir>,
    pub(super) files: usize,
    pub(super) bytes: u64,
}

impl ObjFolder {
    pub(super) fn new(output: &Path, face: &ExportFace) -> Result<Self, ExportError> {
        let mut mesh = Mesh::new(face.positions.clone(), face.polygons.clone())?;
        if let Some(uvs) = &face.uvs {
            mesh = mesh.with_uvs(uvs.clone())?;
        }
        let groups = face.sections.iter().flat_map(|section| {
            let runs = section.polygons.chunk_by(|a, b| a + 1 == *b);
            runs.map(|run| FaceGroup {
                name: section.name.clone(),
                faces: run[0] as usize..run[run.len() - 1] as usize + 1,
            })
        });
        let mut groups: Vec<FaceGroup> = groups.collect();
        groups.sort_by_key(|group| group.faces.start);
        let partial = if output.is_dir() {
            None
        } else {
            let parent = match output.parent() {
                Some(parent) if !parent.as_os_str().is_empty() => parent,
                _ => Path::new("."),
            };
            let folder = tempfile::Builder::new()
                .prefix(".fabrig-")
                .suffix(".partial")
                .tempdir_in(parent);
            Some(folder.map_err(ExportError::io(output))?)
        };
        Ok(Self {
            mesh: mesh.with_groups(groups),
            output: output.to_owned(),
            partial,
            files: 0,
            bytes: 0,
        })
    }

    /// Writes the face at other positions.
    pub(super) fn write(&mut self, name: &str, positions: Vec<Point>) -> Result<(), ExportError> {
        let folder = match &self.partial {
            Some(partial) => partial.path(),
            None => &self.output,
        };
        let path = folder.join(format!("{name}.obj"));
        write_obj(&path, &self.mesh.with_positions(positions)?)?;
        let length = std::fs::metadata(&path).map_err(ExportError::io(&path))?;
        self.files += 1;
        self.bytes += length.len();
        Ok(())
    }

    /// Gives a new folder its name.
    pub(super) fn finish(self) -> Result<(usize, u64), ExportError> {
        if let Some(partial) = self.partial {
            let io = ExportError::io(&self.output);
            #[cfg(unix)]
            {
                // A temporary folder is the user's alone; what is kept follows the usual rights.
                use std::os::unix::fs::PermissionsExt;
                let rights = std::fs::Permissions::from_mode(0o755);
                std::fs::set_permissions(partial.path(), rights).map_err(&io)?;
            }
            std::fs::rename(partial.keep(), &self.output).map_err(io)?;
        }
        Ok((self.files, self.bytes))
    }
}
