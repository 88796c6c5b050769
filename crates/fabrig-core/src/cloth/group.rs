//! A group: patches of one grid shape in the lanes of one register, and one substep of them.
//!
//! Everything a substep needs is kept here as arrays of one entry per node (or edge), each
//! entry holding that node of every patch. Nothing is allocated while stepping.

use nalgebra::Point3;

use super::constraints::attachment::{OrderFreeSum, Port, anchor_pull, project_pair};
use super::constraints::bend::{BendCompliance, bend_energy, project_bend};
use super::constraints::damping::damping_mass;
use super::constraints::grid_lists::GridLists;
use super::constraints::inertia::{FrameForces, frame_acceleration};
use super::constraints::magnet::Magnet;
use super::constraints::pressure::{project_pressure, swept_volume};
use super::constraints::shear::{project_shear, shear_energy};
use super::constraints::stretch::{
    RestLengths, StretchCompliance, edge_length, project_stretch, stretch_energy,
};
use super::constraints::wind::{Air, add_wind};
use super::input::{ClothOptions, ClothPatch, Integrator, PatchMotion};
use super::lanes::{Real, Vec3};
use super::report::Energies;
use super::time::{Stencil, hermite};

/// Displacements further than this are taken for a failure. [mm]
const FARTHEST: f64 = 1e5;

/// One substep, the same for all groups.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Substep {
    /// Duration. [s]
    pub(crate) h: f64,
    /// Duration of the one before. [s]
    pub(crate) previous_h: f64,
    /// Progress through the frame before and after, 0 to 1.
    pub(crate) progress: [f64; 2],
    /// Uniform acceleration. [mm/s^2]
    pub(crate) uniform: [f64; 3],
    /// Angular velocity [rad/s] and acceleration [rad/s^2] of the head frame.
    pub(crate) angular: [[f64; 3]; 2],
    /// Air velocity. [mm/s]
    pub(crate) wind: [f64; 3],
}

impl Substep {
    /// Whether acceleration differs from node to node.
    fn has_field(&self) -> bool {
        self.angular != [[0.0; 3]; 2] || self.wind != [0.0; 3]
    }
}

/// The pairs of a group's nodes with nodes of other patches.
#[derive(Debug, Clone, Default)]
pub(crate) struct GroupPairs {
    /// (node, lane) of every node that has pairs.
    pub(crate) nodes: Vec<(u32, u32)>,
    /// Partners of each such node.
    pub(crate) partners: Vec<Vec<Partner>>,
}

/// The other end of a pair.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Partner {
    /// Its group.
    pub(crate) group: usize,
    /// Its index among the ports of that group.
    pub(crate) port: usize,
    /// k. [mass/s^2]
    pub(crate) stiffness: f64,
}

/// What the energy monitor looks at, per patch.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Monitor {
    /// Energies now.
    pub(crate) energies: Energies,
    /// Energy before the frame.
    pub(crate) before: f64,
    /// Square root of the kinetic energy that moving targets and fields can give. It adds to
    /// the square root of the energy there was.
    pub(crate) drive: f64,
    /// Energy by which rest lengths and anchors differ from the targets.
    pub(crate) mismatch: f64,
    /// Displacements that were held back.
    pub(crate) clamped: u64,
    /// Whether all of the state is finite and near.
    pub(crate) is_sound: bool,
}

/// A group behind its lane type.
pub(crate) trait PatchGroup: Send + Sync {
    /// Patches of the lanes.
    fn patches(&self) -> &[usize];
    /// Replaces the pairs.
    fn set_pairs(&mut self, pairs: GroupPairs);
    /// Puts the cloth on the targets, moving with them.
    fn reset(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]);
    /// Starts a frame of `dt` seconds.
    fn begin_frame(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]);
    /// First half of a substep: up to the inertial target. Fills `ports`.
    fn predict(&mut self, substep: &Substep, ports: &mut Vec<Port>);
    /// Second half of a substep: the constraints. Reads the ports of all groups.
    fn solve(&mut self, substep: &Substep, ports: &[Vec<Port>]);
    /// Ends the frame: what the monitor sees, per patch.
    fn end_frame(&mut self, monitors: &mut Vec<Monitor>);
    /// Takes backward Euler steps for a patch for `frames` frames.
    fn fall_back(&mut self, lane: usize, frames: u32);
    /// Puts a patch back to its target.
    fn freeze(&mut self, lane: usize);
    /// Writes positions of a patch. [mm, head frame]
    fn write_positions(&self, lane: usize, positions: &mut [Point3<f32>]);
    /// Position and velocity of one node in full precision. [mm, mm/s]
    fn node_state(&self, lane: usize, node: usize) -> ([f64; 3], [f64; 3]);
}

/// An anchored node.
#[derive(Debug, Clone)]
struct Anchor {
    node: usize,
    lane: usize,
    /// Index among the anchors of its patch.
    index: usize,
    /// k. [mass/s^2]
    stiffness: f64,
    /// Position at the end of the frame before. [mm, relative to the patch's centre]
    start: [f64; 3],
    /// Hermite segment of this frame: chord and slopes. [mm]
    segment: [[f64; 3]; 3],
    /// Velocity at the end of the frame, if known. [mm/s]
    velocity: Option<[f64; 3]>,
}

/// Per-lane bookkeeping.
#[derive(Debug, Clone, Copy, Default)]
struct LaneState {
    has_history: bool,
    euler_frames: u32,
    energy: f64,
    mismatch: f64,
    /// Whether the end slopes of the last frame came from given velocities.
    has_velocity: bool,
}

/// Patches of one shape, side by side.
pub(crate) struct Group<R> {
    patches: Vec<usize>,
    integrator: Integrator,
    has_pressure: bool,
    /// Centre of each patch, which positions are relative to. [mm, head frame]
    origin: Vec3<R>,

    mass: R,
    magnet: Magnet<R>,
    damping: R,
    /// Stretch and compression. [mass/s^2]
    stretch: [R; 2],
    stretch_damping_time: R,
    shear: R,
    bend: R,
    bend_dropoff: R,
    pressure: R,
    inv_edge_squared: R,
    /// Half the mean edge, squared. [mm^2]
    clamp_squared: R,
    air: Air<R>,
    inv_air_mass: R,
    /// Sum of anchor stiffnesses per node. [mass/s^2]
    anchor_stiffness: Vec<R>,
    anchors: Vec<Anchor>,
    pairs: GroupPairs,

    lists: GridLists,
    edge_lengths: RestLengths<R>,
    diagonal_lengths: RestLengths<R>,

    displacements: Vec<Vec3<R>>,
    previous_displacements: Vec<Vec3<R>>,
    velocities: Vec<Vec3<R>>,
    previous_velocities: Vec<Vec3<R>>,
    /// How far the targets moved in the last substep. [mm]
    target_steps: Vec<Vec3<R>>,

    /// Targets at the start of the frame, relative to the centre. [mm]
    starts: Vec<Vec3<R>>,
    /// Hermite segments: chord, slope at the start and at the end, times dt. [mm]
    chords: Vec<Vec3<R>>,
    start_slopes: Vec<Vec3<R>>,
    end_slopes: Vec<Vec3<R>>,
    /// Targets at the end of the frame, relative to the centre. [mm]
    ends: Vec<Vec3<R>>,
    /// Velocities of the targets at the end of the frame. [mm/s]
    end_velocities: Vec<Vec3<R>>,
    /// Targets at the end of the frame as given. [mm, head frame]
    end_positions: Vec<Vec<Point3<f32>>>,

    /// Targets at the end of the substep, relative to the centre. [mm]
    targets: Vec<Vec3<R>>,
    /// Displacements, then positions, that are being solved for. [mm]
    solution: Vec<Vec3<R>>,
    /// x_b - X. [mm]
    past: Vec<Vec3<R>>,
    /// X + u_b. [mm]
    resting: Vec<Vec3<R>>,
    inv_masses: Vec<R>,
    accelerations: Vec<Vec3<R>>,
    gradient: Vec<Vec3<R>>,

    /// Effective step for which `inv_masses` holds.
    masses_h_e: R,
    h_e: R,
    clamped: R,
    drive: R,
    mismatch: R,
    lane_states: Vec<LaneState>,
}

impl<R: Real> Group<R> {
    /// A group of `patches` (indices into `all`), at rest.
    pub(crate) fn new(all: &[ClothPatch], patches: &[usize], options: &ClothOptions) -> Self {
        let shape = all[patches[0]].shape;
        let n = shape.node_count();
        // Lanes to spare repeat the last patch, so that their arithmetic is sound too.
        let of_lane = |lane: usize| patches[lane.min(patches.len() - 1)];
        let per_lane = |value: &dyn Fn(&ClothPatch) -> f64| {
            let mut out = R::splat(0.0);
            for lane in 0..R::LANES {
                out.set_lane(lane, value(&all[of_lane(lane)]));
            }
            out
        };
        let zero = vec![Vec3::<R>::zero(); n];
        let mut origin = Vec3::zero();
        let mut rest = zero.clone();
        for lane in 0..R::LANES {
            let nodes = &all[of_lane(lane)].rest;
            let mut sum = [0.0; 3];
            for p in nodes {
                for axis in 0..3 {
                    sum[axis] += f64::from(p[axis]);
                }
            }
            // Whole millimetres: exact in any precision, and a mirrored patch has the
            // mirrored centre.
            let center = sum.map(|s| (s / n as f64).round());
            origin.set_lane(lane, center);
            for (local, p) in rest.iter_mut().zip(nodes) {
                local.set_lane(lane, relative(p, center));
            }
        }
        let lists = GridLists::new(shape);
        let mean_edge = mean_edge(&lists.edges, &rest);
        let area = |p: &ClothPatch| rest_area(p);
        let mut anchor_stiffness = vec![R::splat(0.0); n];
        let mut anchors = Vec::new();
        for (lane, &patch) in patches.iter().enumerate() {
            let mut index = 0;
            for (nodes, strength) in all[patch].anchor_sets() {
                let stiffness = strength * all[patch].material.stretch_stiffness();
                for &node in nodes {
                    let node = node as usize;
                    let sum = anchor_stiffness[node].lane(lane) + stiffness;
                    anchor_stiffness[node].set_lane(lane, sum);
                    anchors.push(Anchor {
                        node,
                        lane,
                        index,
                        stiffness,
                        start: rest[node].lane(lane),
                        segment: [[0.0; 3]; 3],
                        velocity: None,
                    });
                    index += 1;
                }
            }
        }
        let blends = |edges: &[[u32; 2]]| -> Vec<R> {
            edges
                .iter()
                .map(|&[i, j]| {
                    let noise = edge_noise(options.seed, i, j);
                    let blend = options.rest_blend * (1.0 + options.rest_imperfection * noise);
                    R::splat(blend.clamp(0.0, 1.0))
                })
                .collect()
        };
        Self {
            patches: patches.to_vec(),
            integrator: options.integrator,
            has_pressure: patches.iter().any(|&p| all[p].material.pressure > 0.0),
            origin,
            mass: per_lane(&|p| p.material.mass),
            magnet: Magnet {
                stiffness: per_lane(&|p| p.material.magnet_stiffness()),
                damping: per_lane(&|p| p.material.magnet_damping()),
            },
            damping: per_lane(&|p| p.material.damping),
            stretch: [
                per_lane(&|p| p.material.stretch_stiffness()),
                per_lane(&|p| p.material.compression_stiffness()),
            ],
            stretch_damping_time: per_lane(&|p| p.material.stretch_damping_time()),
            shear: per_lane(&|p| p.material.shear_stiffness()),
            bend: per_lane(&|p| p.material.bend_stiffness()),
            bend_dropoff: per_lane(&|p| p.material.bend_angle_dropoff),
            pressure: per_lane(&|p| p.material.pressure_stiffness(n, area(p))),
            inv_edge_squared: R::splat(1.0) / (mean_edge * mean_edge).max(R::splat(1e-12)),
            // A grid without edges has no measure to hold displacements to.
            clamp_squared: R::select_less(
                R::splat(0.0),
                mean_edge,
                mean_edge * mean_edge * R::splat(0.25),
                R::splat(FARTHEST * FARTHEST),
            ),
            air: Air {
                density: R::splat(options.air_density),
                drag: R::splat(options.drag),
                lift: R::splat(options.lift),
            },
            inv_air_mass: per_lane(&|p| {
                n as f64 / (options.areal_density * p.material.mass * area(p)).max(1e-12)
            }),
            anchor_stiffness,
            anchors,
            pairs: GroupPairs::default(),
            edge_lengths: RestLengths::new(&rest, &lists.edges, blends(&lists.edges)),
            diagonal_lengths: RestLengths::new(&rest, &lists.diagonals, blends(&lists.diagonals)),
            lists,
            displacements: zero.clone(),
            previous_displacements: zero.clone(),
            velocities: zero.clone(),
            previous_velocities: zero.clone(),
            target_steps: zero.clone(),
            starts: rest.clone(),
            chords: zero.clone(),
            start_slopes: zero.clone(),
            end_slopes: zero.clone(),
            end_velocities: zero.clone(),
            end_positions: (0..patches.len())
                .map(|lane| all[patches[lane]].rest.clone())
                .collect(),
            targets: rest.clone(),
            ends: rest,
            solution: zero.clone(),
            past: zero.clone(),
            resting: zero.clone(),
            inv_masses: vec![R::splat(0.0); n],
            accelerations: zero.clone(),
            gradient: zero,
            masses_h_e: R::splat(-1.0),
            h_e: R::splat(0.0),
            clamped: R::splat(0.0),
            drive: R::splat(0.0),
            mismatch: R::splat(0.0),
            lane_states: vec![LaneState::default(); R::LANES],
        }
    }

    /// Patch of a lane; lanes to spare repeat the last one.
    fn patch_of(&self, lane: usize) -> usize {
        self.patches[lane.min(self.patches.len() - 1)]
    }

    /// Loads target ends into the lanes. Straight motion is marked by lane.
    fn load_ends(&mut self, dt: f64, targets: &[PatchMotion]) {
        for lane in 0..R::LANES {
            let motion = &targets[self.patch_of(lane)];
            let center = self.origin.lane(lane);
            for (end, p) in self.ends.iter_mut().zip(&motion.positions) {
                end.set_lane(lane, relative(p, center));
            }
            self.lane_states[lane].has_velocity = !motion.velocities.is_empty();
            for (i, slope) in self.end_slopes.iter_mut().enumerate() {
                match motion.velocities.get(i) {
                    Some(v) => slope.set_lane(lane, [0, 1, 2].map(|a| f64::from(v[a]) * dt)),
                    None => {
                        let (a, b) = (self.starts[i].lane(lane), self.ends[i].lane(lane));
                        slope.set_lane(lane, [0, 1, 2].map(|axis| b[axis] - a[axis]));
                    }
                }
            }
        }
        for (lane, kept) in self.end_positions.iter_mut().enumerate() {
            kept.copy_from_slice(&targets[self.patches[lane]].positions);
        }
    }

    fn load_anchors(&mut self, dt: f64, anchors: &[PatchMotion]) {
        for anchor in &mut self.anchors {
            let old = anchor.segment;
            for axis in 0..3 {
                anchor.start[axis] += old[0][axis];
            }
            anchor.segment = [[0.0; 3]; 3];
            let old_velocity = anchor.velocity.take();
            let Some(motion) = anchors.get(self.patches[anchor.lane]) else {
                continue;
            };
            let center = self.origin.lane(anchor.lane);
            // Rounded as the targets are, so that an anchor on its target pulls not at all.
            let mut end = Vec3::<R>::zero();
            end.set_lane(0, relative(&motion.positions[anchor.index], center));
            let end = end.lane(0);
            let chord = [0, 1, 2].map(|axis| end[axis] - anchor.start[axis]);
            anchor.velocity = motion
                .velocities
                .get(anchor.index)
                .map(|v| [0, 1, 2].map(|axis| f64::from(v[axis])));
            let slope = |v: Option<[f64; 3]>| v.map_or(chord, |v| v.map(|x| x * dt));
            anchor.segment = [chord, slope(old_velocity), slope(anchor.velocity)];
        }
    }

    #[inline(always)]
    fn begin_frame_lanes(&mut self, dt: f64) {
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

    /// Weights of the substep, lane by lane: patches that fell back take Euler steps.
    fn stencils(&self, substep: &Substep) -> [R; 2] {
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
    fn refresh_masses(&mut self) {
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
    fn evaluate_fields(&mut self, substep: &Substep) {
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
    fn predict_lanes(&mut self, substep: &Substep) {
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

    fn write_ports(&self, ports: &mut Vec<Port>) {
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

    fn solve_pairs(&mut self, ports: &[Vec<Port>]) {
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
    fn solve_lanes(&mut self, substep: &Substep) {
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
    fn finish_lanes(&mut self) {
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

    /// Energies of all lanes at the end of the frame.
    #[inline(always)]
    fn energy_lanes(&mut self) -> [R; 7] {
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
        let [stretch, compression] =
            stretch_energy(&self.lists.edges, x, &self.edge_lengths, self.stretch);
        let shear = shear_energy(&self.lists.diagonals, x, &self.diagonal_lengths, self.shear);
        let bend = BendCompliance {
            compliance: one,
            dropoff: self.bend_dropoff,
            inv_edge_squared: self.inv_edge_squared,
        };
        let bend = bend_energy(&self.lists.triples, &self.displacements, self.bend, &bend);
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
        [
            half * self.mass * kinetic,
            half * self.magnet.stiffness * magnet,
            stretch,
            compression,
            shear,
            bend,
            pressure,
        ]
    }

    /// Anchor energy of a lane, and the energy an anchor would have on the target.
    fn anchor_energies(&self) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 2]; self.patches.len()];
        for anchor in &self.anchors {
            let (node, lane) = (anchor.node, anchor.lane);
            let target = self.ends[node].lane(lane);
            let u = self.displacements[node].lane(lane);
            for axis in 0..3 {
                let a = anchor.start[axis] + anchor.segment[0][axis] - target[axis];
                sums[lane][0] += 0.5 * anchor.stiffness * (u[axis] - a).powi(2);
                sums[lane][1] += 0.5 * anchor.stiffness * a * a;
            }
        }
        sums
    }

    fn clear_lane(&mut self, lane: usize) {
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

impl<R: Real> PatchGroup for Group<R> {
    fn patches(&self) -> &[usize] {
        &self.patches
    }

    fn set_pairs(&mut self, pairs: GroupPairs) {
        self.pairs = pairs;
    }

    fn reset(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        self.starts.copy_from_slice(&self.ends);
        self.load_ends(1.0, targets);
        self.load_anchors(1.0, anchors);
        vectorized(BeginFrame(self, 1.0));
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
        }
    }

    fn begin_frame(&mut self, dt: f64, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        let inv = R::splat(dt);
        self.starts.copy_from_slice(&self.ends);
        for (slope, v) in self.start_slopes.iter_mut().zip(&self.end_velocities) {
            *slope = *v * inv;
        }
        let had_velocity: Vec<bool> = self.lane_states.iter().map(|s| s.has_velocity).collect();
        self.load_ends(dt, targets);
        for lane in 0..R::LANES {
            // After a straight segment nothing is known about the velocity here.
            if !had_velocity[lane] {
                for i in 0..self.starts.len() {
                    let (a, b) = (self.starts[i].lane(lane), self.ends[i].lane(lane));
                    self.start_slopes[i].set_lane(lane, [0, 1, 2].map(|k| b[k] - a[k]));
                }
            }
        }
        self.load_anchors(dt, anchors);
        self.clamped = R::splat(0.0);
        vectorized(BeginFrame(self, dt));
    }

    fn predict(&mut self, substep: &Substep, ports: &mut Vec<Port>) {
        vectorized(Predict(self, substep));
        self.write_ports(ports);
    }

    fn solve(&mut self, substep: &Substep, ports: &[Vec<Port>]) {
        self.solve_pairs(ports);
        vectorized(Solve(self, substep));
        for state in &mut self.lane_states {
            state.has_history = true;
        }
    }

    fn end_frame(&mut self, monitors: &mut Vec<Monitor>) {
        let sums = vectorized(EnergyOf(self));
        let anchors = self.anchor_energies();
        monitors.clear();
        for lane in 0..self.patches.len() {
            let energies = Energies {
                kinetic: sums[0].lane(lane),
                magnet: sums[1].lane(lane),
                anchors: anchors[lane][0],
                stretch: sums[2].lane(lane),
                compression: sums[3].lane(lane),
                shear: sums[4].lane(lane),
                bend: sums[5].lane(lane),
                pressure: sums[6].lane(lane),
            };
            let mut squared = 0.0;
            for u in &self.displacements {
                squared += u.dot(*u).lane(lane);
            }
            let state = &mut self.lane_states[lane];
            let mismatch = self.mismatch.lane(lane) + anchors[lane][1];
            monitors.push(Monitor {
                energies,
                before: state.energy,
                drive: self.drive.lane(lane),
                mismatch: mismatch + state.mismatch,
                clamped: self.clamped.lane(lane) as u64,
                is_sound: energies.total().is_finite() && squared < FARTHEST * FARTHEST,
            });
            state.energy = energies.total();
            state.mismatch = mismatch;
            state.euler_frames = state.euler_frames.saturating_sub(1);
        }
    }

    fn fall_back(&mut self, lane: usize, frames: u32) {
        self.lane_states[lane].euler_frames = frames;
    }

    fn freeze(&mut self, lane: usize) {
        self.clear_lane(lane);
        self.lane_states[lane].energy = 0.0;
    }

    fn write_positions(&self, lane: usize, positions: &mut [Point3<f32>]) {
        for (i, p) in positions.iter_mut().enumerate() {
            let u = self.displacements[i].lane(lane);
            let end = &self.end_positions[lane][i];
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

impl ClothPatch {
    /// Nodes and strength of each set of anchors, in order.
    pub(crate) fn anchor_sets(&self) -> impl Iterator<Item = (&[u32], f64)> {
        use super::input::ClothAttachment::Anchors;
        self.attachments.iter().filter_map(|a| match a {
            Anchors { nodes, strength } => Some((nodes.as_slice(), *strength)),
            _ => None,
        })
    }
}

/// A position relative to a centre.
fn relative(p: &Point3<f32>, center: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from(p[axis]) - center[axis])
}

/// Mean length of the grid's edges. [mm]
fn mean_edge<R: Real>(edges: &[[u32; 2]], positions: &[Vec3<R>]) -> R {
    let mut sum = R::splat(0.0);
    for &[i, j] in edges {
        sum += edge_length(positions[i as usize], positions[j as usize]);
    }
    sum / R::splat(edges.len().max(1) as f64)
}

/// Area of a patch at rest. [mm^2]
fn rest_area(patch: &ClothPatch) -> f64 {
    let at = |i: u32| patch.rest[i as usize].map(f64::from);
    patch
        .shape
        .quads()
        .iter()
        .map(|&[a, b, c, d]| (at(c) - at(a)).cross(&(at(d) - at(b))).norm() / 2.0)
        .sum()
}

/// Noise in [-1, 1] for the edge of two nodes, the same in every patch (SplitMix64's
/// finalizer).
fn edge_noise(seed: u64, i: u32, j: u32) -> f64 {
    let edge = (u64::from(i) << 32) | u64::from(j);
    let mut z = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((edge + 1).wrapping_mul(0xBF58_476D_1CE4_E5B9));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Runs `work` compiled for the widest vector instructions that this processor has.
///
/// A closure would not do: it is compiled for the baseline unless it happens to be inlined.
fn vectorized<W: pulp::NullaryFnOnce>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
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

vectorized_work!(BeginFrame<f64> -> (), |group, dt| group.begin_frame_lanes(dt));
vectorized_work!(Predict<&'a Substep> -> (), |group, substep| group.predict_lanes(substep));
vectorized_work!(Solve<&'a Substep> -> (), |group, substep| group.solve_lanes(substep));
vectorized_work!(EnergyOf<> -> [R; 7], |group, | group.energy_lanes());
