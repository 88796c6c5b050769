//! What a rig must hold to pass.

use serde::{Deserialize, Serialize};

/// Limits of a check. Every field is a gate of the same name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CheckGates {
    /// Vertices of lips and lids that move with the other side, per shape, at most.
    pub wrong_side: f64,
    /// Edges of the mesh that a shape tears, at most.
    pub torn_edges: f64,
    /// What a shape of one side does to the other beyond the template, at most. (mm)
    pub leak_mm: f64,
    /// Triangles in view that face forwards, turn over, and do not on the template, at most. (%)
    pub flipped_percent: f64,
    /// How deep lips or lids stand in each other, at most. (mm)
    pub crossing_mm: f64,
    /// Amplitude against the template's at the face's size, at least.
    pub least_ratio: f64,
    /// The same, at most.
    pub largest_ratio: f64,
    /// Cosine of a shape's motion with the template's, at least.
    pub least_direction: f64,
    /// The same of a single muscle shape, at least.
    pub muscle_direction: f64,
    /// Distance from the mesh to the registered template that 95 % of the face keep, at most.
    /// (mm)
    pub distance_mm: f64,
}

impl Default for CheckGates {
    fn default() -> Self {
        Self {
            wrong_side: 0.0,
            torn_edges: 0.0,
            leak_mm: 0.5,
            flipped_percent: 0.2,
            crossing_mm: 1.5,
            least_ratio: 0.4,
            largest_ratio: 2.5,
            least_direction: 0.5,
            muscle_direction: 0.0,
            distance_mm: 3.0,
        }
    }
}

/// Name and meaning of a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gate {
    /// As in [`CheckGates`].
    pub name: &'static str,
    /// In words.
    pub meaning: &'static str,
}

const fn gate(name: &'static str, meaning: &'static str) -> Gate {
    Gate { name, meaning }
}

/// All gates.
pub const GATES: [Gate; 10] = [
    gate(
        "wrong_side",
        "vertices of lips and lids that move with the other side, at most",
    ),
    gate(
        "torn_edges",
        "edges of the mesh that a shape tears, at most",
    ),
    gate(
        "leak_mm",
        "motion of the other side by a shape of one side, at most (mm)",
    ),
    gate(
        "flipped_percent",
        "triangles in view, facing forwards, that turn over and do not on the template, at most (%)",
    ),
    gate(
        "crossing_mm",
        "how deep lips or lids stand in each other, at most (mm)",
    ),
    gate(
        "least_ratio",
        "amplitude against the template's at the face's size, at least",
    ),
    gate("largest_ratio", "the same, at most"),
    gate(
        "least_direction",
        "cosine of a shape's motion with the template's, at least",
    ),
    gate(
        "muscle_direction",
        "the same of a single muscle shape, at least",
    ),
    gate(
        "distance_mm",
        "distance of the mesh from the registered template, 95 % of the face, at most (mm)",
    ),
];

impl CheckGates {
    /// The limit of the gate of this name.
    pub fn get(&self, name: &str) -> Option<f64> {
        let mut own = *self;
        own.limit(name).copied()
    }

    /// Changes the gate of this name; `false` where there is none.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        match self.limit(name) {
            Some(limit) => {
                *limit = value;
                true
            }
            None => false,
        }
    }

    fn limit(&mut self, name: &str) -> Option<&mut f64> {
        Some(match name {
            "wrong_side" => &mut self.wrong_side,
            "torn_edges" => &mut self.torn_edges,
            "leak_mm" => &mut self.leak_mm,
            "flipped_percent" => &mut self.flipped_percent,
            "crossing_mm" => &mut self.crossing_mm,
            "least_ratio" => &mut self.least_ratio,
            "largest_ratio" => &mut self.largest_ratio,
            "least_direction" => &mut self.least_direction,
            "muscle_direction" => &mut self.muscle_direction,
            "distance_mm" => &mut self.distance_mm,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gate_is_set_by_its_name() {
        let mut gates = CheckGates::default();
        for (k, gate) in GATES.iter().enumerate() {
            let value = 100.0 + k as f64;
            assert!(gates.set(gate.name, value), "{}", gate.name);
            assert_eq!(gates.get(gate.name), Some(value));
        }
        assert!(!gates.set("wrong", 1.0));
        let json = serde_json::to_value(gates).unwrap();
        assert_eq!(json.as_object().unwrap().len(), GATES.len());
    }
}
