//! The cloth: patches grouped into lanes, frames cut into substeps, guards.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::constraints::attachment::Port;
use super::error::ClothError;
use super::group::{Group, GroupPairs, Monitor, Partner, PatchGroup, Substep};
use super::hook::SubstepHook;
use super::hooked::{SeenNodes, advance_hooked};
use super::input::{
    ClothAttachment, ClothOptions, ClothPatch, FrameInput, HeadMotion, PatchMotion, Precision,
};
use super::lanes::{F32x8, F64x8};
use super::report::{Counters, Energies, StepReport};
use super::validate;

/// Substeps of a long frame are at most this many times those of 1/60 s.
const LONGEST_FRAME: u32 = 8;

/// Substeps that share an evaluation of the wind, which changes more slowly than they do.
const WIND_SUBSTEPS: u32 = 8;

/// Energy may exceed the bound by this factor before a patch falls back.
const ENERGY_TOLERANCE: f64 = 4.0;

/// Energy may exceed the bound by this factor before a patch is frozen.
const FREEZE_TOLERANCE: f64 = 1e3;

/// A patch that has fallen back in this many frames on end is solved by descent as well.
const LONGEST_EULER: u32 = 3;

/// A patch that has fallen back in this many frames on end is frozen.
const LONGEST_TROUBLE: u32 = 30;

/// Frames of backward Euler after a fall-back, and of descent after a fall-back to that.
const EULER_FRAMES: u32 = 2;
const ROBUST_FRAMES: u32 = 30;

/// A cloth of patches, drawn to moving targets. See the [module](super) for the method.
pub struct Cloth {
    options: ClothOptions,
    layout: Vec<PatchLayout>,
    groups: Vec<Box<dyn PatchGroup>>,
    /// Ports of each group, and those of the next substep.
    ports: [Vec<Vec<Port>>; 2],
    has_pairs: bool,
    monitors: Vec<Vec<Monitor>>,
    positions: Vec<Vec<Point3<f32>>>,
    energies: Vec<Energies>,
    /// Energy that each patch may have, and at the end the whole, from what was put in so far.
    ceilings: Vec<f64>,
    /// For how many frames on end each patch has fallen back.
    troubled_frames: Vec<u32>,
    previous_h: f64,
    fields: Fields,
}

/// Where a patch is, and what its input must look like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchLayout {
    pub(crate) node_count: usize,
    pub(crate) anchor_count: usize,
    pub(super) group: usize,
    pub(super) lane: usize,
}

/// Gravity's difference, wind and head motion at the end of a frame.
#[derive(Debug, Clone, Copy)]
struct Fields {
    gravity: Vector3<f64>,
    wind: Vector3<f64>,
    linear: Vector3<f64>,
    angular_velocity: Vector3<f64>,
    angular_acceleration: Vector3<f64>,
}

impl Fields {
    const NONE: Self = Self {
        gravity: Vector3::new(0.0, 0.0, 0.0),
        wind: Vector3::new(0.0, 0.0, 0.0),
        linear: Vector3::new(0.0, 0.0, 0.0),
        angular_velocity: Vector3::new(0.0, 0.0, 0.0),
        angular_acceleration: Vector3::new(0.0, 0.0, 0.0),
    };

    fn of(input: &FrameInput<'_>, standing: Vector3<f32>) -> Self {
        let HeadMotion {
            linear_acceleration,
            angular_velocity,
            angular_acceleration,
        } = input.head;
        Self {
            gravity: input.gravity.map_or(Vector3::zeros(), |g| {
                g.map(f64::from) - standing.map(f64::from)
            }),
            wind: input.wind.map(f64::from),
            linear: linear_acceleration.map(f64::from),
            angular_velocity: angular_velocity.map(f64::from),
            angular_acceleration: angular_acceleration.map(f64::from),
        }
    }

    fn between(&self, end: &Self, s: f64) -> Self {
        Self {
            gravity: self.gravity.lerp(&end.gravity, s),
            wind: self.wind.lerp(&end.wind, s),
            linear: self.linear.lerp(&end.linear, s),
            angular_velocity: self.angular_velocity.lerp(&end.angular_velocity, s),
            angular_acceleration: self.angular_acceleration.lerp(&end.angular_acceleration, s),
        }
    }
}

impl Cloth {
    /// A cloth at rest in the neutral positions of its patches.
    ///
    /// # Errors
    ///
    /// [`ClothError`] with the patch and the number that is wrong.
    pub fn new(patches: &[ClothPatch], options: &ClothOptions) -> Result<Self, ClothError> {
        validate::options(options)?;
        validate::patches(patches)?;
        let mut groups: Vec<Box<dyn PatchGroup>> = Vec::new();
        let mut layout: Vec<PatchLayout> = patches
            .iter()
            .map(|p| PatchLayout {
                node_count: p.shape.node_count(),
                anchor_count: p.anchor_sets().map(|(nodes, _)| nodes.len()).sum(),
                group: 0,
                lane: 0,
            })
            .collect();
        for members in plan_groups(patches, options.precision) {
            for (lane, &patch) in members.iter().enumerate() {
                layout[patch].group = groups.len();
                layout[patch].lane = lane;
            }
            groups.push(make_group(patches, &members, options));
        }
        let has_pairs = link_pairs(patches, &layout, &mut groups);
        let empty_ports = vec![Vec::new(); groups.len()];
        Ok(Self {
            options: *options,
            positions: patches.iter().map(|p| p.rest.clone()).collect(),
            energies: vec![Energies::default(); patches.len()],
            ceilings: vec![0.0; patches.len() + 1],
            troubled_frames: vec![0; patches.len()],
            monitors: vec![Vec::new(); groups.len()],
            ports: [empty_ports.clone(), empty_ports],
            has_pairs,
            layout,
            groups,
            previous_h: 0.0,
            fields: Fields::NONE,
        })
    }

    /// The options it was made with.
    pub fn options(&self) -> &ClothOptions {
        &self.options
    }

    /// How many patches there are.
    pub fn patch_count(&self) -> usize {
        self.layout.len()
    }

    /// Puts the cloth on `targets`, moving as they do, with no field acting: for the start of
    /// a take, cuts and teleports. Anchors go to `anchors`, or stay if there are none.
    ///
    /// # Errors
    ///
    /// As [`Cloth::step`].
    pub fn reset(
        &mut self,
        targets: &[PatchMotion],
        anchors: &[PatchMotion],
    ) -> Result<(), ClothError> {
        validate::motions(&self.layout, targets, anchors)?;
        self.put_on_targets(targets, anchors);
        self.write_positions();
        Ok(())
    }

    /// As [`Cloth::reset`], but `hook` has a say in where nodes start.
    ///
    /// # Errors
    ///
    /// As [`Cloth::step`].
    pub fn reset_with(
        &mut self,
        targets: &[PatchMotion],
        anchors: &[PatchMotion],
        hook: &mut dyn SubstepHook,
    ) -> Result<(), ClothError> {
        validate::motions(&self.layout, targets, anchors)?;
        self.put_on_targets(targets, anchors);
        let seen = SeenNodes::new(hook.patches(), &self.layout);
        let mut nodes: Vec<Point3<f32>> = hook
            .patches()
            .iter()
            .flat_map(|&patch| targets[patch].positions.iter().copied())
            .collect();
        let wanted = nodes.clone();
        hook.reset(&mut nodes);
        seen.for_each(hook.moved(), |at, node, i| {
            let offset = [0, 1, 2].map(|k| f64::from(nodes[i][k]) - f64::from(wanted[i][k]));
            self.groups[at.group].place(at.lane, node, offset);
        });
        self.write_positions();
        Ok(())
    }

    fn put_on_targets(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        for group in &mut self.groups {
            group.reset(targets, anchors);
        }
        self.fields = Fields::NONE;
        self.previous_h = 0.0;
        self.energies.fill(Energies::default());
        self.ceilings.fill(0.0);
        self.troubled_frames.fill(0);
    }

    /// Moves the cloth through one frame.
    ///
    /// The frame is cut into [`ClothOptions::substeps`] per 1/60 s. Results have the same bits
    /// for any number of threads.
    ///
    /// # Errors
    ///
    /// [`ClothError`] for counts that do not match, numbers that are not finite, and a time
    /// step that is not positive; the cloth is then unchanged.
    pub fn step(&mut self, input: &FrameInput<'_>) -> Result<StepReport, ClothError> {
        self.step_hooked(input, None)
    }

    /// As [`Cloth::step`], with `hook` moving nodes at the end of every substep.
    ///
    /// # Errors
    ///
    /// As [`Cloth::step`].
    pub fn step_with(
        &mut self,
        input: &FrameInput<'_>,
        hook: &mut dyn SubstepHook,
    ) -> Result<StepReport, ClothError> {
        self.step_hooked(input, Some(hook))
    }

    fn step_hooked(
        &mut self,
        input: &FrameInput<'_>,
        hook: Option<&mut dyn SubstepHook>,
    ) -> Result<StepReport, ClothError> {
        validate::frame(&self.layout, input)?;
        let end = Fields::of(input, self.options.standing_gravity);
        let count = self.substep_count(input.dt);
        let substeps: Vec<Substep> = (0..count)
            .map(|k| self.substep(k, count, input.dt, &end))
            .collect();
        let (dt, targets, anchors) = (input.dt, input.targets, input.anchors);
        let monitors = &mut self.monitors;
        if let Some(hook) = hook {
            self.groups
                .par_iter_mut()
                .for_each(|g| g.begin_frame(dt, targets, anchors));
            advance_hooked(
                &mut self.groups,
                &mut self.ports,
                &substeps,
                &self.layout,
                hook,
            );
            self.groups
                .par_iter_mut()
                .zip(monitors)
                .for_each(|(g, m)| g.end_frame(m));
        } else if self.has_pairs {
            self.groups
                .par_iter_mut()
                .for_each(|g| g.begin_frame(dt, targets, anchors));
            advance_together(&mut self.groups, &mut self.ports, &substeps);
            self.groups
                .par_iter_mut()
                .zip(monitors)
                .for_each(|(g, m)| g.end_frame(m));
        } else {
            self.groups
                .par_iter_mut()
                .zip(monitors)
                .for_each(|(group, monitor)| {
                    group.begin_frame(dt, targets, anchors);
                    let mut none = Vec::new();
                    for (k, substep) in substeps.iter().enumerate() {
                        if k == 0 {
                            group.predict(substep, &mut none);
                        } else {
                            group.turn(substep, &mut none);
                        }
                        group.solve(substep, &[]);
                    }
                    group.finish();
                    group.end_frame(monitor);
                });
        }
        self.fields = end;
        self.previous_h = input.dt / f64::from(count);
        let (counters, energies) = self.guard();
        self.write_positions();
        Ok(StepReport {
            substeps: count,
            counters,
            energies,
        })
    }

    /// Positions of a patch's nodes after the last step. [mm, head frame]
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn positions(&self, patch: usize) -> &[Point3<f32>] {
        &self.positions[patch]
    }

    /// Energies of a patch after the last step.
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn patch_energies(&self, patch: usize) -> &Energies {
        &self.energies[patch]
    }

    /// Position (mm) and velocity (mm/s) of one node in the precision of the solver.
    ///
    /// # Panics
    ///
    /// If there is no such patch or node.
    pub fn node_state(&self, patch: usize, node: usize) -> (Point3<f64>, Vector3<f64>) {
        let at = &self.layout[patch];
        let (x, v) = self.groups[at.group].node_state(at.lane, node);
        (Point3::from(x), Vector3::from(v))
    }

    fn substep_count(&self, dt: f64) -> u32 {
        let wanted = dt * 60.0 * f64::from(self.options.substeps);
        let most = self.options.substeps * LONGEST_FRAME;
        // A millionth less, so that rounding in dt does not add a substep.
        ((wanted * (1.0 - 1e-6)).ceil() as u32).clamp(1, most)
    }

    fn substep(&self, k: u32, count: u32, dt: f64, end: &Fields) -> Substep {
        let h = dt / f64::from(count);
        let progress = [k, k + 1].map(|i| f64::from(i) / f64::from(count));
        let f = self.fields.between(end, progress[1]);
        let first = k - k % WIND_SUBSTEPS;
        let shared = WIND_SUBSTEPS.min(count - first);
        let middle = f64::from(first) + 0.5 * f64::from(shared);
        let wind = self.fields.between(end, middle / f64::from(count)).wind;
        Substep {
            h,
            previous_h: if k == 0 { self.previous_h } else { h },
            progress,
            uniform: (f.gravity - f.linear).into(),
            angular: [f.angular_velocity.into(), f.angular_acceleration.into()],
            wind: wind.into(),
            wind_horizon: (k == first && wind != Vector3::zeros())
                .then(|| 0.5 * h * f64::from(shared)),
        }
    }

    /// Looks at every patch after a frame, and acts where one has gone wrong.
    fn guard(&mut self) -> (Counters, Energies) {
        let mut counters = Counters::default();
        let mut sum = Energies::default();
        // Pairs hand energy from patch to patch; then only the whole is bounded.
        let mut whole = Monitor::default();
        let mut whole_energy = 0.0;
        for m in self.monitors.iter().flatten() {
            whole.before += m.before;
            whole.drive += m.drive;
            whole.mismatch += m.mismatch;
            whole_energy += m.energies.total();
        }
        let last = self.ceilings.len() - 1;
        let whole_bound = energy_bound(&whole, whole_energy, &mut self.ceilings[last]);
        for (group, monitors) in self.groups.iter_mut().zip(&self.monitors) {
            for (lane, m) in monitors.iter().enumerate() {
                let patch = group.patches()[lane];
                counters.clamped_displacements += m.clamped;
                let energy = m.energies.total();
                let own_bound = energy_bound(m, energy, &mut self.ceilings[patch]);
                let bound = if self.has_pairs {
                    whole_bound
                } else {
                    own_bound
                };
                self.energies[patch] = m.energies;
                let trouble = &mut self.troubled_frames[patch];
                *trouble = if energy > ENERGY_TOLERANCE * bound {
                    *trouble + 1
                } else {
                    0
                };
                let is_lost = energy > FREEZE_TOLERANCE * bound || *trouble > LONGEST_TROUBLE;
                if !m.is_sound || is_lost {
                    group.freeze(lane);
                    counters.frozen_patches += 1;
                    self.energies[patch] = Energies::default();
                    self.ceilings[patch] = 0.0;
                    *trouble = 0;
                } else if *trouble > LONGEST_EULER {
                    group.fall_back(lane, ROBUST_FRAMES, true);
                    counters.robust_fallbacks += 1;
                } else if *trouble > 0 {
                    group.fall_back(lane, EULER_FRAMES, false);
                    counters.euler_fallbacks += 1;
                }
                sum += self.energies[patch];
            }
        }
        if !self.ceilings[last].is_finite() {
            self.ceilings[last] = sum.total();
        }
        (counters, sum)
    }

    fn write_positions(&mut self) {
        let (layout, groups) = (&self.layout, &self.groups);
        self.positions
            .par_iter_mut()
            .zip(layout)
            .for_each(|(out, at)| groups[at.group].write_positions(at.lane, out));
    }
}

/// What energy a patch may have after a frame: what it had, or might have had, and what moving
/// targets and fields gave, as amplitudes, with what rest lengths and anchors hold against the
/// targets. Without input the ceiling never rises, however slowly energy creeps up. The floor
/// is the energy of a thousandth of a millimetre at 10 Hz in a thousand nodes.
fn energy_bound(m: &Monitor, energy: f64, ceiling: &mut f64) -> f64 {
    let before = ceiling.min(ENERGY_TOLERANCE * m.before).max(0.0);
    let amplitude = before.sqrt() + m.drive;
    let bound = amplitude * amplitude + 2.0 * m.mismatch + 1.0;
    *ceiling = energy.min(bound).max(amplitude * amplitude);
    bound
}

/// Runs all substeps with the groups in step, as pairs couple them.
fn advance_together(
    groups: &mut [Box<dyn PatchGroup>],
    ports: &mut [Vec<Vec<Port>>; 2],
    substeps: &[Substep],
) {
    let [now, next] = ports;
    let Some(first) = substeps.first() else {
        return;
    };
    groups
        .par_iter_mut()
        .zip(now.par_iter_mut())
        .for_each(|(g, p)| g.predict(first, p));
    for (k, substep) in substeps.iter().enumerate() {
        let following = substeps.get(k + 1);
        let shared: &[Vec<Port>] = now;
        groups
            .par_iter_mut()
            .zip(next.par_iter_mut())
            .for_each(|(g, p)| {
                g.solve(substep, shared);
                match following {
                    Some(following) => g.turn(following, p),
                    None => g.finish(),
                }
            });
        std::mem::swap(now, next);
    }
}

/// Patches of one shape, with or without pressure, in chunks of at most eight.
fn plan_groups(patches: &[ClothPatch], precision: Precision) -> Vec<Vec<usize>> {
    let widest = match precision {
        Precision::Single | Precision::Double => 8,
        Precision::SingleScalar => 1,
    };
    let mut alike: BTreeMap<(u32, u32, bool, bool), Vec<usize>> = BTreeMap::new();
    for (index, p) in patches.iter().enumerate() {
        let key = (
            p.shape.u_count,
            p.shape.v_count,
            p.shape.is_periodic,
            p.material.pressure > 0.0,
        );
        alike.entry(key).or_default().push(index);
    }
    alike
        .into_values()
        .flat_map(|members| {
            members
                .chunks(widest)
                .map(<[usize]>::to_vec)
                .collect::<Vec<_>>()
        })
        .collect()
}

fn make_group(
    patches: &[ClothPatch],
    members: &[usize],
    options: &ClothOptions,
) -> Box<dyn PatchGroup> {
    match options.precision {
        Precision::Double => Box::new(Group::<F64x8>::new(patches, members, options)),
        Precision::SingleScalar => Box::new(Group::<f32>::new(patches, members, options)),
        Precision::Single => Box::new(Group::<F32x8>::new(patches, members, options)),
    }
}

/// Gives every group the pairs of its nodes. Returns whether there are any.
fn link_pairs(
    patches: &[ClothPatch],
    layout: &[PatchLayout],
    groups: &mut [Box<dyn PatchGroup>],
) -> bool {
    let mut lists = vec![GroupPairs::default(); groups.len()];
    let mut ports: BTreeMap<(usize, u32), usize> = BTreeMap::new();
    let mut port_of = |lists: &mut [GroupPairs], patch: usize, node: u32| {
        let at = &layout[patch];
        *ports.entry((patch, node)).or_insert_with(|| {
            let list = &mut lists[at.group];
            list.nodes.push((node, at.lane as u32));
            list.partners.push(Vec::new());
            list.nodes.len() - 1
        })
    };
    let mut has_pairs = false;
    for (a, patch) in patches.iter().enumerate() {
        for attachment in &patch.attachments {
            let ClothAttachment::Patch {
                patch: b,
                pairs,
                strength,
            } = attachment
            else {
                continue;
            };
            let b = *b as usize;
            let stiffness = |p: usize| patches[p].material.stretch_stiffness();
            let stiffness = strength * stiffness(a).min(stiffness(b));
            for &(node, other) in pairs {
                has_pairs = true;
                let (ga, gb) = (layout[a].group, layout[b].group);
                let pa = port_of(&mut lists, a, node);
                let pb = port_of(&mut lists, b, other);
                lists[ga].partners[pa].push(Partner {
                    group: gb,
                    port: pb,
                    stiffness,
                });
                lists[gb].partners[pb].push(Partner {
                    group: ga,
                    port: pa,
                    stiffness,
                });
            }
        }
    }
    for (group, list) in groups.iter_mut().zip(lists) {
        group.set_pairs(list);
    }
    has_pairs
}
