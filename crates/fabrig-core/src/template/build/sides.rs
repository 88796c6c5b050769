//! Shapes of one side: put right together with their mirror images, then parted again.
//!
//! A smile is drawn as two halves that mostly act together. Both are corrected as one
//! symmetric shape; the left one is the left part of it, with a smooth blend across the mid
//! plane. So the halves at equal weights give exactly the corrected whole, and none reaches
//! further to the other side than the blend.

use super::fairing::smooth_step;
use super::identity::{reflect, symmetric_left};
use crate::{Point, Vector};

/// Where left and right are.
pub(super) struct Sides<'a> {
    pub(super) rest: &'a [Point],
    pub(super) mirror: &'a [u32],
    /// Half the width of the blend. (mm)
    pub(super) blend: f64,
}

impl Sides<'_> {
    /// Whether nearly all that moves lies on the left (the sides of `mouthLeft`, which carries
    /// the whole mouth, do not).
    pub(super) fn is_of_left(&self, deltas: &[Vector]) -> bool {
        let (mut left, mut right) = (0.0, 0.0);
        for (p, delta) in self.rest.iter().zip(deltas) {
            if p.x > 0.0 {
                left += delta.norm_squared();
            } else if p.x < 0.0 {
                right += delta.norm_squared();
            }
        }
        left > 4.0 * right
    }

    /// A left shape and its mirror image together.
    pub(super) fn together(&self, left: &[Vector]) -> Vec<Vector> {
        (0..left.len())
            .map(|v| left[v] + reflect(left[self.mirror[v] as usize]))
            .collect()
    }

    /// The left part of a shape of both sides.
    pub(super) fn left_part(&self, both: &[Vector]) -> Vec<Vector> {
        self.rest
            .iter()
            .zip(both)
            .map(|(p, d)| d * smooth_step((p.x / self.blend + 1.0) / 2.0))
            .collect()
    }

    /// A shape of both sides, made exactly symmetric.
    pub(super) fn symmetric(&self, deltas: &[Vector]) -> Vec<Vector> {
        symmetric_left(deltas, deltas, self.mirror)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_sum_to_the_whole_and_stay_on_their_side() {
        let rest: Vec<Point> = [-20.0, -2.0, 0.0, 2.0, 20.0]
            .map(|x| Point::new(x, 1.0, 2.0))
            .to_vec();
        let mirror = [4, 3, 2, 1, 0];
        let sides = Sides {
            rest: &rest,
            mirror: &mirror,
            blend: 8.0,
        };
        let drawn: Vec<Vector> = (0..5)
            .map(|v| Vector::new(f64::from(v), 0.5 * f64::from(v * v), -1.0))
            .collect();
        assert!(sides.is_of_left(&drawn));
        let both = sides.together(&drawn);
        let left = sides.left_part(&both);
        assert_eq!(left[0], Vector::zeros());
        for (whole, sum) in both.iter().zip(sides.together(&left)) {
            assert!((whole - sum).norm() < 1e-12);
        }
        assert_eq!(sides.symmetric(&both)[2].x, 0.0);
    }
}
