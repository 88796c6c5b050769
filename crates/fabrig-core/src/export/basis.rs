//! Simulated frames as a few morph targets: the principal components of their offsets.
//!
//! A morph target a frame would hold the frames exactly and take as much room as they do. The
//! offsets of a take lie near a space of few dimensions, which the eigenvectors of the frames'
//! Gram matrix span. Every component is shifted and scaled so that its weight runs over
//! [0, 1], which every program accepts; what the shifts sum up to is a target of its own, held
//! at weight 1.
//!
//! Source: Alexa & Müller 2000, Representing Animations by Principal Components.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::BasisError;
use super::face::{Placement, Shape};
use crate::Vector;

/// Frames that the components are taken from at most; the others are projected on them.
const MOST_FRAMES: usize = 400;
/// Components at most, unless more are asked for.
const MOST_COMPONENTS: usize = 160;

/// Frames as morph targets and their weights.
pub(super) struct Basis {
    /// The mean with all shifts, then the components.
    pub(super) shapes: Vec<Shape>,
    /// A weight for every target, frame by frame, in [0, 1].
    pub(super) weights: Vec<Vec<f32>>,
    pub(super) error: BasisError,
}

/// - `frames`: offsets in the file's unit, `3 vertex_count` numbers each
/// - `count`: how many components; as many as `tolerance` needs when `None`
/// - `tolerance`: root mean square error of a frame (mm)
pub(super) fn reduce(
    frames: &[Vec<f32>],
    count: Option<usize>,
    tolerance: f64,
    placement: &Placement,
) -> Basis {
    let length = frames.first().map_or(0, Vec::len);
    let vertex_count = (length / 3).max(1) as f64;
    let millimetres = placement.length(&Vector::x());
    let mut mean = vec![0.0f64; length];
    for frame in frames {
        for (sum, x) in mean.iter_mut().zip(frame) {
            *sum += f64::from(*x);
        }
    }
    mean.iter_mut()
        .for_each(|x| *x /= frames.len().max(1) as f64);
    let centred = |frame: &[f32]| -> DVector<f64> {
        let pairs = frame.iter().zip(&mean);
        DVector::from_iterator(length, pairs.map(|(x, m)| f64::from(*x) - m))
    };

    let stride = frames.len().div_ceil(MOST_FRAMES).max(1);
    let sampled: Vec<DVector<f64>> = frames.iter().step_by(stride).map(|f| centred(f)).collect();
    let directions = principal_directions(&sampled, count.unwrap_or(MOST_COMPONENTS));
    // Shape [frame, direction].
    let coefficients: Vec<Vec<f64>> = frames
        .par_iter()
        .map(|frame| {
            let frame = centred(frame);
            directions.iter().map(|d| d.dot(&frame)).collect()
        })
        .collect();
    let kept = count.unwrap_or_else(|| {
        needed(frames, &coefficients, &centred, |square| {
            (square / vertex_count).sqrt() * millimetres <= tolerance
        })
    });
    let directions = &directions[..kept.min(directions.len())];

    let mut basis = Basis {
        shapes: Vec::new(),
        weights: vec![vec![1.0]; frames.len()],
        error: BasisError {
            components: 0,
            rms_mm: 0.0,
            worst_frame_rms_mm: 0.0,
            max_mm: 0.0,
        },
    };
    let mut base = DVector::from_column_slice(&mean);
    let mut components = Vec::new();
    for (k, direction) in directions.iter().enumerate() {
        let of_frames = coefficients.iter().map(|c| c[k]);
        let (low, high) = of_frames.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| {
            (low.min(c), high.max(c))
        });
        if high <= low {
            continue;
        }
        base += direction * low;
        components.push(direction * (high - low));
        for (weights, c) in basis.weights.iter_mut().zip(&coefficients) {
            weights.push(((c[k] - low) / (high - low)) as f32);
        }
    }
    components.insert(0, base);
    basis.error = error_of(frames, &components, &basis.weights, millimetres);
    basis.shapes = components
        .iter()
        .enumerate()
        .map(|(k, component)| Shape {
            name: if k == 0 {
                "mean".to_owned()
            } else {
                format!("component_{k:03}")
            },
            offsets: (0u32..)
                .zip(component.as_slice().chunks_exact(3))
                .map(|(v, d)| (v, Vector::new(d[0], d[1], d[2])))
                .filter(|(_, offset)| *offset != Vector::zeros())
                .collect(),
        })
        .collect();
    basis
}

/// Orthonormal directions that hold most of the frames, most first.
fn principal_directions(frames: &[DVector<f64>], count: usize) -> Vec<DVector<f64>> {
    let n = frames.len();
    let rows: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .map(|i| (0..=i).map(|j| frames[i].dot(&frames[j])).collect())
        .collect();
    let gram = DMatrix::from_fn(n, n, |i, j| rows[i.max(j)][i.min(j)]);
    let eigen = SymmetricEigen::new(gram);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let largest = order.first().map_or(0.0, |&k| eigen.eigenvalues[k]);
    order.retain(|&k| eigen.eigenvalues[k] > 1e-12 * largest && largest > 0.0);
    order.truncate(count);
    order
        .par_iter()
        .map(|&k| {
            let vector = eigen.eigenvectors.column(k);
            let mut direction = DVector::zeros(frames[0].len());
            for (frame, share) in frames.iter().zip(vector.iter()) {
                direction.axpy(*share, frame, 1.0);
            }
            direction / eigen.eigenvalues[k].sqrt()
        })
        .collect()
}

/// How many directions bring what every frame leaves over, a sum of squares, within bounds.
fn needed(
    frames: &[Vec<f32>],
    coefficients: &[Vec<f64>],
    centred: &(impl Fn(&[f32]) -> DVector<f64> + Sync),
    is_small: impl Fn(f64) -> bool + Sync,
) -> usize {
    let needs = frames.par_iter().zip(coefficients).map(|(frame, own)| {
        let mut left = centred(frame).norm_squared();
        let mut count = 0;
        while count < own.len() && !is_small(left.max(0.0)) {
            left -= own[count] * own[count];
            count += 1;
        }
        count
    });
    needs.max().unwrap_or(0)
}

fn error_of(
    frames: &[Vec<f32>],
    components: &[DVector<f64>],
    weights: &[Vec<f32>],
    millimetres: f64,
) -> BasisError {
    // Sum of squares and largest square of each frame.
    let errors: Vec<(f64, f64)> = frames
        .par_iter()
        .zip(weights)
        .map(|(frame, weights)| {
            let mut left: DVector<f64> =
                DVector::from_iterator(frame.len(), frame.iter().map(|x| f64::from(*x)));
            for (component, weight) in components.iter().zip(weights) {
                left.axpy(-f64::from(*weight), component, 1.0);
            }
            let squares = left.as_slice().chunks_exact(3);
            squares
                .map(|d| d.iter().map(|x| x * x).sum::<f64>())
                .fold((0.0, 0.0), |(sum, most), square: f64| {
                    (sum + square, f64::max(most, square))
                })
        })
        .collect();
    let vertex_count = frames.first().map_or(1, |frame| (frame.len() / 3).max(1)) as f64;
    let most = |pick: fn(&(f64, f64)) -> f64| errors.iter().map(pick).fold(0.0, f64::max);
    let sum: f64 = errors.iter().map(|e| e.0).sum();
    BasisError {
        components: components.len(),
        rms_mm: (sum / vertex_count / frames.len().max(1) as f64).sqrt() * millimetres,
        worst_frame_rms_mm: (most(|e| e.0) / vertex_count).sqrt() * millimetres,
        max_mm: most(|e| e.1).sqrt() * millimetres,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::LengthUnit;
    use nalgebra::Similarity3;

    /// Three movements of thirty vertices, and a little of a fourth.
    fn frames() -> Vec<Vec<f32>> {
        (0..50)
            .map(|f| {
                let t = f as f32 * 0.2;
                (0..90)
                    .map(|x| {
                        let x = x as f32;
                        t.sin() * (0.1 * x).cos()
                            + (0.7 * t).cos() * (0.3 * x).sin()
                            + 0.5 * (0.05 * t * t) * (0.02 * x)
                            + 1e-3 * (1.7 * t).sin() * (0.9 * x).cos()
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn few_components_hold_a_take_of_few_dimensions_within_the_tolerance() {
        let placement = Placement::new(Similarity3::identity(), LengthUnit::Millimetre);
        let frames = frames();
        let basis = reduce(&frames, None, 0.005, &placement);
        assert!((4..=5).contains(&basis.shapes.len()), "{:?}", basis.error);
        assert!(basis.error.worst_frame_rms_mm <= 0.005);
        assert!(
            basis
                .weights
                .iter()
                .flatten()
                .all(|w| (0.0..=1.0).contains(w))
        );
        let exact = reduce(&frames, Some(20), 0.005, &placement);
        assert!(exact.error.max_mm < 1e-5, "{:?}", exact.error);
        // What is written adds up to what is reported.
        let mut at = [Vector::zeros(); 30];
        for (shape, weight) in basis.shapes.iter().zip(&basis.weights[17]) {
            for &(v, offset) in &shape.offsets {
                at[v as usize] += offset * f64::from(*weight);
            }
        }
        let error = (0..30).map(|v| {
            let want = Vector::from_fn(|c, _| f64::from(frames[17][3 * v + c]));
            (at[v] - want).norm()
        });
        assert!(error.fold(0.0, f64::max) <= basis.error.max_mm + 1e-6);
    }

    #[test]
    fn a_face_that_does_not_move_has_no_components() {
        let placement = Placement::new(Similarity3::identity(), LengthUnit::Millimetre);
        let basis = reduce(&vec![vec![0.0; 9]; 4], None, 0.01, &placement);
        assert_eq!((basis.shapes.len(), basis.error.max_mm), (1, 0.0));
    }
}
