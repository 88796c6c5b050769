//! Linear maps fitted to a face's own expressions, in the place of amplitudes.
//!
//! Alpha of Eq. 3 says how far a muscle moves, not which way. With examples enough the map
//! `M` of displacements at a place of the skin is known whole:
//!
//! `M = (sum_k Y_k S_k^T + r I)(sum_k S_k S_k^T + r I)^-1`
//!
//! over examples `k` and the skin around, with `S_k` what the shapes say there and `Y_k` what the
//! face does. It keeps to the identity in directions that nothing moves in.

use nalgebra::Matrix3;

use super::offset::{Moment, limited, spread_moments};
use super::{Example, JawShapes};
use crate::Vector;
use crate::mesh::Topology;
use crate::template::Template;

/// Rounds of averaging over neighbours, some 4 mm each on the face.
const ROUNDS: usize = 8;
/// `r`: squared error of an observed displacement over squared spread of maps. (mm^2)
const RIDGE: f64 = 1.0;

/// The map at each of the template's vertices.
///
/// - `deltas`: displacements of every vertex by each shape (mm), shape
///   `[shape_count][vertex_count]`
///
/// Examples that open the jaw say nothing: what turns is not mapped.
pub fn fit_maps(
    template: &Template,
    jaw: &JawShapes,
    deltas: &[Vec<Vector>],
    examples: &[Example],
) -> Vec<Matrix3<f64>> {
    let is_straight = |example: &&Example| {
        let jaw = [jaw.open, jaw.close].into_iter().flatten();
        jaw.into_iter().all(|s| example.weights[s as usize] == 0.0)
    };
    let mut moments = vec![Moment::default(); template.skin.vertex_count()];
    for example in examples.iter().filter(is_straight) {
        let active: Vec<(usize, f64)> = example
            .weights
            .iter()
            .enumerate()
            .filter(|(_, w)| **w != 0.0)
            .map(|(i, w)| (i, f64::from(*w)))
            .collect();
        for (v, moment) in moments.iter_mut().enumerate() {
            if !example.is_seen[v] {
                continue;
            }
            let said: Vector = active.iter().map(|&(i, w)| deltas[i][v] * w).sum();
            moment.add(&said, &example.deltas[v], 1.0);
        }
    }
    let topology = Topology::from_mesh(&template.skin);
    spread_moments(template, &topology, moments, ROUNDS)
        .into_iter()
        .map(|moment| limited(moment.ridged(RIDGE).map()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template::human;
    use crate::transfer::{OffsetMode, offsets_on_face};

    #[test]
    fn a_turn_of_all_displacements_is_found_again_where_they_are_large() {
        let template = human();
        let rest = template.skin.positions();
        let own = offsets_on_face(template, rest, OffsetMode::Global)
            .unwrap()
            .deltas;
        let turn = nalgebra::Rotation3::from_euler_angles(0.2, 0.1, -0.3).into_inner() * 1.2;
        let jaw = JawShapes::of(template);
        let examples: Vec<Example> = (0..own.len())
            .filter(|i| i % 3 != 0)
            .map(|i| {
                let mut weights = vec![0.0; own.len()];
                weights[i] = 1.0;
                Example {
                    name: template.shapes[i].name.clone(),
                    weights,
                    deltas: own[i].iter().map(|d| turn * d).collect(),
                    is_seen: vec![true; rest.len()],
                }
            })
            .collect();
        let maps = fit_maps(template, &jaw, &own, &examples);
        // On shapes that were no examples.
        let (mut error, mut motion) = (0.0, 0.0);
        for (i, shape) in own.iter().enumerate().filter(|(i, _)| i % 3 == 0) {
            if Some(i as u32) == jaw.open || Some(i as u32) == jaw.close {
                continue;
            }
            for (d, map) in shape.iter().zip(&maps) {
                error += (map * d - turn * d).norm_squared();
                motion += (turn * d - d).norm_squared();
            }
        }
        assert!(error < 0.05 * motion, "{error} of {motion} mm^2 is left");
        assert_eq!(
            fit_maps(template, &jaw, &own, &[]),
            vec![Matrix3::identity(); rest.len()]
        );
    }
}
