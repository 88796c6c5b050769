//! What a frame is spared, as [`crate::scene::economy`] decides, and what it was spared.

use super::Simulation;
use crate::Vector;
use crate::cloth::StepReport;
use crate::scene::economy::{ActingFields, EconomyReport, Omen, Plan, Present};

impl Simulation {
    /// Does something during which everything is modelled, whatever the scene's economy.
    pub(in crate::scene) fn without_economy<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> T {
        let thrift = self.thrift.take();
        let slack = std::mem::take(&mut self.skin_slack);
        let done = act(self);
        self.thrift = thrift;
        self.skin_slack = slack;
        self.forget_frames();
        done
    }

    /// Lets thrift see what the take does after the frame of `dt` seconds that comes.
    pub(super) fn look_ahead(&mut self, dt: f64) {
        let Some(mut thrift) = self.thrift.take() else {
            return;
        };
        let start = self.time;
        while let Some(time) = thrift.looks_ahead(start, &self.pose.rates, dt) {
            let pose = self.pose_at(time);
            let gravity = self.acceleration_in(&self.world_of(&pose), time);
            let wind = pose.head.rotation.inverse() * pose.wind;
            let head = &pose.head_motion;
            let fields = ActingFields::new(gravity, wind, head, &self.scene.cloth);
            let omen = Omen {
                rates: &pose.rates,
                acceleration: fields.at(&self.middle.coords, head),
                air: fields.air(),
            };
            thrift.see([start, time], &omen, dt);
        }
        self.thrift = Some(thrift);
    }

    /// Decides what the frame is spared that leads to the present pose.
    ///
    /// - `gravity`: and all that accelerates the face from outside [mm/s^2, head frame]
    pub(super) fn plan(&mut self, dt: f64, gravity: Vector) -> Plan {
        let (Some(mut thrift), Some(cloth)) = (self.thrift.take(), &self.cloth) else {
            return Plan::default();
        };
        let wind = self.pose.head.rotation.inverse() * self.pose.wind;
        let options = &self.scene.cloth;
        let anchored = self.anchored.iter().zip(&self.targets).zip(&self.anchors);
        let pulls: Vec<_> = anchored
            .map(|((anchored, target), held)| anchored.pulls(target, held))
            .collect();
        let present = Present {
            dt,
            full: options.substeps,
            fields: ActingFields::new(gravity, wind, &self.pose.head_motion, options),
            targets: &self.targets,
            before: &self.evaluated,
            moved: &self.has_moved,
            pulls: &pulls,
            nodes: &|patch| self.patch_positions(patch),
        };
        let plan = thrift.plan(&present, |held| cloth.sleepers(held));
        self.thrift = Some(thrift);
        plan
    }

    /// Learns how the frame went.
    pub(super) fn learn(&mut self, dt: f64) {
        let (Some(thrift), Some(cloth)) = (&mut self.thrift, &self.cloth) else {
            return;
        };
        thrift.learn(dt, |own| cloth.patch_energies(own));
        for (patch, has_moved) in self.has_moved.iter_mut().enumerate() {
            *has_moved |= thrift.is_awake(patch);
        }
    }

    pub(super) fn economy_report(&self, dt: f64, plan: &Plan, step: &StepReport) -> EconomyReport {
        let Some(cloth) = &self.cloth else {
            return EconomyReport::default();
        };
        let full = cloth.substep_count(dt, None);
        let still = self
            .thrift
            .as_ref()
            .map_or(0, |thrift| thrift.still_count());
        EconomyReport {
            is_whole: step.sleeping_patches == 0
                && step.substeps == full
                && still == 0
                && self.skin_moved == self.skin.len(),
            patches: cloth.patch_count() as u32,
            sleeping: step.sleeping_patches,
            still,
            substeps: step.substeps,
            full_substeps: full,
            skin_vertices: self.skin.len() as u32,
            skin_moved: self.skin_moved as u32,
            estimate: plan.estimate,
            bound: plan.bound,
            is_storm: plan.is_storm,
        }
    }
}
