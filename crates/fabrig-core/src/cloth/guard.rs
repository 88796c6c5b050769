//! The ladder of guards: what a patch may have of energy, and what is done where it has more.

use super::group::{Monitor, PatchGroup};
use super::report::{Counters, Energies};

/// Energy may exceed the bound by this factor before a patch falls back.
const ENERGY_TOLERANCE: f64 = 4.0;

/// Energy may exceed the bound by this factor before a patch is frozen.
const FREEZE_TOLERANCE: f64 = 1e3;

/// Share of the damping rate at which what energy there was must go. An oscillation loses energy
/// at the whole rate; this leaves room for what swings across the damping.
const DECAY_SHARE: f64 = 0.25;

/// A patch that has fallen back in this many frames on end is solved by descent as well.
const LONGEST_EULER: u32 = 3;

/// A patch that has fallen back in this many frames on end is frozen.
const LONGEST_TROUBLE: u32 = 30;

/// Frames of backward Euler after a fall-back, and of descent after a fall-back to that.
const EULER_FRAMES: u32 = 2;
const ROBUST_FRAMES: u32 = 30;

/// What is known of every patch's energy.
pub(super) struct Guard {
    /// Energies after the last step.
    pub(super) energies: Vec<Energies>,
    /// Energy that each patch may have, and at the end the whole, from what was put in so far.
    ceilings: Vec<f64>,
    /// For how many frames on end each patch has fallen back.
    troubled_frames: Vec<u32>,
    has_pairs: bool,
}

impl Guard {
    pub(super) fn new(patch_count: usize, has_pairs: bool) -> Self {
        Self {
            energies: vec![Energies::default(); patch_count],
            ceilings: vec![0.0; patch_count + 1],
            troubled_frames: vec![0; patch_count],
            has_pairs,
        }
    }

    /// Forgets what was put in.
    pub(super) fn reset(&mut self) {
        self.energies.fill(Energies::default());
        self.ceilings.fill(0.0);
        self.troubled_frames.fill(0);
    }

    /// Says that patches fell asleep or woke: what was put into the whole is no longer known.
    pub(super) fn forget_whole(&mut self) {
        if let Some(whole) = self.ceilings.last_mut() {
            *whole = f64::INFINITY;
        }
    }

    /// Looks at every patch after a frame, and acts where one has gone wrong. Patches of groups
    /// that sleep keep what they had.
    ///
    /// - `dt`: duration of the frame (s)
    pub(super) fn watch(
        &mut self,
        dt: f64,
        groups: &mut [Box<dyn PatchGroup>],
        monitors: &[Vec<Monitor>],
        asleep: &[bool],
    ) -> (Counters, Energies) {
        let mut counters = Counters::default();
        let mut sum = Energies::default();
        // Pairs hand energy from patch to patch; then only the whole is bounded.
        let mut whole = Monitor {
            damping: f64::INFINITY,
            ..Monitor::default()
        };
        let mut whole_energy = 0.0;
        let awake = monitors.iter().zip(asleep).filter(|(_, asleep)| !**asleep);
        for m in awake.flat_map(|(monitors, _)| monitors) {
            whole.before += m.before;
            whole.drive += m.drive;
            whole.mismatch += m.mismatch;
            whole.damping = whole.damping.min(m.damping);
            whole_energy += m.energies.total();
        }
        let last = self.ceilings.len() - 1;
        let whole_bound = energy_bound(&whole, dt, whole_energy, &mut self.ceilings[last]);
        for ((group, monitors), &is_asleep) in groups.iter_mut().zip(monitors).zip(asleep) {
            if is_asleep {
                for &patch in group.patches() {
                    sum += self.energies[patch];
                }
                continue;
            }
            for (lane, m) in monitors.iter().enumerate() {
                let patch = group.patches()[lane];
                counters.clamped_displacements += m.clamped;
                let energy = m.energies.total();
                let own_bound = energy_bound(m, dt, energy, &mut self.ceilings[patch]);
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
}

/// What energy a patch may have after a frame: what it had, or might have had, less what damping
/// must have taken; and what moving targets and fields gave, as amplitudes, with what rest lengths
/// and anchors hold against the targets. Without input the ceiling never rises, however slowly
/// energy creeps up, and falls where there is damping, so that an oscillation that feeds itself is
/// found out. The floor is the energy of a thousandth of a millimetre at 10 Hz in a thousand nodes.
fn energy_bound(m: &Monitor, dt: f64, energy: f64, ceiling: &mut f64) -> f64 {
    let kept = (-DECAY_SHARE * m.damping * dt).exp();
    let before = kept * ceiling.min(ENERGY_TOLERANCE * m.before).max(0.0);
    let amplitude = before.sqrt() + m.drive;
    let bound = amplitude * amplitude + 2.0 * m.mismatch + 1.0;
    *ceiling = energy.min(bound).max(amplitude * amplitude);
    bound
}
