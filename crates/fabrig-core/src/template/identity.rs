//! How people differ from the template, as a pack keeps it.

use serde::{Deserialize, Serialize};

use super::TemplateError;
use super::geometry::unpack;
use crate::Vector;

/// Modes are kept in steps of this length: finer than anything a registration can tell. [mm]
const STEP_MM: f64 = 1.0 / 64.0;

/// One vector of steps for each vertex that is not the second of a mirrored pair.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct StoredModes(Vec<Vec<[i32; 3]>>);

/// For packing; modes must be mirror symmetric.
pub(super) fn store_modes(mirror: &[u32], modes: &[Vec<Vector>]) -> StoredModes {
    let steps = |d: &Vector| [d.x, d.y, d.z].map(|c| (c / STEP_MM).round() as i32);
    StoredModes(
        modes
            .iter()
            .map(|mode| {
                (0..mirror.len())
                    .filter(|&v| v as u32 <= mirror[v])
                    .map(|v| steps(&mode[v]))
                    .collect()
            })
            .collect(),
    )
}

/// Modes of variation, one vector per skin vertex each. (mm per standard deviation)
pub(super) fn load_modes(bytes: &[u8], mirror: &[u32]) -> Result<Vec<Vec<Vector>>, TemplateError> {
    let stored: StoredModes = unpack(bytes)?;
    let owners: Vec<usize> = (0..mirror.len())
        .filter(|&v| v as u32 <= mirror[v])
        .collect();
    stored
        .0
        .iter()
        .map(|steps| {
            if steps.len() != owners.len() {
                return Err(TemplateError::Length {
                    what: "a mode of identity".to_owned(),
                    found: steps.len(),
                    expected: owners.len(),
                });
            }
            let mut mode = vec![Vector::zeros(); mirror.len()];
            for (&v, s) in owners.iter().zip(steps) {
                let d = Vector::new(f64::from(s[0]), f64::from(s[1]), f64::from(s[2])) * STEP_MM;
                mode[mirror[v] as usize] = Vector::new(-d.x, d.y, d.z);
                mode[v] = d;
            }
            Ok(mode)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::template::human;

    #[test]
    fn the_bundled_modes_are_symmetric_ordered_and_some_millimetres() {
        let template = human();
        assert!(template.identity_modes.len() >= 30);
        let sizes: Vec<f64> = template
            .identity_modes
            .iter()
            .map(|mode| {
                for (v, &m) in template.mirror.iter().enumerate() {
                    if v as u32 != m {
                        let (a, b) = (mode[v], mode[m as usize]);
                        assert!(a.x == -b.x && a.y == b.y && a.z == b.z);
                    }
                }
                let sum: f64 = mode.iter().map(|d| d.norm_squared()).sum();
                (sum / mode.len() as f64).sqrt()
            })
            .collect();
        assert!(sizes[0] > 1.0 && sizes[0] < 30.0, "{sizes:?}");
        assert!(sizes[sizes.len() - 1] < sizes[0]);
    }
}
