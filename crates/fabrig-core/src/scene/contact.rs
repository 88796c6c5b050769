//! Contact of a face: its patches, eyeballs and the colliders around it.

use nalgebra::Isometry3;

use crate::anatomy::{Attachment, PatchChart, PatchKind, Side};
use crate::cloth::ClothPatch;
use crate::collision::{
    Collider, ColliderFrame, CollisionError, Contact, ContactBody, ContactPatch, Verdict,
};
use crate::rig::Rig;
use crate::scene::Scene;
use crate::scene::bodies::Body;
use crate::scene::modelled::Modelled;
use crate::template::RigidBody;
use nalgebra::Point3;

/// Patches that come so near to a jaw at rest may meet it. (mm)
const JAW_REACH: f64 = 15.0;
/// Deeper nodes than this are covered no more: the tissue over them gives way. (mm)
const DEEPEST_COVER: f64 = 5.0;

/// Contact with the poses of what takes part in it.
pub(super) struct FaceContact {
    pub(super) contact: Contact,
    colliders: Vec<Collider>,
    /// Poses that code set, in each collider's frame.
    set_poses: Vec<Option<Isometry3<f64>>>,
    /// Poses now, in the head frame. (mm)
    poses: Vec<Isometry3<f64>>,
}

impl FaceContact {
    /// Contact as a scene asks for it; none where nothing could touch.
    ///
    /// - `patches`: those that are cloth, as `modelled` says
    pub(super) fn new(
        rig: &Rig,
        scene: &Scene,
        patches: &[ClothPatch],
        modelled: &Modelled,
        bodies: &[Body],
    ) -> Result<Option<Self>, CollisionError> {
        scene.contact.check()?;
        if !scene.has_contact() {
            return Ok(None);
        }
        let of_contact: Vec<ContactPatch> = modelled
            .patches()
            .iter()
            .map(|&patch| &rig.patches[patch])
            .zip(patches)
            .map(|(own, cloth)| {
                let chart = &own.patch.chart;
                let is_ring = chart.kind == PatchKind::Sphincter;
                ContactPatch {
                    shape: cloth.shape,
                    rest: cloth.rest.clone(),
                    cover: chart
                        .nodes
                        .iter()
                        .map(|n| n.depth.min(DEEPEST_COVER) as f32)
                        .collect(),
                    attached_to: chart
                        .attachments
                        .iter()
                        .filter_map(|a| match a {
                            Attachment::Patch { patch, .. } => modelled.cloth_of(*patch as usize),
                            Attachment::Body { .. } => None,
                        })
                        .collect(),
                    is_ring,
                    is_mouth: is_mouth_ring(chart),
                    node_mass: scene.cloth.areal_density * cloth.material.mass * cloth.area()
                        / cloth.rest.len() as f64,
                    bodies: (0..bodies.len())
                        .filter(|&b| may_meet(&bodies[b], chart, &cloth.rest))
                        .collect(),
                }
            })
            .collect();
        let of_bodies: Vec<ContactBody> = bodies
            .iter()
            .map(|body| ContactBody {
                surface: body.surface.clone(),
                // Both are wet.
                friction: scene.contact.eye_friction,
                rest: body.rest(),
            })
            .collect();
        let contact = Contact::new(&of_contact, &of_bodies, &scene.colliders, &scene.contact)?;
        Ok(Some(Self {
            contact,
            set_poses: vec![None; scene.colliders.len()],
            poses: vec![Isometry3::identity(); scene.colliders.len()],
            colliders: scene.colliders.clone(),
        }))
    }

    /// Says where everything is at the end of the next frame.
    ///
    /// - `bodies`: poses of the face's own [mm, head frame]
    pub(super) fn begin_frame(
        &mut self,
        time: f64,
        head: &Isometry3<f64>,
        bodies: &[Isometry3<f64>],
    ) {
        for ((pose, collider), set) in self
            .poses
            .iter_mut()
            .zip(&self.colliders)
            .zip(&self.set_poses)
        {
            let own = set.unwrap_or_else(|| collider.pose_at(time));
            *pose = match collider.frame {
                ColliderFrame::World => head.inverse() * own,
                ColliderFrame::Head => own,
            };
        }
        self.contact.begin_frame(bodies, &self.poses);
    }

    pub(super) fn set_pose(
        &mut self,
        index: usize,
        pose: Isometry3<f64>,
    ) -> Result<(), CollisionError> {
        let count = self.set_poses.len();
        let slot = self
            .set_poses
            .get_mut(index)
            .ok_or(CollisionError::NoSuchCollider { index, count })?;
        if !pose.translation.vector.iter().all(|c| c.abs() < 1e6) {
            return Err(CollisionError::Pose { index });
        }
        *slot = Some(pose);
        Ok(())
    }

    /// Poses of the colliders at the end of the last frame. [mm, head frame]
    pub(super) fn poses(&self) -> &[Isometry3<f64>] {
        &self.poses
    }

    pub(super) fn judge<'a>(
        &self,
        positions: impl Fn(usize) -> &'a [Point3<f32>],
    ) -> Result<Verdict, CollisionError> {
        let colliders: Vec<(&Collider, Isometry3<f64>)> = self
            .colliders
            .iter()
            .zip(self.poses.iter().copied())
            .collect();
        self.contact.judge(positions, &colliders)
    }
}

/// Whether a body holds a patch out: eyeballs the ring around them, jaws what lies over them.
fn may_meet(body: &Body, chart: &PatchChart, rest: &[Point3<f32>]) -> bool {
    let is_ring = chart.kind == PatchKind::Sphincter;
    match body.follows {
        RigidBody::EyeLeft => is_ring && chart.side == Side::Left,
        RigidBody::EyeRight => is_ring && chart.side == Side::Right,
        RigidBody::Skull | RigidBody::Mandible => {
            rest.iter().any(|node| body.distance(node) < JAW_REACH)
        }
    }
}

/// Whether a patch is the ring around the mouth.
pub(super) fn is_mouth_ring(chart: &PatchChart) -> bool {
    chart.kind == PatchKind::Sphincter && chart.side == Side::Mid
}
