//! A group behind its interface, with the hot parts compiled for the processor's vectors.

use nalgebra::{Point3, Vector3};

use super::descent::merge;
use super::interface::{GroupFloor, GroupPairs, Monitor, PatchGroup, Span, Substep};
use super::pairs::PairTable;
use super::ports::{OwnPorts, Ports};
use super::state::{FARTHEST, Group};
use crate::cloth::input::{Mode, PatchMotion};
use crate::cloth::report::Energies;
use crate::cloth::time::{hermite, hermite_slope};
use crate::machine::{Real, vectorized};

impl<R: Real> PatchGroup for Group<R> {
    fn patches(&self) -> &[usize] {
        &self.patches
    }

    fn set_pairs(&mut self, first_port: usize, pairs: GroupPairs) {
        self.pairs = PairTable::new(first_port, &pairs);
    }

    fn set_floor(&mut self, floor: GroupFloor) {
        self.floor.set(floor);
    }

    fn reset(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        std::mem::swap(&mut self.targets, &mut self.ends);
        vectorized(LoadEnds(self, (1.0, targets)));
        self.floor.load(&self.patches, targets);
        self.load_anchors(1.0, anchors);
        vectorized(BeginFrame(self, 1.0));
        self.floor.hold();
        self.edge_lengths.hold();
        self.diagonal_lengths.hold();
        for lane in 0..R::LANES {
            if !self.lane_states[lane].has_velocity {
                for v in &mut self.end_velocities {
                    v.set_lane(lane, [0.0; 3]);
                }
            }
            self.clear_lane(lane);
            self.lane_states[lane].energy = 0.0;
            self.lane_states[lane].mismatch = self.mismatch.lane(lane);
            self.lane_states[lane].euler_frames = 0;
            self.lane_states[lane].robust_frames = 0;
        }
    }

    fn begin_frame(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        let inv = R::splat(dt);
        // The frame starts where the last one ended; the new ends replace all of the old targets.
        std::mem::swap(&mut self.targets, &mut self.ends);
        for (slope, v) in self.start_slopes.iter_mut().zip(&self.end_velocities) {
            *slope = *v * inv;
        }
        vectorized(LoadEnds(self, (dt, targets)));
        self.floor.load(&self.patches, targets);
        self.load_anchors(dt, anchors);
        self.clamped = R::splat(0.0);
        vectorized(BeginFrame(self, dt));
    }

    fn predict(&mut self, substep: &Substep, ports: OwnPorts<'_>) {
        vectorized(Predict(self, substep));
        self.write_ports(ports);
    }

    fn solve(&mut self, substep: &Substep, ports: &Ports) {
        vectorized(SolvePairs(self, ports));
        vectorized(PlaceFloor(self, (substep.progress[1], ports)));
        let sweeps = self.sweeps;
        let robust_count = (self.lane_states.iter())
            .filter(|s| s.robust_frames > 0)
            .count();
        if self.mode == Mode::Robust || robust_count == R::LANES {
            vectorized(Descend(self, (substep, sweeps)));
        } else if robust_count > 0 {
            let is_robust: Vec<bool> = (self.lane_states.iter())
                .map(|s| s.robust_frames > 0)
                .collect();
            let start = self.solution.clone();
            vectorized(Descend(self, (substep, sweeps)));
            let robust = std::mem::replace(&mut self.solution, start);
            self.solve_fast(substep, sweeps);
            merge(&mut self.solution, &robust, &is_robust);
        } else {
            self.solve_fast(substep, sweeps);
        }
        for state in &mut self.lane_states {
            state.has_history = true;
        }
    }

    fn set_hooked(&mut self, is_hooked: bool) {
        self.clamp_squared = if is_hooked {
            R::splat(FARTHEST * FARTHEST)
        } else {
            self.edge_limit_squared
        };
    }

    fn hold_back(&mut self) {
        vectorized(HoldBack(self));
    }

    fn write_solution(&self, lane: usize, positions: &mut [Point3<f32>]) {
        let center = self.origin.lane(lane);
        for (x, p) in self.solution.iter().zip(positions) {
            let x = x.lane(lane);
            *p = Point3::from([0, 1, 2].map(|axis| (x[axis] + center[axis]) as f32));
        }
    }

    fn shift(&mut self, lane: usize, node: usize, by: [f64; 3]) {
        let x = self.solution[node].lane(lane);
        self.solution[node].set_lane(lane, [0, 1, 2].map(|axis| x[axis] + by[axis]));
    }

    fn straighten(&mut self, lane: usize, node: usize, from: Point3<f32>, span: Span) {
        let (Span { progress, h, .. }, elapsed) = (span, span.elapsed());
        let center = self.origin.lane(lane);
        let segment = |weights: [f64; 3]| {
            let weights = weights.map(R::splat);
            self.segments().weighted(node, weights).lane(lane)
        };
        let (end, began) = (hermite(1.0), hermite(progress[0]));
        let left = segment([0, 1, 2].map(|k| end[k] - began[k]));
        let (end, x) = (self.ends[node].lane(lane), self.solution[node].lane(lane));
        let goal = self.targets[node].lane(lane);
        // How fast the target goes now, and went a substep ago. (mm/s)
        let dt = elapsed / (progress[1] - progress[0]);
        let rate = |s: f64| segment(hermite_slope(s)).map(|way| way / dt);
        let rates = [rate(progress[1]), rate(progress[1] - h / dt)];
        let h_e = self.h_e.lane(lane);
        let u = [0, 1, 2].map(|k| x[k] - goal[k]);
        // Against the target.
        let v = [0, 1, 2].map(|k| {
            let began = f64::from(from[k]) - center[k] - (end[k] - left[k]);
            (u[k] - began) / elapsed
        });
        let [now, before] = rates.map(|rate| [0, 1, 2].map(|k| v[k] + rate[k]));
        self.past[node].set_lane(lane, [0, 1, 2].map(|k| u[k] - now[k] * h_e));
        self.displacements[node].set_lane(lane, [0, 1, 2].map(|k| u[k] - v[k] * h));
        self.velocities[node].set_lane(lane, before);
    }

    fn note_shifts(&mut self, lane: usize, squared: f64, stopped: bool) {
        let amplitude = (0.5 * self.mass.lane(lane) * squared).sqrt() / self.h_e.lane(lane);
        self.drive.set_lane(lane, self.drive.lane(lane) + amplitude);
        if stopped {
            self.lane_states[lane].has_history = false;
        }
    }

    fn effective_step(&self, lane: usize) -> [f64; 2] {
        let mass = self.inv_masses.first().map_or(1.0, |w| 1.0 / w.lane(lane));
        [self.h_e.lane(lane), mass / self.mass.lane(lane)]
    }

    fn place(&mut self, lane: usize, node: usize, offset: [f64; 3]) {
        self.displacements[node].set_lane(lane, offset);
        self.previous_displacements[node].set_lane(lane, offset);
    }

    fn finish(&mut self) {
        vectorized(Finish(self));
    }

    fn turn(&mut self, following: &Substep, ports: OwnPorts<'_>) {
        vectorized(Turn(self, following));
        self.write_ports(ports);
    }

    fn end_frame(&mut self, monitors: &mut Vec<Monitor>) {
        let sums = vectorized(EnergyOf(self));
        monitors.clear();
        for lane in 0..self.patches.len() {
            let energies = Energies {
                kinetic: sums[0].lane(lane),
                magnet: sums[1].lane(lane),
                anchors: sums[7].lane(lane),
                stretch: sums[2].lane(lane),
                compression: sums[3].lane(lane),
                shear: sums[4].lane(lane),
                bend: sums[5].lane(lane),
                pressure: sums[6].lane(lane),
            };
            let squared = self.squared_distance.lane(lane);
            let state = &mut self.lane_states[lane];
            let mismatch = self.mismatch.lane(lane) + sums[8].lane(lane);
            monitors.push(Monitor {
                energies,
                before: state.energy,
                drive: self.drive.lane(lane),
                mismatch: mismatch + state.mismatch,
                damping: self.damping.lane(lane) + self.magnet.damping.lane(lane),
                clamped: self.clamped.lane(lane) as u64,
                is_sound: energies.total().is_finite() && squared < FARTHEST * FARTHEST,
            });
            state.energy = energies.total();
            state.mismatch = mismatch;
            state.euler_frames = state.euler_frames.saturating_sub(1);
            state.robust_frames = state.robust_frames.saturating_sub(1);
        }
    }

    fn fall_back(&mut self, lane: usize, frames: u32, is_robust: bool) {
        let state = &mut self.lane_states[lane];
        state.euler_frames = frames;
        if is_robust {
            state.robust_frames = frames;
        }
    }

    fn fall_asleep(&mut self, ports: [OwnPorts<'_>; 2]) {
        for ports in ports {
            self.write_sleeping_ports(ports);
        }
    }

    fn wake(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        self.begin_frame(dt, targets, anchors);
        self.follow_targets();
    }

    fn freeze(&mut self, lane: usize) {
        self.clear_lane(lane);
        self.lane_states[lane].energy = 0.0;
    }

    fn write_displacements(&self, lane: usize, displacements: &mut [Vector3<f32>]) {
        for (out, u) in displacements.iter_mut().zip(&self.displacements) {
            *out = Vector3::from(u.lane(lane).map(|x| x as f32));
        }
    }

    fn write_positions(&self, lane: usize, positions: &mut [Point3<f32>]) {
        let nodes = self.end_positions[lane].iter().zip(&self.displacements);
        for (p, (end, u)) in positions.iter_mut().zip(nodes) {
            let u = u.lane(lane);
            *p = Point3::new(
                (f64::from(end.x) + u[0]) as f32,
                (f64::from(end.y) + u[1]) as f32,
                (f64::from(end.z) + u[2]) as f32,
            );
        }
    }

    fn node_state(&self, lane: usize, node: usize) -> ([f64; 3], [f64; 3]) {
        let u = self.displacements[node].lane(lane);
        let end = &self.end_positions[lane][node];
        (
            [0, 1, 2].map(|axis| f64::from(end[axis]) + u[axis]),
            self.velocities[node].lane(lane),
        )
    }
}

impl<R: Real> Group<R> {
    fn solve_fast(&mut self, substep: &Substep, sweeps: u32) {
        match (self.mode, sweeps) {
            (Mode::Paper, _) => vectorized(Project(self, (substep, sweeps))),
            (_, 1) => vectorized(Solve(self, substep)),
            _ => vectorized(Sweep(self, (substep, sweeps))),
        }
    }
}

macro_rules! vectorized_work {
    ($name:ident<$($field:ty),*> -> $output:ty, |$group:ident, $($argument:ident)?| $body:expr) => {
        struct $name<'a, R>(&'a mut Group<R>, $($field),*);

        impl<R: Real> pulp::NullaryFnOnce for $name<'_, R> {
            type Output = $output;

            #[inline(always)]
            fn call(self) -> $output {
                let Self($group, $($argument)?) = self;
                $body
            }
        }
    };
}

vectorized_work!(
    LoadEnds<(f64, &'a [PatchMotion])> -> (),
    |group, ends| group.load_ends_lanes(ends.0, ends.1)
);
vectorized_work!(BeginFrame<f64> -> (), |group, dt| group.begin_frame_lanes(dt));
vectorized_work!(Predict<&'a Substep> -> (), |group, substep| group.predict_lanes(substep));
vectorized_work!(SolvePairs<&'a Ports> -> (), |group, ports| group.solve_pairs(ports));
vectorized_work!(
    PlaceFloor<(f64, &'a Ports)> -> (),
    |group, at| group.place_floor(at.0, at.1)
);
vectorized_work!(Solve<&'a Substep> -> (), |group, substep| group.solve_lanes(substep));
vectorized_work!(
    Sweep<(&'a Substep, u32)> -> (),
    |group, how| group.sweep_lanes(how.0, how.1)
);
vectorized_work!(
    Project<(&'a Substep, u32)> -> (),
    |group, how| group.project_lanes(how.0, how.1)
);
vectorized_work!(
    Descend<(&'a Substep, u32)> -> (),
    |group, how| group.descend_lanes(how.0, how.1)
);
vectorized_work!(HoldBack<> -> (), |group, | group.hold_back_lanes());
vectorized_work!(Finish<> -> (), |group, | group.finish_lanes());
vectorized_work!(Turn<&'a Substep> -> (), |group, substep| group.turn_lanes(substep));
vectorized_work!(EnergyOf<> -> [R; 9], |group, | group.energy_lanes());
