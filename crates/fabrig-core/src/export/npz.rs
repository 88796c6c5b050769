//! NumPy arrays in one archive, uncompressed.
//!
//! Source: NumPy, `numpy.lib.format`.

use std::io::{self, Write};

use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipWriter};

use super::face::{ExportFace, Frame, Shape, WeightAnimation, single};

/// Elements of an array.
pub(crate) enum Elements<'a> {
    F32(&'a [f32]),
    F64(&'a [f64]),
    U32(&'a [u32]),
    /// Texts, padded to the longest.
    Text(&'a [String]),
}

/// An archive on its way.
pub(crate) struct NpzWriter<W: Write> {
    zip: ZipWriter<StreamWriter<W>>,
}

impl<W: Write> NpzWriter<W> {
    pub(crate) fn new(out: W) -> Self {
        Self {
            zip: ZipWriter::new_stream(out),
        }
    }

    /// Begins an array; its bytes follow.
    fn begin(&mut self, name: &str, kind: &str, shape: &[usize]) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            // Of a fixed date: equal inputs give equal files.
            .last_modified_time(zip::DateTime::default())
            .large_file(true);
        self.zip.start_file(format!("{name}.npy"), options)?;
        let dimensions: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!(
            "{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}",
            dimensions.join(" ")
        );
        // Mark, version and length take ten bytes; all of it a multiple of 64.
        let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
        while header.len() + 1 < length {
            header.push(' ');
        }
        header.push('\n');
        self.zip.write_all(b"\x93NUMPY\x01\x00")?;
        self.zip.write_all(&(header.len() as u16).to_le_bytes())?;
        self.zip.write_all(header.as_bytes())
    }

    pub(crate) fn array(
        &mut self,
        name: &str,
        shape: &[usize],
        elements: Elements<'_>,
    ) -> io::Result<()> {
        match elements {
            Elements::F32(values) => {
                self.begin(name, "<f4", shape)?;
                self.values(values)
            }
            Elements::F64(values) => {
                self.begin(name, "<f8", shape)?;
                let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
                self.zip.write_all(&bytes)
            }
            Elements::U32(values) => {
                self.begin(name, "<u4", shape)?;
                let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
                self.zip.write_all(&bytes)
            }
            Elements::Text(texts) => {
                let longest = texts.iter().map(|t| t.chars().count()).max();
                let width = longest.unwrap_or(0).max(1);
                self.begin(name, &format!("<U{width}"), shape)?;
                let mut bytes = Vec::new();
                for text in texts {
                    let padding = std::iter::repeat('\0');
                    let letters = text.chars().chain(padding).take(width);
                    bytes.extend(letters.flat_map(|c| u32::from(c).to_le_bytes()));
                }
                self.zip.write_all(&bytes)
            }
        }
    }

    /// Begins an array of 32-bit floats whose values are given bit by bit.
    pub(crate) fn begin_floats(&mut self, name: &str, shape: &[usize]) -> io::Result<()> {
        self.begin(name, "<f4", shape)
    }

    /// More of the array begun.
    pub(crate) fn values(&mut self, values: &[f32]) -> io::Result<()> {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.zip.write_all(&bytes)
    }

    pub(crate) fn finish(self) -> io::Result<()> {
        self.zip.finish()?;
        Ok(())
    }
}

/// The face at rest: `vertices`, `face_vertex_counts`, `face_vertex_indices`, `uvs`,
/// `uv_indices`, `materials`, `face_materials`, `millimetres_per_unit`.
pub(super) fn write_face(npz: &mut NpzWriter<impl Write>, face: &ExportFace) -> io::Result<()> {
    let flat: Vec<f64> = face
        .positions
        .iter()
        .flat_map(|p| [p.x, p.y, p.z])
        .collect();
    npz.array("vertices", &[face.positions.len(), 3], Elements::F64(&flat))?;
    let counts: Vec<u32> = face.polygons.iter().map(|f| f.len() as u32).collect();
    npz.array(
        "face_vertex_counts",
        &[counts.len()],
        Elements::U32(&counts),
    )?;
    let corners = face.polygons.corners();
    npz.array(
        "face_vertex_indices",
        &[corners.len()],
        Elements::U32(corners),
    )?;
    if let Some(uvs) = &face.uvs {
        let flat: Vec<f32> = uvs.coordinates.iter().flatten().copied().collect();
        npz.array("uvs", &[uvs.coordinates.len(), 2], Elements::F32(&flat))?;
        npz.array(
            "uv_indices",
            &[uvs.corners.len()],
            Elements::U32(&uvs.corners),
        )?;
    }
    let names = face.appearance.names();
    npz.array("materials", &[names.len()], Elements::Text(&names))?;
    let mut materials = vec![0; counts.len()];
    for section in &face.sections {
        for &polygon in &section.polygons {
            materials[polygon as usize] = section.material as u32;
        }
    }
    npz.array(
        "face_materials",
        &[materials.len()],
        Elements::U32(&materials),
    )?;
    let unit = [face.placement.millimetres_per_unit];
    npz.array("millimetres_per_unit", &[], Elements::F64(&unit))
}

/// `shape_names` and `shapes`, the offset of every vertex at weight 1.
pub(super) fn write_shapes(
    npz: &mut NpzWriter<impl Write>,
    shapes: &[Shape],
    vertex_count: usize,
) -> io::Result<()> {
    let names: Vec<String> = shapes.iter().map(|s| s.name.clone()).collect();
    npz.array("shape_names", &[names.len()], Elements::Text(&names))?;
    npz.begin_floats("shapes", &[shapes.len(), vertex_count, 3])?;
    for shape in shapes {
        let mut all = vec![0.0; 3 * vertex_count];
        for (vertex, offset) in &shape.offsets {
            let start = 3 * *vertex as usize;
            all[start..start + 3].copy_from_slice(&single(offset));
        }
        npz.values(&all)?;
    }
    Ok(())
}

/// `times`, `weights` of the shapes, and `heads` as 4 by 4 matrices where the head moves.
pub(super) fn write_weights(
    npz: &mut NpzWriter<impl Write>,
    animation: &WeightAnimation,
) -> io::Result<()> {
    let count = animation.times.len();
    npz.array("times", &[count], Elements::F64(&animation.times))?;
    let flat: Vec<f32> = animation.weights.iter().flatten().copied().collect();
    npz.array(
        "weights",
        &[count, flat.len() / count.max(1)],
        Elements::F32(&flat),
    )?;
    if animation.heads.is_empty() {
        return Ok(());
    }
    let rows = animation
        .heads
        .iter()
        .map(|head| head.to_homogeneous().transpose());
    let flat: Vec<f64> = rows.flat_map(|m| m.as_slice().to_vec()).collect();
    npz.array("heads", &[count, 4, 4], Elements::F64(&flat))
}

/// Vertices of one frame of the array begun.
pub(super) fn write_frame(
    npz: &mut NpzWriter<impl Write>,
    face: &ExportFace,
    frame: &Frame,
    with_head: bool,
) -> io::Result<()> {
    let moved = face.moved(frame, with_head);
    let flat: Vec<f32> = moved.iter().flat_map(|p| single(&p.coords)).collect();
    npz.values(&flat)
}
