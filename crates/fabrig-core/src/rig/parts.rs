//! Pieces of the user's mesh that are not skin: eyeballs, teeth, tongue.

use serde::{Deserialize, Serialize};

use crate::registration::RigidComponent;
use crate::rig::PartShape;
use crate::template::{EyeSocket, RigidBody};
use crate::{Point, Vector};

/// A piece of the user's mesh that moves rigidly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigPart {
    /// `eye_l`, `eye_r`, `upper_rigid` (moves with the skull), `lower_rigid` (with the
    /// mandible), `tongue`; numbered from the second on.
    pub name: String,
    /// What it moves with.
    pub follows: RigidBody,
    /// Its vertices in the user's mesh, rising.
    pub vertices: Vec<u32>,
    /// What shapes do to it besides: a tongue that comes out.
    pub shapes: Vec<PartShape>,
}

/// Names the pieces that registration found, and puts the sockets where the eyeballs are.
///
/// - `positions`: the mesh in the head frame (mm)
/// - `eyes`: sockets as the skin has them
pub(super) fn name_parts(
    components: &[RigidComponent],
    positions: &[Point],
    eyes: &mut [EyeSocket; 2],
) -> Vec<RigPart> {
    let mut parts: Vec<RigPart> = Vec::new();
    for component in components {
        let name = match component.body {
            RigidBody::Skull => "upper_rigid",
            RigidBody::Mandible => "lower_rigid",
            RigidBody::EyeLeft => "eye_l",
            RigidBody::EyeRight => "eye_r",
        };
        let same = parts.iter().filter(|p| p.follows == component.body).count();
        parts.push(RigPart {
            name: if same == 0 {
                name.to_owned()
            } else {
                format!("{name}_{}", same + 1)
            },
            follows: component.body,
            vertices: component.vertices.clone(),
            shapes: Vec::new(),
        });
    }
    for (eye, body) in [RigidBody::EyeLeft, RigidBody::EyeRight]
        .into_iter()
        .enumerate()
    {
        let ball = parts
            .iter()
            .filter(|p| p.follows == body)
            .max_by_key(|p| p.vertices.len());
        if let Some((center, radius)) = ball.and_then(|b| fit_sphere(&b.vertices, positions)) {
            eyes[eye].center = center;
            eyes[eye].radius = radius;
        }
    }
    parts
}

/// Sphere through points in the least squares sense, `|p|^2 = 2 c p + (r^2 - |c|^2)`; `None`
/// where the points do not tell, or are not round to a tenth of the radius.
fn fit_sphere(piece: &[u32], positions: &[Point]) -> Option<(Point, f64)> {
    let origin = positions[*piece.first()? as usize];
    let mut normal = nalgebra::Matrix4::zeros();
    let mut rhs = nalgebra::Vector4::zeros();
    for &v in piece {
        let p = positions[v as usize] - origin;
        let row = nalgebra::Vector4::new(2.0 * p.x, 2.0 * p.y, 2.0 * p.z, 1.0);
        normal += row * row.transpose();
        rhs += row * p.norm_squared();
    }
    let x = normal.cholesky()?.solve(&rhs);
    let center = Vector::new(x[0], x[1], x[2]);
    let radius = (x[3] + center.norm_squared()).max(0.0).sqrt();
    let center = origin + center;
    let error = piece
        .iter()
        .map(|&v| ((positions[v as usize] - center).norm() - radius).powi(2))
        .sum::<f64>()
        / piece.len() as f64;
    (radius > 0.0 && error.sqrt() < 0.1 * radius).then_some((center, radius))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_socket_moves_to_the_eyeball_that_is_there() {
        let center = Point::new(31.0, 12.0, 60.0);
        let positions: Vec<Point> = (0..60)
            .map(|i| {
                let (a, b) = (f64::from(i) * 0.7, f64::from(i) * 0.31);
                center + 11.5 * Vector::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos())
            })
            .collect();
        let mut eyes = [30.0, -30.0].map(|x| EyeSocket {
            center: Point::new(x, 10.0, 58.0),
            radius: 13.0,
            look_angles: [0.5; 4],
        });
        let untouched = eyes[1];
        let components = [RigidComponent {
            vertices: (0..60).collect(),
            body: RigidBody::EyeLeft,
        }];
        let parts = name_parts(&components, &positions, &mut eyes);
        assert_eq!(parts[0].name, "eye_l");
        assert!((eyes[0].center - center).norm() < 1e-9);
        assert!((eyes[0].radius - 11.5).abs() < 1e-9);
        assert_eq!(eyes[1], untouched);
    }
}
