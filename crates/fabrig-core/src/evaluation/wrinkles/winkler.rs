//! What a beam on springs says about a patch.

use serde::Serialize;

use crate::cloth::{Material, NodeVariation};

/// Buckling of a line of nodes on magnets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Winkler {
    /// Wavelength of the beam, `2 pi (B/K)^(1/4)` edges. (mm)
    pub beam_wavelength: f64,
    /// Wavelength of the line of nodes; two edges where bending is too weak to tell. (mm)
    pub wavelength: f64,
    /// Strain at which it buckles.
    pub critical_strain: f64,
}

/// Prediction for small waves.
///
/// - `edge`: length of an edge along the line (mm)
/// - `variation`: of the nodes there
///
/// Returns `None` without magnet or edges, where nothing sets a wavelength.
pub fn winkler(material: &Material, variation: &NodeVariation, edge: f64) -> Option<Winkler> {
    let foundation = material.magnet_stiffness();
    // Small waves feel the bending that angle dropoff leaves them.
    let dropoff = 1.0 - material.bend_angle_dropoff;
    let bending = material.bend_stiffness() * f64::from(variation.bend) * dropoff;
    let pressing = material.compression_stiffness() * f64::from(variation.stretch);
    if !(foundation > 0.0 && bending > 0.0 && pressing > 0.0 && edge > 0.0) {
        return None;
    }
    let ratio = foundation / bending;
    // x = 2 - 2 cos(phase) is 4 at two edges a wave.
    let x = ratio.sqrt().min(4.0);
    let phase = (1.0 - 0.5 * x).acos();
    Some(Winkler {
        beam_wavelength: std::f64::consts::TAU * ratio.powf(-0.25) * edge,
        wavelength: std::f64::consts::TAU / phase * edge,
        critical_strain: (foundation / x + bending * x) / pressing,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_waves_are_those_of_the_beam_and_short_ones_end_at_two_edges() {
        let mut material = Material {
            bend_resistance: 5000.0,
            ..Material::LINEAR_MUSCLE
        };
        let long = winkler(&material, &NodeVariation::NONE, 2.0).unwrap();
        assert!((long.wavelength / long.beam_wavelength - 1.0).abs() < 0.02);
        material.bend_resistance = 1e-3;
        let short = winkler(&material, &NodeVariation::NONE, 2.0).unwrap();
        assert!((short.wavelength - 4.0).abs() < 1e-9);
        material.magnet_frequency_hz = 0.0;
        assert_eq!(winkler(&material, &NodeVariation::NONE, 2.0), None);
    }
}
