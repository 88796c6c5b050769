//! PC2 and MDD: the vertices of every frame in the order of the mesh, which they are put on in
//! the other program.

use std::io::{self, Write};

use super::face::{ExportFace, Frame, single};

/// Begins a PC2 file: mark, version 1, vertices, first frame, frames a sample, samples.
pub(super) fn begin_pc2(
    out: &mut dyn Write,
    vertex_count: usize,
    frame_count: usize,
) -> io::Result<()> {
    out.write_all(b"POINTCACHE2\0")?;
    out.write_all(&1i32.to_le_bytes())?;
    out.write_all(&(vertex_count as i32).to_le_bytes())?;
    out.write_all(&0f32.to_le_bytes())?;
    out.write_all(&1f32.to_le_bytes())?;
    out.write_all(&(frame_count as i32).to_le_bytes())
}

/// Begins an MDD file: frames, vertices, the time of every frame. (s)
pub(super) fn begin_mdd(
    out: &mut dyn Write,
    vertex_count: usize,
    frame_count: usize,
    fps: f64,
) -> io::Result<()> {
    out.write_all(&(frame_count as i32).to_be_bytes())?;
    out.write_all(&(vertex_count as i32).to_be_bytes())?;
    for frame in 0..frame_count {
        out.write_all(&((frame as f64 / fps) as f32).to_be_bytes())?;
    }
    Ok(())
}

/// One frame; PC2 is little endian, MDD big.
pub(super) fn write_frame(
    out: &mut dyn Write,
    face: &ExportFace,
    frame: &Frame,
    with_head: bool,
    is_big_endian: bool,
) -> io::Result<()> {
    let moved = face.moved(frame, with_head);
    let numbers = moved.iter().flat_map(|p| single(&p.coords));
    let bytes: Vec<u8> = numbers
        .flat_map(|x| {
            if is_big_endian {
                x.to_be_bytes()
            } else {
                x.to_le_bytes()
            }
        })
        .collect();
    out.write_all(&bytes)
}
