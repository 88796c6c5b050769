//! Decides, frame by frame, what is left out.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::fields::ActingFields;
use super::foresight::{Foresight, Omen};
use super::options::Economy;
use super::patch::{Frugal, Present};
use super::ways::{ties, ways_of_shapes};
use super::{
    AHEAD, CALM, GROWTH, MEMORY, ROUNDING, SKIN_SHARE, SLEEP_SHARE, SNAP, STILL_SHARE, STORM,
    SUBSTEP_ERROR, SUBSTEP_SHARE,
};
use crate::cloth::{ClothOptions, ClothPatch, Energies, Integrator, Material, Mode};
use crate::rig::Rig;
use crate::scene::anchors::BoneAnchors;
use crate::scene::{FacePose, SceneError};

/// Wind that makes a storm. (mm/s^2)
const STORM_AIR: f64 = 500.0;

/// Rest lengths follow muscle shapes at least so far where substeps are spared.
const LEAST_BLEND: f64 = 0.85;

/// Ranges of materials with which [`SUBSTEP_ERROR`] was measured: stretch against magnet, the
/// magnet's frequency (Hz) and its damping ratio.
const MEASURED: [[f64; 2]; 3] = [[5.0, 40.0], [5.0, 16.0], [0.1, 1.5]];

/// Decides, frame by frame, what is left out.
pub(in crate::scene) struct Thrift {
    options: Economy,
    /// (mm)
    tolerance: f64,
    patches: Vec<Frugal>,
    foresight: Foresight,
    /// Place in the cloth of each.
    cloth_of: Vec<Option<usize>>,
    /// Whether what sparing substeps costs was measured for such a cloth.
    is_measured: bool,
    /// Time since the face was put somewhere. (s)
    clock: f64,
    /// How long everything is modelled from now on. (s)
    whole: f64,
    fields: Option<ActingFields>,
    pulls: Vec<Vec<Vector3<f32>>>,
    /// Substeps per 1/60 s of the frame before.
    substeps: u32,
    /// Patches whose muscle shapes were evaluated for the present frame.
    moving: Vec<bool>,
    /// What is remembered: what sleep and what the substeps that were spared have cost, and X.
    /// (mm)
    remembered: [f64; 3],
}

/// What a frame is spared.
#[derive(Debug, Clone, Default)]
pub(in crate::scene) struct Plan {
    /// Patches of the cloth that are held; none at all where everything is modelled.
    pub(in crate::scene) held: Vec<bool>,
    /// Substeps per 1/60 s; none: all.
    pub(in crate::scene) substeps: Option<u32>,
    /// Difference to the full model, unless a patch snaps, and if one does. (mm)
    pub(in crate::scene) estimate: f64,
    pub(in crate::scene) bound: f64,
    pub(in crate::scene) is_storm: bool,
    /// Whether everything is modelled.
    pub(in crate::scene) is_whole: bool,
}

impl Thrift {
    /// Takes the measure of a rig's shapes.
    ///
    /// - `patches`: all of the rig, as cloth; `cloth_of`: place in the cloth of those that are
    pub(in crate::scene) fn new(
        rig: &Rig,
        patches: &[ClothPatch],
        cloth_of: Vec<Option<usize>>,
        anchored: &[BoneAnchors],
        economy: Economy,
        options: &ClothOptions,
    ) -> Result<Self, SceneError> {
        let shapes = ways_of_shapes(rig, anchored)?;
        let count = rig.shape_names.len();
        let frequency = |patch: &ClothPatch| TAU * patch.material.magnet_frequency_hz;
        let materials: Vec<_> = patches
            .iter()
            .zip(&cloth_of)
            .map(|(patch, own)| own.map(|_| patch.material))
            .collect();
        let tied = ties(rig).into_iter().zip(shapes).zip(patches);
        Ok(Self {
            options: economy,
            tolerance: economy.tolerance.on(rig),
            patches: tied
                .map(|((ties, shapes), patch)| {
                    let partners = ties
                        .partners
                        .iter()
                        .map(|tie| frequency(&patches[tie.patch]));
                    let softest = partners.fold(frequency(patch), f64::min);
                    let nodes = patch.rest.len();
                    Frugal::new(shapes, ties, &patch.material, nodes, count, softest)
                })
                .collect(),
            foresight: Foresight::new(&materials, count),
            cloth_of,
            is_measured: is_measured(patches, options),
            clock: 0.0,
            whole: CALM,
            fields: None,
            pulls: vec![Vec::new(); patches.len()],
            substeps: options.substeps,
            moving: vec![true; patches.len()],
            remembered: [0.0; 3],
        })
    }

    /// Forgets the past: the face was put somewhere at once.
    pub(in crate::scene) fn reset(&mut self, options: &ClothOptions) {
        for patch in &mut self.patches {
            patch.reset();
        }
        self.foresight.forget();
        self.clock = 0.0;
        self.whole = CALM;
        self.fields = None;
        self.substeps = options.substeps;
        self.remembered = [0.0; 3];
    }

    /// When to look next at what comes, before the frame of `dt` seconds that starts at `start`;
    /// none once all of it was seen.
    ///
    /// - `rates`: of the weights at the start (1/s)
    pub(in crate::scene) fn looks_ahead(
        &mut self,
        start: f64,
        rates: &[f32],
        dt: f64,
    ) -> Option<f64> {
        self.foresight.next([start, start + dt + AHEAD], rates, dt)
    }

    /// Sees what comes `ahead` seconds after the start of the frame.
    pub(in crate::scene) fn see(&mut self, [start, time]: [f64; 2], omen: &Omen<'_>, dt: f64) {
        let is_storm = self.foresight.see(time, omen, dt, &self.patches) || omen.air > STORM_AIR;
        if is_storm {
            self.whole = self.whole.max(time - start);
        }
    }

    /// What comes is not known any more: somebody else drives the face.
    pub(in crate::scene) fn forget_ahead(&mut self) {
        self.foresight.forget();
    }

    /// Patches whose muscle shapes are to be evaluated for `pose`.
    pub(in crate::scene) fn moving(&mut self, pose: &FacePose) -> &[bool] {
        // Less than nothing: every change counts.
        let limit = if self.options.sleep && self.whole <= 0.0 {
            STILL_SHARE * self.tolerance
        } else {
            -1.0
        };
        for (patch, moves) in self.patches.iter_mut().zip(&mut self.moving) {
            *moves = patch.moves(&pose.weights, limit);
        }
        &self.moving
    }

    /// Decides who is held, and how many substeps the frame takes.
    ///
    /// - `sleepers`: of patches of the cloth that are held, those that then sleep
    pub(in crate::scene) fn plan(
        &mut self,
        now: &Present<'_>,
        sleepers: impl FnOnce(&[bool]) -> Vec<bool>,
    ) -> Plan {
        let before = self.fields.unwrap_or(now.fields);
        let change = now.fields.difference(&before);
        let at = [self.clock, self.tolerance];
        let weighed: Vec<[f64; 2]> = self
            .patches
            .iter_mut()
            .enumerate()
            .map(|(index, patch)| patch.weigh(index, now, self.moving[index], change, at))
            .collect();
        let of_cloth = || (0..weighed.len()).filter_map(|p| Some((p, self.cloth_of[p]?)));
        let furthest = of_cloth().map(|(p, _)| weighed[p][0]).fold(0.0, f64::max);
        let is_storm = furthest > STORM || now.fields.air() > STORM_AIR;
        let is_whole = is_storm || self.whole > 0.0;
        let may_sleep = |p: usize| {
            self.options.sleep && (self.options.quasi_static || !self.moving[p]) && !is_whole
        };
        let mut held = vec![false; of_cloth().count()];
        for (p, own) in of_cloth() {
            held[own] = may_sleep(p) && weighed[p][1] <= SLEEP_SHARE * self.tolerance;
        }
        let asleep = sleepers(&held);
        let kept = (-now.dt / MEMORY).exp();
        let [slept, spared, lively] = self.remembered.map(|cost| cost * kept);
        let of_sleep = of_cloth().filter(|(_, own)| asleep[*own]);
        let slept = of_sleep.map(|(p, _)| weighed[p][1]).fold(slept, f64::max);
        let slept = slept.max(if self.still_count() > 0 {
            2.0 * STILL_SHARE * self.tolerance
        } else {
            0.0
        });
        let awake = of_cloth().filter(|(_, own)| !asleep[*own]);
        let reach = awake.map(|(p, _)| weighed[p][0]).fold(0.0, f64::max);
        // What moves in a long frame was not to be seen before it.
        let longer = (now.dt * 60.0).max(1.0);
        let sparing = |s: u32| {
            let gap = 1.0 / f64::from(s) - 1.0 / f64::from(now.full);
            SUBSTEP_ERROR * longer * gap * reach
        };
        // BDF2 takes a step of at most twice the one before.
        let least = self.substeps.div_ceil(2).min(now.full);
        let substeps = if self.options.substeps && self.is_measured && !is_whole {
            let budget = (self.tolerance - slept).min(SUBSTEP_SHARE * self.tolerance);
            let fits = |&s: &u32| sparing(s) <= budget;
            (least..=now.full).find(fits).unwrap_or(now.full)
        } else {
            now.full
        };
        let spared = sparing(substeps).max(spared);
        let lively = lively.max(furthest);
        self.remembered = [slept, spared, lively];
        self.remember(
            &weighed,
            &asleep,
            kept,
            sparing(substeps) / reach.max(f64::MIN_POSITIVE),
        );
        let estimate = slept + spared;
        let snap = if estimate > 0.0 {
            let grown = GROWTH * (estimate + ROUNDING);
            grown.min(SNAP * lively)
        } else {
            0.0
        };
        self.whole = if is_storm { CALM } else { self.whole - now.dt };
        for p in 0..self.patches.len() {
            let sleeps = self.cloth_of[p].is_some_and(|own| asleep[own]);
            if sleeps && !self.patches[p].is_asleep {
                self.patches[p].fall_asleep(p, now, before, &self.pulls[p]);
            } else if !sleeps {
                self.patches[p].is_asleep = false;
            }
        }
        self.pulls.clone_from_slice(now.pulls);
        self.fields = Some(now.fields);
        self.substeps = substeps;
        Plan {
            held,
            substeps: Some(substeps),
            estimate,
            bound: estimate + snap,
            is_storm,
            is_whole,
        }
    }

    /// Remembers what sparing substeps costs each patch that is awake: in proportion to what it
    /// does itself, or one that it is tied to.
    ///
    /// - `kept`: share of an older error that lasts
    /// - `error`: against what patches do
    fn remember(&mut self, weighed: &[[f64; 2]], asleep: &[bool], kept: f64, error: f64) {
        for p in 0..self.patches.len() {
            if self.cloth_of[p].is_none_or(|own| asleep[own]) {
                continue;
            }
            let patch = &mut self.patches[p];
            let partners = patch.partner_patches().map(|q| weighed[q][0]);
            let reach = partners.fold(weighed[p][0], f64::max);
            patch.spared = (patch.spared * kept).max(error * reach);
        }
    }

    /// Learns how the frame went.
    ///
    /// - `energies`: of a patch of the cloth
    pub(in crate::scene) fn learn<'a>(
        &mut self,
        dt: f64,
        energies: impl Fn(usize) -> &'a Energies,
    ) {
        self.clock += dt;
        for (patch, own) in self.patches.iter_mut().zip(&self.cloth_of) {
            if let (Some(own), false) = (*own, patch.is_asleep) {
                patch.learn(energies(own), self.clock);
            }
        }
    }

    /// Patches that do not sleep in the present frame.
    pub(in crate::scene) fn is_awake(&self, patch: usize) -> bool {
        self.cloth_of[patch].is_some() && !self.patches[patch].is_asleep
    }

    /// Patches whose muscle shapes were not evaluated for the present frame.
    pub(in crate::scene) fn still_count(&self) -> u32 {
        self.moving.iter().filter(|moves| !**moves).count() as u32
    }

    /// (mm)
    pub(in crate::scene) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// How far nodes may go before they move the skin. (mm)
    pub(in crate::scene) fn skin_slack(&self) -> f32 {
        (SKIN_SHARE * self.tolerance) as f32
    }
}

/// Whether what sparing substeps costs was measured for such a cloth.
fn is_measured(patches: &[ClothPatch], options: &ClothOptions) -> bool {
    let is_known = |m: &Material| {
        let numbers = [
            m.stretch_stiffness() / m.magnet_stiffness(),
            m.magnet_frequency_hz,
            m.magnet_damping_ratio,
        ];
        let ranges = numbers.iter().zip(&MEASURED);
        ranges
            .into_iter()
            .all(|(x, [low, high])| x >= low && x <= high)
    };
    options.mode == Mode::Fast
        && options.integrator == Integrator::Bdf2
        && options.sweeps == 1
        && options.rest_blend >= LEAST_BLEND
        && patches
            .iter()
            .all(|patch| patch.variations.is_empty() && is_known(&patch.material))
}
