//! How a face looks: skin, eyes with irises, teeth.

use std::collections::BTreeMap;

use super::{Layer, Material, Paint, RenderError, Rgb};
use crate::mesh::{Mesh, Polygons};
use crate::{Point, Vector};

/// Materials and colours of a face, in sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaceLook {
    /// Skin tone.
    pub skin: [u8; 3],
    /// Iris.
    pub iris: [u8; 3],
    /// Teeth.
    pub teeth: [u8; 3],
    /// Gums and tongue.
    pub tongue: [u8; 3],
}

impl Default for FaceLook {
    fn default() -> Self {
        Self {
            skin: [216, 164, 140],
            iris: [86, 116, 128],
            teeth: [238, 232, 218],
            tongue: [190, 96, 92],
        }
    }
}

impl FaceLook {
    /// A skin layer.
    ///
    /// # Errors
    ///
    /// As [`Layer::from_polygons`].
    pub fn skin(&self, positions: Vec<Point>, polygons: &Polygons) -> Result<Layer, RenderError> {
        Ok(Layer::from_polygons(positions, polygons)?
            .with_color(Rgb::from_srgb(self.skin))
            .with_material(Material::SKIN))
    }

    /// A part inside the head by its name (`eye_l`, `eye_r`, `upper_teeth`, `lower_teeth`,
    /// `tongue`; any other is grey). An eyeball looks along `gaze` from the sphere fitted to it.
    ///
    /// # Errors
    ///
    /// As [`Layer::from_polygons`].
    pub fn part(
        &self,
        name: &str,
        positions: Vec<Point>,
        polygons: &Polygons,
        gaze: Vector,
    ) -> Result<Layer, RenderError> {
        let eye_center = sphere_of(&positions).map(|(center, _)| center);
        let layer = Layer::from_polygons(positions, polygons)?.with_material(Material::WET);
        match (name, eye_center) {
            (name, Some(center)) if name.starts_with("eye") => layer.with_paint(Paint::Eye {
                center,
                gaze: gaze.try_normalize(0.0).unwrap_or_else(Vector::z),
                iris: Rgb::from_srgb(self.iris),
            }),
            (name, _) if name.contains("teeth") => Ok(layer.with_color(Rgb::from_srgb(self.teeth))),
            ("tongue", _) => Ok(layer.with_color(Rgb::from_srgb(self.tongue))),
            _ => Ok(layer.with_color(Rgb::from_srgb([205, 200, 195]))),
        }
    }
}

/// Layers for a mesh of which nothing is known but its surface: the largest connected piece is
/// skin, pieces that are spheres are eyes that look along +Z, the rest is teeth-coloured.
///
/// # Errors
///
/// As [`Layer::from_polygons`].
pub fn mesh_layers(mesh: &Mesh, look: &FaceLook) -> Result<Vec<Layer>, RenderError> {
    let mut pieces = components(mesh);
    pieces.sort_by_key(|faces| std::cmp::Reverse(faces.len()));
    let skin_size = pieces.first().map_or(0, Vec::len);
    let mut layers = Vec::new();
    for faces in pieces {
        let mut index = BTreeMap::new();
        let mut positions = Vec::new();
        let mut polygons = Polygons::new();
        for &face in &faces {
            let corners: Vec<u32> = mesh
                .polygons()
                .face(face)
                .iter()
                .map(|&v| {
                    *index.entry(v).or_insert_with(|| {
                        positions.push(mesh.positions()[v as usize]);
                        positions.len() as u32 - 1
                    })
                })
                .collect();
            polygons.push(&corners);
        }
        let is_small = faces.len() * 2 < skin_size;
        let is_eye = is_small
            && sphere_of(&positions).is_some_and(|(_, misfit)| misfit < 0.08)
            && positions.len() >= 40;
        layers.push(if is_eye {
            look.part("eye", positions, &polygons, Vector::z())?
        } else if is_small {
            look.part("teeth", positions, &polygons, Vector::z())?
        } else {
            look.skin(positions, &polygons)?
        });
    }
    Ok(layers)
}

/// Faces of each connected piece, in order of their first face.
fn components(mesh: &Mesh) -> Vec<Vec<usize>> {
    let mut parent: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for face in mesh.polygons().iter() {
        let a = root(&mut parent, face[0]);
        for &v in &face[1..] {
            let b = root(&mut parent, v);
            parent[b as usize] = a;
        }
    }
    let mut of_root = BTreeMap::new();
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for (i, face) in mesh.polygons().iter().enumerate() {
        let r = root(&mut parent, face[0]);
        let piece = *of_root.entry(r).or_insert_with(|| {
            pieces.push(Vec::new());
            pieces.len() - 1
        });
        pieces[piece].push(i);
    }
    pieces
}

/// Centre of the sphere that fits best (linear least squares), and the relative RMS misfit.
/// `None` for fewer than four points or points in one plane.
fn sphere_of(positions: &[Point]) -> Option<(Point, f64)> {
    if positions.len() < 4 {
        return None;
    }
    let mean = positions.iter().map(|p| p.coords).sum::<Vector>() / positions.len() as f64;
    let mut normal = nalgebra::Matrix4::zeros();
    let mut right = nalgebra::Vector4::zeros();
    for p in positions {
        let d = p.coords - mean;
        let row = nalgebra::Vector4::new(2.0 * d.x, 2.0 * d.y, 2.0 * d.z, 1.0);
        normal += row * row.transpose();
        right += row * d.norm_squared();
    }
    let solution = normal.lu().solve(&right)?;
    let offset = solution.xyz();
    let radius = (solution.w + offset.norm_squared()).max(0.0).sqrt();
    if !(radius > 0.0 && radius.is_finite()) {
        return None;
    }
    let center = Point::from(mean + offset);
    let misfit = positions
        .iter()
        .map(|p| ((p - center).norm() / radius - 1.0).powi(2))
        .sum::<f64>();
    Some((center, (misfit / positions.len() as f64).sqrt()))
}

/// Colour of a place on an eyeball. The iris of an adult spans about 29 degrees to each side of
/// the line of sight (11.7 mm across on a ball of 24 mm), the pupil about 9.
pub(super) fn eye_color(point: &Point, center: &Point, gaze: &Vector, iris: Rgb) -> Rgb {
    const IRIS: f64 = 0.505;
    const PUPIL: f64 = 0.165;
    let white = Rgb::from_srgb([238, 233, 228]);
    let Some(direction) = (point - center).try_normalize(0.0) else {
        return white;
    };
    let angle = direction.dot(gaze).clamp(-1.0, 1.0).acos();
    let soft = |edge: f64, width: f64| ((angle - edge) / width + 0.5).clamp(0.0, 1.0) as f32;
    let limbus = iris * 0.25;
    let inner = (iris * 1.25).mix(iris * 0.8, ((angle - PUPIL) / (IRIS - PUPIL)) as f32);
    let ringed = inner.mix(limbus, soft(IRIS - 0.05, 0.09));
    let seen = Rgb::from_srgb([12, 12, 14]).mix(ringed, soft(PUPIL, 0.03));
    // The white turns pink towards the corners.
    let ball = white.mix(
        Rgb::from_srgb([222, 178, 168]),
        ((angle - 0.9).max(0.0)) as f32,
    );
    seen.mix(ball, soft(IRIS, 0.05))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_is_found_from_a_cap() {
        let center = Point::new(30.0, -4.0, 80.0);
        let cap: Vec<Point> = (0..200)
            .map(|i| {
                let z = 1.0 - f64::from(i) / 400.0;
                let a = f64::from(i) * 2.4;
                let r = (1.0 - z * z).sqrt();
                center + Vector::new(r * a.cos(), r * a.sin(), z) * 12.0
            })
            .collect();
        let (found, misfit) = sphere_of(&cap).expect("fits");
        assert!((found - center).norm() < 1e-6 && misfit < 1e-9);
    }

    #[test]
    fn the_pupil_is_dark_and_the_white_is_light() {
        let look = |angle: f64| {
            let p = Point::new(angle.sin(), 0.0, angle.cos());
            eye_color(
                &p,
                &Point::origin(),
                &Vector::z(),
                Rgb::from_srgb([86, 116, 128]),
            )
        };
        assert!(look(0.0).0[1] < 0.02);
        assert!(look(0.7).0[1] > 0.6);
        let Rgb([r, g, b]) = look(0.33);
        assert!(b > r && g > r && b < 0.5);
    }
}
