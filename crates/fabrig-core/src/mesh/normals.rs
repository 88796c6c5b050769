//! Normals of triangles and vertices.

use crate::{Point, Vector};

/// Normal of every triangle times twice its area, shape [triangle_count, 3].
///
/// Counter-clockwise corners give the outward side; a degenerate triangle gives zero.
pub fn triangle_normals(positions: &[Point], triangles: &[[u32; 3]]) -> Vec<Vector> {
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            (b - a).cross(&(c - a))
        })
        .collect()
}

/// Unit normal of every vertex, triangle normals weighted by the angle at the vertex.
///
/// - `positions`: shape [vertex_count, 3]; `triangles`: indices into them
///
/// A vertex without a face of positive area gets the zero vector.
///
/// Source: Thürmer & Wüthrich 1998, Computing Vertex Normals from Polygonal Facets.
pub fn vertex_normals(positions: &[Point], triangles: &[[u32; 3]]) -> Vec<Vector> {
    let mut normals = vec![Vector::zeros(); positions.len()];
    for t in triangles {
        let p = t.map(|v| positions[v as usize]);
        let normal = (p[1] - p[0]).cross(&(p[2] - p[0]));
        let double_area = normal.norm();
        if double_area <= 0.0 {
            continue;
        }
        for k in 0..3 {
            let a = p[(k + 1) % 3] - p[k];
            let b = p[(k + 2) % 3] - p[k];
            // atan2 keeps its accuracy for slivers, where acos loses it.
            let angle = double_area.atan2(a.dot(&b));
            normals[t[k] as usize] += normal * (angle / double_area);
        }
    }
    for n in &mut normals {
        *n = n.try_normalize(0.0).unwrap_or_else(Vector::zeros);
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_corner_points_along_its_diagonal_however_its_sides_are_split() {
        // The corner at the origin of three unit squares; one square meets it with two
        // triangles, the others with one, so an area weighting would tilt the normal.
        let p: Vec<Point> = [
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1., 0., 1.],
            [0., 1., 1.],
        ]
        .iter()
        .map(|c| Point::new(c[0], c[1], c[2]))
        .collect();
        let triangles = [
            [0, 2, 1],
            [0, 3, 2],
            [0, 1, 4],
            [1, 5, 4],
            [0, 4, 3],
            [3, 4, 6],
        ];
        let n = vertex_normals(&p, &triangles)[0];
        let expected = -Vector::new(1.0, 1.0, 1.0).normalize();
        assert!((n - expected).norm() < 1e-12, "{n}");
    }

    #[test]
    fn degenerate_faces_add_nothing_and_lonely_vertices_get_zero() {
        let p = vec![
            Point::new(0., 0., 0.),
            Point::new(1., 0., 0.),
            Point::new(0., 1., 0.),
            Point::new(2., 0., 0.),
        ];
        let n = vertex_normals(&p, &[[0, 1, 2], [0, 1, 3]]);
        assert_eq!(n[0], Vector::z());
        assert_eq!(n[3], Vector::zeros());
    }
}
