//! Layers for what the project makes: templates, patches, frames of a recording.

use super::{FaceLook, Label, Layer, Material, RenderError, Rgb};
use crate::anatomy::{Patch, PatchChart};
use crate::mesh::Polygons;
use crate::recording::{RecordedFrame, RecordedSurface};
use crate::template::{EyeSocket, RigidBody, Template};
use crate::transfer::{EyeShapes, JawPose, JawShapes};
use crate::{Point, Vector};

/// The template's skin and rigid parts at rest.
///
/// # Errors
///
/// As [`Layer::from_polygons`].
pub fn template_layers(template: &Template, look: &FaceLook) -> Result<Vec<Layer>, RenderError> {
    posed_template_layers(template, &vec![0.0; template.shapes.len()], look)
}

/// The template under its own shapes, as the pack has them: a plain weighted sum for the skin,
/// the hinge for lower teeth and tongue, turned eyes. Nothing is simulated.
///
/// - `weights`: one per shape of the template; shapes without one stay at rest
///
/// # Errors
///
/// As [`Layer::from_polygons`].
pub fn posed_template_layers(
    template: &Template,
    weights: &[f32],
    look: &FaceLook,
) -> Result<Vec<Layer>, RenderError> {
    let weight = |shape: usize| f64::from(weights.get(shape).copied().unwrap_or(0.0));
    let mut skin = template.skin.positions().to_vec();
    for (shape, whole) in template.shapes.iter().enumerate() {
        for (vertex, delta) in whole.deltas.iter().filter(|_| weight(shape) != 0.0) {
            skin[*vertex as usize] += weight(shape) * delta;
        }
    }
    let mut layers = vec![look.skin(skin, template.skin.polygons())?];
    let mut all = weights.to_vec();
    all.resize(template.shapes.len(), 0.0);
    let jaw = JawPose::at(&template.jaw, &JawShapes::of(template), 1.0, &all);
    let (turn, slide) = jaw.affine(&template.jaw);
    let eyes = EyeShapes::of(template);
    for (index, part) in (0u32..).zip(&template.rigid_parts) {
        let mut positions = part.mesh.positions().to_vec();
        for (shape, of_part, deltas) in &template.part_deltas {
            for (p, d) in positions.iter_mut().zip(deltas) {
                if *of_part == index {
                    *p += weight(*shape as usize) * d;
                }
            }
        }
        if part.follows == RigidBody::Mandible {
            for p in &mut positions {
                *p = Point::from(turn * p.coords + slide);
            }
        }
        let gaze = match part.follows {
            RigidBody::EyeLeft => gaze(&template.eyes[0], &eyes[0], 1.0, &weight),
            RigidBody::EyeRight => gaze(&template.eyes[1], &eyes[1], -1.0, &weight),
            _ => Vector::z(),
        };
        layers.push(look.part(&part.name, positions, part.mesh.polygons(), gaze)?);
    }
    Ok(layers)
}

/// Where an eye looks; `out` is +1 for the eye at +X.
fn gaze(socket: &EyeSocket, shapes: &EyeShapes, out: f64, weight: &dyn Fn(usize) -> f64) -> Vector {
    let angle = |k: usize| {
        shapes.look[k].map_or(0.0, |shape| weight(shape as usize)) * socket.look_angles[k]
    };
    let (pitch, yaw) = (angle(0) - angle(1), out * (angle(3) - angle(2)));
    Vector::new(
        yaw.sin() * pitch.cos(),
        pitch.sin(),
        yaw.cos() * pitch.cos(),
    )
}

/// One patch in its chart's colour; `positions` are one per grid node.
///
/// # Errors
///
/// [`RenderError::IndexOutOfRange`] when there are fewer positions than nodes.
pub fn patch_layer(chart: &PatchChart, positions: Vec<Point>) -> Result<Layer, RenderError> {
    let quads = Polygons::from_faces(chart.quads());
    Ok(Layer::from_polygons(positions, &quads)?
        .with_color(Rgb::from_srgb(chart.color))
        .with_material(Material::MATTE))
}

/// Patches at rest, and a name for each at its middle node.
///
/// # Errors
///
/// As [`patch_layer`].
pub fn patch_layers(patches: &[Patch]) -> Result<(Vec<Layer>, Vec<Label>), RenderError> {
    let mut layers = Vec::new();
    let mut labels = Vec::new();
    for patch in patches {
        let grid = patch.chart.grid;
        layers.push(patch_layer(&patch.chart, patch.neutral.clone())?);
        let middle = grid.index(grid.u_count / 2, grid.v_count / 2);
        if let Some(&anchor) = patch.neutral.get(middle) {
            labels.push(Label {
                anchor,
                text: patch.chart.name.replace('_', " "),
                color: Rgb::from_srgb(patch.chart.color),
            });
        }
    }
    Ok((layers, labels))
}

/// What of a recorded frame to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RecordingContent {
    /// Skin and parts.
    #[default]
    Face,
    /// Patches and parts.
    Patches,
    /// Patches and parts under a veil of skin.
    Both,
}

/// One frame of a recording, placed by the recorded head motion. Eyeballs look along the axis
/// that most of their rotation since `first`, the recording's first frame, leaves them.
///
/// # Errors
///
/// As [`Layer::new`].
pub fn recording_layers(
    frame: &RecordedFrame,
    first: &RecordedFrame,
    content: RecordingContent,
    look: &FaceLook,
) -> Result<Vec<Layer>, RenderError> {
    let place = |surface: &RecordedSurface| -> Vec<Point> {
        let moved = surface.positions.iter().map(|p| frame.head * p);
        moved.collect()
    };
    let mut layers = Vec::new();
    if let (Some(skin), true) = (&frame.skin, content != RecordingContent::Patches) {
        let layer = look.skin(place(skin), &Polygons::from_faces(&skin.info.triangles))?;
        let is_veil = content == RecordingContent::Both;
        layers.push(layer.with_opacity(if is_veil { 0.3 } else { 1.0 }));
    }
    if content != RecordingContent::Face {
        for patch in &frame.patches {
            let [r, g, b, _] = patch.info.color;
            let layer = Layer::new(place(patch), patch.info.triangles.clone())?;
            layers.push(layer.with_color(Rgb::from_srgb([r, g, b])));
        }
    }
    for part in &frame.parts {
        let rest = first.parts.iter().find(|p| p.info.name == part.info.name);
        let turn = rest.map_or_else(Default::default, |rest| turn_of(rest, part));
        let gaze = frame.head * (turn * Vector::z());
        let polygons = Polygons::from_faces(&part.info.triangles);
        layers.push(look.part(&part.info.name, place(part), &polygons, gaze)?);
    }
    for collider in &frame.colliders {
        let [r, g, b, _] = collider.info.color;
        let layer = Layer::new(place(collider), collider.info.triangles.clone())?;
        layers.push(layer.with_color(Rgb::from_srgb([r, g, b])));
    }
    Ok(layers)
}

/// The rotation that best carries one surface into another of the same vertices (Kabsch).
fn turn_of(from: &RecordedSurface, to: &RecordedSurface) -> nalgebra::Rotation3<f64> {
    let mean = |s: &RecordedSurface| {
        let sum: Vector = s.positions.iter().map(|p| p.coords).sum();
        sum / s.positions.len().max(1) as f64
    };
    let (from_mean, to_mean) = (mean(from), mean(to));
    let mut covariance = nalgebra::Matrix3::zeros();
    for (p, q) in from.positions.iter().zip(&to.positions) {
        covariance += (q.coords - to_mean) * (p.coords - from_mean).transpose();
    }
    nalgebra::Rotation3::from_matrix(&covariance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::SurfaceInfo;

    #[test]
    fn a_turned_eye_is_recognised() {
        let surface = |positions: Vec<Point>| RecordedSurface {
            info: SurfaceInfo {
                name: "eye_l".to_owned(),
                color: [255; 4],
                vertex_count: positions.len(),
                triangles: Vec::new(),
                vertex_colors: Vec::new(),
            },
            positions,
        };
        let ball: Vec<Point> = (0..60)
            .map(|i| {
                let z = f64::from(i) / 30.0 - 1.0;
                let a = f64::from(i) * 2.4;
                let r = (1.0 - z * z).max(0.0).sqrt();
                Point::new(r * a.cos(), r * a.sin(), z) * 12.0
            })
            .collect();
        let turn = nalgebra::Rotation3::from_euler_angles(0.2, -0.35, 0.05);
        let turned = ball.iter().map(|p| turn * p + Vector::x() * 30.0).collect();
        let found = turn_of(&surface(ball.clone()), &surface(turned));
        assert!(found.angle_to(&turn) < 1e-6, "{found}");
    }
}
