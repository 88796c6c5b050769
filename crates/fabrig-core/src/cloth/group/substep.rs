//! One substep: prediction, constraints, new state.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::attachment::{OrderFreeSum, Port, anchor_pull, project_pair};
use crate::cloth::constraints::bend::{BendCompliance, project_bend};
use crate::cloth::constraints::damping::damping_mass;
use crate::cloth::constraints::inertia::{FrameForces, frame_acceleration};
use crate::cloth::constraints::pressure::project_pressure;
use crate::cloth::constraints::shear::project_shear;
use crate::cloth::constraints::stretch::{StretchCompliance, project_stretch};
use crate::cloth::constraints::wind::add_wind;
use crate::cloth::input::Integrator;
use crate::cloth::lanes::{Real, Vec3};
use crate::cloth::time::{Stencil, hermite};

impl<R: Real> Group<R> {
    /// Weights of the substep, lane by lane: patches that fell back take Euler steps.
    pub(super) fn stencils(&self, substep: &Substep) -> [R; 2] {
        let mut weights = [R::splat(0.0); 2];
        for lane in 0..R::LANES {
            let state = &self.lane_states[lane];
            let is_euler = self.integrator == Integrator::BackwardEuler
                || !state.has_history
                || state.euler_frames > 0;
            let stencil = if is_euler {
                Stencil::euler(substep.h)
            } else {
                Stencil::bdf2(substep.h, substep.previous_h)
            };
            weights[0].set_lane(lane, stencil.history);
            weights[1].set_lane(lane, stencil.h_e);
        }
        weights
    }

    #[inline(always)]
    pub(super) fn refresh_masses(&mut self) {
        let h_e = self.h_e;
        let same = (0..R::LANES).all(|l| h_e.lane(l) == self.masses_h_e.lane(l));
        if same {
            return;
        }
        self.masses_h_e = h_e;
        let shared = self.mass
            + damping_mass(self.mass, self.damping, h_e)
            + self.magnet.added_mass(self.mass, h_e);
        for (w, &anchor) in self.inv_masses.iter_mut().zip(&self.anchor_stiffness) {
            *w = R::splat(1.0) / (shared + anchor * h_e * h_e);
        }
    }

    /// Acceleration of every node where the stencil expects it at the end of the substep.
    #[inline(always)]
    pub(super) fn evaluate_fields(&mut self, substep: &Substep) {
        let forces = FrameForces {
            uniform: Vec3::splat(substep.uniform),
            angular_velocity: Vec3::splat(substep.angular[0]),
            angular_acceleration: Vec3::splat(substep.angular[1]),
        };
        let two = R::splat(2.0);
        // Extrapolated state, in arrays that are free until later in the substep.
        for i in 0..self.targets.len() {
            let u = self.displacements[i] * two - self.previous_displacements[i];
            let v = self.velocities[i] * two - self.previous_velocities[i];
            let x = self.targets[i] + u;
            self.solution[i] = x;
            self.past[i] = v;
            self.accelerations[i] = frame_acceleration(&forces, self.origin + x, v);
        }
        if substep.wind != [0.0; 3] {
            add_wind(
                &self.lists.cells,
                &self.solution,
                &self.past,
                Vec3::splat(substep.wind),
                &self.air,
                self.inv_air_mass,
                &mut self.accelerations,
            );
        }
        let mut sum = R::splat(0.0);
        for a in &self.accelerations {
            sum += a.dot(*a);
        }
        self.drive += (R::splat(0.5) * self.mass * sum).sqrt() * R::splat(substep.h);
    }

    #[inline(always)]
    pub(super) fn predict_lanes(&mut self, substep: &Substep) {
        let [history, h_e] = self.stencils(substep);
        self.h_e = h_e;
        self.refresh_masses();
        let before = hermite(substep.progress[0]);
        let after = hermite(substep.progress[1]);
        let [c, a, b] = after.map(R::splat);
        let [dc, da, db] = [0, 1, 2].map(|i| R::splat(after[i] - before[i]));
        let has_field = substep.has_field();
        let n = self.targets.len();
        for i in 0..n {
            let (chord, start, end) = (self.chords[i], self.start_slopes[i], self.end_slopes[i]);
            self.targets[i] = self.starts[i] + (chord * c + start * a + end * b);
        }
        if has_field {
            self.evaluate_fields(substep);
        } else if substep.uniform != [0.0; 3] {
            let squared: f64 = substep.uniform.iter().map(|x| x * x).sum();
            let half = R::splat(0.5 * squared * n as f64);
            self.drive += (self.mass * half).sqrt() * R::splat(substep.h);
        }
        let uniform = Vec3::splat(substep.uniform);
        let follow = self.magnet.past_mass(self.mass, h_e);
        let h_e2 = h_e * h_e;
        let pull = self.magnet.stiffness * h_e2;
        for i in 0..n {
            let (chord, start, end) = (self.chords[i], self.start_slopes[i], self.end_slopes[i]);
            let step = chord * dc + start * da + end * db;
            let (u, up) = (self.displacements[i], self.previous_displacements[i]);
            // As u + r (u - u'): weights that are rounded to a sum other than 1 would be a force.
            let ub = u + (u - up) * history;
            let now = u - step;
            let then = up - self.target_steps[i] - step;
            let xb = now + (now - then) * history;
            let (v, vp) = (self.velocities[i], self.previous_velocities[i]);
            let vb = v + (v - vp) * history;
            let acceleration = if has_field {
                self.accelerations[i]
            } else {
                uniform
            };
            // The mass-weighted mean of y, x_b, X + u_b and X, as a change of x_b: the rounding
            // of the weights' sum then does not act on x_b.
            let coasting = vb * h_e + acceleration * h_e2;
            let draw = pull + self.anchor_stiffness[i] * h_e2;
            let top = coasting * self.mass + (ub - xb) * follow - xb * draw;
            self.target_steps[i] = step;
            self.past[i] = xb;
            self.resting[i] = self.targets[i] + ub;
            self.solution[i] = xb + top * self.inv_masses[i];
        }
        for anchor in &self.anchors {
            let (node, lane) = (anchor.node, anchor.lane);
            let weights = after;
            let target = self.targets[node].lane(lane);
            let offset = [0, 1, 2].map(|axis| {
                let moved: f64 = (0..3).map(|k| weights[k] * anchor.segment[k][axis]).sum();
                anchor.start[axis] + moved - target[axis]
            });
            let (pull, _) = anchor_pull(offset, anchor.stiffness, h_e.lane(lane));
            let w = self.inv_masses[node].lane(lane);
            let u = self.solution[node].lane(lane);
            self.solution[node].set_lane(lane, [0, 1, 2].map(|k| u[k] + pull[k] * w));
        }
    }

    pub(super) fn write_ports(&self, ports: &mut Vec<Port>) {
        ports.clear();
        for (&(node, lane), partners) in self.pairs.nodes.iter().zip(&self.pairs.partners) {
            let (node, lane) = (node as usize, lane as usize);
            ports.push(Port {
                displacement: self.solution[node].lane(lane),
                inv_mass: self.inv_masses[node].lane(lane),
                pair_count: partners.len() as f64,
            });
        }
    }

    pub(super) fn solve_pairs(&mut self, ports: &[Vec<Port>]) {
        let pairs = &self.pairs;
        for (&(node, lane), partners) in pairs.nodes.iter().zip(&pairs.partners) {
            let (node, lane) = (node as usize, lane as usize);
            let h_e = self.h_e.lane(lane);
            let own = Port {
                displacement: self.solution[node].lane(lane),
                inv_mass: self.inv_masses[node].lane(lane),
                pair_count: partners.len() as f64,
            };
            let mut sum = OrderFreeSum::default();
            for partner in partners {
                let other = &ports[partner.group][partner.port];
                let compliance = 1.0 / (partner.stiffness * h_e * h_e);
                sum.add(project_pair(&own, other, compliance));
            }
            let total = sum.total();
            let moved = [0, 1, 2].map(|axis| own.displacement[axis] + total[axis]);
            self.solution[node].set_lane(lane, moved);
        }
    }

    #[inline(always)]
    pub(super) fn solve_lanes(&mut self, substep: &Substep) {
        let h_e2 = self.h_e * self.h_e;
        let one = R::splat(1.0);
        let progress = R::splat(substep.progress[1]);
        if self.has_pressure {
            project_pressure(
                &self.lists.cells,
                &self.targets,
                &mut self.solution,
                &self.inv_masses,
                one / (self.pressure * h_e2),
                &mut self.gradient,
            );
        }
        let bend = BendCompliance {
            compliance: one / (self.bend * h_e2),
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        project_bend(
            &self.lists.triples,
            &mut self.solution,
            &self.inv_masses,
            &bend,
        );
        for (x, target) in self.solution.iter_mut().zip(&self.targets) {
            *x = *target + *x;
        }
        project_shear(
            &self.lists.diagonals,
            &mut self.solution,
            &self.inv_masses,
            &self.diagonal_lengths,
            progress,
            one / (self.shear * h_e2),
        );
        let compliance = StretchCompliance {
            stretch: one / (self.stretch[0] * h_e2),
            compression: one / (self.stretch[1] * h_e2),
            gamma: self.stretch_damping_time / self.h_e,
        };
        project_stretch(
            &self.lists.edges,
            &mut self.solution,
            &self.inv_masses,
            &self.edge_lengths,
            &self.resting,
            progress,
            &compliance,
        );
        self.finish_lanes();
    }

    /// New displacements and velocities from the solution. Displacements are held to half an
    /// edge, measured against the head or against the moving target, whichever is less: a
    /// cloth that follows its target and one that ignores it both move as they should.
    #[inline(always)]
    pub(super) fn finish_lanes(&mut self) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let inv_h = one / self.h_e;
        let limit = self.clamp_squared;
        for i in 0..self.solution.len() {
            let old = self.displacements[i];
            let step = self.solution[i] - self.targets[i] - old;
            let moved = step + self.target_steps[i];
            let (relative, absolute) = (step.dot(step), moved.dot(moved));
            let squared = R::select_less(relative, absolute, relative, absolute);
            self.clamped += R::select_less(limit, squared, one, zero);
            let scale = (limit / squared.max(limit)).sqrt();
            let new = old + step * scale;
            self.previous_displacements[i] = old;
            self.displacements[i] = new;
            self.previous_velocities[i] = self.velocities[i];
            self.velocities[i] = (new - self.past[i]) * inv_h;
        }
    }
}
