//! Which patches of a rig are cloth.
//!
//! A patch that is not stands exactly on its targets. So a node of the cloth that is attached to
//! it, at the offset that the targets of both have (Eq. 5), is held at its own target: the
//! attachment becomes an anchor with the same stiffness.

use nalgebra::Point3;

use super::{Scene, SceneError};
use crate::cloth::{ClothAttachment, ClothPatch, PatchMotion};
use crate::facs::nearest_name;
use crate::rig::Rig;

/// Patches of a rig that are cloth.
pub(super) struct Modelled {
    /// Place in the cloth of each patch of the rig.
    cloth_of: Vec<Option<usize>>,
    /// Patch of the rig of each patch of the cloth.
    rig_of: Vec<usize>,
    /// For each patch of the cloth the nodes that are held at their own targets because what
    /// they are attached to is no cloth.
    held: Vec<Vec<u32>>,
    targets: Vec<PatchMotion>,
    anchors: Vec<PatchMotion>,
}

impl Modelled {
    /// - `patches`: all patches of the rig
    ///
    /// Returns those that are cloth, too.
    ///
    /// # Errors
    ///
    /// [`SceneError::Value`] for a name that no patch has.
    pub(super) fn new(
        rig: &Rig,
        scene: &Scene,
        patches: Vec<ClothPatch>,
    ) -> Result<(Self, Vec<ClothPatch>), SceneError> {
        let names: Vec<&str> = rig
            .patches
            .iter()
            .map(|patch| patch.patch.chart.name.as_str())
            .collect();
        let simulate = &scene.simulate;
        let chosen = simulate.choose(&names).map_err(|(list, index)| {
            let listed = if list == "only" {
                &simulate.only
            } else {
                &simulate.except
            };
            scene.source.value(
                &format!("simulate.{list}[{index}]"),
                "the name of a patch of the rig".to_owned(),
                format!("'{}'", listed[index]),
                nearest_name(&listed[index], names.iter().copied()),
            )
        })?;
        Ok(Self::of(&chosen, patches))
    }

    fn of(chosen: &[bool], all: Vec<ClothPatch>) -> (Self, Vec<ClothPatch>) {
        let rig_of: Vec<usize> = (0..all.len()).filter(|&p| chosen[p]).collect();
        let mut cloth_of = vec![None; all.len()];
        for (cloth, &patch) in rig_of.iter().enumerate() {
            cloth_of[patch] = Some(cloth);
        }
        let mut patches: Vec<ClothPatch> = rig_of
            .iter()
            .map(|&patch| ClothPatch {
                attachments: Vec::new(),
                ..all[patch].clone()
            })
            .collect();
        let mut held = vec![Vec::new(); patches.len()];
        let mut holds = vec![Vec::new(); patches.len()];
        let mut hold = |cloth: usize, nodes: Vec<u32>, strength: f64| {
            held[cloth].extend(&nodes);
            holds[cloth].push(ClothAttachment::Anchors { nodes, strength });
        };
        for (index, patch) in all.iter().enumerate() {
            for attachment in &patch.attachments {
                let ClothAttachment::Patch {
                    patch: other,
                    pairs,
                    strength,
                } = attachment
                else {
                    if let Some(cloth) = cloth_of[index] {
                        patches[cloth].attachments.push(attachment.clone());
                    }
                    continue;
                };
                let other = *other as usize;
                // Relative to the smaller stiffness of the two, where an anchor's is to its own.
                let stiffness = |p: usize| all[p].material.stretch_stiffness();
                let share = |own: usize| {
                    let least = stiffness(index).min(stiffness(other));
                    strength
                        * if least > 0.0 {
                            least / stiffness(own)
                        } else {
                            0.0
                        }
                };
                match (cloth_of[index], cloth_of[other]) {
                    (Some(own), Some(other)) => {
                        patches[own].attachments.push(ClothAttachment::Patch {
                            patch: other as u32,
                            pairs: pairs.clone(),
                            strength: *strength,
                        });
                    }
                    (Some(own), None) => {
                        hold(own, pairs.iter().map(|pair| pair.0).collect(), share(index));
                    }
                    (None, Some(own)) => {
                        hold(own, pairs.iter().map(|pair| pair.1).collect(), share(other));
                    }
                    (None, None) => {}
                }
            }
        }
        for (patch, holds) in patches.iter_mut().zip(holds) {
            patch.attachments.extend(holds);
        }
        let modelled = Self {
            cloth_of,
            rig_of,
            held,
            targets: Vec::new(),
            anchors: Vec::new(),
        };
        (modelled, patches)
    }

    /// Place in the cloth of a patch of the rig, if it is there.
    pub(super) fn cloth_of(&self, patch: usize) -> Option<usize> {
        self.cloth_of[patch]
    }

    /// Patches of the rig that are cloth, in the order of the cloth.
    pub(super) fn patches(&self) -> &[usize] {
        &self.rig_of
    }

    /// Of the motions of all patches of the rig, and of their anchors, those of the cloth's.
    pub(super) fn gather<'a>(
        &'a mut self,
        targets: &'a [PatchMotion],
        anchors: &'a [PatchMotion],
    ) -> (&'a [PatchMotion], &'a [PatchMotion]) {
        if self.rig_of.len() == targets.len() {
            return (targets, anchors);
        }
        self.targets
            .resize_with(self.rig_of.len(), PatchMotion::default);
        self.anchors
            .resize_with(self.rig_of.len(), PatchMotion::default);
        for (cloth, &patch) in self.rig_of.iter().enumerate() {
            let (target, anchor) = (&mut self.targets[cloth], &mut self.anchors[cloth]);
            target.clone_from(&targets[patch]);
            anchor.clone_from(&anchors[patch]);
            for &node in &self.held[cloth] {
                let node = node as usize;
                anchor.positions.push(target.positions[node]);
                anchor.velocities.push(target.velocities[node]);
            }
        }
        (&self.targets, &self.anchors)
    }
}

/// The middle of a face: of all nodes of its patches. [mm, head frame]
pub(super) fn middle(rig: &Rig) -> crate::Point {
    let nodes = rig.patches.iter().flat_map(|patch| &patch.patch.neutral);
    let (sum, count) = nodes.fold((crate::Vector::zeros(), 0usize), |(sum, count), node| {
        (sum + node.coords, count + 1)
    });
    Point3::from(sum / count.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth::{Cloth, ClothOptions, FrameInput, GridShape, Material};

    fn sheet(z: f32, attachments: Vec<ClothAttachment>) -> ClothPatch {
        let shape = GridShape {
            u_count: 4,
            v_count: 4,
            is_periodic: false,
        };
        let node = |k: u32| Point3::new((k % 4) as f32 * 2.0, (k / 4) as f32 * 2.0, z);
        ClothPatch {
            shape,
            rest: (0..16).map(node).collect(),
            material: Material::FAT,
            attachments,
            variations: Vec::new(),
        }
    }

    /// A sheet on another that a third one is attached to.
    fn patches() -> Vec<ClothPatch> {
        let to = |patch: u32| ClothAttachment::Patch {
            patch,
            pairs: vec![(0, 1), (5, 5)],
            strength: 2.0,
        };
        vec![
            sheet(0.0, vec![]),
            sheet(3.0, vec![to(0)]),
            sheet(6.0, vec![to(1)]),
        ]
    }

    #[test]
    fn attachments_to_what_is_no_cloth_hold_nodes_at_their_targets() {
        let (mut modelled, cloth) = Modelled::of(&[false, true, false], patches());
        let anchors = |nodes: &[u32]| ClothAttachment::Anchors {
            nodes: nodes.to_vec(),
            strength: 2.0,
        };
        assert_eq!(cloth.len(), 1);
        assert_eq!(cloth[0].attachments, [anchors(&[0, 5]), anchors(&[1, 5])]);
        let targets: Vec<PatchMotion> = patches()
            .iter()
            .map(|p| PatchMotion::still(&p.rest))
            .collect();
        let none = vec![PatchMotion::default(); 3];
        let (own, held) = modelled.gather(&targets, &none);
        assert_eq!(own, &targets[1..2]);
        let expected: Vec<_> = [0, 5, 1, 5].map(|n| targets[1].positions[n]).to_vec();
        assert_eq!(held[0].positions, expected);
    }

    #[test]
    fn a_lone_patch_hangs_as_it_does_between_stiff_neighbours() {
        // Under a sideways load the held nodes move less than the free ones.
        let (mut modelled, cloth) = Modelled::of(&[false, true, false], patches());
        let targets: Vec<PatchMotion> = patches()
            .iter()
            .map(|p| PatchMotion::still(&p.rest))
            .collect();
        let none = vec![PatchMotion::default(); 3];
        let mut solver = Cloth::new(&cloth, &ClothOptions::default()).unwrap();
        let (own, held) = modelled.gather(&targets, &none);
        for _ in 0..240 {
            let input = FrameInput {
                anchors: held,
                gravity: Some([9810.0, -9810.0, 0.0].into()),
                ..FrameInput::new(1.0 / 60.0, own)
            };
            solver.step(&input).unwrap();
        }
        let moved = |node: usize| (solver.positions(0)[node] - own[0].positions[node]).norm();
        assert!(moved(5) < 0.8 * moved(15), "{} {}", moved(5), moved(15));
        assert!(moved(15) > 1.0);
    }
}
