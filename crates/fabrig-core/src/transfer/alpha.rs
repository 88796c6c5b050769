//! The size of a patch on this face against its size on the template: alpha of Eq. 3 where
//! there are no example expressions.

use crate::Point;
use crate::anatomy::{GridShape, PatchKind};

/// Bounds of alpha: outside them one of the two patches is not the muscle it claims to be.
pub const ALPHA_LIMITS: [f64; 2] = [0.25, 4.0];

/// Ratio of mean fibre lengths for a linear muscle, square root of the ratio of areas for a
/// sphincter or a fat pad, clamped to [`ALPHA_LIMITS`]. A patch without size gives 1.
pub fn size_ratio(kind: PatchKind, grid: GridShape, template: &[Point], face: &[Point]) -> f64 {
    let ratio = match kind {
        PatchKind::LinearMuscle => fibre_length(grid, face) / fibre_length(grid, template),
        PatchKind::Sphincter | PatchKind::FatPad => {
            (area(grid, face) / area(grid, template)).sqrt()
        }
    };
    if ratio.is_finite() {
        ratio.clamp(ALPHA_LIMITS[0], ALPHA_LIMITS[1])
    } else {
        1.0
    }
}

/// Mean length of the grid lines along u. (mm)
fn fibre_length(grid: GridShape, nodes: &[Point]) -> f64 {
    let mut total = 0.0;
    for v in 0..grid.v_count {
        for u in 1..grid.u_count {
            total += (nodes[grid.index(u, v)] - nodes[grid.index(u - 1, v)]).norm();
        }
    }
    total / f64::from(grid.v_count)
}

/// Area of the grid's quads. [mm^2]
fn area(grid: GridShape, nodes: &[Point]) -> f64 {
    grid.quads()
        .iter()
        .map(|q| {
            let [a, b, c, d] = q.map(|i| nodes[i as usize]);
            0.5 * (c - a).cross(&(d - b)).norm()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(scale_u: f64, scale_v: f64) -> (GridShape, Vec<Point>) {
        let grid = GridShape {
            u_count: 5,
            v_count: 4,
            is_periodic: false,
        };
        let nodes = (0..grid.v_count)
            .flat_map(|v| {
                (0..grid.u_count)
                    .map(move |u| Point::new(f64::from(u) * scale_u, f64::from(v) * scale_v, 0.0))
            })
            .collect();
        (grid, nodes)
    }

    #[test]
    fn a_linear_muscle_scales_with_its_fibres_alone() {
        let (grid, template) = plane(1.0, 1.0);
        let (_, face) = plane(1.5, 3.0);
        let ratio = size_ratio(PatchKind::LinearMuscle, grid, &template, &face);
        assert!((ratio - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_pad_scales_with_the_root_of_its_area() {
        let (grid, template) = plane(1.0, 1.0);
        let (_, face) = plane(2.0, 1.5);
        let ratio = size_ratio(PatchKind::FatPad, grid, &template, &face);
        assert!((ratio - 3.0f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_patch_without_size_keeps_the_template_amplitude() {
        let (grid, template) = plane(0.0, 0.0);
        let (_, face) = plane(1.0, 1.0);
        assert_eq!(
            size_ratio(PatchKind::FatPad, grid, &template, &template),
            1.0
        );
        assert_eq!(size_ratio(PatchKind::FatPad, grid, &template, &face), 1.0);
    }
}
