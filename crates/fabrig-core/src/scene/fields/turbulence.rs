//! Gusts in the wind, and a seat that shakes.

use serde::{Deserialize, Serialize};

/// Gusts: air that moves at random about the wind, without divergence.
///
/// They are carried along by the wind (Taylor's frozen turbulence), so that in a wind of U a
/// gust passes in about `length / U`, and change on their own over `time`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Turbulence {
    /// Root mean square of each component of the velocity. (mm/s)
    pub intensity: f64,
    /// Length L over which gusts are alike: two points r apart are correlated by
    /// `exp(-r^2/2L^2)`. (mm)
    pub length: f64,
    /// Time T over which gusts change, besides being carried along: `exp(-t^2/2T^2)`. (s)
    pub time: f64,
    /// Another seed is other weather of the same kind.
    pub seed: u64,
}

impl Default for Turbulence {
    fn default() -> Self {
        Self {
            intensity: 1000.0,
            length: 150.0,
            time: 0.5,
            seed: 0,
        }
    }
}

/// A seat that shakes: a random acceleration of everything around the face, as in a car.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shake {
    /// Root mean square of each component of the acceleration. (mm/s^2)
    pub intensity: f64,
    /// Time T over which it changes: `exp(-t^2/2T^2)`. (s)
    pub time: f64,
    /// Another seed is another road.
    pub seed: u64,
}

impl Default for Shake {
    fn default() -> Self {
        Self {
            intensity: 2000.0,
            time: 0.05,
            seed: 0,
        }
    }
}
