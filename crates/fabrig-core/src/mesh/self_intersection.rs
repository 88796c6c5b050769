//! Triangles of a surface that pass through each other.
//!
//! Candidates are found by a sweep along x over the triangles' boxes; two triangles pass
//! through each other where an edge of one meets the inside of the other (Möller & Trumbore
//! 1997). Triangles that share a vertex, and ones in the same plane, do not count.

use rayon::prelude::*;

use crate::Point;

/// Pairs of triangles that pass through each other, lower index first, rising.
pub fn self_intersections(positions: &[Point], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let corners: Vec<[Point; 3]> = triangles
        .iter()
        .map(|t| t.map(|v| positions[v as usize]))
        .collect();
    let boxes: Vec<(Point, Point)> = corners
        .iter()
        .map(|[a, b, c]| (a.inf(b).inf(c), a.sup(b).sup(c)))
        .collect();
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.sort_by(|&a, &b| {
        let x = |k: u32| boxes[k as usize].0.x;
        x(a).total_cmp(&x(b)).then(a.cmp(&b))
    });
    let mut pairs: Vec<[u32; 2]> = order
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, &one)| {
            let (low, high) = boxes[one as usize];
            let (order, boxes, corners) = (&order, &boxes, &corners);
            order[k + 1..]
                .iter()
                .take_while(move |&&other| boxes[other as usize].0.x <= high.x)
                .filter(move |&&other| {
                    let (l, h) = boxes[other as usize];
                    (1..3).all(|c| l[c] <= high[c] && h[c] >= low[c])
                        && !triangles[one as usize]
                            .iter()
                            .any(|v| triangles[other as usize].contains(v))
                        && pass_through(&corners[one as usize], &corners[other as usize])
                })
                .map(move |&other| [one.min(other), one.max(other)])
        })
        .collect();
    pairs.sort_unstable();
    pairs
}

fn pass_through(one: &[Point; 3], other: &[Point; 3]) -> bool {
    let crosses = |edges: &[Point; 3], face: &[Point; 3]| {
        (0..3).any(|k| edge_meets(&edges[k], &edges[(k + 1) % 3], face))
    };
    crosses(one, other) || crosses(other, one)
}

fn edge_meets(from: &Point, to: &Point, [a, b, c]: &[Point; 3]) -> bool {
    let (direction, e1, e2) = (to - from, b - a, c - a);
    let p = direction.cross(&e2);
    let determinant = e1.dot(&p);
    if determinant == 0.0 {
        return false;
    }
    let s = from - a;
    let u = s.dot(&p) / determinant;
    let q = s.cross(&e1);
    let v = direction.dot(&q) / determinant;
    let t = e2.dot(&q) / determinant;
    u > 0.0 && v > 0.0 && u + v < 1.0 && t > 0.0 && t < 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossing_triangles_are_found_and_touching_ones_are_not() {
        let p = |x: f64, y: f64, z: f64| Point::new(x, y, z);
        let positions = vec![
            p(0., 0., 0.),
            p(4., 0., 0.),
            p(0., 4., 0.),
            // Through the first.
            p(1., 1., -1.),
            p(1., 1., 1.),
            p(1., 3., 1.),
            // Beside it.
            p(9., 9., -1.),
            p(9., 9., 1.),
            p(9., 8., 1.),
        ];
        let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 1, 4]];
        assert_eq!(self_intersections(&positions, &triangles), [[0, 1]]);
    }
}
