//! One patch as thrift sees it.

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};

use super::fields::ActingFields;
use super::ways::{Ties, rms_distance};
use super::{SLEEP_SHARE, STILL_SHARE, STRAIN};
use crate::cloth::{Energies, Material, PatchMotion};
use crate::rig::NodeTargets;

/// Jaw and lids turn: a node's way there is at most this much longer than straight.
const BENT: f64 = 1.25;

/// Swings lose their amplitude at this share of the damping rate at least.
const DECAY_SHARE: f64 = 0.5;

/// Share of the tolerance within which a patch must swing to fall asleep: naps of a frame or two
/// save nothing.
const FALL_SHARE: f64 = 0.15;

/// Of `v / w0` and of what acceleration adds in a frame, what counts in X.
const REACH_SHARE: f64 = 0.7;

/// The frame that is about to be taken.
pub(in crate::scene) struct Present<'a> {
    /// Its duration. (s)
    pub(in crate::scene) dt: f64,
    /// The full model's substeps per 1/60 s.
    pub(in crate::scene) full: u32,
    pub(in crate::scene) fields: ActingFields,
    /// Muscle shapes at its end, and, of patches that move, at its start.
    pub(in crate::scene) targets: &'a [PatchMotion],
    pub(in crate::scene) before: &'a [NodeTargets],
    /// Patches whose muscle shapes were evaluated for its end.
    pub(in crate::scene) moved: &'a [bool],
    /// How far bones hold nodes from their muscle shapes, patch by patch. (mm)
    pub(in crate::scene) pulls: &'a [Vec<Vector3<f32>>],
    /// Where the nodes of patches are, at its start. [mm, head frame]
    pub(in crate::scene) nodes: &'a dyn Fn(usize) -> &'a [Point3<f32>],
}

/// A patch as thrift sees it.
pub(super) struct Frugal {
    /// Shapes that move it, each with the root mean square of its way at weight 1. (mm)
    pub(super) shapes: Vec<(u32, f64)>,
    ties: Ties,
    node_count: usize,
    /// sqrt(k / k_magnet) of its stiffest tie.
    gain: f64,
    /// Angular frequency of the magnet, and the lowest among it and those of what it is tied to;
    /// half its damping. (1/s)
    frequency: f64,
    softest: f64,
    decay: f64,
    mass: f64,
    /// Weights at which its muscle shapes were evaluated.
    weights: Vec<f32>,
    /// Displacement (mm) and velocity (mm/s) against its muscle shapes, root mean square.
    displacement: f64,
    /// Velocities of the last half period of the magnet, by time.
    speeds: VecDeque<(f64, f64)>,
    /// Since when there are velocities. (s)
    first: f64,
    /// Bound of the amplitude at which it swings, if it sleeps. (mm)
    swing: f64,
    /// Bound of what sparing substeps has cost it and is remembered. (mm)
    pub(super) spared: f64,
    pub(super) is_asleep: bool,
    asleep: Asleep,
}

/// How things stood when a patch fell asleep.
#[derive(Default)]
struct Asleep {
    fields: Option<ActingFields>,
    target: Vec<Point3<f32>>,
    pulls: Vec<Vector3<f32>>,
    /// Displacements of the nodes that it is paired with. (mm)
    partners: Vec<Vector3<f32>>,
}

impl Frugal {
    pub(super) fn new(
        shapes: Vec<(u32, f64)>,
        ties: Ties,
        material: &Material,
        node_count: usize,
        shape_count: usize,
        softest: f64,
    ) -> Self {
        let ratio = material.stretch_stiffness() / material.magnet_stiffness();
        let frequency = std::f64::consts::TAU * material.magnet_frequency_hz;
        Self {
            shapes,
            gain: (ties.strength * ratio).sqrt(),
            ties,
            node_count,
            frequency,
            softest,
            decay: 0.5 * (material.magnet_damping() + material.damping),
            mass: material.mass,
            weights: vec![f32::NAN; shape_count],
            displacement: 0.0,
            speeds: VecDeque::new(),
            first: f64::INFINITY,
            swing: 0.0,
            spared: 0.0,
            is_asleep: false,
            asleep: Asleep::default(),
        }
    }

    /// Forgets the past.
    pub(super) fn reset(&mut self) {
        self.weights.fill(f32::NAN);
        self.displacement = 0.0;
        self.speeds.clear();
        self.first = f64::INFINITY;
        self.swing = 0.0;
        self.spared = 0.0;
        self.is_asleep = false;
    }

    /// Patches that it is tied to.
    pub(super) fn partner_patches(&self) -> impl Iterator<Item = usize> + '_ {
        self.ties.partners.iter().map(|tie| tie.patch)
    }

    /// Whether its muscle shapes go further than `limit` (mm) from where they were evaluated last;
    /// if so, they are to be evaluated now.
    pub(super) fn moves(&mut self, weights: &[f32], limit: f64) -> bool {
        let ways = self.shapes.iter().map(|&(shape, way)| {
            let shape = shape as usize;
            f64::from((weights[shape] - self.weights[shape]).abs()) * way
        });
        // Written so that no number, the mark of the unknown, is moving.
        if BENT * ways.sum::<f64>() <= limit {
            return false;
        }
        self.weights.copy_from_slice(weights);
        true
    }

    /// X of the frame, and what holding the patch through it may cost. (mm)
    ///
    /// - `moves`: whether its muscle shapes were evaluated
    /// - `change`: in the acceleration of fields, against the frame before (mm/s^2)
    /// - `clock`: time at the start of the frame (s); `tolerance` (mm)
    pub(super) fn weigh(
        &mut self,
        index: usize,
        now: &Present<'_>,
        moves: bool,
        change: f64,
        [clock, tolerance]: [f64; 2],
    ) -> [f64; 2] {
        let target = &now.targets[index];
        let acceleration = if moves {
            acceleration(target, &now.before[index], now.dt)
        } else {
            0.0
        };
        let per_frequency = now.dt / self.frequency;
        let forced = acceleration * per_frequency;
        let speed = self.speeds.back().map_or(0.0, |last| last.1);
        let swings = REACH_SHARE * speed / self.frequency;
        let reach =
            self.displacement.hypot(swings) + REACH_SHARE * (forced + change * per_frequency);
        if self.is_asleep {
            self.swing = self.swing * (-DECAY_SHARE * self.decay * now.dt).exp() + forced;
        } else {
            let half_period = std::f64::consts::PI / self.frequency;
            while self
                .speeds
                .front()
                .is_some_and(|s| s.0 < clock - half_period)
            {
                self.speeds.pop_front();
            }
            if self.first > clock - half_period {
                return [reach, f64::INFINITY];
            }
            let fastest = self.speeds.iter().map(|s| s.1).fold(0.0, f64::max);
            self.swing = fastest / self.softest + forced;
        }
        // What is evaluated no more may have gone that much further.
        let still = if moves {
            0.0
        } else {
            2.0 * STILL_SHARE * tolerance
        };
        // What it is off by when it falls asleep it keeps.
        let mut cost = self.swing + still + self.spared;
        let is_too_lively = !self.is_asleep && self.swing > FALL_SHARE * tolerance;
        if cost > SLEEP_SHARE * tolerance || is_too_lively {
            return [reach, f64::INFINITY];
        }
        if self.is_asleep {
            let way = rms_distance(&target.positions, &self.asleep.target);
            let fields = self.asleep.fields.as_ref();
            let field = fields.map_or(f64::INFINITY, |then| now.fields.difference(then));
            cost += STRAIN * way
                + 2.0 * field / (self.frequency * self.frequency)
                + 2.0 * self.gain * self.pulled(index, now);
        } else {
            if moves {
                cost += STRAIN * rms_distance(&target.positions, &now.before[index].0);
            }
            cost += 2.0 * change / (self.frequency * self.frequency);
        }
        [reach, cost]
    }

    /// How far paired nodes and bones have moved against muscle shapes since the patch fell
    /// asleep: root mean square over its nodes. (mm)
    fn pulled(&self, index: usize, now: &Present<'_>) -> f64 {
        let square = |a: &Vector3<f32>, b: &Vector3<f32>| f64::from((a - b).norm_squared());
        let partners = self.partners(now).zip(&self.asleep.partners);
        let partners: f64 = partners.map(|(a, b)| square(&a, b)).sum();
        let bones = now.pulls[index].iter().zip(&self.asleep.pulls);
        let bones: f64 = bones.map(|(a, b)| square(a, b)).sum();
        ((partners + bones) / self.node_count as f64).sqrt()
    }

    /// Displacements of the nodes that it is paired with, at the start of the frame. (mm)
    fn partners<'a>(&'a self, now: &'a Present<'_>) -> impl Iterator<Item = Vector3<f32>> + 'a {
        self.ties.partners.iter().flat_map(|tie| {
            let (nodes, targets) = ((now.nodes)(tie.patch), now.start_of(tie.patch));
            tie.nodes
                .iter()
                .map(move |&node| nodes[node as usize] - targets[node as usize])
        })
    }

    /// Falls asleep for the frame, from how things stood at its start.
    ///
    /// - `fields`: of the frame before
    /// - `pulls`: of bones, then
    pub(super) fn fall_asleep(
        &mut self,
        index: usize,
        now: &Present<'_>,
        fields: ActingFields,
        pulls: &[Vector3<f32>],
    ) {
        self.is_asleep = true;
        let mut partners = std::mem::take(&mut self.asleep.partners);
        partners.clear();
        partners.extend(self.partners(now));
        self.asleep.partners = partners;
        self.asleep.fields = Some(fields);
        self.asleep.target.clear();
        self.asleep.target.extend(now.start_of(index));
        self.asleep.pulls.clear();
        self.asleep.pulls.extend(pulls);
    }

    /// Learns how a frame went that it was awake in, which ended at `clock` (s).
    pub(super) fn learn(&mut self, energies: &Energies, clock: f64) {
        self.is_asleep = false;
        let of_node = 2.0 / (self.mass * self.node_count as f64);
        self.displacement = (energies.magnet * of_node).sqrt() / self.frequency;
        let speed = (energies.kinetic * of_node).sqrt();
        self.first = self.first.min(clock);
        self.speeds.push_back((clock, speed));
    }
}

/// Root mean square acceleration of muscle shapes on their way through a frame of `dt` seconds: of a
/// cubic segment at that end where it is larger, so that what comes and goes within a frame counts.
/// (mm/s^2)
fn acceleration(end: &PatchMotion, start: &NodeTargets, dt: f64) -> f64 {
    let step = dt as f32;
    let (mut first, mut last) = (0.0, 0.0);
    let starts = start.0.iter().zip(&start.1);
    for ((p, v), (q, w)) in end.positions.iter().zip(&end.velocities).zip(starts) {
        let (chord, a, b) = ((p - q) * 6.0, w * step, v * step);
        first += f64::from((chord - a * 4.0 - b * 2.0).norm_squared());
        last += f64::from((a * 2.0 + b * 4.0 - chord).norm_squared());
    }
    (first.max(last) / end.positions.len().max(1) as f64).sqrt() / (dt * dt)
}

impl Present<'_> {
    /// Muscle shapes of a patch at the start of the frame. [mm, head frame]
    fn start_of(&self, patch: usize) -> &[Point3<f32>] {
        if self.moved[patch] {
            &self.before[patch].0
        } else {
            &self.targets[patch].positions
        }
    }
}
