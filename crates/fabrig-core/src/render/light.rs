//! Light: what is baked at the vertices, and the shade of one point.
//!
//! Diffuse light is Lambert's with a per-channel wrap around the terminator; the highlight is
//! the GGX distribution with Schlick's Fresnel term and the Kelemen-Szirmay-Kalos visibility.

use rayon::prelude::*;

use super::layer::Material;
use super::tracer::Tracer;
use super::{Camera, Rgb};
use crate::{Point, Vector};

/// Rays for the ambient occlusion of one vertex.
const AMBIENT_RAYS: usize = 24;
/// Rays towards the key light, which is a disc.
const KEY_RAYS: usize = 6;
/// Half the angle under which the key light's disc is seen. (rad)
const KEY_SPREAD: f64 = 0.14;
/// Occluders count up to this share of the scene's radius, fading with distance.
const AMBIENT_REACH: f64 = 0.35;

/// Directional lights over an ambient term, in world axes.
pub(super) struct Lights {
    key: Vector,
    fill: Vector,
    rim: Vector,
    up: Vector,
}

const KEY_COLOR: Rgb = Rgb([2.35, 2.22, 2.02]);
const FILL_COLOR: Rgb = Rgb([0.36, 0.42, 0.52]);
const RIM_COLOR: Rgb = Rgb([0.75, 0.82, 0.95]);
const SKY_COLOR: Rgb = Rgb([0.54, 0.57, 0.64]);
const GROUND_COLOR: Rgb = Rgb([0.27, 0.22, 0.20]);

/// What reaches a vertex, each in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exposure {
    pub(super) ambient: f32,
    pub(super) key: f32,
}

impl Exposure {
    pub(super) const FULL: Self = Self {
        ambient: 1.0,
        key: 1.0,
    };
}

impl Lights {
    /// Lights that hang about the camera: the key at the upper left, the fill at the right.
    pub(super) fn about(camera: &Camera) -> Self {
        let at = |right: f64, up: f64, back: f64| {
            (camera.right * right + camera.up * up - camera.forward * back).normalize()
        };
        Self {
            key: at(-0.62, 0.62, 0.72),
            fill: at(0.85, 0.05, 0.55),
            rim: at(0.55, 0.55, -0.75),
            up: camera.up,
        }
    }

    /// The exposure of every vertex of one layer.
    ///
    /// `occludes` says of a primitive whether it casts shadows.
    pub(super) fn bake(
        &self,
        positions: &[Point],
        normals: &[Vector],
        tracer: &Tracer,
        occludes: impl Fn(u32) -> bool + Sync,
    ) -> Vec<Exposure> {
        let offset = tracer.radius * 2e-3;
        let reach = tracer.radius * AMBIENT_REACH;
        let (key_right, key_up) = tangents(&self.key);
        positions
            .par_iter()
            .zip(normals)
            .map(|(p, n)| {
                if n.norm_squared() < 0.5 {
                    return Exposure::FULL;
                }
                let origin = p + n * offset;
                let (tangent, bitangent) = tangents(n);
                let mut open = 0.0;
                for k in 0..AMBIENT_RAYS {
                    let [x, y] = disc_sample(k, AMBIENT_RAYS);
                    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
                    let direction = (tangent * x + bitangent * y + n * z).normalize();
                    let hit = tracer.cast(&origin, &direction, 0.0, reach, |i, _| occludes(i));
                    open += hit.map_or(1.0, |h| (h.distance / reach).sqrt());
                }
                // A face turned away is dark by its angle already; rays that leave it through its own
                // surface meet backs, which must not cut off the light that wraps around.
                let facing = n.dot(&self.key);
                let mut lit = KEY_RAYS;
                if facing > -0.5 {
                    lit = (0..KEY_RAYS)
                        .filter(|&k| {
                            let [x, y] = disc_sample(k, KEY_RAYS);
                            let direction =
                                (self.key + (key_right * x + key_up * y) * KEY_SPREAD).normalize();
                            let far = 4.0 * tracer.radius;
                            tracer
                                .cast(&origin, &direction, 0.0, far, |i, front| {
                                    (front || facing > 0.15) && occludes(i)
                                })
                                .is_none()
                        })
                        .count();
                }
                Exposure {
                    ambient: (open / AMBIENT_RAYS as f64) as f32,
                    key: lit as f32 / KEY_RAYS as f32,
                }
            })
            .collect()
    }

    /// Light that leaves a surface towards the eye.
    ///
    /// - `normal`, `to_eye`: unit vectors
    pub(super) fn shade(
        &self,
        color: Rgb,
        material: &Material,
        normal: &Vector,
        to_eye: &Vector,
        exposure: Exposure,
    ) -> Rgb {
        // A normal that leans away from the eye is a rounding artefact of smooth shading.
        let view_cos = (normal.dot(to_eye) as f32).max(0.05);
        let sky = (normal.dot(&self.up) as f32) * 0.5 + 0.5;
        let ambient = GROUND_COLOR.mix(SKY_COLOR, sky) * exposure.ambient;
        let mut diffuse = ambient;
        let mut gloss = Rgb::BLACK;
        // The rim light is wide and soft: it outlines the shape and leaves hardly a highlight.
        for (direction, light, reach, sharpness) in [
            (&self.key, KEY_COLOR, exposure.key, 1.0),
            (&self.fill, FILL_COLOR, exposure.ambient, 0.6),
            (&self.rim, RIM_COLOR, exposure.ambient, 0.12),
        ] {
            let cos = normal.dot(direction) as f32;
            let wrapped = Rgb(material.wrap.map(|w| {
                let x = ((cos + w) / (1.0 + w)).max(0.0);
                // Wrapped light is spread over more of the sphere, so it is weaker.
                x * x.min(1.0).powf(w) / (1.0 + 0.5 * w)
            }));
            diffuse += light.filter(wrapped) * (reach * std::f32::consts::FRAC_1_PI * 1.15);
            let shine = highlight(material, normal, to_eye, direction);
            gloss += light * (shine * cos.max(0.0) * reach * sharpness);
        }
        // Faint sky reflection towards grazing angles.
        let grazing = (1.0 - view_cos).powi(5) * (1.0 - material.roughness) * 0.25;
        gloss += SKY_COLOR * (grazing * exposure.ambient);
        color.filter(diffuse) + gloss
    }
}

/// Cook-Torrance highlight: GGX, Schlick, V = 1 / (4 (l.h)^2).
fn highlight(material: &Material, normal: &Vector, to_eye: &Vector, to_light: &Vector) -> f32 {
    let Some(half) = (to_eye + to_light).try_normalize(1e-6) else {
        return 0.0;
    };
    let cos_half = normal.dot(&half).max(0.0) as f32;
    let cos_light = to_light.dot(&half).max(0.05) as f32;
    let a2 = material.roughness.powi(4).max(1e-4);
    let spread = cos_half * cos_half * (a2 - 1.0) + 1.0;
    let distribution = a2 / (std::f32::consts::PI * spread * spread);
    let fresnel = material.specular + (1.0 - material.specular) * (1.0 - cos_light).powi(5);
    distribution * fresnel / (4.0 * cos_light * cos_light)
}

/// Compresses light above 0.75 so that highlights roll off instead of clipping.
pub(super) fn expose(light: Rgb) -> Rgb {
    const KNEE: f32 = 0.75;
    Rgb(light.0.map(|c| {
        if c <= KNEE {
            c.max(0.0)
        } else {
            let over = (c - KNEE) / (1.0 - KNEE);
            KNEE + (1.0 - KNEE) * over / (1.0 + over)
        }
    }))
}

/// Sample k of n on the unit disc, evenly spread by the golden angle.
fn disc_sample(k: usize, n: usize) -> [f64; 2] {
    let radius = ((k as f64 + 0.5) / n as f64).sqrt();
    let angle = k as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    [radius * angle.cos(), radius * angle.sin()]
}

/// Two unit vectors across a unit vector and each other.
fn tangents(n: &Vector) -> (Vector, Vector) {
    let helper = if n.x.abs() < 0.7 {
        Vector::x()
    } else {
        Vector::y()
    };
    let t = n.cross(&helper).normalize();
    (t, n.cross(&t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::View;

    #[test]
    fn tangents_are_orthonormal() {
        for n in [Vector::x(), Vector::y(), Vector::new(0.6, 0.0, 0.8)] {
            let (t, b) = tangents(&n);
            assert!(n.dot(&t).abs() < 1e-12 && n.dot(&b).abs() < 1e-12 && t.dot(&b).abs() < 1e-12);
            assert!((b.norm() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_roof_darkens_what_lies_under_it() {
        let roof = |z: f64| {
            [
                Point::new(-50.0, -50.0, z),
                Point::new(50.0, -50.0, z),
                Point::new(0.0, 80.0, z),
            ]
        };
        let tracer = Tracer::new(&[roof(0.0), roof(5.0)], &[]);
        let camera = Camera::framing(
            View::Front,
            [Point::origin(), Point::new(1.0, 1.0, 1.0)].into_iter(),
            1.0,
            (0.0, 0.0),
            false,
        );
        let lights = Lights::about(&camera);
        let at = [Point::origin()];
        let up = [Vector::z()];
        let covered = lights.bake(&at, &up, &tracer, |_| true)[0];
        let open = lights.bake(&at, &up, &tracer, |i| i == 0)[0];
        assert!(covered.ambient < 0.6 && covered.key == 0.0, "{covered:?}");
        assert_eq!(open, Exposure::FULL);
    }

    #[test]
    fn exposure_is_monotone_and_stays_below_one() {
        let mut last = 0.0;
        for k in 1..200 {
            let [c, ..] = expose(Rgb([k as f32 * 0.05; 3])).0;
            assert!(c > last && c < 1.0);
            last = c;
        }
    }
}
