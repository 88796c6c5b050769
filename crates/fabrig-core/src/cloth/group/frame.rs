//! The ends of a frame: targets and anchors in, energies out.

use nalgebra::Vector3;

use super::state::Group;
use crate::cloth::constraints::bend::{BendCompliance, bend_energy};
use crate::cloth::constraints::pressure::{PadFaces, pad_volume};
use crate::cloth::constraints::shear::shear_energy;
use crate::cloth::constraints::stretch::stretch_energy;
use crate::cloth::input::PatchMotion;
use crate::machine::{Real, Vec3};

impl<R: Real> Group<R> {
    /// Patch of a lane; lanes to spare repeat the last one.
    pub(super) fn patch_of(&self, lane: usize) -> usize {
        self.patches[lane.min(self.patches.len() - 1)]
    }

    /// Loads target ends into the lanes. Straight motion is marked by lane.
    ///
    /// Where a frame starts after straight motion, nothing is known about the velocity there, so
    /// that the chord is its slope too.
    #[inline(always)]
    pub(super) fn load_ends_lanes(&mut self, dt: f64, targets: &[PatchMotion]) {
        let motions: Vec<&PatchMotion> = (0..R::LANES)
            .map(|lane| &targets[self.patch_of(lane)])
            .collect();
        let origin = self.origin;
        let positions = motions.iter().map(|m| m.positions.as_slice());
        interleave(&mut self.ends, positions, |p| &p.coords, |end| end - origin);
        let has_velocity = |lane: usize| !motions[lane].velocities.is_empty();
        let step = R::splat(dt);
        let velocities = motions.iter().map(|m| m.velocities.as_slice());
        interleave(
            &mut self.end_slopes,
            velocities,
            |v| v,
            |slope| slope * step,
        );
        let (targets, ends) = (&self.targets, &self.ends);
        straighten(&mut self.end_slopes, targets, ends, has_velocity);
        let states = &self.lane_states;
        straighten(&mut self.start_slopes, targets, ends, |lane| {
            states[lane].has_velocity
        });
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
            let chord = self.ends[i] - self.targets[i];
            let (a, b) = (self.start_slopes[i], self.end_slopes[i]);
            self.chords[i] = chord;
            let first = (chord * six - a * four - b * two) * inv_dt2;
            let last = (a * two + b * four - chord * six) * inv_dt2;
            jerk += first.dot(first).max(last.dot(last));
            let kick = a * inv_dt - self.end_velocities[i];
            jump += kick.dot(kick);
            self.end_velocities[i] = b * inv_dt;
        }
        if self.has_pressure {
            let cells = &self.lists.cells;
            self.floor
                .begin_frame(cells, &self.ends, &mut self.gradient);
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
            let faces = PadFaces {
                cells: &self.lists.cells,
                targets: &self.ends,
                heights: &self.floor.heights,
            };
            let volume = pad_volume(&faces, &self.displacements, &mut self.gradient);
            let gained = volume - self.floor.rest;
            pressure = half * self.pressure * gained * gained;
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

    /// Lets nodes keep their displacement through a frame and move as their targets do.
    pub(super) fn follow_targets(&mut self) {
        self.velocities.copy_from_slice(&self.end_velocities);
        self.previous_velocities
            .copy_from_slice(&self.end_velocities);
        self.target_steps.fill(Vec3::zero());
        self.previous_displacements
            .copy_from_slice(&self.displacements);
        for state in &mut self.lane_states {
            state.has_history = false;
        }
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

/// Makes chords the slopes of those lanes whose velocity is not known.
#[inline(always)]
fn straighten<R: Real>(
    slopes: &mut [Vec3<R>],
    starts: &[Vec3<R>],
    ends: &[Vec3<R>],
    is_known: impl Fn(usize) -> bool,
) {
    let chords = starts.iter().zip(ends).map(|(a, b)| *b - *a);
    let unknown: Vec<usize> = (0..R::LANES).filter(|&lane| !is_known(lane)).collect();
    if unknown.len() == R::LANES {
        for (slope, chord) in slopes.iter_mut().zip(chords) {
            *slope = chord;
        }
    } else if !unknown.is_empty() {
        for (slope, chord) in slopes.iter_mut().zip(chords) {
            for &lane in &unknown {
                slope.set_lane(lane, chord.lane(lane));
            }
        }
    }
}

/// Nodes that are interleaved at once, so that they stay in the nearest cache.
const TILE: usize = 32;

/// Loads one list of vectors into each lane, and then does something to all lanes. Lanes whose
/// list is empty keep what they have.
#[inline(always)]
fn interleave<'a, R: Real, T: 'a>(
    nodes: &mut [Vec3<R>],
    lanes: impl Iterator<Item = &'a [T]> + Clone,
    vector: impl Fn(&T) -> &Vector3<f32>,
    finish: impl Fn(Vec3<R>) -> Vec3<R>,
) {
    for (tile, nodes) in nodes.chunks_mut(TILE).enumerate() {
        for (lane, values) in lanes.clone().enumerate() {
            let values = values.get(tile * TILE..).unwrap_or_default();
            for (node, value) in nodes.iter_mut().zip(values) {
                let v = vector(value);
                node.x.load_lane(lane, v.x);
                node.y.load_lane(lane, v.y);
                node.z.load_lane(lane, v.z);
            }
        }
        for node in nodes {
            *node = finish(*node);
        }
    }
}
