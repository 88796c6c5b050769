//! Where bone holds the nodes that are attached to it (Eq. 5).
//!
//! An origin is held where the bone carries it. But skin slides over bone: where a muscle shape
//! draws an attached node further along the bone than [`MOST_SLIDE`], a rigid hold would pull
//! the held pose off its shapes, and the node is held where the shapes put it instead. So bone
//! keeps such a node from swinging, and the shapes keep their word.

use nalgebra::{Point3, Vector3};

use crate::anatomy::Attachment;
use crate::cloth::PatchMotion;
use crate::rig::{Rig, RigPatch};
use crate::template::RigidBody;
use crate::transfer::{JawPose, ShapeWeights};
use crate::{Point, Vector};

/// Slide along the bone, at weight 1 of any one shape, up to which a node is held rigidly. (mm)
const MOST_SLIDE: f64 = 0.5;

/// What holds one attached node.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Anchor {
    node: u32,
    /// The bone that carries it; `None` where it follows its muscle shapes.
    bone: Option<RigidBody>,
    rest: Point3<f32>,
}

/// The attached nodes of one patch, in the order of its attachments.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct BoneAnchors {
    anchors: Vec<Anchor>,
}

/// The mandible now: `x -> c + R (p - c) + slide`, and how fast that changes.
pub(super) struct Mandible {
    rotation: nalgebra::Matrix3<f64>,
    center: Vector,
    slide: Vector,
    /// (rad/s) along the hinge.
    turning: Vector,
    /// (mm/s)
    sliding: Vector,
}

impl Mandible {
    /// - `rates`: of the weights, same length (1/s)
    pub(super) fn at(rig: &Rig, weights: &[f32], rates: &[f32]) -> Self {
        let hinge = &rig.jaw.hinge;
        let pose = rig.jaw_pose(weights);
        // Angle and slide are linear in the weights, so their rates are those of the rates.
        let rate = rig.jaw_pose(rates);
        Self {
            rotation: rotation(rig, &pose),
            center: hinge.center.coords,
            slide: pose.slide,
            turning: hinge.axis.normalize() * rate.angle,
            sliding: rate.slide,
        }
    }

    fn carry(&self, rest: &Point) -> (Point, Vector) {
        let arm = self.rotation * (rest.coords - self.center);
        (
            Point::from(self.center + arm + self.slide),
            self.turning.cross(&arm) + self.sliding,
        )
    }
}

fn rotation(rig: &Rig, pose: &JawPose) -> nalgebra::Matrix3<f64> {
    pose.affine(&rig.jaw.hinge).0
}

impl BoneAnchors {
    /// Finds out which attached nodes of a patch slide over their bone.
    pub(super) fn new(rig: &Rig, patch: &RigPatch) -> Self {
        let rest: Vec<Point3<f32>> = patch.patch.neutral.iter().map(|q| q.cast()).collect();
        let mut held: Vec<(u32, RigidBody, f64)> = Vec::new();
        for attachment in &patch.patch.chart.attachments {
            if let Attachment::Body { body, nodes, .. } = attachment {
                held.extend(nodes.iter().map(|&node| (node, *body, 0.0)));
            }
        }
        if held.is_empty() {
            return Self::default();
        }
        let jaw = &rig.jaw.shapes;
        let mut shapes: Vec<u32> = patch.transfer.shapes.iter().map(|s| s.shape).collect();
        shapes.extend(
            [jaw.open, jaw.forward, jaw.left, jaw.right]
                .iter()
                .flatten(),
        );
        shapes.sort_unstable();
        shapes.dedup();
        let count = rig.shape_names.len();
        let mut weights = vec![0.0; count];
        let still = vec![0.0; count];
        let mut now = rest.clone();
        let mut velocities = vec![Vector3::zeros(); rest.len()];
        for shape in shapes {
            weights[shape as usize] = 1.0;
            let at = ShapeWeights {
                weights: &weights,
                rates: None,
            };
            let context = rig.transfer_context();
            patch
                .transfer
                .evaluate(&context, &rest, at, &mut now, &mut velocities);
            let mandible = Mandible::at(rig, &weights, &still);
            for (node, body, slide) in &mut held {
                let n = *node as usize;
                let (carried, _) = carry(*body, &mandible, &rest[n]);
                *slide = slide.max(f64::from((now[n] - carried).norm()));
            }
            weights[shape as usize] = 0.0;
        }
        let anchors = held
            .into_iter()
            .map(|(node, body, slide)| Anchor {
                node,
                bone: (is_bone(body) && slide < MOST_SLIDE).then_some(body),
                rest: rest[node as usize],
            })
            .collect();
        Self { anchors }
    }

    /// Where the nodes are held now, and how fast that moves.
    pub(super) fn place(&self, mandible: &Mandible, target: &PatchMotion, out: &mut PatchMotion) {
        out.positions.clear();
        out.velocities.clear();
        for anchor in &self.anchors {
            let node = anchor.node as usize;
            let (position, velocity) = match anchor.bone {
                Some(bone) => carry(bone, mandible, &anchor.rest),
                None => (target.positions[node], target.velocities[node]),
            };
            out.positions.push(position);
            out.velocities.push(velocity);
        }
    }

    /// How far each node is held from where its muscle shapes want it. (mm)
    pub(super) fn pulls(&self, target: &PatchMotion, held: &PatchMotion) -> Vec<Vector3<f32>> {
        let ends = self.anchors.iter().zip(&held.positions);
        ends.map(|(anchor, held)| held - target.positions[anchor.node as usize])
            .collect()
    }
}

fn is_bone(body: RigidBody) -> bool {
    matches!(body, RigidBody::Skull | RigidBody::Mandible)
}

/// Where a bone carries a node, and how fast; eyeballs carry none.
fn carry(body: RigidBody, mandible: &Mandible, rest: &Point3<f32>) -> (Point3<f32>, Vector3<f32>) {
    if body == RigidBody::Mandible {
        let (position, velocity) = mandible.carry(&rest.cast());
        (position.cast(), velocity.cast())
    } else {
        (*rest, Vector3::zeros())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::tests::coarse_rig;

    #[test]
    fn anchors_stay_on_bone_or_on_the_shapes_within_the_slide() {
        let rig = coarse_rig();
        let still = vec![0.0; rig.shape_names.len()];
        let mut weights = still.clone();
        weights[rig.shape_index("jawOpen").unwrap()] = 1.0;
        let at = ShapeWeights {
            weights: &weights,
            rates: None,
        };
        let mut targets = vec![(Vec::new(), Vec::new()); rig.patches.len()];
        rig.targets(at, &mut targets).unwrap();
        let mandible = Mandible::at(&rig, &weights, &still);
        let (mut rigid, mut sliding) = (0, 0);
        for (patch, (positions, velocities)) in rig.patches.iter().zip(targets) {
            let anchored = BoneAnchors::new(&rig, patch);
            let target = PatchMotion {
                positions,
                velocities,
            };
            let mut held = PatchMotion::default();
            anchored.place(&mandible, &target, &mut held);
            for (anchor, position) in anchored.anchors.iter().zip(&held.positions) {
                let wanted = target.positions[anchor.node as usize];
                let apart = f64::from((position - wanted).norm());
                match anchor.bone {
                    Some(_) => rigid += 1,
                    None => sliding += 1,
                }
                assert!(apart < MOST_SLIDE, "{apart} mm off the shape");
            }
        }
        assert!(rigid > 0 && sliding > 0, "{rigid} rigid, {sliding} sliding");
    }

    #[test]
    fn a_mandible_moves_as_fast_as_its_place_changes() {
        let rig = coarse_rig();
        let count = rig.shape_names.len();
        let (mut weights, mut rates) = (vec![0.0f32; count], vec![0.0f32; count]);
        for (name, weight, rate) in [("jawOpen", 0.4, 2.0), ("jawLeft", 0.3, -1.0)] {
            let shape = rig.shape_index(name).unwrap();
            (weights[shape], rates[shape]) = (weight, rate);
        }
        let p = Point::new(10.0, -80.0, 70.0);
        let (_, velocity) = Mandible::at(&rig, &weights, &rates).carry(&p);
        let h = 1e-3f32;
        let later: Vec<f32> = weights.iter().zip(&rates).map(|(w, r)| w + h * r).collect();
        let sooner: Vec<f32> = weights.iter().zip(&rates).map(|(w, r)| w - h * r).collect();
        let place = |w: &[f32]| Mandible::at(&rig, w, &rates).carry(&p).0;
        let numeric = (place(&later) - place(&sooner)) / f64::from(2.0 * h);
        assert!((numeric - velocity).norm() < 1e-2 * velocity.norm());
    }
}
