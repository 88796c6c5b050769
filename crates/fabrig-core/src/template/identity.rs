//! How people differ from the template, as a pack keeps it.

use serde::{Deserialize, Serialize};

use super::TemplateError;
use super::geometry::unpack;
use crate::Vector;

/// Modes are kept in steps of this length: finer than anything a registration can tell. [mm]
const STEP_MM: f64 = 1.0 / 32.0;

/// One vector of steps for each vertex that is not the second of a mirrored pair; what the
/// second does, its mirror image says.
type HalfMode = Vec<[i32; 3]>;

/// Modes as they are kept, each kind in falling order of size.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct StoredModes {
    /// Both sides alike.
    symmetric: Vec<HalfMode>,
    /// One side does the opposite of the other.
    antisymmetric: Vec<HalfMode>,
}

/// For packing; modes must be what their names say.
pub(super) fn store_modes(
    mirror: &[u32],
    symmetric: &[Vec<Vector>],
    antisymmetric: &[Vec<Vector>],
) -> StoredModes {
    let half = |modes: &[Vec<Vector>]| {
        let steps = |d: &Vector| [d.x, d.y, d.z].map(|c| (c / STEP_MM).round() as i32);
        modes
            .iter()
            .map(|mode| owners(mirror).map(|v| steps(&mode[v])).collect())
            .collect()
    };
    StoredModes {
        symmetric: half(symmetric),
        antisymmetric: half(antisymmetric),
    }
}

/// Modes of variation, one vector per skin vertex each: those that move both sides alike, then
/// those that do not. (mm per standard deviation)
pub(super) fn load_modes(bytes: &[u8], mirror: &[u32]) -> Result<Vec<Vec<Vector>>, TemplateError> {
    let stored: StoredModes = unpack(bytes)?;
    let owners: Vec<usize> = owners(mirror).collect();
    let kinds = [(&stored.symmetric, 1.0), (&stored.antisymmetric, -1.0)];
    let mut modes = Vec::new();
    for (half, sign) in kinds
        .iter()
        .flat_map(|(m, s)| m.iter().map(move |h| (h, *s)))
    {
        if half.len() != owners.len() {
            return Err(TemplateError::Length {
                what: "a mode of identity".to_owned(),
                found: half.len(),
                expected: owners.len(),
            });
        }
        let mut mode = vec![Vector::zeros(); mirror.len()];
        for (&v, s) in owners.iter().zip(half) {
            let d = Vector::new(f64::from(s[0]), f64::from(s[1]), f64::from(s[2])) * STEP_MM;
            mode[mirror[v] as usize] = reflect(d) * sign;
            mode[v] = d;
        }
        modes.push(mode);
    }
    Ok(modes)
}

/// The first vertex of each mirrored pair, and those on the mid plane.
fn owners(mirror: &[u32]) -> impl Iterator<Item = usize> + '_ {
    (0..mirror.len()).filter(|&v| v as u32 <= mirror[v])
}

/// The mirror image of a vector through the plane x = 0.
pub(super) fn reflect(v: Vector) -> Vector {
    Vector::new(0.0 - v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::reflect;
    use crate::template::human;

    #[test]
    fn the_bundled_modes_are_of_two_kinds_ordered_and_some_millimetres() {
        let template = human();
        assert!(template.identity_modes.len() >= 30);
        let mut signs = Vec::new();
        let sizes: Vec<f64> = template
            .identity_modes
            .iter()
            .map(|mode| {
                let follows = |sign: f64| {
                    let mut pairs = template.mirror.iter().enumerate();
                    pairs
                        .all(|(v, &m)| v as u32 == m || mode[m as usize] == reflect(mode[v]) * sign)
                };
                signs.push(if follows(1.0) {
                    1
                } else {
                    assert!(follows(-1.0));
                    -1
                });
                let sum: f64 = mode.iter().map(|d| d.norm_squared()).sum();
                (sum / mode.len() as f64).sqrt()
            })
            .collect();
        assert!(signs.is_sorted_by(|a, b| a >= b), "{signs:?}");
        assert!(signs.contains(&1) && signs.contains(&-1));
        assert!(sizes[0] > 1.0 && sizes[0] < 30.0, "{sizes:?}");
        assert!(sizes[sizes.len() - 1] < sizes[0]);
    }
}
