//! Time beside error for many settings of the solver on one scene.

use serde::{Deserialize, Serialize};

use super::floor::{Floor, floor};
use super::measure::{Difference, difference, nudged, run};
use super::scene::BenchScene;
use crate::cloth::{ClothError, ClothOptions, Counters, Integrator, Mode, Precision};

/// A setting that is measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Mode of the solver.
    pub mode: Mode,
    /// Order of the time integrator.
    pub integrator: Integrator,
    /// Arithmetic.
    pub precision: Precision,
    /// Per 1/60 s.
    pub substeps: u32,
    /// Per substep.
    pub sweeps: u32,
}

impl Setting {
    /// The options with this setting in them.
    pub fn options(&self, base: &ClothOptions) -> ClothOptions {
        ClothOptions {
            mode: self.mode,
            integrator: self.integrator,
            precision: self.precision,
            substeps: self.substeps,
            sweeps: self.sweeps,
            ..*base
        }
    }

    /// In a word or two: `fast`, `fast, Euler`, `robust`, `fast, f64`.
    pub fn family(&self) -> String {
        let mode = match self.mode {
            Mode::Fast => "fast",
            Mode::Robust => "robust",
            Mode::Paper => "paper",
        };
        let mut name = mode.to_owned();
        if self.mode != Mode::Paper && self.integrator == Integrator::BackwardEuler {
            name += ", Euler";
        }
        match self.precision {
            Precision::Single => {}
            Precision::SingleScalar => name += ", scalar",
            Precision::Double => name += ", f64",
        }
        if self.sweeps > 1 {
            name += &format!(", {} sweeps", self.sweeps);
        }
        name
    }
}

/// What one setting costs and how far it is off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ParetoPoint {
    /// The setting.
    pub setting: Setting,
    /// Median of the frames. (ms)
    pub median_ms: f64,
    /// What 95 % of the frames do not exceed. (ms)
    pub p95_ms: f64,
    /// The quickest frame. (ms)
    pub least_ms: f64,
    /// To the reference.
    pub error: Difference,
    /// Guards that acted.
    pub counters: Counters,
}

/// All settings on one scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pareto {
    /// The scene.
    pub scene: String,
    /// Nodes of the scene.
    pub node_count: usize,
    /// Frames of 1/60 s that were run.
    pub frame_count: usize,
    /// Threads that worked.
    pub thread_count: usize,
    /// Substeps of the double-precision reference.
    pub reference_substeps: u32,
    /// Difference of the reference to one with half the substeps.
    pub reference_difference: Difference,
    /// What moving every third node of the neutral shape by a micrometre changes, at default
    /// settings in double precision.
    pub micrometre: Difference,
    /// The floor.
    pub floor: Floor,
    /// The points.
    pub points: Vec<ParetoPoint>,
}

/// Settings worth measuring: every mode, substeps 1 to 128, sweeps 1 to 4, both precisions.
/// The short list has the lines' ends, the default, and what lies about it.
pub fn settings(is_full: bool) -> Vec<Setting> {
    let base = Setting {
        mode: Mode::Fast,
        integrator: Integrator::Bdf2,
        precision: Precision::Single,
        substeps: 1,
        sweeps: 1,
    };
    let euler = Setting {
        integrator: Integrator::BackwardEuler,
        ..base
    };
    let with_sweeps = |sweeps| Setting { sweeps, ..base };
    let double = Setting {
        precision: Precision::Double,
        ..base
    };
    let of_mode = |mode| Setting { mode, ..base };
    let all: &[u32] = &[1, 2, 3, 4, 6, 8, 9, 10, 12, 16, 32, 64, 128];
    let up_to = |most| &all[..all.partition_point(|&substeps| substeps <= most)];
    let lines: Vec<(Setting, &[u32])> = if is_full {
        vec![
            (base, all),
            (euler, all),
            (with_sweeps(2), all),
            (with_sweeps(3), up_to(16)),
            (with_sweeps(4), up_to(16)),
            (double, all),
            (of_mode(Mode::Robust), up_to(32)),
            (of_mode(Mode::Paper), up_to(32)),
        ]
    } else {
        vec![
            (base, &[1, 2, 4, 6, 8, 9, 10, 16, 32]),
            (euler, &[1, 4, 8, 32]),
            (with_sweeps(2), &[1, 4, 8]),
            (with_sweeps(4), &[1, 4]),
            (double, &[8]),
            (of_mode(Mode::Robust), &[1, 2, 4, 8]),
            (of_mode(Mode::Paper), &[1, 4, 8]),
        ]
    };
    lines
        .into_iter()
        .flat_map(|(setting, substeps)| {
            substeps.iter().map(move |&substeps| Setting {
                substeps,
                ..setting
            })
        })
        .collect()
}

/// Measures settings on a scene. `progress` hears how many of how many are done, and stops the
/// measurement by `false`; what has been measured by then is returned.
///
/// # Errors
///
/// As [`run`].
pub fn pareto(
    scene: &BenchScene,
    base: &ClothOptions,
    settings: &[Setting],
    reference_substeps: u32,
    progress: &mut dyn FnMut(usize, usize) -> bool,
) -> Result<Pareto, ClothError> {
    let frames = scene.frames.len();
    let keep = if frames > 240 { 3 } else { 1 };
    let reference = |substeps| ClothOptions {
        substeps,
        precision: Precision::Double,
        ..*base
    };
    let total = settings.len() + 4;
    let exact = run(scene, &reference(reference_substeps), frames, keep)?;
    let mut points = Vec::new();
    let mut goes_on = progress(1, total);
    let coarser = run(scene, &reference(reference_substeps / 2), frames, keep)?;
    goes_on &= progress(2, total);
    let moved = nudged(scene);
    let plain = run(scene, &reference(base.substeps), frames, keep)?;
    let nudge = run(&moved, &reference(base.substeps), frames, keep)?;
    goes_on &= progress(4, total);
    for (index, setting) in settings.iter().enumerate() {
        if !goes_on {
            break;
        }
        let result = run(scene, &setting.options(base), frames, keep)?;
        points.push(ParetoPoint {
            setting: *setting,
            median_ms: result.quantile_ms(0.5),
            p95_ms: result.quantile_ms(0.95),
            least_ms: result.quantile_ms(0.0),
            error: difference(scene, &result, &exact),
            counters: result.counters,
        });
        goes_on = progress(5 + index, total);
    }
    Ok(Pareto {
        scene: scene.name.clone(),
        node_count: scene.node_count(),
        frame_count: frames,
        thread_count: rayon::current_num_threads(),
        reference_substeps,
        reference_difference: difference(scene, &coarser, &exact),
        micrometre: difference(scene, &nudge, &plain),
        floor: floor(scene),
        points,
    })
}
