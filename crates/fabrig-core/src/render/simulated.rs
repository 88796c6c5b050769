//! Layers of a face as a simulation has it now.

use super::{FaceLook, Label, Layer, RenderError, Rgb, patch_layer};
use crate::mesh::Polygons;
use crate::scene::Simulation;
use crate::{Point, Vector};

/// Skin and loose parts, in the head frame. (mm)
///
/// # Errors
///
/// As [`Layer::from_polygons`].
pub fn simulation_layers(
    simulation: &Simulation,
    look: &FaceLook,
) -> Result<Vec<Layer>, RenderError> {
    let rig = simulation.rig();
    let skin: Vec<Point> = simulation.skin().iter().map(|p| p.cast()).collect();
    let mut owner = vec![None; skin.len()];
    for (part, piece) in rig.parts.iter().enumerate() {
        for (k, &vertex) in piece.vertices.iter().enumerate() {
            owner[vertex as usize] = Some((part, k as u32));
        }
    }
    let mut skin_polygons = Polygons::new();
    let mut part_polygons = vec![Polygons::new(); rig.parts.len()];
    for face in rig.face.polygons().iter() {
        let places: Option<Vec<(usize, u32)>> = face.iter().map(|&v| owner[v as usize]).collect();
        match places {
            Some(places) => {
                let corners: Vec<u32> = places.iter().map(|p| p.1).collect();
                part_polygons[places[0].0].push(&corners);
            }
            None => skin_polygons.push(face),
        }
    }
    let mut layers = vec![look.skin(skin.clone(), &skin_polygons)?];
    for ((part, polygons), pose) in rig.parts.iter().zip(&part_polygons).zip(simulation.parts()) {
        if polygons.is_empty() {
            continue;
        }
        let positions = part.vertices.iter().map(|&v| skin[v as usize]).collect();
        let gaze = pose.motion.rotation * Vector::z();
        layers.push(look.part(&part.name, positions, polygons, gaze)?);
    }
    Ok(layers)
}

/// Muscles and fat in the colours of their charts, in the head frame. (mm)
///
/// # Errors
///
/// As [`patch_layer`].
pub fn simulation_patch_layers(simulation: &Simulation) -> Result<Vec<Layer>, RenderError> {
    let patches = simulation.rig().patches.iter().enumerate();
    patches
        .map(|(index, patch)| {
            let nodes = simulation.patch_positions(index);
            let nodes = nodes.iter().map(|p| p.cast()).collect();
            patch_layer(&patch.patch.chart, nodes)
        })
        .collect()
}

/// The name of each patch at its middle node.
pub fn simulation_labels(simulation: &Simulation) -> Vec<Label> {
    let patches = simulation.rig().patches.iter().enumerate();
    patches
        .map(|(index, patch)| {
            let chart = &patch.patch.chart;
            let middle = chart
                .grid
                .index(chart.grid.u_count / 2, chart.grid.v_count / 2);
            Label {
                anchor: simulation.patch_positions(index)[middle].cast(),
                text: chart.name.replace('_', " "),
                color: Rgb::from_srgb(chart.color),
            }
        })
        .collect()
}
