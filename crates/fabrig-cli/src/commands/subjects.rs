//! What `fabrig render` draws of a rig or the template: the poses asked for, as layers.

use std::sync::Arc;

use anyhow::{Result, bail};
use fabrig_core::Point;
use fabrig_core::facs::expression_sheet;
use fabrig_core::render::{
    FaceLook, Label, Layer, posed_template_layers, simulation_labels, simulation_layers,
    simulation_patch_layers,
};
use fabrig_core::rig::Rig;
use fabrig_core::scene::{FacePose, Scene, Simulation, hold_pose};
use fabrig_core::template::Template;

use super::pose::parse_pose;
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
        Ok(expression_sheet(sheet.name(), shapes)?)
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
            simulation_patch_layers(&simulation)?
        } else {
            simulation_layers(&simulation, &FaceLook::default())?
        };
        let labels = if args.names {
            simulation_labels(&simulation)
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
