//! Around the sweep of a substep: the inertial target before it, the new state after it.
//!
//! Where one substep follows another, both are done in one pass over the nodes
//! ([`Group::turn_lanes`]): the state goes through memory once.

use super::interface::Substep;
use super::state::Group;
use crate::cloth::constraints::damping::damping_mass;
use crate::cloth::constraints::inertia::{FrameForces, frame_acceleration};
use crate::cloth::constraints::wind::add_wind;
use crate::cloth::input::{Integrator, Mode};
use crate::cloth::time::{Stencil, hermite};
use crate::machine::{Real, Vec3};

/// A node's motion: displacements from the target (mm) and velocities (mm/s), now and a
/// substep ago.
#[derive(Debug, Clone, Copy)]
struct NodeMotion<R> {
    u: Vec3<R>,
    previous_u: Vec3<R>,
    v: Vec3<R>,
    previous_v: Vec3<R>,
}

/// Hermite segments of all nodes over a frame. (mm)
pub(super) struct Segments<'a, R> {
    chords: &'a [Vec3<R>],
    start_slopes: &'a [Vec3<R>],
    end_slopes: &'a [Vec3<R>],
}

impl<R: Real> Segments<'_, R> {
    /// Part of a node's segment. (mm)
    #[inline(always)]
    pub(super) fn weighted(&self, i: usize, [chord, start, end]: [R; 3]) -> Vec3<R> {
        self.chords[i] * chord + self.start_slopes[i] * start + self.end_slopes[i] * end
    }
}

/// Holds displacements back, and counts.
struct Clamp<R> {
    /// Half an edge, squared. [mm^2]
    limit: R,
    count: R,
}

impl<R: Real> Clamp<R> {
    /// `step` of a displacement, held to half an edge, measured against the head or against the
    /// target that moves by `target_step`, whichever is less: a cloth that follows its target
    /// and one that ignores it both move as they should. (mm)
    ///
    /// How the target moves is asked only where it matters, which is hardly ever.
    #[inline(always)]
    fn held(&mut self, step: Vec3<R>, target_step: impl FnOnce() -> Vec3<R>) -> Vec3<R> {
        let limit = self.limit;
        let relative = step.dot(step);
        if !R::any_less(limit, relative) {
            return step;
        }
        let moved = step + target_step();
        let absolute = moved.dot(moved);
        let squared = R::select_less(relative, absolute, relative, absolute);
        self.count += R::select_less(limit, squared, R::splat(1.0), R::splat(0.0));
        step * (limit / squared.max(limit)).sqrt()
    }
}

/// What predicting a substep has in common for all nodes.
#[derive(Debug, Clone, Copy)]
struct Prediction<R> {
    history: R,
    h_e: R,
    /// Added masses that draw to X, and to X + u_b. [mass]
    pull: R,
    follow: R,
    /// Hermite weights of what is left of the target's way to the end of the frame, of its step
    /// now, of its step before where that was in the same frame, and of u_b - x_b: the step less
    /// what history takes of the one before.
    left: [R; 3],
    step: [R; 3],
    last_step: [R; 3],
    drift: [R; 3],
}

/// Acceleration of the nodes. (mm/s^2)
trait Field<R> {
    /// The acceleration, where all nodes have the same.
    fn uniform(&self) -> Option<Vec3<R>> {
        None
    }

    /// Of node `i`, expected at `x` (mm, relative to the centre) with velocity `v` (mm/s).
    fn at(&self, i: usize, x: Vec3<R>, v: Vec3<R>) -> Vec3<R>;
}

/// The same for all nodes.
struct Uniform<R>(Vec3<R>);

/// Of a turning head, about the centre of the patches.
struct Turning<R>(FrameForces<R>);

/// Of a turning head in wind, whose share was evaluated beforehand.
struct Windy<'a, R>(Turning<R>, &'a [Vec3<R>]);

impl<R: Real> Field<R> for Uniform<R> {
    #[inline(always)]
    fn uniform(&self) -> Option<Vec3<R>> {
        Some(self.0)
    }

    #[inline(always)]
    fn at(&self, _: usize, _: Vec3<R>, _: Vec3<R>) -> Vec3<R> {
        self.0
    }
}

impl<R: Real> Field<R> for Turning<R> {
    #[inline(always)]
    fn at(&self, _: usize, x: Vec3<R>, v: Vec3<R>) -> Vec3<R> {
        frame_acceleration(&self.0, x, v)
    }
}

impl<R: Real> Field<R> for Windy<'_, R> {
    #[inline(always)]
    fn at(&self, i: usize, x: Vec3<R>, v: Vec3<R>) -> Vec3<R> {
        self.0.at(i, x, v) + self.1[i]
    }
}

impl<R: Real> Group<R> {
    /// Weights of the substep, lane by lane: patches that fell back take Euler steps.
    fn stencils(&self, substep: &Substep) -> [R; 2] {
        let mut weights = [R::splat(0.0); 2];
        for lane in 0..R::LANES {
            let state = &self.lane_states[lane];
            let is_euler = self.integrator == Integrator::BackwardEuler
                || self.mode == Mode::Paper
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
    fn refresh_masses(&mut self) {
        let h_e = self.h_e;
        let same = (0..R::LANES).all(|l| h_e.lane(l) == self.masses_h_e.lane(l));
        if same {
            return;
        }
        self.masses_h_e = h_e;
        self.masses_version += 1;
        let damped = self.mass + damping_mass(self.mass, self.damping, h_e);
        if self.mode == Mode::Paper {
            // Springs are projected, all of them.
            let shared = damped + self.magnet.past_mass(self.mass, h_e);
            self.inv_masses.fill(R::splat(1.0) / shared);
            return;
        }
        let shared = damped + self.magnet.added_mass(self.mass, h_e);
        for (w, &anchor) in self.inv_masses.iter_mut().zip(&self.anchor_stiffness) {
            *w = R::splat(1.0) / (shared + anchor * h_e * h_e);
        }
    }

    /// Takes up a substep: its stencil, masses and weights.
    #[inline(always)]
    fn begin_substep(&mut self, substep: &Substep) -> Prediction<R> {
        let [history, h_e] = self.stencils(substep);
        self.h_e = h_e;
        self.refresh_masses();
        let last = self.weights;
        self.weights = [hermite(substep.progress[0]), hermite(substep.progress[1])];
        let difference = |[a, b]: [[f64; 3]; 2]| {
            [
                R::splat(b[0] - a[0]),
                R::splat(b[1] - a[1]),
                R::splat(b[2] - a[2]),
            ]
        };
        let is_folded = if self.mode == Mode::Paper { 0.0 } else { 1.0 };
        let (step, last_step) = (difference(self.weights), difference(last));
        Prediction {
            history,
            h_e,
            pull: self.magnet.stiffness * (h_e * h_e) * R::splat(is_folded),
            follow: self.magnet.past_mass(self.mass, h_e),
            left: difference([self.weights[1], hermite(1.0)]),
            step,
            last_step,
            drift: std::array::from_fn(|k| step[k] - last_step[k] * history),
        }
    }

    /// First half of the first substep of a frame: up to the inertial target.
    #[inline(always)]
    pub(super) fn predict_lanes(&mut self, substep: &Substep) {
        let prediction = self.begin_substep(substep);
        self.predict_all::<false>(substep, &prediction);
    }

    /// End of a substep and first half of the one that follows in the same frame.
    #[inline(always)]
    pub(super) fn turn_lanes(&mut self, substep: &Substep) {
        if substep.wind_horizon.is_none() {
            // The new state needs the old effective step.
            let inv_h = R::splat(1.0) / self.h_e;
            let prediction = self.begin_substep(substep);
            self.inv_h = inv_h;
            self.predict_all::<true>(substep, &prediction);
        } else {
            self.finish_lanes();
            self.predict_lanes(substep);
        }
    }

    /// End of a substep: new displacements and velocities from the solution.
    #[inline(always)]
    pub(super) fn finish_lanes(&mut self) {
        self.inv_h = R::splat(1.0) / self.h_e;
        let [before, after] = self.weights;
        let weights = [
            R::splat(after[0] - before[0]),
            R::splat(after[1] - before[1]),
            R::splat(after[2] - before[2]),
        ];
        let mut clamp = Clamp {
            limit: self.clamp_squared,
            count: self.clamped,
        };
        for i in 0..self.solution.len() {
            let target_step = self.segments().weighted(i, weights);
            let (u, v) = (self.displacements[i], self.velocities[i]);
            let now = u + clamp.held(self.solution[i] - self.targets[i] - u, || target_step);
            self.target_steps[i] = target_step;
            self.displacements[i] = now;
            self.previous_displacements[i] = u;
            self.velocities[i] = (now - self.past[i]) * self.inv_h;
            self.previous_velocities[i] = v;
        }
        self.clamped = clamp.count;
    }

    /// Holds displacements in the solution itself, for a hook to see: as [`Clamp::held`] does,
    /// which then no longer has to.
    #[inline(always)]
    pub(super) fn hold_back_lanes(&mut self) {
        let [before, after] = self.weights;
        let weights = [0, 1, 2].map(|k| R::splat(after[k] - before[k]));
        let limit = self.edge_limit_squared;
        for i in 0..self.solution.len() {
            let old = self.displacements[i];
            let step = self.solution[i] - self.targets[i] - old;
            let relative = step.dot(step);
            if !R::any_less(limit, relative) {
                continue;
            }
            let moved = step + self.segments().weighted(i, weights);
            let absolute = moved.dot(moved);
            let squared = R::select_less(relative, absolute, relative, absolute);
            if !R::any_less(limit, squared) {
                continue;
            }
            let (one, zero) = (R::splat(1.0), R::splat(0.0));
            self.clamped += R::select_less(limit, squared, one, zero);
            let held = self.targets[i] + (old + step * (limit / squared.max(limit)).sqrt());
            let x = self.solution[i];
            let select = |a: R, b: R| R::select_less(limit, squared, a, b);
            self.solution[i] = Vec3::new(
                select(held.x, x.x),
                select(held.y, x.y),
                select(held.z, x.z),
            );
        }
    }

    #[inline(always)]
    fn predict_all<const IS_TURN: bool>(&mut self, substep: &Substep, p: &Prediction<R>) {
        let [w, dw] = substep.angular;
        let squared = if substep.wind != [0.0; 3] {
            if let Some(horizon) = substep.wind_horizon {
                self.evaluate_wind(substep, horizon);
            }
            let turning = Turning(FrameForces::new(substep.uniform, w, dw).about(self.origin));
            let wind = std::mem::take(&mut self.wind_accelerations);
            let sum = self.predict_in::<IS_TURN, _>(&Windy(turning, &wind), p);
            self.wind_accelerations = wind;
            sum
        } else if [w, dw] != [[0.0; 3]; 2] {
            let forces = FrameForces::new(substep.uniform, w, dw).about(self.origin);
            self.predict_in::<IS_TURN, _>(&Turning(forces), p)
        } else {
            self.predict_in::<IS_TURN, _>(&Uniform(Vec3::splat(substep.uniform)), p)
        };
        self.move_anchors(p.left);
        if self.mode != Mode::Paper {
            self.pull_to_anchors();
        }
        self.drive += (R::splat(0.5) * self.mass * squared).sqrt() * R::splat(substep.h);
    }

    /// Predicts every node, with the end of the substep before if `IS_TURN`. Returns the sum
    /// of squared accelerations.
    #[inline(always)]
    fn predict_in<const IS_TURN: bool, F: Field<R>>(&mut self, field: &F, p: &Prediction<R>) -> R {
        let h_e2 = p.h_e * p.h_e;
        let n = self.solution.len();
        // Slices of one length, so that the loop checks no bounds.
        let segments = Segments {
            chords: &self.chords[..n],
            start_slopes: &self.start_slopes[..n],
            end_slopes: &self.end_slopes[..n],
        };
        let (ends, inv_masses) = (&self.ends[..n], &self.inv_masses[..n]);
        let is_damped = self.has_stretch_damping;
        let previous_us = &self.previous_displacements[..n];
        let previous_vs = &self.previous_velocities[..n];
        let target_steps = &self.target_steps[..n];
        let (us, vs) = (&mut self.displacements[..n], &mut self.velocities[..n]);
        let (targets, pasts) = (&mut self.targets[..n], &mut self.past[..n]);
        let (restings, solution) = (&mut self.resting[..n], &mut self.solution[..n]);
        let mut clamp = Clamp {
            limit: self.clamp_squared,
            count: self.clamped,
        };
        let mut squared = R::splat(0.0);
        for i in 0..n {
            // How far the target moves more than it did, of which history takes its share.
            let (m, drift);
            if IS_TURN {
                let (u, v) = (us[i], vs[i]);
                let moved = clamp.held(solution[i] - targets[i] - u, || {
                    segments.weighted(i, p.last_step)
                });
                let now = u + moved;
                m = NodeMotion {
                    u: now,
                    previous_u: u,
                    v: (now - pasts[i]) * self.inv_h,
                    previous_v: v,
                };
                us[i] = m.u;
                vs[i] = m.v;
                drift = segments.weighted(i, p.drift);
            } else {
                m = NodeMotion {
                    u: us[i],
                    previous_u: previous_us[i],
                    v: vs[i],
                    previous_v: previous_vs[i],
                };
                drift = segments.weighted(i, p.step) - target_steps[i] * p.history;
            }
            // From the end of the frame: steps that are summed up would sum up their rounding, and
            // neighbours that are rounded differently are a strain.
            let target = ends[i] - segments.weighted(i, p.left);
            // As u + g (u - u'): weights that are rounded to a sum other than 1 would be a force.
            let change = m.u - m.previous_u;
            let ub = m.u + change * p.history;
            let xb = ub - drift;
            let gain = m.v - m.previous_v;
            let vb = m.v + gain * p.history;
            let acceleration = field.at(i, target + m.u + change, m.v + gain);
            if field.uniform().is_none() {
                squared += acceleration.dot(acceleration);
            }
            // The mass-weighted mean of y, x_b, X + u_b and X, as a change of x_b: the rounding
            // of the weights' sum then does not act on x_b.
            let coasting = vb * p.h_e + acceleration * h_e2;
            let top = coasting * self.mass + drift * p.follow - xb * p.pull;
            targets[i] = target;
            pasts[i] = xb;
            if is_damped {
                restings[i] = target + ub;
            }
            solution[i] = xb + top * inv_masses[i];
        }
        self.clamped = clamp.count;
        match field.uniform() {
            Some(a) => a.dot(a) * R::splat(n as f64),
            None => squared,
        }
    }

    /// Hermite segments of the frame.
    #[inline(always)]
    pub(super) fn segments(&self) -> Segments<'_, R> {
        Segments {
            chords: &self.chords,
            start_slopes: &self.start_slopes,
            end_slopes: &self.end_slopes,
        }
    }

    /// What the wind does to every node where it is expected after `horizon` (s).
    #[inline(always)]
    fn evaluate_wind(&mut self, substep: &Substep, horizon: f64) {
        let horizon = R::splat(horizon);
        // The expected state, in an array that is free until later in the substep.
        for i in 0..self.solution.len() {
            let now = self.targets[i] + self.displacements[i];
            self.solution[i] = now + self.velocities[i] * horizon;
        }
        self.wind_accelerations.fill(Vec3::zero());
        add_wind(
            &self.lists.cells,
            &self.solution,
            &self.velocities,
            Vec3::splat(substep.wind),
            &self.air,
            self.inv_air_mass,
            &mut self.wind_accelerations,
        );
    }
}
