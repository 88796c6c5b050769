//! The cloth: patches grouped into lanes, frames cut into substeps, guards.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::assembly::{Assembly, PatchLayout, assemble};
use super::error::ClothError;
use super::group::{Monitor, OwnPorts, PatchGroup, Ports, Substep, each_group};
use super::guard::Guard;
use super::hook::SubstepHook;
use super::hooked::{SeenNodes, advance_hooked};
use super::input::{ClothOptions, ClothPatch, FrameInput, HeadMotion, PatchMotion};
use super::report::{Energies, StepReport};
use super::validate;
use crate::machine::among_workers;

/// Substeps of a long frame are at most this many times those of 1/60 s.
const LONGEST_FRAME: u32 = 8;

/// Substeps that share an evaluation of the wind, which changes more slowly than they do.
const WIND_SUBSTEPS: u32 = 8;

/// A cloth of patches, drawn to moving targets. See the [module](super) for the method.
pub struct Cloth {
    options: ClothOptions,
    layout: Vec<PatchLayout>,
    groups: Vec<Box<dyn PatchGroup>>,
    /// Ports of all groups, and those of the next substep.
    ports: [Ports; 2],
    /// Groups that sleep.
    asleep: Vec<bool>,
    /// What patches do that sleep, one per patch.
    dreams: Vec<Dream>,
    /// Motions of targets in the last frame in which any patch slept, and of the anchors of those
    /// that did.
    dreamt: [Vec<PatchMotion>; 2],
    monitors: Vec<Vec<Monitor>>,
    guard: Guard,
    positions: Vec<Vec<Point3<f32>>>,
    previous_h: f64,
    fields: Fields,
}

/// What a patch does that sleeps: it keeps its displacement from its targets.
#[derive(Debug, Clone, Default)]
struct Dream {
    /// (mm)
    displacements: Vec<Vector3<f32>>,
    /// Whether it fell asleep just now.
    is_new: bool,
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
        let Assembly {
            groups,
            layout,
            ports,
        } = assemble(patches, options);
        Ok(Self {
            options: *options,
            positions: patches.iter().map(|p| p.rest.clone()).collect(),
            guard: Guard::new(patches.len(), !ports.is_empty()),
            monitors: vec![Vec::new(); groups.len()],
            asleep: vec![false; groups.len()],
            dreams: vec![Dream::default(); patches.len()],
            dreamt: [(); 2].map(|()| vec![PatchMotion::default(); patches.len()]),
            ports: [ports.clone(), ports],
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
        for moved in hook.moved() {
            let (at, node) = seen.place_of(moved.node);
            let i = moved.node as usize;
            let offset = [0, 1, 2].map(|k| f64::from(nodes[i][k]) - f64::from(wanted[i][k]));
            self.groups[at.group].place(at.lane, node, offset);
        }
        self.write_positions();
        Ok(())
    }

    fn put_on_targets(&mut self, targets: &[PatchMotion], anchors: &[PatchMotion]) {
        for group in &mut self.groups {
            group.reset(targets, anchors);
        }
        self.asleep.fill(false);
        self.fields = Fields::NONE;
        self.previous_h = 0.0;
        self.guard.reset();
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
        among_workers(|| self.step_hooked(input, None))
    }

    /// As [`Cloth::step`], with `hook` moving nodes at the end of substeps, as its stride says.
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
        let count = self.substep_count(input.dt, input.substeps);
        self.send_to_sleep(if hook.is_some() { &[] } else { input.held }, input.dt);
        self.dream(input);
        let substeps: Vec<Substep> = (0..count)
            .map(|k| self.substep(k, count, input.dt, &end))
            .collect();
        let (dt, targets, anchors) = (input.dt, input.targets, input.anchors);
        let (monitors, asleep) = (&mut self.monitors, &self.asleep);
        if let Some(hook) = hook {
            each_group(&mut self.groups).for_each(|g| g.begin_frame(dt, targets, anchors));
            advance_hooked(
                &mut self.groups,
                &mut self.ports,
                &substeps,
                &self.layout,
                hook,
            );
            each_group(&mut self.groups)
                .zip(monitors)
                .for_each(|(g, m)| g.end_frame(m));
        } else if !self.ports[0].is_empty() {
            awake(&mut self.groups, asleep).for_each(|g| g.begin_frame(dt, targets, anchors));
            advance_together(&mut self.groups, &mut self.ports, &substeps, asleep);
            each_group(&mut self.groups)
                .zip(monitors)
                .zip(asleep)
                .filter(|(_, asleep)| !**asleep)
                .for_each(|((g, m), _)| g.end_frame(m));
        } else {
            let none = Ports::default();
            each_group(&mut self.groups)
                .zip(monitors)
                .zip(asleep)
                .filter(|(_, asleep)| !**asleep)
                .for_each(|((group, monitor), _)| {
                    group.begin_frame(dt, targets, anchors);
                    for (k, substep) in substeps.iter().enumerate() {
                        if k == 0 {
                            group.predict(substep, OwnPorts::none(&mut 0));
                        } else {
                            group.turn(substep, OwnPorts::none(&mut 0));
                        }
                        group.solve(substep, &none);
                    }
                    group.finish();
                    group.end_frame(monitor);
                });
        }
        self.fields = end;
        self.previous_h = input.dt / f64::from(count);
        let (counters, energies) =
            self.guard
                .watch(input.dt, &mut self.groups, &self.monitors, &self.asleep);
        self.write_positions();
        let sleepers = self.groups.iter().zip(&self.asleep).filter(|(_, a)| **a);
        Ok(StepReport {
            substeps: if self.asleep.iter().all(|a| *a) {
                0
            } else {
                count
            },
            sleeping_patches: sleepers.map(|(g, _)| g.patches().len() as u32).sum(),
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

    /// Whether a patch slept in the last step.
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn is_asleep(&self, patch: usize) -> bool {
        self.asleep[self.layout[patch].group]
    }

    /// Energies of a patch after the last step.
    ///
    /// # Panics
    ///
    /// If there is no such patch.
    pub fn patch_energies(&self, patch: usize) -> &Energies {
        &self.guard.energies[patch]
    }

    /// Position (mm) and velocity (mm/s) of one node in the precision of the solver.
    ///
    /// # Panics
    ///
    /// If there is no such patch or node.
    pub fn node_state(&self, patch: usize, node: usize) -> (Point3<f64>, Vector3<f64>) {
        let at = &self.layout[patch];
        if self.asleep[at.group] {
            let (target, u) = (&self.dreamt[0][patch], &self.dreams[patch].displacements);
            let x = target.positions[node].cast() + u[node].cast::<f64>();
            let v = target.velocities.get(node);
            return (x, v.map_or(Vector3::zeros(), |v| v.cast()));
        }
        let (x, v) = self.groups[at.group].node_state(at.lane, node);
        (Point3::from(x), Vector3::from(v))
    }

    /// Of patches that may be held, those that then sleep: all that share a register must be held.
    ///
    /// - `held`: as [`FrameInput::held`]
    pub fn sleepers(&self, held: &[bool]) -> Vec<bool> {
        let mut out = vec![false; self.layout.len()];
        for group in self.groups.iter().filter(|g| sleeps(g.patches(), held)) {
            for &patch in group.patches() {
                out[patch] = true;
            }
        }
        out
    }

    /// Puts to sleep the groups of which all patches are held, and wakes the others.
    ///
    /// - `dt`: duration of the frame (s)
    fn send_to_sleep(&mut self, held: &[bool], dt: f64) {
        let mut has_changed = false;
        let [now, next] = self.ports.each_mut().map(Ports::split);
        let groups = self.groups.iter_mut().zip(now).zip(next);
        for (index, ((group, now), next)) in groups.enumerate() {
            let sleeps = sleeps(group.patches(), held);
            match (self.asleep[index], sleeps) {
                (false, true) => {
                    group.fall_asleep([now, next]);
                    for &patch in group.patches() {
                        self.dreams[patch].is_new = true;
                    }
                }
                (true, false) => {
                    let [targets, anchors] = &self.dreamt;
                    group.wake(dt, targets, anchors);
                }
                _ => {}
            }
            has_changed |= sleeps != self.asleep[index];
            self.asleep[index] = sleeps;
        }
        if has_changed {
            self.guard.forget_whole();
        }
    }

    /// Lets patches that sleep follow their targets, and remembers where all went.
    fn dream(&mut self, input: &FrameInput<'_>) {
        if !self.asleep.contains(&true) {
            return;
        }
        let (groups, asleep) = (&self.groups, &self.asleep);
        let [dreamt_targets, dreamt_anchors] = &mut self.dreamt;
        for (patch, at) in self.layout.iter().enumerate() {
            let (target, dreamt) = (&input.targets[patch], &mut dreamt_targets[patch]);
            if !asleep[at.group] {
                // Pads that wake ask where what they lie on was.
                dreamt.clone_from(target);
                continue;
            }
            let (dream, positions) = (&mut self.dreams[patch], &mut self.positions[patch]);
            if std::mem::take(&mut dream.is_new) {
                dream
                    .displacements
                    .resize(positions.len(), Vector3::zeros());
                groups[at.group].write_displacements(at.lane, &mut dream.displacements);
            } else if dreamt == target {
                continue;
            }
            dreamt.clone_from(target);
            if let Some(anchors) = input.anchors.get(patch) {
                dreamt_anchors[patch].clone_from(anchors);
            }
            let followed = target.positions.iter().zip(&dream.displacements);
            for (position, (target, displacement)) in positions.iter_mut().zip(followed) {
                *position = target + displacement;
            }
        }
    }

    /// Substeps that a frame of `dt` seconds is cut into, at `substeps` per 1/60 s, or those of the
    /// options.
    pub fn substep_count(&self, dt: f64, substeps: Option<u32>) -> u32 {
        let substeps = substeps.unwrap_or(self.options.substeps);
        let wanted = dt * 60.0 * f64::from(substeps);
        let most = substeps * LONGEST_FRAME;
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

    fn write_positions(&mut self) {
        let (layout, groups, asleep) = (&self.layout, &self.groups, &self.asleep);
        self.positions
            .par_iter_mut()
            .zip(layout)
            .filter(|(_, at)| !asleep[at.group])
            .for_each(|(out, at)| groups[at.group].write_positions(at.lane, out));
    }
}

fn sleeps(patches: &[usize], held: &[bool]) -> bool {
    patches.iter().all(|&p| held.get(p) == Some(&true))
}

/// The groups that do not sleep.
fn awake<'a>(
    groups: &'a mut [Box<dyn PatchGroup>],
    asleep: &'a [bool],
) -> impl ParallelIterator<Item = &'a mut Box<dyn PatchGroup>> {
    each_group(groups)
        .zip(asleep)
        .filter(|(_, asleep)| !**asleep)
        .map(|(group, _)| group)
}

/// Runs all substeps with the groups in step, as pairs couple them.
fn advance_together(
    groups: &mut [Box<dyn PatchGroup>],
    ports: &mut [Ports; 2],
    substeps: &[Substep],
    asleep: &[bool],
) {
    let [now, next] = ports;
    let Some(first) = substeps.first() else {
        return;
    };
    each_group(groups)
        .zip(now.split())
        .zip(asleep)
        .filter(|(_, asleep)| !**asleep)
        .for_each(|((g, p), _)| g.predict(first, p));
    for (k, substep) in substeps.iter().enumerate() {
        let following = substeps.get(k + 1);
        let shared: &Ports = now;
        each_group(groups)
            .zip(next.split())
            .zip(asleep)
            .filter(|(_, asleep)| !**asleep)
            .for_each(|((g, p), _)| {
                g.solve(substep, shared);
                match following {
                    Some(following) => g.turn(following, p),
                    None => g.finish(),
                }
            });
        std::mem::swap(now, next);
    }
}
