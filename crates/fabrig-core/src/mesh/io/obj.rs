//! Wavefront OBJ, read strictly.
//!
//! A rig gives back the very mesh it was made from, so vertex `i` of the [`Mesh`] is the
//! `i`-th `v` line of the file, and quads and n-gons stay what they are. The established
//! readers rebuild vertices from corner tuples, and report neither the line of an error nor a
//! NaN; hence this one. It reads `v`, `vt`, `f`, `g`, `o` and `usemtl`, joins lines that end
//! in a backslash, and passes over every other keyword (normals, curves, materials).
//!
//! Source: Wavefront *Advanced Visualizer* manual, appendix B1 (object files).

use std::path::Path;

use super::{MeshIoError, ObjProblem};
use crate::Point;
use crate::mesh::{CornerUvs, FaceGroup, Mesh, Polygons};

/// Reads a mesh from the text of an OBJ file; `path` only names it in errors.
///
/// A file that gives texture coordinates to some corners alone gets (0, 0) at the others.
///
/// # Errors
///
/// [`MeshIoError::Obj`] with the line, [`MeshIoError::Empty`] without vertices or faces.
pub fn parse_obj(text: &str, path: &Path) -> Result<Mesh, MeshIoError> {
    let mut reader = ObjReader::default();
    for (line, content) in logical_lines(text) {
        reader
            .line(line, &content)
            .map_err(|problem| at_line(path, line, problem))?;
    }
    reader.finish(path)
}

fn at_line(path: &Path, line: usize, problem: ObjProblem) -> MeshIoError {
    MeshIoError::Obj {
        path: path.to_owned(),
        line,
        problem,
    }
}

/// Lines without comments, numbered from 1, continued lines joined under their first number.
pub(crate) fn logical_lines(
    text: &str,
) -> impl Iterator<Item = (usize, std::borrow::Cow<'_, str>)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut content = std::borrow::Cow::Borrowed(strip_comment(first));
        while let Some(stem) = content.trim_end().strip_suffix('\\') {
            let stem = stem.to_owned();
            let next = lines.next().map_or("", |(_, next)| strip_comment(next));
            content = std::borrow::Cow::Owned(stem + " " + next);
        }
        Some((number + 1, content))
    })
}

fn strip_comment(line: &str) -> &str {
    line.split_once('#').map_or(line, |(before, _)| before)
}

/// Kinds of names that a run of faces may carry; each keeps its own current name.
#[derive(Clone, Copy)]
enum GroupKind {
    Object,
    Group,
    Material,
}

#[derive(Default)]
struct ObjReader {
    positions: Vec<Point>,
    coordinates: Vec<[f32; 2]>,
    polygons: Polygons,
    /// Texture coordinate of each corner, `None` where the file gives none.
    uv_corners: Vec<Option<u32>>,
    /// Line of each face, for errors that only the whole file can show.
    face_lines: Vec<usize>,
    groups: Vec<FaceGroup>,
    /// Names in force per [`GroupKind`], with the face that each began at.
    open: [Vec<(String, usize)>; 3],
}

impl ObjReader {
    fn line(&mut self, line: usize, content: &str) -> Result<(), ObjProblem> {
        let content = content.trim();
        let (keyword, rest) = content
            .split_once(char::is_whitespace)
            .unwrap_or((content, ""));
        match keyword {
            "v" => self.vertex(rest),
            "vt" => self.texture_coordinate(rest),
            "f" | "fo" => self.face(line, rest),
            "g" => {
                let names = rest.split_whitespace().map(str::to_owned).collect();
                self.open_groups(GroupKind::Group, names);
                Ok(())
            }
            "o" => {
                self.open_groups(GroupKind::Object, vec![rest.trim().to_owned()]);
                Ok(())
            }
            "usemtl" => {
                self.open_groups(GroupKind::Material, vec![rest.trim().to_owned()]);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn vertex(&mut self, rest: &str) -> Result<(), ObjProblem> {
        let mut p = [0.0; 3];
        read_numbers("v", rest, &mut p, self.positions.len() + 1)?;
        self.positions.push(Point::from(p));
        Ok(())
    }

    fn texture_coordinate(&mut self, rest: &str) -> Result<(), ObjProblem> {
        // A one-dimensional texture has u alone; v is then 0.
        let mut uv = [0.0; 2];
        let count = rest.split_whitespace().count().clamp(1, 2);
        read_numbers("vt", rest, &mut uv[..count], self.coordinates.len() + 1)?;
        self.coordinates.push([uv[0] as f32, uv[1] as f32]);
        Ok(())
    }

    fn face(&mut self, line: usize, rest: &str) -> Result<(), ObjProblem> {
        let mut corners = Vec::with_capacity(4);
        for text in rest.split_whitespace() {
            let mut fields = text.split('/');
            let vertex = parse_index(text, fields.next())?.ok_or_else(|| bad_corner(text))?;
            corners.push(resolve("vertex", vertex, self.positions.len())?);
            self.uv_corners
                .push(match parse_index(text, fields.next())? {
                    Some(uv) => Some(resolve("texture coordinate", uv, self.coordinates.len())?),
                    None => None,
                });
            parse_index(text, fields.next())?;
            if fields.next().is_some() {
                return Err(bad_corner(text));
            }
        }
        if corners.len() < 3 {
            return Err(ObjProblem::TooFewCorners {
                found: corners.len(),
            });
        }
        self.polygons.push(&corners);
        self.face_lines.push(line);
        Ok(())
    }

    fn open_groups(&mut self, kind: GroupKind, names: Vec<String>) {
        let face = self.polygons.len();
        let names = names.into_iter().filter(|name| !name.is_empty());
        let previous = std::mem::replace(
            &mut self.open[kind as usize],
            names.map(|name| (name, face)).collect(),
        );
        self.close(previous);
    }

    fn close(&mut self, names: Vec<(String, usize)>) {
        let end = self.polygons.len();
        for (name, start) in names {
            if start < end {
                self.groups.push(FaceGroup {
                    name,
                    faces: start..end,
                });
            }
        }
    }

    fn finish(mut self, path: &Path) -> Result<Mesh, MeshIoError> {
        for kind in [GroupKind::Object, GroupKind::Group, GroupKind::Material] {
            let names = std::mem::take(&mut self.open[kind as usize]);
            self.close(names);
        }
        self.groups
            .sort_by_key(|g| (g.faces.start, std::cmp::Reverse(g.faces.end)));
        if self.positions.is_empty() || self.polygons.is_empty() {
            return Err(MeshIoError::Empty {
                path: path.to_owned(),
                vertex_count: self.positions.len(),
                face_count: self.polygons.len(),
            });
        }
        self.check_ranges()
            .map_err(|(line, problem)| at_line(path, line, problem))?;

        let uvs = self.uv_corners.iter().any(Option::is_some).then(|| {
            let blank = self.coordinates.len() as u32;
            let corners: Vec<u32> = self
                .uv_corners
                .iter()
                .map(|uv| uv.unwrap_or(blank))
                .collect();
            if corners.contains(&blank) {
                self.coordinates.push([0.0, 0.0]);
            }
            CornerUvs {
                coordinates: self.coordinates,
                corners,
            }
        });
        let invalid = |source| MeshIoError::Invalid {
            path: path.to_owned(),
            source,
        };
        let mesh = Mesh::new(self.positions, self.polygons).map_err(invalid)?;
        let mesh = match uvs {
            Some(uvs) => mesh.with_uvs(uvs).map_err(invalid)?,
            None => mesh,
        };
        Ok(mesh.with_groups(self.groups))
    }

    /// Positive indices may point forwards, so they are checked against the whole file.
    fn check_ranges(&self) -> Result<(), (usize, ObjProblem)> {
        let check = |element, index: u32, count: usize| {
            if (index as usize) < count {
                return Ok(());
            }
            Err(ObjProblem::IndexOutOfRange {
                element,
                index: i64::from(index) + 1,
                count,
            })
        };
        for (face, &line) in self.face_lines.iter().enumerate() {
            for corner in self.polygons.corner_range(face) {
                let vertex = self.polygons.corners()[corner];
                check("vertex", vertex, self.positions.len()).map_err(|p| (line, p))?;
                if let Some(uv) = self.uv_corners[corner] {
                    check("texture coordinate", uv, self.coordinates.len())
                        .map_err(|p| (line, p))?;
                }
            }
        }
        Ok(())
    }
}

/// Reads the first `out.len()` numbers of a line; more (weights, colours) are passed over.
fn read_numbers(
    keyword: &'static str,
    rest: &str,
    out: &mut [f64],
    element: usize,
) -> Result<(), ObjProblem> {
    let mut words = rest.split_whitespace();
    for (found, slot) in out.iter_mut().enumerate() {
        let word = words.next().ok_or(ObjProblem::TooFewCoordinates {
            keyword,
            expected: if keyword == "v" { 3 } else { 1 },
            found,
        })?;
        *slot = word.parse().map_err(|_| ObjProblem::NotANumber {
            found: word.to_owned(),
        })?;
        if !slot.is_finite() {
            return Err(ObjProblem::NotFinite {
                vertex: element,
                found: word.to_owned(),
            });
        }
    }
    Ok(())
}

fn bad_corner(text: &str) -> ObjProblem {
    ObjProblem::BadCorner {
        found: text.to_owned(),
    }
}

/// One field of a corner; `None` where it is absent or empty.
fn parse_index(corner: &str, field: Option<&str>) -> Result<Option<i64>, ObjProblem> {
    match field {
        None | Some("") => Ok(None),
        Some(field) => field.parse().map(Some).map_err(|_| bad_corner(corner)),
    }
}

/// OBJ's index (from 1, or from -1 backwards) to one from 0.
fn resolve(element: &'static str, index: i64, count: usize) -> Result<u32, ObjProblem> {
    let out_of_range = ObjProblem::IndexOutOfRange {
        element,
        index,
        count,
    };
    let zero_based = match index {
        0 => return Err(out_of_range),
        i if i > 0 => i - 1,
        i => count as i64 + i,
    };
    u32::try_from(zero_based).map_err(|_| out_of_range)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Mesh, MeshIoError> {
        parse_obj(text, Path::new("face.obj"))
    }

    fn problem(text: &str) -> (usize, ObjProblem) {
        match parse(text) {
            Err(MeshIoError::Obj { line, problem, .. }) => (line, problem),
            other => panic!("expected a line error, got {other:?}"),
        }
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn order_polygons_texture_coordinates_and_groups_are_kept() {
        let mesh = parse(&format!(
            "\u{feff}# made by hand\r\no head\n{SQUARE}v 2 0.5 0 1.0\nvt 0 0\nvt 1 0.5 0\n\
             g skin lips\nusemtl pink\nf 4/1 1/2 2/1 \\\n  3/2\ng\nf -4//1 -1//1 -3//1\n"
        ))
        .unwrap();
        assert_eq!(mesh.positions()[4], Point::new(2.0, 0.5, 0.0));
        assert_eq!(mesh.polygons().face(0), [3, 0, 1, 2]);
        assert_eq!(mesh.polygons().face(1), [1, 4, 2]);
        let uvs = mesh.uvs().unwrap();
        assert_eq!(uvs.corners, [0, 1, 0, 1, 2, 2, 2]);
        assert_eq!(
            uvs.coordinates,
            [[0.0, 0.0], [1.0, 0.5], [0.0, 0.0]],
            "corners without coordinates get one of their own"
        );
        let groups: Vec<_> = mesh
            .groups()
            .iter()
            .map(|g| (g.name.as_str(), g.faces.clone()))
            .collect();
        assert_eq!(
            groups,
            [
                ("head", 0..2),
                ("pink", 0..2),
                ("skin", 0..1),
                ("lips", 0..1)
            ]
        );
    }

    #[test]
    fn faces_may_point_forwards() {
        let mesh = parse("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").unwrap();
        assert_eq!(mesh.face_count(), 1);
    }

    #[test]
    fn errors_name_the_line_and_the_cause() {
        assert_eq!(
            problem("v 0 0 0\n\nv 1 nan 0\n"),
            (
                3,
                ObjProblem::NotFinite {
                    vertex: 2,
                    found: "nan".into()
                }
            )
        );
        assert!(matches!(
            problem("v 1e999 0 0\n"),
            (1, ObjProblem::NotFinite { .. })
        ));
        assert!(matches!(
            problem("v 0 0,5 0\n"),
            (1, ObjProblem::NotANumber { .. })
        ));
        assert_eq!(
            problem("v 0 0\n"),
            (
                1,
                ObjProblem::TooFewCoordinates {
                    keyword: "v",
                    expected: 3,
                    found: 2
                }
            )
        );
        for (face, index) in [("f 1 2 5", 5), ("f 1 0 2", 0), ("f 1 2 -5", -5)] {
            assert_eq!(
                problem(&format!("{SQUARE}{face}\n")),
                (
                    5,
                    ObjProblem::IndexOutOfRange {
                        element: "vertex",
                        index,
                        count: 4
                    }
                ),
                "{face}"
            );
        }
        assert!(matches!(
            problem(&format!("{SQUARE}f 1/1 2/1 3/1\n")),
            (
                5,
                ObjProblem::IndexOutOfRange {
                    element: "texture coordinate",
                    ..
                }
            )
        ));
        assert_eq!(
            problem(&format!("{SQUARE}f 1 2\n")),
            (5, ObjProblem::TooFewCorners { found: 2 })
        );
        for corner in ["x", "1.5", "1/2/3/4", "/1"] {
            assert!(matches!(
                problem(&format!("{SQUARE}f {corner} 2 3\n")),
                (5, ObjProblem::BadCorner { .. })
            ));
        }
    }

    #[test]
    fn a_file_without_a_surface_is_empty() {
        for (text, counts) in [("", (0, 0)), (SQUARE, (4, 0)), ("PNG\0\u{1}", (0, 0))] {
            match parse(text) {
                Err(MeshIoError::Empty {
                    vertex_count,
                    face_count,
                    ..
                }) => assert_eq!((vertex_count, face_count), counts),
                other => panic!("{other:?}"),
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "([vfgo# /\\\\0-9.-]|vt |nan|\n){0,80}") {
            let _ = parse(&text);
        }
    }
}
