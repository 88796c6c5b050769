//! What `fabrig render` draws of a rig or the template: the poses asked for, as layers.

use std::sync::Arc;

use anyhow::{Result, bail};
use fabrig_core::Point;
use fabrig_core::mesh::Polygons;
use fabrig_core::render::{FaceLook, Label, Layer, Rgb, patch_layer, posed_template_layers};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template::Template;

use super::pose::{expression_sheet, parse_pose};
use crate::cli::RenderArgs;
use crate::console::Console;

/// What is in one picture before it is looked at from somewhere.
pub(super) struct Subject {
    pub(super) caption: String,
    pub(super) layers: Vec<Layer>,
    pub(super) labels: Vec<Label>,
    /// What its picture holds, where that is not what the others hold. (mm)
    pub(super) focus: Vec<Point>,
}

impl Subject {
    pub(super) fn plain(caption: &str, layers: Vec<Layer>) -> Self {
        Self {
            caption: caption.to_owned(),
            layers,
            labels: Vec::new(),
            focus: Vec::new(),
        }
    }
}

/// The poses asked for by name, or the neutral face.
fn poses(shapes: &[String], args: &RenderArgs) -> Result<Vec<(String, Vec<f32>)>> {
    let parse = |text: &str| parse_pose(text, shapes);
    if let Some(sheet) = args.expressions {
        expression_sheet(sheet.name(), shapes)
    } else if args.all_shapes {
        Ok((0..shapes.len())
            .map(|shape| {
                let mut weights = vec![0.0; shapes.len()];
                weights[shape] = 1.0;
                // The corrective of an open jaw is nothing to look at without one.
                let jaw = shapes.iter().position(|name| name == "jawOpen");
                match jaw.filter(|_| shapes[shape] == "mouthClose") {
                    Some(jaw) => {
                        weights[jaw] = 1.0;
                        ("mouthClose, jawOpen".to_owned(), weights)
                    }
                    None => (shapes[shape].clone(), weights),
                }
            })
            .collect())
    } else if args.pose.is_empty() {
        Ok(vec![(String::new(), vec![0.0; shapes.len()])])
    } else {
        let texts = args.pose.iter();
        texts.map(|text| Ok((text.clone(), parse(text)?))).collect()
    }
}

/// The template in the poses asked for, as its shapes are drawn.
pub(super) fn template_subjects(template: &Template, args: &RenderArgs) -> Result<Vec<Subject>> {
    let names: Vec<String> = template.shapes.iter().map(|s| s.name.clone()).collect();
    poses(&names, args)?
        .into_iter()
        .map(|(caption, weights)| {
            let layers = posed_template_layers(template, &weights, &FaceLook::default())?;
            Ok(Subject::plain(&caption, layers))
        })
        .collect()
}

/// A rig in the poses asked for, each held until still.
pub(super) fn rig_subjects(console: &Console, rig: Rig, args: &RenderArgs) -> Result<Vec<Subject>> {
    let poses = poses(&rig.shape_names, args)?;
    let mut simulation = Simulation::new(Arc::new(rig), Scene::default(), None)?;
    let count = poses.len() as u64;
    let mut subjects = Vec::with_capacity(poses.len());
    for (index, (caption, weights)) in poses.into_iter().enumerate() {
        let mut pose = FacePose::neutral(weights.len());
        pose.weights = weights;
        hold_pose(&mut simulation, &pose)?;
        let layers = if args.patches {
            patch_layers_now(&simulation)?
        } else {
            face_layers(&simulation)?
        };
        let labels = if args.names {
            patch_labels(&simulation)
        } else {
            Vec::new()
        };
        subjects.push(Subject {
            caption,
            layers,
            labels,
            focus: Vec::new(),
        });
        if console
            .show("settle", index as u64 + 1, count, "")
            .is_break()
        {
            bail!("stopped; nothing was written");
        }
    }
    Ok(subjects)
}

/// Skin and loose parts of a simulated face.
pub(super) fn face_layers(simulation: &Simulation) -> Result<Vec<Layer>> {
    let look = FaceLook::default();
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
        let gaze = pose.motion.rotation * fabrig_core::Vector::z();
        layers.push(look.part(&part.name, positions, polygons, gaze)?);
    }
    Ok(layers)
}

fn patch_layers_now(simulation: &Simulation) -> Result<Vec<Layer>> {
    let patches = simulation.rig().patches.iter().enumerate();
    patches
        .map(|(index, patch)| {
            let nodes = simulation.patch_positions(index);
            let nodes = nodes.iter().map(|p| p.cast()).collect();
            Ok(patch_layer(&patch.patch.chart, nodes)?)
        })
        .collect()
}

fn patch_labels(simulation: &Simulation) -> Vec<Label> {
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
