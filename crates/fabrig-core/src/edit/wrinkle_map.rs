//! Wrinkle maps: where on the face the cloth is looser or stiffer than its material says.
//!
//! A map has a value in [0, 1] everywhere on the user's mesh: a PNG in its texture coordinates
//! (black 0, white 1), or a text of one number per vertex. Every node takes the value of the
//! skin over it, and where that is m its factors are `1 + m (factor - 1)`.
//!
//! # Source
//!
//! nCloth's painted maps, as the paper's artists used them; Zhu & Joslin 2024, section 6.

use std::io::Cursor;
use std::path::Path;

use super::{EditError, WrinkleEdit};
use crate::anatomy::{PatchChart, PatchKind};
use crate::cloth::NodeVariation;
use crate::facs::nearest_name;
use crate::mesh::{Mesh, Surface, SurfacePoint, vertex_normals};
use crate::rig::{RING_SHARE, Rig, is_called};
use crate::skin::NarrowPatch;

/// Pixels beyond this are no wrinkle map of ours. (bytes)
const LARGEST_IMAGE: usize = 1 << 30;
/// Over this share of a ring's way outwards its skin goes from never folding to folding.
const RING_RISE: f64 = 0.2;
/// The same from the rim of a sheet inwards.
const RIM_RISE: f64 = 0.2;
/// Share of the fibres' way over which white fades.
const ALONG_FADE: f64 = 0.1;

/// A wrinkle map of one mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum WrinkleMap {
    /// A value in [0, 1] per vertex of the user's mesh.
    Vertices(Vec<f32>),
    /// A grey image in the mesh's texture coordinates, row by row from the top, in [0, 1].
    Image {
        /// Pixels of a row.
        width: usize,
        /// Values.
        values: Vec<f32>,
    },
}

impl WrinkleMap {
    /// Reads a PNG, or a text of numbers between spaces, commas or line ends.
    ///
    /// # Errors
    ///
    /// [`EditError::Io`], [`EditError::WrinkleMap`] with what is wrong with the file.
    pub fn read(path: &Path) -> Result<Self, EditError> {
        let bytes = std::fs::read(path).map_err(|source| EditError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&bytes).map_err(|problem| EditError::WrinkleMap {
            path: path.to_owned(),
            problem,
        })
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        if bytes.starts_with(b"\x89PNG") {
            return image(bytes);
        }
        let text = std::str::from_utf8(bytes)
            .map_err(|_| "it is neither a PNG nor a text of numbers".to_owned())?;
        let words = text.split(|c: char| c.is_whitespace() || c == ',');
        let values = words
            .filter(|word| !word.is_empty())
            .enumerate()
            .map(|(vertex, word)| match word.parse::<f32>() {
                Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
                _ => Err(format!(
                    "the value of vertex {vertex} is '{word}'; it must be a number from 0 to 1"
                )),
            });
        Ok(Self::Vertices(values.collect::<Result<_, _>>()?))
    }

    /// Whether it fits a mesh; if not, why.
    fn check(&self, mesh: &Mesh) -> Result<(), String> {
        match self {
            Self::Vertices(values) if values.len() != mesh.vertex_count() => Err(format!(
                "it has {} values, but the rig's mesh has {} vertices; give one value a vertex, \
                 in their order",
                values.len(),
                mesh.vertex_count()
            )),
            Self::Image { .. } if mesh.uvs().is_none() => Err(
                "it is an image, but the rig's mesh has no texture coordinates; give one number \
                 a vertex instead, or build the rig from a mesh that has them"
                    .to_owned(),
            ),
            _ => Ok(()),
        }
    }

    /// Value at a place of the mesh, of which `corners` are the triangle's.
    fn at(&self, mesh: &Mesh, corners: &[Corner; 3], barycentric: [f64; 3]) -> f64 {
        let blend = |of: &dyn Fn(&Corner) -> f64| -> f64 {
            corners
                .iter()
                .zip(barycentric)
                .map(|(c, b)| of(c) * b)
                .sum()
        };
        match (self, mesh.uvs()) {
            (Self::Vertices(values), _) => blend(&|c| f64::from(values[c.vertex as usize])),
            (Self::Image { width, values }, Some(uvs)) => {
                let uv = |axis: usize| {
                    blend(&|c| {
                        let index = uvs.corners[c.corner] as usize;
                        f64::from(uvs.coordinates[index][axis])
                    })
                };
                bilinear(values, *width, [uv(0), 1.0 - uv(1)])
            }
            (Self::Image { .. }, None) => 0.0,
        }
    }
}

/// Gives the nodes of a rig the word of a wrinkle map, and lets the skin over them show it.
///
/// - `map`: none means white wherever the patches of `edit` can fold
///
/// # Errors
///
/// [`EditError::WrinkleMap`] where it does not fit the rig's mesh, [`EditError::OutOfRange`],
/// [`EditError::UnknownName`].
pub fn apply_wrinkle_map(
    rig: &mut Rig,
    name: &str,
    map: Option<&WrinkleMap>,
    edit: &WrinkleEdit,
) -> Result<(), EditError> {
    edit.check(name)?;
    check_factors(name, edit)?;
    check_patches(rig, edit)?;
    let problem = |problem| EditError::WrinkleMap {
        path: edit.map.clone().unwrap_or_default(),
        problem,
    };
    let painted = match map {
        None => None,
        Some(map) => {
            map.check(&rig.face).map_err(problem)?;
            Some((map, Skin::of(rig).map_err(problem)?))
        }
    };
    let factors = [edit.stretch, edit.bend, edit.rest_blend].map(|f| f as f32);
    rig.variations.resize(rig.patches.len(), Vec::new());
    let mut white: Vec<(usize, Vec<f64>)> = Vec::new();
    for (index, (patch, variations)) in rig.patches.iter().zip(&mut rig.variations).enumerate() {
        let chart = &patch.patch.chart;
        let mut named = edit.patches.iter();
        if !edit.patches.is_empty() && !named.any(|name| is_called(&chart.name, name)) {
            continue;
        }
        let mut values: Vec<f64> = match &painted {
            Some((map, skin)) => {
                let nodes = patch.patch.neutral.iter();
                let places = nodes.map(|node| skin.surface.closest(node));
                places.map(|at| skin.value(map, &rig.face, &at)).collect()
            }
            None => foldable(chart),
        };
        if let Some(along) = edit.along {
            for (node, value) in values.iter_mut().enumerate() {
                *value *= within(chart, node, along);
            }
        }
        if values.iter().all(|&m| m == 0.0) {
            continue;
        }
        variations.resize(values.len(), NodeVariation::NONE);
        for (v, &m) in variations.iter_mut().zip(&values) {
            let [stretch, bend, rest_blend] = factors.map(|f| 1.0 + m as f32 * (f - 1.0));
            v.stretch = (v.stretch * stretch).clamp(1e-3, 1e3);
            v.bend = (v.bend * bend).clamp(1e-3, 1e3);
            v.rest_blend = (v.rest_blend * rest_blend).clamp(0.0, 1.0);
        }
        white.push((index, values));
    }
    narrow_skin(rig, &white, edit.narrow)
}

/// Where skin over a patch can fold: not on the lids or lips of a ring, nor at the rim of a sheet,
/// beyond which skin hangs on something else.
fn foldable(chart: &PatchChart) -> Vec<f64> {
    let grid = chart.grid;
    let last = f64::from(grid.v_count.max(2) - 1);
    (0..grid.node_count() as u32)
        .map(|node| match chart.kind {
            PatchKind::Sphincter => {
                let outwards = f64::from(node / grid.u_count) / last;
                smooth((outwards - RING_SHARE) / RING_RISE)
            }
            PatchKind::LinearMuscle | PatchKind::FatPad => {
                let place = |k: u32, count: u32| f64::from(k) / f64::from(count.max(2) - 1);
                let u = place(node % grid.u_count, grid.u_count);
                let v = place(node / grid.u_count, grid.v_count);
                let inwards = |share: f64| smooth(share.min(1.0 - share) / RIM_RISE);
                inwards(u) * inwards(v)
            }
        })
        .collect()
}

/// How much a node is on a part of the way along the fibres.
fn within(chart: &PatchChart, node: usize, [from, to]: [f64; 2]) -> f64 {
    let grid = chart.grid;
    let around = f64::from(grid.u_count.max(2) - u32::from(!grid.is_periodic));
    let place = f64::from(node as u32 % grid.u_count) / around;
    smooth(1.0 - (from - place).max(place - to) / ALONG_FADE)
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Lets skin over white nodes hang on them alone.
fn narrow_skin(rig: &mut Rig, white: &[(usize, Vec<f64>)], most: f64) -> Result<(), EditError> {
    if most == 0.0 || white.is_empty() {
        return Ok(());
    }
    let mut patches = Vec::new();
    let mut start = 0;
    let mut wanted = white.iter().peekable();
    for (index, patch) in rig.patches.iter().enumerate() {
        if wanted.next_if(|(w, _)| *w == index).is_some() {
            patches.push(NarrowPatch::new(&patch.patch, start)?);
        }
        start += patch.patch.neutral.len() as u32;
    }
    let skin = rig.face_in_head();
    let normals = vertex_normals(&skin, &rig.face.triangles());
    let value =
        |_: usize, patch: usize, uv: [f64; 2]| most * patches[patch].at(uv, &white[patch].1);
    let binding = rig.binding.narrowed(&patches, &skin, &normals, &value)?;
    rig.binding = binding;
    Ok(())
}

fn check_factors(name: &str, edit: &WrinkleEdit) -> Result<(), EditError> {
    let [from, to] = edit.along.unwrap_or([0.0, 1.0]);
    for (what, value, [low, high], condition) in [
        ("stretch", edit.stretch, [1e-3, 1e3], "from 0.001 to 1000"),
        ("bend", edit.bend, [1e-3, 1e3], "from 0.001 to 1000"),
        ("rest_blend", edit.rest_blend, [0.0, 1.0], "from 0 to 1"),
        ("narrow", edit.narrow, [0.0, 1.0], "from 0 to 1"),
        ("along", from, [0.0, 1.0], "from 0 to 1"),
        ("along", to, [from.min(1.0), 1.0], "from its start to 1"),
    ] {
        if !(low..=high).contains(&value) {
            return Err(EditError::OutOfRange {
                name: format!("wrinkles.{name}"),
                what,
                value,
                condition,
            });
        }
    }
    Ok(())
}

fn check_patches(rig: &Rig, edit: &WrinkleEdit) -> Result<(), EditError> {
    let names = || rig.patches.iter().map(|p| p.patch.chart.name.as_str());
    for wanted in &edit.patches {
        if !names().any(|name| is_called(name, wanted)) {
            return Err(EditError::UnknownName {
                what: "patch",
                found: wanted.clone(),
                nearest: nearest_name(wanted, names()).unwrap_or_default().to_owned(),
            });
        }
    }
    Ok(())
}

/// A corner of a triangle of the mesh: its vertex, and its place among the polygons' corners.
#[derive(Debug, Clone, Copy)]
struct Corner {
    vertex: u32,
    corner: usize,
}

/// The skin of a rig's mesh, without what is rigid.
struct Skin {
    surface: Surface,
    /// Corners of each of the surface's triangles.
    corners: Vec<[Corner; 3]>,
}

impl Skin {
    fn of(rig: &Rig) -> Result<Self, String> {
        let polygons = rig.face.polygons();
        let mut corners = Vec::new();
        for face in 0..polygons.len() {
            let range = polygons.corner_range(face);
            let at = |corner: usize| Corner {
                vertex: polygons.corners()[corner],
                corner,
            };
            let is_skin = polygons
                .face(face)
                .iter()
                .all(|&v| rig.regions.get(v as usize).is_some_and(Option::is_some));
            if is_skin {
                let fan = range.start + 1..range.end.saturating_sub(1);
                corners.extend(fan.map(|k| [at(range.start), at(k), at(k + 1)]));
            }
        }
        let positions = rig.face_in_head();
        let triangles: Vec<[u32; 3]> = corners.iter().map(|t| t.map(|c| c.vertex)).collect();
        let surface = Surface::new(&positions, &triangles).map_err(|error| error.to_string())?;
        Ok(Self { surface, corners })
    }

    fn value(&self, map: &WrinkleMap, mesh: &Mesh, place: &SurfacePoint) -> f64 {
        let corners = &self.corners[place.triangle as usize];
        map.at(mesh, corners, place.barycentric).clamp(0.0, 1.0)
    }
}

/// A grey image from a PNG of any kind: the brightness of its colour, its opacity left aside.
fn image(bytes: &[u8]) -> Result<WrinkleMap, String> {
    let limits = png::Limits {
        bytes: LARGEST_IMAGE,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let said = |error: png::DecodingError| format!("the PNG cannot be read: {error}");
    let mut reader = decoder.read_info().map_err(said)?;
    let size = reader.output_buffer_size();
    let size = size.filter(|&size| size <= LARGEST_IMAGE);
    let size = size.ok_or_else(|| "the PNG is too large".to_owned())?;
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels).map_err(said)?;
    let channels = info.color_type.samples();
    let values = pixels[..info.buffer_size()]
        .chunks_exact(channels)
        .map(|pixel| match *pixel {
            [r, g, b, ..] => {
                (0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)) / 255.0
            }
            [grey, ..] => f32::from(grey) / 255.0,
            [] => 0.0,
        })
        .collect();
    Ok(WrinkleMap::Image {
        width: info.width as usize,
        values,
    })
}

/// Value at `at` (0 to 1, from the upper left) between the centres of pixels.
fn bilinear(values: &[f32], width: usize, at: [f64; 2]) -> f64 {
    let height = values.len() / width.max(1);
    if height == 0 {
        return 0.0;
    }
    let split = |share: f64, count: usize| {
        let last = (count - 1) as f64;
        let place = (share * count as f64 - 0.5).clamp(0.0, last);
        let low = place.floor();
        (low as usize, (low as usize + 1).min(count - 1), place - low)
    };
    let (left, right, across) = split(at[0], width);
    let (top, bottom, down) = split(at[1], height);
    let value = |x: usize, y: usize| f64::from(values[y * width + x]);
    let row = |y: usize| value(left, y) * (1.0 - across) + value(right, y) * across;
    row(top) * (1.0 - down) + row(bottom) * down
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png_of(color: png::ColorType, width: u32, height: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        drop(writer);
        bytes
    }

    #[test]
    fn grey_and_coloured_images_are_read_and_blended_between_pixels() {
        let grey = png_of(png::ColorType::Grayscale, 2, 2, &[0, 255, 255, 0]);
        let WrinkleMap::Image { width, values } = WrinkleMap::parse(&grey).unwrap() else {
            panic!("an image");
        };
        assert_eq!((width, values.as_slice()), (2, &[0.0, 1.0, 1.0, 0.0][..]));
        assert_eq!(bilinear(&values, 2, [0.25, 0.25]), 0.0);
        assert_eq!(bilinear(&values, 2, [0.5, 0.25]), 0.5);
        assert_eq!(bilinear(&values, 2, [2.0, -3.0]), 1.0);
        let white = png_of(png::ColorType::Rgba, 1, 1, &[255, 255, 255, 0]);
        let WrinkleMap::Image { values, .. } = WrinkleMap::parse(&white).unwrap() else {
            panic!("an image");
        };
        assert!((values[0] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_map_says_where() {
        let read = |text: &str| WrinkleMap::parse(text.as_bytes());
        assert_eq!(
            read("0 0.5,\n1"),
            Ok(WrinkleMap::Vertices(vec![0.0, 0.5, 1.0]))
        );
        let error = read("0 0.5 1.5").unwrap_err();
        assert!(error.contains("vertex 2 is '1.5'"), "{error}");
        assert!(read("0 nan").unwrap_err().contains("vertex 1"));
        let grey = png_of(png::ColorType::Grayscale, 4, 4, &[7; 16]);
        for cut in [8, 20, grey.len() / 2] {
            assert!(WrinkleMap::parse(&grey[..cut]).is_err(), "cut at {cut}");
        }
    }
}
