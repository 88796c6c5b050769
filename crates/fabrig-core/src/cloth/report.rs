//! What a step reports: guards that acted, and energies.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// What happened in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// Substeps taken.
    pub substeps: u32,
    /// Patches that slept.
    #[serde(default)]
    pub sleeping_patches: u32,
    /// Guards that acted in this frame.
    pub counters: Counters,
    /// Energies at the end of the frame, over all patches.
    pub energies: Energies,
}

/// How often each guard acted. All zero in a frame without trouble.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Node displacements held to half an edge per substep (relative to the target).
    pub clamped_displacements: u64,
    /// Patches whose energy rose beyond what was put in, and which fell back to backward Euler
    /// for the next two frames.
    pub euler_fallbacks: u64,
    /// Patches that went on having too much energy, and are solved by descent for the next
    /// half second.
    #[serde(default)]
    pub robust_fallbacks: u64,
    /// Patches that were put back to their targets, because their state was no number or far
    /// away or had a thousand times the energy put in.
    pub frozen_patches: u64,
}

impl Counters {
    /// How often any guard acted.
    pub fn total(&self) -> u64 {
        self.clamped_displacements
            + self.euler_fallbacks
            + self.robust_fallbacks
            + self.frozen_patches
    }
}

impl AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.clamped_displacements += other.clamped_displacements;
        self.euler_fallbacks += other.euler_fallbacks;
        self.robust_fallbacks += other.robust_fallbacks;
        self.frozen_patches += other.frozen_patches;
    }
}

/// Energies by kind. [mass mm^2/s^2]
///
/// Kinetic energy is of the motion relative to the targets.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Energies {
    pub kinetic: f64,
    pub magnet: f64,
    pub anchors: f64,
    pub stretch: f64,
    pub compression: f64,
    pub shear: f64,
    pub bend: f64,
    pub pressure: f64,
}

impl Energies {
    /// Their sum.
    pub fn total(&self) -> f64 {
        self.kinetic
            + self.magnet
            + self.anchors
            + self.stretch
            + self.compression
            + self.shear
            + self.bend
            + self.pressure
    }
}

impl AddAssign for Energies {
    fn add_assign(&mut self, other: Self) {
        self.kinetic += other.kinetic;
        self.magnet += other.magnet;
        self.anchors += other.anchors;
        self.stretch += other.stretch;
        self.compression += other.compression;
        self.shear += other.shear;
        self.bend += other.bend;
        self.pressure += other.pressure;
    }
}
