//! What a recording is to hold, by name.

use serde::{Deserialize, Serialize};

use super::RecordingOptions;

/// Something that a recording can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordedKind {
    /// Skin, eyeballs, teeth and tongue as shaded meshes.
    Skin,
    /// Muscles and fat as shaded meshes.
    Patches,
    /// Skin vertices and patch nodes as points.
    Points,
    /// Where the muscle shapes want the patch nodes, as points.
    Magnets,
    /// Patches coloured by their stretch.
    Strain,
    /// Arrows where things touch.
    Contacts,
    /// What the face touches, as shaded meshes.
    Colliders,
    /// The weights of the shapes.
    Weights,
    /// The cloth's energies.
    Energies,
    /// Distances of the patches from their muscle shapes.
    Errors,
    /// Times of every frame: they differ from run to run, and so does the file then.
    Timings,
}

impl RecordedKind {
    /// Each with its name in scene files, in Python and on the command line.
    pub const NAMED: [(&'static str, Self); 11] = [
        ("skin", Self::Skin),
        ("patches", Self::Patches),
        ("points", Self::Points),
        ("magnets", Self::Magnets),
        ("strain", Self::Strain),
        ("contacts", Self::Contacts),
        ("colliders", Self::Colliders),
        ("weights", Self::Weights),
        ("energies", Self::Energies),
        ("errors", Self::Errors),
        ("timings", Self::Timings),
    ];
}

/// Rates of what is written only on request. (1/s)
const STRAIN_HZ: f64 = 15.0;
const MAGNETS_HZ: f64 = 10.0;

impl RecordingOptions {
    /// Only these things, at the rates that are set; those that have none at a usual one.
    #[must_use]
    pub fn only(self, kinds: &[RecordedKind]) -> Self {
        let usual = Self::default();
        let has = |kind| kinds.contains(&kind);
        let rate = |kind, own: f64, usual: f64| match (has(kind), own > 0.0) {
            (false, _) => 0.0,
            (true, true) => own,
            (true, false) => usual,
        };
        Self {
            skin_hz: rate(RecordedKind::Skin, self.skin_hz, usual.skin_hz),
            patches_hz: rate(RecordedKind::Patches, self.patches_hz, usual.patches_hz),
            points_hz: rate(RecordedKind::Points, self.points_hz, usual.points_hz),
            strain_hz: rate(RecordedKind::Strain, self.strain_hz, STRAIN_HZ),
            magnets_hz: rate(RecordedKind::Magnets, self.magnets_hz, MAGNETS_HZ),
            contacts: has(RecordedKind::Contacts),
            colliders: has(RecordedKind::Colliders),
            weights: has(RecordedKind::Weights),
            energies: has(RecordedKind::Energies),
            errors: has(RecordedKind::Errors),
            timings: has(RecordedKind::Timings),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_named_is_left_at_the_rates_that_were_set() {
        let options = RecordingOptions {
            skin_hz: 12.0,
            ..RecordingOptions::default()
        };
        let kinds = [
            RecordedKind::Skin,
            RecordedKind::Strain,
            RecordedKind::Timings,
        ];
        let only = options.only(&kinds);
        assert_eq!((only.skin_hz, only.strain_hz), (12.0, STRAIN_HZ));
        assert_eq!(
            (only.patches_hz, only.points_hz, only.magnets_hz),
            (0.0, 0.0, 0.0)
        );
        assert!(only.timings && !only.weights && !only.contacts && !only.errors);
        assert_eq!(only.chunk_bytes, options.chunk_bytes);
    }
}
