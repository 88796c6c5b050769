//! Reads the MakeHuman base mesh, its targets and its mirror table.
//!
//! Source units are decimetres, +Y up, +Z out of the face, the character's left +X.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::template::TemplateError;
use crate::{Point, Vector};

/// The base mesh as its file has it.
#[derive(Debug, Clone)]
pub(super) struct BaseMesh {
    /// Every vertex of every group. [dm]
    pub(super) positions: Vec<Point>,
    /// Faces of each group.
    pub(super) groups: BTreeMap<String, Vec<Vec<u32>>>,
    /// For each vertex its mirror image.
    pub(super) mirror: Vec<u32>,
}

/// A sparse displacement of the base mesh. [dm]
pub(super) type Target = Vec<(u32, Vector)>;

impl BaseMesh {
    /// Reads `mpfb2/3dobjs/base.obj` and `mpfb2/mesh_metadata/hm08.mirror` under `data`.
    pub(super) fn read(data: &Path) -> Result<Self, TemplateError> {
        let path = data.join("mpfb2/3dobjs/base.obj");
        let mut positions = Vec::new();
        let mut groups: BTreeMap<String, Vec<Vec<u32>>> = BTreeMap::new();
        let mut group = String::new();
        for (number, line) in text(&path)?.lines().enumerate() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let c = numbers::<f64>(words, 3, &path, number)?;
                    positions.push(Point::new(c[0], c[1], c[2]));
                }
                Some("g") => group = words.next().unwrap_or_default().to_owned(),
                Some("f") => {
                    let corners = words
                        .map(|w| {
                            let index = w.split('/').next().unwrap_or(w);
                            number_in::<u32>(index, &path, number)?
                                .checked_sub(1)
                                .ok_or_else(|| bad(&path, number, "vertex numbers start at 1"))
                        })
                        .collect::<Result<Vec<_>, _>>()?;
                    groups.entry(group.clone()).or_default().push(corners);
                }
                _ => {}
            }
        }
        let mirror = read_mirror(data, positions.len())?;
        Ok(Self {
            positions,
            groups,
            mirror,
        })
    }

    /// Faces of one group.
    pub(super) fn group(&self, name: &str) -> Result<&[Vec<u32>], TemplateError> {
        self.groups
            .get(name)
            .map(Vec::as_slice)
            .ok_or_else(|| TemplateError::Missing {
                what: "the builder".to_owned(),
                name: name.to_owned(),
            })
    }
}

fn read_mirror(data: &Path, vertex_count: usize) -> Result<Vec<u32>, TemplateError> {
    let path = data.join("mpfb2/mesh_metadata/hm08.mirror");
    let mut mirror = vec![u32::MAX; vertex_count];
    for (number, line) in text(&path)?.lines().enumerate() {
        let words = line.split_whitespace().take(2);
        let pair = numbers::<u32>(words, 2, &path, number)?;
        *mirror
            .get_mut(pair[0] as usize)
            .ok_or_else(|| bad(&path, number, "no such vertex"))? = pair[1];
    }
    for (vertex, &image) in mirror.iter().enumerate() {
        if mirror.get(image as usize) != Some(&(vertex as u32)) {
            return Err(TemplateError::Mirror {
                vertex: vertex as u32,
                mirror: image,
            });
        }
    }
    Ok(mirror)
}

/// Reads a body target (`mpfb2/targets/<name>.target.gz`).
pub(super) fn read_body_target(data: &Path, name: &str) -> Result<Target, TemplateError> {
    let path = data.join("mpfb2/targets").join(format!("{name}.target.gz"));
    let file = std::fs::read(&path).map_err(|source| TemplateError::Read {
        path: path.clone(),
        source,
    })?;
    let mut decoded = String::new();
    flate2::read::GzDecoder::new(&file[..])
        .read_to_string(&mut decoded)
        .map_err(|source| TemplateError::Read {
            path: path.clone(),
            source,
        })?;
    parse_target(&decoded, &path)
}

/// Reads a face shape (`faceunits01/targets/faceunits/<name>.target`).
pub(super) fn read_face_target(data: &Path, name: &str) -> Result<Target, TemplateError> {
    let path = data
        .join("faceunits01/targets/faceunits")
        .join(format!("{name}.target"));
    parse_target(&text(&path)?, &path)
}

fn parse_target(text: &str, path: &Path) -> Result<Target, TemplateError> {
    let mut target = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            None => {}
            Some(comment) if comment.starts_with('#') => {}
            Some(vertex) => {
                let vertex = number_in::<u32>(vertex, path, number)?;
                let d = numbers::<f64>(words, 3, path, number)?;
                target.push((vertex, Vector::new(d[0], d[1], d[2])));
            }
        }
    }
    Ok(target)
}

fn text(path: &Path) -> Result<String, TemplateError> {
    std::fs::read_to_string(path).map_err(|source| TemplateError::Read {
        path: path.to_owned(),
        source,
    })
}

fn numbers<'a, T: FromStr>(
    words: impl Iterator<Item = &'a str>,
    count: usize,
    path: &Path,
    line: usize,
) -> Result<Vec<T>, TemplateError> {
    let found = words
        .map(|w| number_in(w, path, line))
        .collect::<Result<Vec<T>, _>>()?;
    if found.len() == count {
        Ok(found)
    } else {
        Err(bad(
            path,
            line,
            &format!("expected {count} numbers, found {}", found.len()),
        ))
    }
}

fn number_in<T: FromStr>(word: &str, path: &Path, line: usize) -> Result<T, TemplateError> {
    word.parse()
        .map_err(|_| bad(path, line, &format!("{word:?} is not a number")))
}

fn bad(path: &Path, line: usize, reason: &str) -> TemplateError {
    TemplateError::SourceLine {
        path: PathBuf::from(path),
        line: line + 1,
        reason: reason.to_owned(),
    }
}
