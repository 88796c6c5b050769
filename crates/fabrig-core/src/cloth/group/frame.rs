//! The ends of a frame: targets and anchors in, energies out.

use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, bend_energy};
use crate::cloth::constraints::pressure::swept_volume;
use crate::cloth::constraints::shear::shear_energy;
use crate::cloth::constraints::stretch::stretch_energy;
use crate::cloth::input::PatchMotion;
use crate::cloth::lanes::Real;

impl<R: Real> Group<R> {
    /// Patch of a lane; lanes to spare repeat the last one.
    pub(super) fn patch_of(&self, lane: usize) -> usize {
        self.patches[lane.min(self.patches.len() - 1)]
    }

    /// Loads target ends into the lanes. Straight motion is marked by lane.
    #[inline(always)]
    pub(super) fn load_ends_lanes(&mut self, dt: f64, targets: &[PatchMotion]) {
        let motions: Vec<&PatchMotion> = (0..R::LANES)
            .map(|lane| &targets[self.patch_of(lane)])
            .collect();
        for (lane, motion) in motions.iter().enumerate() {
            for (end, p) in self.ends.iter_mut().zip(&motion.positions) {
                end.x.load_lane(lane, p.x);
                end.y.load_lane(lane, p.y);
                end.z.load_lane(lane, p.z);
            }
        }
        for end in &mut self.ends {
            *end -= self.origin;
        }
        let has_velocity = |lane: usize| !motions[lane].velocities.is_empty();
        for (lane, motion) in motions.iter().enumerate() {
            for (slope, v) in self.end_slopes.iter_mut().zip(&motion.velocities) {
                slope.x.load_lane(lane, v.x);
                slope.y.load_lane(lane, v.y);
                slope.z.load_lane(lane, v.z);
            }
        }
        let step = R::splat(dt);
        for slope in &mut self.end_slopes {
            *slope = *slope * step;
        }
        for lane in (0..R::LANES).filter(|&lane| !has_velocity(lane)) {
            for (i, slope) in self.end_slopes.iter_mut().enumerate() {
                let (a, b) = (self.starts[i].lane(lane), self.ends[i].lane(lane));
                slope.set_lane(lane, [0, 1, 2].map(|axis| b[axis] - a[axis]));
            }
        }
        for lane in 0..R::LANES {
            self.lane_states[lane].has_velocity = has_velocity(lane);
        }
        for (kept, motion) in self.end_positions.iter_mut().zip(&motions) {
            kept.copy_from_slice(&motion.positions);
        }
    }

    #[inline(always)]
    pub(super) fn begin_frame_lanes(&mut self, dt: f64) {
        let inv_dt = R::splat(1.0 / dt);
        let (two, four, six) = (R::splat(2.0), R::splat(4.0), R::splat(6.0));
        let inv_dt2 = inv_dt * inv_dt;
        let (mut jerk, mut jump) = (R::splat(0.0), R::splat(0.0));
        for i in 0..self.ends.len() {
            let chord = self.ends[i] - self.starts[i];
            let (a, b) = (self.start_slopes[i], self.end_slopes[i]);
            self.chords[i] = chord;
            let first = (chord * six - a * four - b * two) * inv_dt2;
            let last = (a * two + b * four - chord * six) * inv_dt2;
            jerk += first.dot(first).max(last.dot(last));
            let kick = a * inv_dt - self.end_velocities[i];
            jump += kick.dot(kick);
            self.end_velocities[i] = b * inv_dt;
        }
        let half_mass = (R::splat(0.5) * self.mass).sqrt();
        self.drive = half_mass * (jerk.sqrt() * R::splat(dt) + jump.sqrt());
        let stretch = self.edge_lengths.begin_frame(&self.lists.edges, &self.ends);
        let shear = self
            .diagonal_lengths
            .begin_frame(&self.lists.diagonals, &self.ends);
        let k = self.stretch[0].max(self.stretch[1]);
        self.mismatch = R::splat(0.5) * (k * stretch + self.shear * shear);
    }

    /// Energies of all lanes at the end of the frame.
    #[inline(always)]
    pub(super) fn energy_lanes(&mut self) -> [R; 9] {
        let half = R::splat(0.5);
        let (mut kinetic, mut magnet) = (R::splat(0.0), R::splat(0.0));
        for i in 0..self.displacements.len() {
            let u = self.displacements[i];
            let v = self.velocities[i] - self.end_velocities[i];
            kinetic += v.dot(v);
            magnet += u.dot(u);
            self.solution[i] = self.ends[i] + u;
        }
        let one = R::splat(1.0);
        let x = &self.solution;
        let [stretch, compression] = stretch_energy(
            &self.lists.edges,
            x,
            (&self.edge_lengths, one),
            self.stretch,
        );
        let shear = shear_energy(
            &self.lists.diagonals,
            x,
            (&self.diagonal_lengths, one),
            self.shear,
        );
        let bend = BendCompliance {
            compliance: one,
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        let bend = bend_energy(
            &self.lists.triples,
            &self.displacements,
            self.bend,
            &bend,
            &self.bend_softness,
        );
        let mut pressure = R::splat(0.0);
        if self.has_pressure {
            let volume = swept_volume(
                &self.lists.cells,
                &self.ends,
                &self.displacements,
                &mut self.gradient,
            );
            pressure = half * self.pressure * volume * volume;
        }
        self.squared_distance = magnet;
        let [anchors, held_off] = self.anchor_energies();
        [
            half * self.mass * kinetic,
            half * self.magnet.stiffness * magnet,
            stretch,
            compression,
            shear,
            bend,
            pressure,
            anchors,
            held_off,
        ]
    }

    pub(super) fn clear_lane(&mut self, lane: usize) {
        for i in 0..self.displacements.len() {
            let velocity = self.end_velocities[i].lane(lane);
            self.displacements[i].set_lane(lane, [0.0; 3]);
            self.previous_displacements[i].set_lane(lane, [0.0; 3]);
            self.velocities[i].set_lane(lane, velocity);
            self.previous_velocities[i].set_lane(lane, velocity);
            self.target_steps[i].set_lane(lane, [0.0; 3]);
        }
        self.lane_states[lane].has_history = false;
    }
}
