//! Wind: drag and lift of the air on every cell.
//!
//! A cell of area A with unit normal n in air that moves by w relative to it feels
//!
//! `F = rho/2 A |w . n| (C_D w + C_L (|w| n' - (w . n') w/|w|))`,
//!
//! where n' is n turned to the side the air goes to. Drag is along w, lift across it; air that
//! streams along the cell does nothing. The force is shared by the four corners. It is
//! evaluated every eight substeps, where the cloth is expected half-way through them.
//!
//! Source: Wejchert & Haumann 1991, *Animation aerodynamics*, section 3, without shielding.

use crate::machine::{Real, Vec3};

/// Coefficients of the air.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Air<R> {
    /// Density. [g/mm^3]
    pub(crate) density: R,
    /// C_D.
    pub(crate) drag: R,
    /// C_L.
    pub(crate) lift: R,
}

/// Force on one cell. [g mm/s^2]
///
/// - `area`: vector area [mm^2]; `wind`: air velocity relative to the cell (mm/s)
#[inline(always)]
pub(crate) fn cell_force<R: Real>(air: &Air<R>, area: Vec3<R>, wind: Vec3<R>) -> Vec3<R> {
    let zero = R::splat(0.0);
    let tiny = R::splat(1e-12);
    let size = area.dot(area).sqrt();
    let n = area * (R::splat(1.0) / size.max(tiny));
    let through = wind.dot(n);
    let towards = R::select_less(through, zero, R::splat(-1.0), R::splat(1.0));
    let n = n * towards;
    let through = through * towards;
    let speed = wind.dot(wind).sqrt();
    let lift = n * speed - wind * (through / speed.max(tiny));
    (wind * air.drag + lift * air.lift) * (R::splat(0.5) * air.density * size * through)
}

/// Adds the wind's acceleration of every node to `accelerations`. (mm/s^2)
///
/// - `positions` (mm), `velocities` (mm/s): one per node; `wind`: air velocity (mm/s)
/// - `inv_node_mass`: one over the mass of a node in the air's units [1/g]
#[inline(always)]
pub(crate) fn add_wind<R: Real>(
    cells: &[[u32; 4]],
    positions: &[Vec3<R>],
    velocities: &[Vec3<R>],
    wind: Vec3<R>,
    air: &Air<R>,
    inv_node_mass: R,
    accelerations: &mut [Vec3<R>],
) {
    let (quarter, half) = (R::splat(0.25), R::splat(0.5));
    for cell in cells {
        let &[a, b, c, d] = cell;
        let (a, b, c, d) = (a as usize, b as usize, c as usize, d as usize);
        let area = (positions[c] - positions[a]).cross(positions[d] - positions[b]) * half;
        let velocity = (velocities[a] + velocities[b] + velocities[c] + velocities[d]) * quarter;
        let push = cell_force(air, area, wind - velocity) * (quarter * inv_node_mass);
        for node in [a, b, c, d] {
            accelerations[node] += push;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AIR: Air<f64> = Air {
        density: 1.2e-6,
        drag: 1.1,
        lift: 0.5,
    };

    #[test]
    fn head_on_wind_is_pure_drag_and_side_wind_is_none() {
        let area = Vec3::splat([0.0, 0.0, 4.0]);
        let f = cell_force(&AIR, area, Vec3::splat([0.0, 0.0, -1e4]));
        let expected = -0.5 * 1.2e-6 * 4.0 * 1e8 * 1.1;
        assert!((f.z / expected - 1.0).abs() < 1e-12 && f.x == 0.0 && f.y == 0.0);
        let f = cell_force(&AIR, area, Vec3::splat([1e4, 0.0, 0.0]));
        assert_eq!(f.dot(f), 0.0);
    }

    #[test]
    fn lift_is_across_the_wind_and_sides_do_not_matter() {
        let wind = Vec3::splat([1e4, 0.0, -1e4]);
        let up = cell_force(&AIR, Vec3::splat([0.0, 0.0, 4.0]), wind);
        let down = cell_force(&AIR, Vec3::splat([0.0, 0.0, -4.0]), wind);
        assert_eq!(up, down);
        let drag_only = cell_force(
            &Air { lift: 0.0, ..AIR },
            Vec3::splat([0.0, 0.0, 4.0]),
            wind,
        );
        let lift = up - drag_only;
        assert!(lift.dot(wind).abs() < 1e-9 * lift.dot(lift).sqrt() * 1e4);
        assert!(lift.dot(lift) > 0.0);
    }

    #[test]
    fn no_area_and_no_wind_give_no_force() {
        for (area, wind) in [([0.0; 3], [1e4, 0.0, 0.0]), ([0.0, 0.0, 1.0], [0.0; 3])] {
            let f = cell_force(&AIR, Vec3::<f64>::splat(area), Vec3::splat(wind));
            assert_eq!(f.dot(f), 0.0);
        }
    }
}
