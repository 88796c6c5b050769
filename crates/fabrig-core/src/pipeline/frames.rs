//! From a simulation to the frames of a recording.

use nalgebra::Point3;

use super::AnimateOptions;
use super::contact::{ContactLog, ContactSummary, collider_surfaces, stat_names};
use super::strain::fibre_strain;
use super::surfaces::Surfaces;
use crate::Error;
use crate::cloth::Counters;
use crate::motion::Clip;
use crate::recording::{ContactFrame, Frame, LogEvent, LogLevel, RecordingInfo, RecordingOptions};
use crate::rig::Rig;
use crate::scene::{FrameReport, Scene, Simulation};

/// Weights that a recording's plots show at first.
const PLOTTED_WEIGHTS: usize = 12;

/// A statistic's name, whether it is asked for, and its value in a frame.
type Stat = (
    &'static str,
    fn(&RecordingOptions) -> bool,
    fn(&FrameReport) -> f64,
);

const STATS: [Stat; 12] = [
    ("settle_rms_mm", |o| o.errors, |r| r.settle_rms),
    ("settle_max_mm", |o| o.errors, |r| r.settle_max),
    (
        "kinetic_energy",
        |o| o.energies,
        |r| r.step.energies.kinetic,
    ),
    ("magnet_energy", |o| o.energies, |r| r.step.energies.magnet),
    (
        "stretch_energy",
        |o| o.energies,
        |r| {
            let energies = &r.step.energies;
            energies.stretch + energies.compression + energies.shear
        },
    ),
    ("bend_energy", |o| o.energies, |r| r.step.energies.bend),
    (
        "pressure_energy",
        |o| o.energies,
        |r| r.step.energies.pressure,
    ),
    ("total_energy", |o| o.energies, |r| r.step.energies.total()),
    ("targets_ms", |o| o.timings, |r| r.targets_ms),
    ("cloth_ms", |o| o.timings, |r| r.cloth_ms),
    ("skin_ms", |o| o.timings, |r| r.skin_ms),
    ("guards", |_| true, |r| r.step.counters.total() as f64),
];

/// Makes frames of what a simulation is at.
pub(super) struct FrameMaker {
    surfaces: Surfaces,
    options: RecordingOptions,
    /// Vertices of each part, gathered anew every frame.
    parts: Vec<Vec<Point3<f32>>>,
    contact: Option<ContactLog>,
}

impl FrameMaker {
    pub(super) fn new(rig: &Rig, options: RecordingOptions) -> Self {
        let surfaces = Surfaces::new(rig);
        Self {
            parts: vec![Vec::new(); surfaces.part_vertices.len()],
            surfaces,
            options,
            contact: None,
        }
    }

    /// What a recording of this rig in this scene is opened with.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] for a collider that cannot be.
    pub(super) fn info(
        &self,
        rig: &Rig,
        clip: Option<&Clip>,
        scene: &Scene,
        fps: f64,
        options: &AnimateOptions,
    ) -> Result<RecordingInfo, Error> {
        let asked = STATS
            .iter()
            .filter(|(_, is_asked, _)| is_asked(&self.options));
        let mut info = RecordingInfo {
            face: String::new(),
            rig: options.rig_name.clone(),
            template: rig.template.clone(),
            fps,
            seed: scene.cloth.seed,
            skin: self.surfaces.skin.clone(),
            patches: self.surfaces.patches.clone(),
            parts: self.surfaces.parts.clone(),
            colliders: None,
            weight_names: rig.shape_names.clone(),
            plotted_weights: Vec::new(),
            stat_names: asked.map(|(name, ..)| (*name).to_owned()).collect(),
            extra: vec![("take".to_owned(), options.take_name.clone())],
        };
        if scene.has_contact() {
            info.colliders = Some(collider_surfaces(scene)?);
            info.stat_names.extend(stat_names(scene));
        }
        if let Some(clip) = clip {
            info.plotted_weights = most_moved(clip, &info.weight_names);
        }
        Ok(info)
    }

    /// Begins to watch the contact of a simulation.
    pub(super) fn watch(&mut self, simulation: &Simulation) {
        self.contact = ContactLog::new(simulation);
    }

    /// What contact did in all frames; none where nothing could touch.
    pub(super) fn contact_summary(&mut self) -> Option<ContactSummary> {
        self.contact.take().map(ContactLog::finish)
    }

    /// Gives the present frame to `to`.
    pub(super) fn give<T>(
        &mut self,
        simulation: &Simulation,
        report: &FrameReport,
        to: impl FnOnce(&Frame<'_>) -> T,
    ) -> T {
        let skin = simulation.skin();
        for (positions, vertices) in self.parts.iter_mut().zip(&self.surfaces.part_vertices) {
            positions.clear();
            positions.extend(vertices.iter().map(|&v| skin[v as usize]));
        }
        let parts: Vec<&[Point3<f32>]> = self.parts.iter().map(Vec::as_slice).collect();
        let patch_count = self.surfaces.patches.len();
        let patches: Vec<&[Point3<f32>]> = (0..patch_count)
            .map(|patch| simulation.patch_positions(patch))
            .collect();
        let magnets: Vec<&[Point3<f32>]> = (0..patch_count)
            .map(|patch| simulation.patch_targets(patch))
            .collect();
        let mut strains = Vec::new();
        if self.options.strain_hz > 0.0 {
            let rig = simulation.rig().patches.iter().zip(&patches);
            strains.extend(rig.map(|(patch, nodes)| fibre_strain(&patch.patch, nodes)));
        }
        let strains: Vec<&[f32]> = strains.iter().map(Vec::as_slice).collect();
        let asked = STATS
            .iter()
            .filter(|(_, is_asked, _)| is_asked(&self.options));
        let mut stats: Vec<f64> = asked.map(|(.., value)| value(report)).collect();
        let mut events: Vec<LogEvent> = guard_event(&report.step.counters).into_iter().collect();
        if let Some(contact) = &mut self.contact {
            stats.extend(contact.take(simulation, report));
            events.extend(contact.event());
        }
        let placed: Vec<&[Point3<f32>]> = match &self.contact {
            Some(contact) => contact.placed.iter().map(Vec::as_slice).collect(),
            None => Vec::new(),
        };
        to(&Frame {
            contact: self.contact.as_ref().map(|contact| ContactFrame {
                colliders: &placed,
                arrows: &contact.arrows,
            }),
            strains: &strains,
            magnets: &magnets,
            skin,
            patches: &patches,
            parts: &parts,
            head: *simulation.head(),
            weights: &simulation.pose().weights,
            stats: &stats,
            events: &events,
        })
    }
}

fn guard_event(counters: &Counters) -> Option<LogEvent> {
    (counters.total() > 0).then(|| LogEvent {
        level: LogLevel::Warning,
        message: format!(
            "guards acted: {} displacements clamped, {} patches on backward Euler, {} put back",
            counters.clamped_displacements, counters.euler_fallbacks, counters.frozen_patches
        ),
    })
}

/// The weights that a take moves most, in the order of `names`.
fn most_moved(clip: &Clip, names: &[String]) -> Vec<String> {
    let channel_count = clip.channels().len();
    let span = |channel: usize| {
        let values = clip.weights().iter().skip(channel).step_by(channel_count);
        let (low, high) = values.fold((1.0f32, 0.0f32), |(low, high), &w| {
            (low.min(w), high.max(w))
        });
        high - low
    };
    let listed: Vec<&str> = names.iter().map(String::as_str).collect();
    let channels = clip.channel_indices(&listed);
    let mut moved: Vec<(usize, f32)> = channels
        .iter()
        .enumerate()
        .filter_map(|(name, &channel)| Some((name, span(channel?))))
        .filter(|&(_, span)| span > 0.0)
        .collect();
    moved.sort_by(|a, b| b.1.total_cmp(&a.1));
    moved.truncate(PLOTTED_WEIGHTS);
    moved.sort_unstable_by_key(|&(name, _)| name);
    moved.iter().map(|&(name, _)| names[name].clone()).collect()
}
