//! An animated mesh as a source: the positions of its vertices, frame by frame.
//!
//! The mesh is the rig's own, vertex by vertex, in its units: the source's neutral face is
//! rigged first. Read are a folder of OBJ files in the order of their names, and NumPy's
//! `.npy` with shape (frames, vertices, 3) in 32- or 64-bit floats.

use std::path::{Path, PathBuf};

use super::{ResponseModel, RetargetError, Site};
use crate::Point;
use crate::mesh::io::{MeshIoError, read_mesh};
use crate::rig::Rig;

/// More sites than this make a fit slower, not better.
const MOST_SITES: usize = 2500;

/// Vertex positions over time.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshMotion {
    /// (s)
    pub times: Vec<f64>,
    /// One list of positions a frame, in the mesh's own units.
    pub frames: Vec<Vec<Point>>,
}

/// An animated mesh cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MeshMotionError {
    /// The file or folder could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// A mesh could not be read.
    #[error(transparent)]
    Mesh(#[from] MeshIoError),
    /// The content is wrong.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl MeshMotion {
    /// Reads a folder of OBJ files, or a `.npy`, at `rate` frames per second.
    ///
    /// # Errors
    ///
    /// [`MeshMotionError`] with the file.
    pub fn read(path: impl AsRef<Path>, rate: f64) -> Result<Self, MeshMotionError> {
        let path = path.as_ref();
        let content = |problem: String| MeshMotionError::Content {
            path: path.to_owned(),
            problem,
        };
        let failed = |source| MeshMotionError::Read {
            path: path.to_owned(),
            source,
        };
        if !(rate.is_finite() && rate > 0.0) {
            return Err(content(format!("{rate} is not a frame rate")));
        }
        let frames = if path.is_dir() {
            let mut files: Vec<PathBuf> = std::fs::read_dir(path)
                .map_err(failed)?
                .map(|entry| entry.map(|e| e.path()))
                .collect::<Result<_, _>>()
                .map_err(failed)?;
            files.retain(|f| f.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")));
            files.sort();
            let mut frames = Vec::with_capacity(files.len());
            for file in files {
                frames.push(read_mesh(&file)?.positions().to_vec());
            }
            frames
        } else {
            parse_npy(&std::fs::read(path).map_err(failed)?).map_err(content)?
        };
        let first = frames.first().map_or(0, Vec::len);
        if first == 0 {
            return Err(content("there are no frames".to_owned()));
        }
        if let Some(frame) = frames.iter().position(|f| f.len() != first) {
            return Err(content(format!(
                "frame {frame} has {} vertices, the first has {first}",
                frames[frame].len()
            )));
        }
        Ok(Self {
            times: (0..frames.len()).map(|i| i as f64 / rate).collect(),
            frames,
        })
    }
}

/// Frames of a `.npy`, versions 1 to 3.
fn parse_npy(bytes: &[u8]) -> Result<Vec<Vec<Point>>, String> {
    let version = match bytes.get(..8) {
        Some(head) if head.starts_with(b"\x93NUMPY") => head[6],
        _ => return Err("it is no folder of OBJ files and no .npy".to_owned()),
    };
    let cut = || "it is cut".to_owned();
    let (length, start) = if version == 1 {
        let b = bytes.get(8..10).ok_or_else(cut)?;
        (usize::from(u16::from_le_bytes([b[0], b[1]])), 10)
    } else {
        let b = bytes.get(8..12).ok_or_else(cut)?;
        (u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize, 12)
    };
    let header = bytes.get(start..start + length).ok_or_else(cut)?;
    let header = String::from_utf8_lossy(header);
    let size = match () {
        () if header.contains("'<f4'") => 4,
        () if header.contains("'<f8'") => 8,
        () => return Err("its numbers are not little-endian 32- or 64-bit floats".to_owned()),
    };
    if header.contains("'fortran_order': True") {
        return Err("it is in Fortran order; save numpy.ascontiguousarray of it".to_owned());
    }
    let shape: Vec<usize> = header
        .split_once("'shape':")
        .and_then(|(_, rest)| rest.split_once('(')?.1.split_once(')'))
        .map(|(numbers, _)| {
            numbers
                .split(',')
                .filter_map(|n| n.trim().parse().ok())
                .collect()
        })
        .unwrap_or_default();
    let &[frames, vertices, 3] = &shape[..] else {
        return Err(format!("its shape is {shape:?}, not (frames, vertices, 3)"));
    };
    let data = &bytes[start + length..];
    let needed = frames
        .checked_mul(vertices)
        .and_then(|n| n.checked_mul(3 * size));
    if needed != Some(data.len()) {
        return Err(format!(
            "its shape {shape:?} does not fit its {} bytes of data",
            data.len()
        ));
    }
    let number = |b: &[u8]| match *b {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    };
    let points: Vec<Point> = data
        .chunks_exact(3 * size)
        .map(|p| {
            let mut numbers = p.chunks_exact(size).map(number);
            let mut next = || numbers.next().unwrap_or(f64::NAN);
            Point::new(next(), next(), next())
        })
        .collect();
    Ok(points
        .chunks(vertices.max(1))
        .map(<[Point]>::to_vec)
        .collect())
}

/// Vertices of a rig's mesh to fit at: all of them, or every so many of a fine mesh.
pub fn mesh_sites(rig: &Rig) -> Vec<Site> {
    let count = rig.face.vertex_count();
    let stride = count.div_ceil(MOST_SITES).max(1);
    (0..count as u32)
        .step_by(stride)
        .map(Site::vertex)
        .collect()
}

impl MeshMotion {
    /// Positions of a model's sites in the head frame. (mm)
    ///
    /// # Errors
    ///
    /// [`RetargetError::Count`] where the mesh has not the rig's vertices.
    pub fn at_sites(
        &self,
        model: &ResponseModel,
    ) -> Result<Vec<Vec<Option<Point>>>, RetargetError> {
        let rig = model.rig();
        let expected = rig.face.vertex_count();
        self.frames
            .iter()
            .map(|frame| {
                if frame.len() != expected {
                    return Err(RetargetError::Count {
                        what: "vertices, as in the rig's own mesh",
                        expected,
                        found: frame.len(),
                    });
                }
                let at = |v: u32| (rig.to_head * frame[v as usize]).coords;
                let place = |site: &Site| {
                    let corners = site.vertices.iter().zip(site.shares);
                    Some(Point::from(
                        corners
                            .map(|(&v, share)| at(v) * share)
                            .sum::<crate::Vector>(),
                    ))
                };
                Ok(model.sites().iter().map(place).collect())
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_are_read_and_others_refused() {
        let data: Vec<u8> = (0..12u8).flat_map(|i| f32::from(i).to_le_bytes()).collect();
        let frames = parse_npy(&npy("<f4", "(2, 2, 3)", &data)).unwrap();
        assert_eq!(frames.len(), 2);
        assert_eq!(frames[1][1], Point::new(9.0, 10.0, 11.0));
        let wide: Vec<u8> = (0..3u8).flat_map(|i| f64::from(i).to_le_bytes()).collect();
        assert_eq!(
            parse_npy(&npy("<f8", "(1, 1, 3)", &wide)).unwrap()[0][0].z,
            2.0
        );
        for (kind, shape, part) in [
            ("<f4", "(2, 3, 3)", "does not fit"),
            ("<f4", "(12,)", "not (frames"),
            ("<i4", "(2, 2, 3)", "floats"),
        ] {
            let error = parse_npy(&npy(kind, shape, &data)).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        for cut in 0..20 {
            assert!(parse_npy(&npy("<f4", "(2, 2, 3)", &data)[..cut]).is_err());
        }
    }
}
