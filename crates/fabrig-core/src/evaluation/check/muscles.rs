//! Single muscle shapes of a rig beside the template's.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::MuscleCheck;
use crate::rig::Rig;
use crate::template::Template;
use crate::transfer::{ShapeWeights, TransferError, muscle_shapes};

/// Muscle shapes that move the template by less are not looked at. (mm)
const TELLING: f64 = 0.5;
/// A muscle that moves by less than this share of the template's motion stands still: what is
/// left is rounding, and points anywhere.
const STILL: f64 = 0.02;

/// Every muscle shape that moves the template by half a millimetre or more.
///
/// - `over`: for each shape the one that it is held together with
pub(super) fn compare_muscles(
    rig: &Rig,
    template: &Template,
    over: &[Option<usize>],
) -> Result<Vec<MuscleCheck>, TransferError> {
    let charts: Vec<_> = rig.patches.iter().map(|p| p.patch.chart.clone()).collect();
    let drawn = muscle_shapes(template, &charts, TELLING)?;
    let context = rig.transfer_context();
    let of_patch = |p: usize| -> Vec<MuscleCheck> {
        let patch = &rig.patches[p];
        let neutral: Vec<Point3<f32>> = patch.patch.neutral.iter().map(|q| q.cast()).collect();
        let pose = |shapes: &[usize]| {
            let mut weights = vec![0.0; rig.shape_names.len()];
            shapes.iter().for_each(|&shape| weights[shape] = 1.0);
            let mut positions = neutral.clone();
            let mut velocities = vec![Vector3::zeros(); neutral.len()];
            let at = ShapeWeights {
                weights: &weights,
                rates: None,
            };
            let transfer = &patch.transfer;
            transfer.evaluate(&context, &neutral, at, &mut positions, &mut velocities);
            positions
        };
        let compare = |drawn: &crate::transfer::MuscleShape| {
            let shape = drawn.shape as usize;
            let base: Vec<usize> = over[shape].into_iter().collect();
            let whole: Vec<usize> = base.iter().copied().chain([shape]).collect();
            let (from, to) = (pose(&base), pose(&whole));
            let (mut dot, mut own, mut wanted, mut most) = (0.0, 0.0, 0.0, 0.0f64);
            for ((a, b), d) in from.iter().zip(&to).zip(&drawn.deltas) {
                let (m, d) = ((b - a).cast::<f64>(), d.cast::<f64>());
                dot += m.dot(&d);
                own += m.norm_squared();
                wanted += d.norm_squared();
                most = most.max(d.norm());
            }
            MuscleCheck {
                name: drawn.name.clone(),
                template_mm: most,
                ratio: dot / wanted,
                direction: if own > STILL * STILL * wanted {
                    dot / (own * wanted).sqrt()
                } else {
                    0.0
                },
            }
        };
        drawn[p].iter().map(compare).collect()
    };
    let by_patch: Vec<Vec<MuscleCheck>> = (0..charts.len()).into_par_iter().map(of_patch).collect();
    Ok(by_patch.into_iter().flatten().collect())
}
