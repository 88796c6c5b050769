//! Stepping a rig through a take.

mod drive;
mod thrift;

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::anatomy::Attachment;
use crate::cloth::bench::SceneFrame;
use crate::cloth::{
    Cloth, ClothAttachment, ClothPatch, FrameInput, HeadMotion, Materials, PatchMotion, StepReport,
};
use crate::collision::{CollisionError, ContactPoint, ContactReport, Verdict};
use crate::machine::among_workers;
use crate::motion::{Clip, EyeAngles, Sample};
use crate::rig::{NodeTargets, Rig};
use crate::scene::anchors::{BoneAnchors, Mandible};
use crate::scene::bodies::bodies;
use crate::scene::contact::FaceContact;
use crate::scene::economy::{EconomyReport, Thrift};
use crate::scene::fields::{Curve, Fields, HeadDrive};
use crate::scene::modelled::{Modelled, middle};
use crate::scene::skin_contact::{SkinContact, SkinContactReport};
use crate::scene::skin_sheet::SkinSheet;
use crate::scene::{Dynamics, EyeSource, Scene, SceneError};
use crate::skin::SkinDeformer;
use crate::template::RigidBody;
use crate::transfer::ShapeWeights;
use crate::{Point, Vector};

/// What drives a face at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct FacePose {
    /// Weight of each shape of the rig, in its order.
    pub weights: Vec<f32>,
    /// Rate of each weight. (1/s)
    pub rates: Vec<f32>,
    /// From the head frame to where the head has moved, before the scene places the face in its
    /// world. (mm)
    pub head: Isometry3<f64>,
    /// How the head frame moves.
    pub head_motion: HeadMotion,
    /// Where the eyes look, where the take says so.
    pub eyes: Option<[EyeAngles; 2]>,
    /// Velocity of the air relative to the head, in the axes that [`Self::head`] leads to.
    /// (mm/s)
    pub wind: Vector,
}

impl FacePose {
    /// The neutral face of a rig with `shape_count` shapes.
    pub fn neutral(shape_count: usize) -> Self {
        Self {
            weights: vec![0.0; shape_count],
            rates: vec![0.0; shape_count],
            head: Isometry3::identity(),
            head_motion: HeadMotion::default(),
            eyes: None,
            wind: Vector::zeros(),
        }
    }
}

/// What a frame took and did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// Time on the take's axis at the end of the frame. (s)
    pub time: f64,
    /// Evaluating the muscle shapes. (ms)
    pub targets_ms: f64,
    /// The cloth. (ms)
    pub cloth_ms: f64,
    /// The skin. (ms)
    pub skin_ms: f64,
    /// What the cloth reported; all zero without dynamics.
    pub step: StepReport,
    /// Root mean square distance of the nodes from their muscle shapes. (mm)
    pub settle_rms: f64,
    /// Largest of these distances. (mm)
    pub settle_max: f64,
    /// What contact did to the skin.
    pub skin_contact: SkinContactReport,
    /// What was left out.
    pub economy: EconomyReport,
}

/// Where a rigid piece of the face stands.
#[derive(Debug, Clone, PartialEq)]
pub struct PartPose {
    /// Index in [`Rig::parts`].
    pub part: usize,
    /// From rest to now. [mm, head frame]
    pub motion: Isometry3<f64>,
}

/// A rig on its way through time.
pub struct Simulation {
    rig: Arc<Rig>,
    scene: Scene,
    clip: Option<Clip>,
    /// For each shape of the rig the channel of the clip that drives it.
    channels: Vec<Option<usize>>,
    time: f64,
    pose: FacePose,
    sample: Sample,
    cloth: Option<Cloth>,
    modelled: Modelled,
    /// Decides what is left out; none where everything is modelled.
    thrift: Option<Thrift>,
    /// Patches that moved since the skin did.
    has_moved: Vec<bool>,
    /// How far each patch is from its muscle shapes: sum of squares and largest. (mm^2, mm)
    settled: Vec<[f64; 2]>,
    /// Whether the skin is as the last frame left it.
    has_skin: bool,
    skin_moved: usize,
    /// How far nodes may go before they move the skin. (mm)
    skin_slack: f32,
    fields: Fields,
    /// Where fields are felt, for the whole face. [mm, head frame]
    middle: Point,
    /// The head's keys, where it has any.
    head_keys: Option<Curve<6>>,
    /// From the head frame to the world, with where the face stands in it. (mm)
    world: Isometry3<f64>,
    contact: Option<FaceContact>,
    skin_contact: Option<SkinContact>,
    skin_report: SkinContactReport,
    /// What holds patches and skin out moves with these, and stands so at rest; none where nothing
    /// touches. [mm, head frame]
    bodies: Vec<(RigidBody, Isometry3<f64>)>,
    evaluated: Vec<NodeTargets>,
    targets: Vec<PatchMotion>,
    anchors: Vec<PatchMotion>,
    anchored: Vec<BoneAnchors>,
    skin_sheet: SkinSheet,
    deformer: SkinDeformer,
    skin: Vec<Point3<f32>>,
}

impl Simulation {
    /// Puts a rig into a scene, at the first frame of a clip (or neutral without one).
    ///
    /// # Errors
    ///
    /// [`SceneError`] where the rig's materials or sizes do not fit.
    pub fn new(rig: Arc<Rig>, scene: Scene, clip: Option<Clip>) -> Result<Self, SceneError> {
        if !scene.faces.is_empty() {
            return Err(SceneError::HasFaces {
                count: scene.faces.len(),
            });
        }
        scene.economy.check()?;
        let rig = scene.dressed(rig)?;
        let all = cloth_patches(&rig)?;
        let (modelled, patches) = Modelled::new(&rig, &scene, all.clone())?;
        let names: Vec<&str> = rig.shape_names.iter().map(String::as_str).collect();
        let channels = clip
            .as_ref()
            .map_or_else(|| vec![None; names.len()], |c| c.channel_indices(&names));
        let anchored: Vec<BoneAnchors> = rig
            .patches
            .iter()
            .map(|patch| BoneAnchors::new(&rig, patch))
            .collect();
        let cloth = match scene.dynamics {
            Dynamics::Cloth => Some(Cloth::new(&patches, &scene.cloth)?),
            Dynamics::None => None,
        };
        let bodies = if scene.has_contact() && scene.contact.bones {
            bodies(&rig)
        } else {
            Vec::new()
        };
        let mut contact = FaceContact::new(&rig, &scene, &patches, &modelled, &bodies)?;
        let skin_sheet = SkinSheet::new(&rig, &scene, &modelled);
        let skin = rig.skin_at_rest();
        let skin_contact = SkinContact::new(&rig, &scene, &bodies, &skin)?;
        if let (Some(of_cloth), Some(of_skin)) = (&mut contact, &skin_contact) {
            of_cloth.contact.set_lips(of_skin.sticky_lips());
        }
        let mut deformer = SkinDeformer::new(&rig.binding, rig.neutral_nodes(), skin.clone())?;
        for (patch, nodes) in rig.variations.iter().enumerate() {
            // Skin folds where lengths stay.
            let is_folding: Vec<bool> = nodes.iter().map(|node| node.rest_blend < 1.0).collect();
            deformer = deformer.turning_across(patch, &is_folding);
        }
        for part in &rig.parts {
            deformer.move_always(&part.vertices);
        }
        let is_thrifty =
            cloth.is_some() && contact.is_none() && scene.economy.tolerance.on(&rig) > 0.0;
        let cloth_of = (0..all.len()).map(|p| modelled.cloth_of(p)).collect();
        let thrift = is_thrifty
            .then(|| Thrift::new(&rig, &all, cloth_of, &anchored, scene.economy, &scene.cloth))
            .transpose()?;
        let count = rig.patches.len();
        let time = clip.as_ref().map_or(0.0, |c| c.times()[0]);
        let head_keys = match &scene.head_motion {
            HeadDrive::Keyed(keys) => Some(keys.curve()),
            HeadDrive::Take(_) => None,
        };
        let mut simulation = Self {
            pose: FacePose::neutral(rig.shape_names.len()),
            modelled,
            has_moved: vec![true; count],
            settled: vec![[0.0; 2]; count],
            has_skin: false,
            skin_moved: 0,
            skin_slack: thrift.as_ref().map_or(0.0, Thrift::skin_slack),
            thrift,
            fields: Fields::new(&scene),
            middle: middle(&rig),
            head_keys,
            world: Isometry3::identity(),
            rig,
            scene,
            clip,
            channels,
            time,
            sample: Sample::default(),
            cloth,
            contact,
            skin_contact,
            skin_report: SkinContactReport::default(),
            bodies: bodies.iter().map(|b| (b.follows, b.rest())).collect(),
            evaluated: vec![(Vec::new(), Vec::new()); count],
            targets: vec![PatchMotion::default(); count],
            anchors: vec![PatchMotion::default(); count],
            anchored,
            skin_sheet,
            deformer,
            skin,
        };
        let start = simulation.pose_at(time);
        simulation.reset(start)?;
        Ok(simulation)
    }

    /// Puts the face into a pose at once: patches on their muscle shapes, moving as they do.
    ///
    /// # Errors
    ///
    /// [`SceneError`] where weights do not fit the rig.
    pub fn reset(&mut self, pose: FacePose) -> Result<(), SceneError> {
        self.forget_frames();
        self.evaluate(pose)?;
        self.begin_contact(self.time);
        let (targets, anchors) = self.modelled.gather(&self.targets, &self.anchors);
        match (&mut self.cloth, &mut self.contact) {
            (Some(cloth), Some(c)) => cloth.reset_with(targets, anchors, &mut c.contact)?,
            (Some(cloth), None) => cloth.reset(targets, anchors)?,
            (None, _) => {}
        }
        self.move_skin()
    }

    /// Takes a pose at a time without moving anything: only the muscle shapes are evaluated.
    pub(super) fn pose_to(&mut self, pose: FacePose, time: f64) -> Result<(), SceneError> {
        self.time = time;
        self.forget_frames();
        self.evaluate(pose)
    }

    /// Nothing is known of frames before.
    fn forget_frames(&mut self) {
        if let Some(thrift) = &mut self.thrift {
            thrift.reset(&self.scene.cloth);
        }
        self.has_skin = false;
        self.settled.fill([0.0; 2]);
    }

    /// Goes `dt` seconds on along the clip.
    ///
    /// # Errors
    ///
    /// [`SceneError`] for a time step that is not positive; the face is then unchanged.
    pub fn advance(&mut self, dt: f64) -> Result<FrameReport, SceneError> {
        check_dt(dt)?;
        among_workers(|| {
            self.look_ahead(dt);
            let pose = self.pose_at(self.time + dt);
            self.take_frame(pose, dt)
        })
    }

    /// Goes `dt` seconds on to a pose that the caller gives: for live input.
    ///
    /// # Errors
    ///
    /// [`SceneError`] for a time step that is not positive or weights that do not fit the
    /// rig; the face is then unchanged.
    pub fn advance_to(&mut self, pose: FacePose, dt: f64) -> Result<FrameReport, SceneError> {
        check_dt(dt)?;
        if let Some(thrift) = &mut self.thrift {
            thrift.forget_ahead();
        }
        among_workers(|| self.take_frame(pose, dt))
    }

    fn take_frame(&mut self, pose: FacePose, dt: f64) -> Result<FrameReport, SceneError> {
        let mut report = FrameReport::default();
        let clock = Instant::now();
        self.evaluate(pose)?;
        report.targets_ms = milliseconds(clock);

        let clock = Instant::now();
        self.begin_contact(self.time + dt);
        let gravity = self.acceleration(self.time + dt);
        let to_head = self.pose.head.rotation.inverse();
        let plan = self.plan(dt, gravity);
        let (targets, anchors) = self.modelled.gather(&self.targets, &self.anchors);
        if let Some(cloth) = &mut self.cloth {
            let input = FrameInput {
                dt,
                targets,
                anchors,
                gravity: Some(gravity.cast()),
                wind: (to_head * self.pose.wind).cast(),
                head: self.pose.head_motion,
                substeps: plan.substeps,
                held: &plan.held,
            };
            report.step = match &mut self.contact {
                Some(c) => cloth.step_with(&input, &mut c.contact)?,
                None => cloth.step(&input)?,
            };
        }
        self.learn(dt);
        report.cloth_ms = milliseconds(clock);

        let clock = Instant::now();
        self.has_skin &= !plan.is_whole;
        self.move_skin()?;
        report.skin_ms = milliseconds(clock);
        report.economy = self.economy_report(dt, &plan, &report.step);
        report.skin_contact = self.skin_report;

        self.time += dt;
        report.time = self.time;
        for patch in (0..self.settled.len()).filter(|&p| self.has_moved[p]) {
            self.settled[patch] = self.settled_now(patch);
        }
        (report.settle_rms, report.settle_max) = self.settle_of(self.settled.iter().copied());
        Ok(report)
    }

    /// What the cloth is told of the frame of `dt` seconds that led to the present pose, on its
    /// own: for running the solver without the face.
    pub fn cloth_frame(&self, dt: f64) -> SceneFrame {
        let to_head = self.pose.head.rotation.inverse();
        SceneFrame {
            dt,
            targets: self.targets.clone(),
            anchors: self.anchors.clone(),
            gravity: Some(self.acceleration(self.time).cast()),
            wind: (to_head * self.pose.wind).cast(),
            head: self.pose.head_motion,
        }
    }

    /// What contact did in the last frame; none where nothing could touch.
    pub fn contact_report(&self) -> Option<&ContactReport> {
        self.contact.as_ref().map(|c| c.contact.report())
    }

    /// What contact did to the skin when it was last moved.
    pub fn skin_contact_report(&self) -> &SkinContactReport {
        &self.skin_report
    }

    /// Where things touched at the end of the last frame.
    pub fn contact_points(&self) -> &[ContactPoint] {
        self.contact.as_ref().map_or(&[], |c| c.contact.points())
    }

    /// Where the scene's colliders are. [mm, head frame]
    pub fn collider_poses(&self) -> &[Isometry3<f64>] {
        self.contact.as_ref().map_or(&[], |c| c.poses())
    }

    /// Puts a collider somewhere for the end of the next frame, in place of its keys.
    ///
    /// - `pose`: in the collider's own frame (mm)
    ///
    /// # Errors
    ///
    /// [`CollisionError`] where there is no such collider, or the pose is not a place.
    pub fn set_collider_pose(
        &mut self,
        index: usize,
        pose: Isometry3<f64>,
    ) -> Result<(), CollisionError> {
        match &mut self.contact {
            Some(c) => c.set_pose(index, pose),
            None => Err(CollisionError::NoSuchCollider { index, count: 0 }),
        }
    }

    /// Tests exactly what crosses what may not, independently of how contact is solved; none
    /// where nothing could touch.
    ///
    /// # Errors
    ///
    /// [`CollisionError`] for a collider that cannot be.
    pub fn judge_contact(&self) -> Result<Option<Verdict>, CollisionError> {
        self.contact
            .as_ref()
            .map(|c| c.judge(|patch| self.patch_positions(self.modelled.patches()[patch])))
            .transpose()
    }

    /// How many patches are cloth.
    pub fn simulated_patches(&self) -> usize {
        match self.cloth {
            Some(_) => self.modelled.patches().len(),
            None => 0,
        }
    }

    /// By how much a frame may differ from the full model's; 0 where everything is modelled.
    /// (mm)
    pub fn tolerance(&self) -> f64 {
        self.thrift.as_ref().map_or(0.0, Thrift::tolerance)
    }

    /// The rig.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Time on the clip's axis. (s)
    pub fn time(&self) -> f64 {
        self.time
    }

    /// What drives the face now.
    pub fn pose(&self) -> &FacePose {
        &self.pose
    }

    /// The user's mesh now, in its vertex order, before the head's own motion.
    /// [mm, head frame]
    pub fn skin(&self) -> &[Point3<f32>] {
        &self.skin
    }

    /// The user's mesh at rest. [mm, head frame]
    pub fn rest_skin(&self) -> &[Point3<f32>] {
        self.deformer.rest()
    }

    /// The user's mesh now, in its own units and place; bit for bit as it was where nothing
    /// moves it.
    pub fn skin_in_own_units(&self) -> Vec<Point> {
        let to_own = self.rig.to_head.inverse();
        self.rig
            .face
            .positions()
            .iter()
            .zip(&self.skin)
            .zip(self.deformer.rest())
            .map(|((own, now), rest)| own + to_own * (now - rest).cast::<f64>())
            .collect()
    }

    /// From the head frame to the world: the pose's, and where the face stands. (mm)
    pub fn head(&self) -> &Isometry3<f64> {
        &self.world
    }

    /// Nodes of a patch now. [mm, head frame]
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn patch_positions(&self, patch: usize) -> &[Point3<f32>] {
        positions_of(patch, self.cloth.as_ref(), &self.modelled, &self.targets)
    }

    /// Where the muscle shapes want the nodes of a patch now. [mm, head frame]
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn patch_targets(&self, patch: usize) -> &[Point3<f32>] {
        &self.targets[patch].positions
    }

    /// Where a rigid body stands against rest. [mm, head frame]
    pub fn body(&self, body: RigidBody) -> Isometry3<f64> {
        match body {
            RigidBody::Skull => Isometry3::identity(),
            RigidBody::Mandible => {
                let hinge = &self.rig.jaw.hinge;
                let pose = self.rig.jaw_pose(&self.pose.weights);
                let axis = nalgebra::Unit::new_normalize(hinge.axis);
                let turn = UnitQuaternion::from_axis_angle(&axis, pose.angle);
                about(&hinge.center, turn, pose.slide)
            }
            RigidBody::EyeLeft => self.eye(0),
            RigidBody::EyeRight => self.eye(1),
        }
    }

    /// Where the rigid pieces of the user's mesh stand.
    pub fn parts(&self) -> Vec<PartPose> {
        self.rig
            .parts
            .iter()
            .enumerate()
            .map(|(part, piece)| PartPose {
                part,
                motion: self.body(piece.follows),
            })
            .collect()
    }

    /// Root mean square and largest distance of the nodes from their muscle shapes. (mm)
    pub fn settle_error(&self) -> (f64, f64) {
        self.settle_of((0..self.targets.len()).map(|patch| self.settled_now(patch)))
    }

    /// Sum of squares and largest distance of a patch's nodes from its muscle shapes. (mm^2, mm)
    fn settled_now(&self, patch: usize) -> [f64; 2] {
        let wanted = &self.targets[patch].positions;
        let pairs = self.patch_positions(patch).iter().zip(wanted);
        let (sum, largest) = pairs.fold((0.0f64, 0.0f32), |(sum, largest), (now, wanted)| {
            let squared = (now - wanted).norm_squared();
            (sum + f64::from(squared), largest.max(squared))
        });
        [sum, f64::from(largest).sqrt()]
    }

    /// Root mean square and largest of what patches are.
    fn settle_of(&self, patches: impl Iterator<Item = [f64; 2]>) -> (f64, f64) {
        let count: usize = self.targets.iter().map(|t| t.positions.len()).sum();
        let (sum, largest) = patches.fold((0.0, 0.0f64), |(sum, largest), [squares, most]| {
            (sum + squares, largest.max(most))
        });
        ((sum / count.max(1) as f64).sqrt(), largest)
    }

    /// Evaluates Eq. 3 at a pose and takes the pose.
    fn evaluate(&mut self, pose: FacePose) -> Result<(), SceneError> {
        let at = ShapeWeights {
            weights: &pose.weights,
            rates: Some(&pose.rates),
        };
        match &mut self.thrift {
            Some(thrift) => {
                let moving = thrift.moving(&pose);
                self.has_moved.copy_from_slice(moving);
                self.rig
                    .targets_of(at, |patch| moving[patch], &mut self.evaluated)?;
            }
            None => {
                self.has_moved.fill(true);
                self.rig.targets(at, &mut self.evaluated)?;
            }
        }
        self.world = self.world_of(&pose);
        self.pose = pose;
        let evaluated = self.targets.iter_mut().zip(&mut self.evaluated);
        for ((target, (positions, velocities)), &moves) in evaluated.zip(&self.has_moved) {
            if moves {
                std::mem::swap(&mut target.positions, positions);
                std::mem::swap(&mut target.velocities, velocities);
            } else {
                target.velocities.fill(Vector3::zeros());
            }
        }
        let mandible = Mandible::at(&self.rig, &self.pose.weights, &self.pose.rates);
        let held = self.anchored.iter().zip(&self.targets);
        let held = held.zip(&mut self.anchors).zip(&self.has_moved);
        for (((anchored, target), anchors), &moves) in held {
            if moves {
                anchored.place(&mandible, target, anchors);
            } else {
                anchors.velocities.fill(Vector3::zeros());
            }
        }
        Ok(())
    }

    fn begin_contact(&mut self, time: f64) {
        let bodies = self.body_poses();
        if let Some(contact) = &mut self.contact {
            contact.begin_frame(time, &self.world, &bodies);
        }
    }

    /// Where the bodies stand that hold patches and skin out. [mm, head frame]
    fn body_poses(&self) -> Vec<Isometry3<f64>> {
        let bodies = self.bodies.iter();
        bodies.map(|(body, rest)| self.body(*body) * rest).collect()
    }

    fn move_skin(&mut self) -> Result<(), SceneError> {
        let nodes: Vec<&[Point3<f32>]> = (0..self.targets.len())
            .map(|p| positions_of(p, self.cloth.as_ref(), &self.modelled, &self.targets))
            .collect();
        let mandible = self.rig.mandible(&self.pose.weights);
        let is_again = self.has_skin && self.scene.economy.skin && self.skin_contact.is_none();
        let has_moved = |patch: usize| !is_again || self.has_moved[patch];
        let nodes = self.skin_sheet.take(&nodes, &self.targets, has_moved);
        if is_again {
            self.skin_moved = self.deformer.deform_again(
                &self.rig.binding,
                &nodes,
                mandible,
                |patch| self.has_moved[patch],
                self.skin_slack,
                &mut self.skin,
            )?;
        } else {
            self.deformer
                .deform(&self.rig.binding, &nodes, mandible, &mut self.skin)?;
            self.skin_moved = self.skin.len();
        }
        self.has_skin = true;
        let bodies = self.body_poses();
        if let Some(contact) = &mut self.skin_contact {
            let colliders = self.contact.as_ref().map_or(&[][..], |c| c.poses());
            self.skin_report = contact.settle(&mut self.skin, colliders, &bodies);
            if let Some(of_cloth) = &mut self.contact {
                of_cloth.contact.set_touching(contact.touching(&self.skin));
            }
        }
        for part in self.parts() {
            let piece = &self.rig.parts[part.part];
            let weight = |shape: u32| self.pose.weights[shape as usize];
            for shape in piece.shapes.iter().filter(|s| weight(s.shape) != 0.0) {
                for (&vertex, delta) in piece.vertices.iter().zip(&shape.deltas) {
                    self.skin[vertex as usize] += delta * weight(shape.shape);
                }
            }
            if part.motion == Isometry3::identity() {
                continue;
            }
            let motion = part.motion.cast::<f32>();
            for &vertex in &piece.vertices {
                let v = vertex as usize;
                self.skin[v] = motion * self.skin[v];
            }
        }
        Ok(())
    }

    fn eye(&self, eye: usize) -> Isometry3<f64> {
        let tracked = match self.scene.eyes {
            EyeSource::Tracked => self.pose.eyes.map(|eyes| eyes[eye]),
            EyeSource::Shapes => None,
        };
        let socket = &self.rig.eyes[eye];
        let angles = tracked.unwrap_or_else(|| {
            let weight = |k: usize| {
                let shape = self.rig.eye_shapes[eye].look[k];
                shape.map_or(0.0, |s| f64::from(self.pose.weights[s as usize]))
            };
            let [up, down, inward, outward] =
                std::array::from_fn(|k| weight(k) * socket.look_angles[k]);
            // Outwards is to the character's left for the left eye.
            let outwards = if eye == 0 { 1.0 } else { -1.0 };
            EyeAngles {
                yaw: outwards * (outward - inward),
                pitch: down - up,
            }
        });
        let turn = UnitQuaternion::from_axis_angle(&Vector::y_axis(), angles.yaw)
            * UnitQuaternion::from_axis_angle(&Vector::x_axis(), angles.pitch);
        about(&socket.center, turn, Vector::zeros())
    }
}

fn about(center: &Point, turn: UnitQuaternion<f64>, slide: Vector) -> Isometry3<f64> {
    let shift = center.coords - turn * center.coords + slide;
    Isometry3::from_parts(Translation3::from(shift), turn)
}

/// The patches of a rig as the cloth takes them.
///
/// # Errors
///
/// [`SceneError`] where the rig's materials cannot be read or lack one that a patch names.
pub fn cloth_patches(rig: &Rig) -> Result<Vec<ClothPatch>, SceneError> {
    let materials = Materials::parse(&rig.materials)?;
    rig.patches
        .iter()
        .enumerate()
        .map(|(index, patch)| {
            let chart = &patch.patch.chart;
            Ok(ClothPatch {
                shape: chart.grid,
                rest: patch.patch.neutral.iter().map(|q| q.cast()).collect(),
                material: *materials.get(&chart.material)?,
                attachments: chart.attachments.iter().map(to_cloth_attachment).collect(),
                variations: rig.variations.get(index).cloned().unwrap_or_default(),
            })
        })
        .collect()
}

/// Where the nodes of a patch are: its cloth's, or where its muscle shapes want them.
fn positions_of<'a>(
    patch: usize,
    cloth: Option<&'a Cloth>,
    modelled: &Modelled,
    targets: &'a [PatchMotion],
) -> &'a [Point3<f32>] {
    match (cloth, modelled.cloth_of(patch)) {
        (Some(cloth), Some(own)) => cloth.positions(own),
        _ => &targets[patch].positions,
    }
}

fn to_cloth_attachment(attachment: &Attachment) -> ClothAttachment {
    match attachment {
        Attachment::Body {
            nodes, strength, ..
        } => ClothAttachment::Anchors {
            nodes: nodes.clone(),
            strength: *strength,
        },
        Attachment::Patch {
            patch,
            pairs,
            strength,
        } => ClothAttachment::Patch {
            patch: *patch,
            pairs: pairs.clone(),
            strength: *strength,
        },
    }
}

fn check_dt(dt: f64) -> Result<(), SceneError> {
    if dt > 0.0 && dt.is_finite() {
        Ok(())
    } else {
        Err(SceneError::TimeStep { dt })
    }
}

fn milliseconds(clock: Instant) -> f64 {
    clock.elapsed().as_secs_f64() * 1e3
}
