//! Scenes that need nothing but the solver: a face-sized one, and the standard patch.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::scene::{BenchScene, SceneFrame};
use crate::cloth::{
    ClothAttachment, ClothPatch, GridShape, HeadMotion, Material, PatchMotion, TIME_UNIT,
};

/// Frames per second.
const RATE: f64 = 60.0;

impl BenchScene {
    /// 29 muscles, 12 fat pads and 3 sphincters, origins anchored, insertions and fat stitched.
    ///
    /// Every patch swings between rest and its pose with its own period, between 0.4 and
    /// 0.9 s, while the head shakes.
    pub fn face(frames: usize) -> Self {
        Self::sized(1.0, true, frames)
    }

    /// The same with `scale` times as many nodes along every grid line, with or without
    /// attachments between patches.
    pub fn sized(scale: f64, has_pairs: bool, frames: usize) -> Self {
        let count = |n: f64| ((n * scale).round() as u32).max(3);
        let sheet = GridShape {
            u_count: count(21.0),
            v_count: count(20.0),
            is_periodic: false,
        };
        let hoop = GridShape {
            u_count: count(48.0),
            v_count: count(15.0),
            is_periodic: true,
        };
        let mut patches = Vec::new();
        for k in 0..29_u32 {
            let mut patch = dome(sheet, k, Material::LINEAR_MUSCLE);
            patch.attachments.push(ClothAttachment::Anchors {
                nodes: (0..sheet.v_count)
                    .map(|v| sheet.index(0, v) as u32)
                    .collect(),
                strength: 1.0,
            });
            if has_pairs {
                let last = sheet.u_count - 1;
                patch.attachments.push(ClothAttachment::Patch {
                    patch: 29 + k % 12,
                    pairs: (0..sheet.v_count)
                        .map(|v| (sheet.index(last, v) as u32, sheet.index(k % 3, v) as u32))
                        .collect(),
                    strength: 0.5,
                });
            }
            patches.push(patch);
        }
        for k in 0..12_u32 {
            let mut patch = dome(sheet, 29 + k, Material::FAT);
            if has_pairs {
                let nodes = sheet.node_count() as u32;
                patch.attachments.push(ClothAttachment::Patch {
                    patch: 2 * k,
                    pairs: (0..nodes).step_by(5).map(|i| (i, i)).collect(),
                    strength: 0.2,
                });
            }
            patches.push(patch);
        }
        for k in 0..3_u32 {
            patches.push(ring(hoop, k));
        }
        let poses: Vec<_> = patches
            .iter()
            .enumerate()
            .map(|(i, p)| pose(p, i))
            .collect();
        let frames = (0..=frames)
            .map(|k| {
                let t = k as f64 / RATE;
                let period = |i: usize| 0.4 + 0.05 * ((i * 7) % 11) as f64;
                let targets = patches
                    .iter()
                    .zip(&poses)
                    .enumerate()
                    .map(|(i, (patch, pose))| swing(patch, pose, period(i), t))
                    .collect();
                SceneFrame {
                    head: shake(t),
                    ..still_head(targets)
                }
            })
            .collect();
        Self::new("domes and rings", patches, frames)
    }

    /// One muscle of 24 x 24 nodes whose magnet swings at 8 Hz, with `ratio` times as stiff
    /// edges, contracted by a quarter and let go again and again.
    pub fn standard_patch(ratio: f64, frames: usize) -> Self {
        let mut material = Material {
            magnet_frequency_hz: 8.0,
            ..Material::LINEAR_MUSCLE
        };
        let resistance = ratio * material.magnet_stiffness() * TIME_UNIT * TIME_UNIT;
        material.stretch_resistance = resistance;
        material.compression_resistance = resistance;
        material.shear_resistance = resistance / 2.0;
        material.bend_resistance = resistance / 2.0;
        let shape = GridShape {
            u_count: 24,
            v_count: 24,
            is_periodic: false,
        };
        let patch = dome(shape, 0, material);
        let pose = pose(&patch, 6);
        let frames = (0..=frames)
            .map(|k| still_head(vec![swing(&patch, &pose, 0.66, k as f64 / RATE)]))
            .collect();
        Self::new(
            &format!("standard patch at ratio {ratio}"),
            vec![patch],
            frames,
        )
    }
}

fn still_head(targets: Vec<PatchMotion>) -> SceneFrame {
    SceneFrame {
        dt: 1.0 / RATE,
        targets,
        anchors: Vec::new(),
        gravity: None,
        wind: Vector3::zeros(),
        head: HeadMotion::default(),
    }
}

/// Between rest and a pose with a period, at time `t`. (s)
fn swing(patch: &ClothPatch, pose: &[Vector3<f32>], period: f64, t: f64) -> PatchMotion {
    let rate = TAU / period;
    let (s, c) = (rate * t).sin_cos();
    let (weight, speed) = ((0.5 - 0.5 * c) as f32, (0.5 * rate * s) as f32);
    PatchMotion {
        positions: patch
            .rest
            .iter()
            .zip(pose)
            .map(|(p, d)| p + d * weight)
            .collect(),
        velocities: pose.iter().map(|d| d * speed).collect(),
    }
}

/// A shake of the head of a tenth of a radian at 2 Hz.
fn shake(t: f64) -> HeadMotion {
    let rate = TAU * 2.0;
    let (s, c) = (rate * t).sin_cos();
    HeadMotion {
        linear_acceleration: Vector3::zeros(),
        angular_velocity: Vector3::new(0.0, (0.1 * rate * c) as f32, 0.0),
        angular_acceleration: Vector3::new(0.0, (-0.1 * rate * rate * s) as f32, 0.0),
    }
}

/// A domed sheet of 40 x 38 mm at a place of its own on a head.
fn dome(shape: GridShape, index: u32, material: Material) -> ClothPatch {
    let angle = f64::from(index) * 2.4;
    let height = f64::from(index % 9) * 15.0 - 60.0;
    let mut rest = Vec::new();
    for v in 0..shape.v_count {
        for u in 0..shape.u_count {
            let x = 40.0 * f64::from(u) / f64::from(shape.u_count - 1) - 20.0;
            let y = 38.0 * f64::from(v) / f64::from(shape.v_count - 1) - 19.0;
            let radius = 75.0 - 0.012 * x * x - 0.01 * y * y;
            let turn = angle + x / 80.0;
            rest.push(Point3::new(
                (radius * turn.sin()) as f32,
                (height + y) as f32,
                (radius * turn.cos()) as f32,
            ));
        }
    }
    ClothPatch {
        shape,
        rest,
        material,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}

/// A ring about an opening of 12 to 33 mm.
fn ring(shape: GridShape, index: u32) -> ClothPatch {
    let mut rest = Vec::new();
    for v in 0..shape.v_count {
        for u in 0..shape.u_count {
            let angle = (f64::from(u) + 0.5) / f64::from(shape.u_count) * TAU;
            let radius = 12.0 + 21.0 * f64::from(v) / f64::from(shape.v_count - 1);
            let (x, y) = (1.4 * radius * angle.cos(), radius * angle.sin());
            rest.push(Point3::new(
                x as f32,
                (y - 40.0 + 50.0 * f64::from(index)) as f32,
                (90.0 - 0.008 * (x * x + y * y)) as f32,
            ));
        }
    }
    ClothPatch {
        shape,
        rest,
        material: Material::SPHINCTER,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}

/// Contraction by a fifth or so towards the first node, with a swell and a drift.
fn pose(patch: &ClothPatch, index: usize) -> Vec<Vector3<f32>> {
    let first = patch.rest[0];
    let share = 0.12 + 0.02 * (index % 7) as f32;
    let drift = Vector3::new(
        1.5 * (index as f32).sin(),
        2.0 * (index as f32 * 1.7).cos(),
        1.0,
    );
    patch
        .rest
        .iter()
        .map(|p| {
            let away = p - first;
            let swell = (away.norm() / 45.0 * std::f32::consts::PI).sin();
            away * -share + drift + p.coords.normalize() * (3.0 * swell)
        })
        .collect()
}
