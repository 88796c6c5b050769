//! Gravity, and the inertial forces of a moving head.
//!
//! The cloth lives in the head frame. There, a node at r with velocity v feels, per mass,
//!
//! `g - a - w' x r - w x (w x r) - 2 w x v`
//!
//! (gravity, linear, Euler, centrifugal, Coriolis), where a is the acceleration of the head
//! frame's origin, w its angular velocity and w' its angular acceleration, all written in head
//! frame axes. The neutral shape is at equilibrium under the standing gravity: the cloth is
//! pre-stressed by it, so only the difference of g to it acts.
//!
//! Source: any text on mechanics in rotating frames, e.g. Landau & Lifshitz, *Mechanics*, 39.

use crate::machine::{Real, Vec3};

/// Acceleration in the head frame, splatted over the lanes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrameForces<R> {
    /// Gravity's difference to the standing gravity, less the linear acceleration. (mm/s^2)
    uniform: Vec3<R>,
    /// Rows of the matrix of r -> w' x r + w x (w x r). [1/s^2]
    turning: [Vec3<R>; 3],
    /// 2 w. (rad/s)
    twice: Vec3<R>,
}

impl<R: Real> FrameForces<R> {
    /// - `uniform`: gravity's difference to the standing gravity, less the linear acceleration
    ///   (mm/s^2)
    /// - `w`: angular velocity (rad/s); `dw`: angular acceleration [rad/s^2]
    pub(crate) fn new(uniform: [f64; 3], w: [f64; 3], dw: [f64; 3]) -> Self {
        let [xx, yy, zz] = [w[0] * w[0], w[1] * w[1], w[2] * w[2]];
        let [xy, xz, yz] = [w[0] * w[1], w[0] * w[2], w[1] * w[2]];
        Self {
            uniform: Vec3::splat(uniform),
            turning: [
                Vec3::splat([-(yy + zz), xy - dw[2], xz + dw[1]]),
                Vec3::splat([xy + dw[2], -(xx + zz), yz - dw[0]]),
                Vec3::splat([xz - dw[1], yz + dw[0], -(xx + yy)]),
            ],
            twice: Vec3::splat(w.map(|x| 2.0 * x)),
        }
    }

    /// The same for positions relative to `center` (mm).
    pub(crate) fn about(self, center: Vec3<R>) -> Self {
        Self {
            uniform: frame_acceleration(&self, center, Vec3::zero()),
            ..self
        }
    }
}

/// Acceleration of one node in the head frame. (mm/s^2)
///
/// - `r`: position (mm) in the head frame, or relative to the centre that the forces are about
/// - `v`: velocity in the head frame (mm/s)
#[inline(always)]
pub(crate) fn frame_acceleration<R: Real>(
    forces: &FrameForces<R>,
    r: Vec3<R>,
    v: Vec3<R>,
) -> Vec3<R> {
    let [x, y, z] = &forces.turning;
    let turning = Vec3::new(x.dot(r), y.dot(r), z.dot(r));
    forces.uniform - turning - forces.twice.cross(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_node_in_a_turning_frame_moves_straight_outside() {
        // In the world the node flies along +y at 3 from (2, 0, 0); the frame spins about z
        // with w = 0.5 + 0.2 t and its origin accelerates by 0.7 along x.
        let (mut r, mut v) = (
            Vec3::<f64>::splat([2.0, 0.0, 0.0]),
            Vec3::splat([0.0, 3.0 - 0.5 * 2.0, 0.0]),
        );
        let h = 1e-5;
        let steps = 100_000;
        for i in 0..steps {
            let t = f64::from(i) * h;
            let angle = 0.5 * t + 0.1 * t * t;
            let forces = FrameForces::new(
                [-0.7 * angle.cos(), 0.7 * angle.sin(), 0.0],
                [0.0, 0.0, 0.5 + 0.2 * t],
                [0.0, 0.0, 0.2],
            );
            v += frame_acceleration(&forces, r, v) * h;
            r += v * h;
        }
        let t = f64::from(steps) * h;
        let angle = 0.5 * t + 0.1 * t * t;
        let world = Vec3::<f64>::splat([2.0 - 0.35 * t * t, 3.0 * t, 0.0]);
        let (s, c) = angle.sin_cos();
        let expected = Vec3::splat([c * world.x + s * world.y, c * world.y - s * world.x, 0.0]);
        let gap = r - expected;
        assert!(gap.dot(gap).sqrt() < 1e-3, "{:?} {:?}", r, expected);
    }

    #[test]
    fn the_matrix_is_that_of_the_cross_products() {
        let [w, dw, r, v] = [
            [0.3, -1.1, 0.7],
            [2.0, 0.4, -0.9],
            [50.0, -20.0, 70.0],
            [3.0, 8.0, -5.0],
        ];
        let forces = FrameForces::<f64>::new([1.0, 2.0, 3.0], w, dw);
        let [w, dw, r, v] = [w, dw, r, v].map(Vec3::splat);
        let expected =
            Vec3::splat([1.0, 2.0, 3.0]) - dw.cross(r) - w.cross(w.cross(r)) - w.cross(v) * 2.0;
        let gap = frame_acceleration(&forces, r, v) - expected;
        assert!(gap.dot(gap).sqrt() < 1e-12);
    }

    #[test]
    fn a_still_head_feels_gravity_alone() {
        let forces = FrameForces::<f32>::new([0.0, -9810.0, 0.0], [0.0; 3], [0.0; 3]);
        let a = frame_acceleration(&forces, Vec3::splat([9.0, 8.0, 7.0]), Vec3::splat([1.0; 3]));
        assert_eq!(a.lane(0), [0.0, -9810.0, 0.0]);
    }
}
