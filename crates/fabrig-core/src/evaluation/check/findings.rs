//! What of a check does not hold, in sentences.

use super::gates::CheckGates;
use super::report::{Finding, MuscleCheck, ShapeCheck};
use super::run::TELLING;
use super::seams::Crossed;
use crate::registration::DistanceStatistics;

/// A shape that moves nothing by this much is dead. (mm)
const DEAD: f64 = 0.1;

/// A shape, and the vertices where something shows.
pub(super) struct Seen {
    pub(super) check: ShapeCheck,
    pub(super) wrong_side: Vec<u32>,
    pub(super) torn: Vec<[u32; 2]>,
    pub(super) flipped: Vec<u32>,
    pub(super) leaking: Option<u32>,
    pub(super) lips: Crossed,
    pub(super) lids: Crossed,
}

/// Collects what does not hold.
pub(super) struct Findings {
    gates: CheckGates,
    pub(super) found: Vec<Finding>,
}

impl Findings {
    pub(super) fn new(gates: CheckGates) -> Self {
        Self {
            gates,
            found: Vec::new(),
        }
    }

    fn add(
        &mut self,
        gate: &'static str,
        shape: &str,
        value: f64,
        vertex: Option<u32>,
        text: String,
    ) {
        self.found.push(Finding {
            gate,
            shape: Some(shape.to_owned()),
            value,
            limit: self.gates.get(gate).unwrap_or_default(),
            vertex,
            text,
        });
    }

    /// Returns the vertices that findings are about.
    pub(super) fn of_shape(
        &mut self,
        seen: &Seen,
        in_view: usize,
        notes: &mut Vec<String>,
    ) -> Vec<u32> {
        let (check, gates) = (&seen.check, self.gates);
        let shape = check.shape.as_str();
        let mut marked: Vec<u32> = Vec::new();
        if check.amplitude_mm < DEAD && check.parts_mm < DEAD {
            if check.template_mm < TELLING {
                notes.push(format!(
                    "{shape} moves nothing: it moves no skin, and the mesh has no part that it \
                     moves"
                ));
            } else {
                let text = format!(
                    "{shape} is dead: nothing moves by {DEAD} mm, on the template {:.1} mm",
                    check.template_mm
                );
                self.add("least_ratio", shape, 0.0, None, text);
            }
        } else if let (Some(ratio), Some(direction)) = (check.ratio, check.direction) {
            if ratio < gates.least_ratio {
                let text = format!("{shape} is weak: {ratio:.2} of the template's amplitude");
                self.add("least_ratio", shape, ratio, None, text);
            }
            if ratio > gates.largest_ratio {
                let text = format!("{shape} is too strong: {ratio:.2} of the template's amplitude");
                self.add("largest_ratio", shape, ratio, None, text);
            }
            if direction < gates.least_direction {
                let text = format!(
                    "{shape} moves another way than on the template (cosine {direction:.2})"
                );
                self.add("least_direction", shape, direction, None, text);
            }
        }
        if check.wrong_side as f64 > gates.wrong_side {
            let text = format!(
                "{shape}: {} vertices of lips or lids move with the other side",
                check.wrong_side
            );
            let vertex = seen.wrong_side.first().copied();
            self.add("wrong_side", shape, check.wrong_side as f64, vertex, text);
            marked.extend(&seen.wrong_side);
        }
        if check.torn_edges as f64 > gates.torn_edges {
            let text = format!("{shape} tears {} edges of the mesh", check.torn_edges);
            let vertex = seen.torn.first().map(|edge| edge[0]);
            self.add("torn_edges", shape, check.torn_edges as f64, vertex, text);
            marked.extend(seen.torn.iter().flatten());
        }
        if let Some(leak) = check.leak_mm.filter(|leak| *leak > gates.leak_mm) {
            let text = format!("{shape} moves the other side by {leak:.2} mm");
            self.add("leak_mm", shape, leak, seen.leaking, text);
            marked.extend(seen.leaking);
        }
        let percent = 100.0 * check.flipped as f64 / in_view.max(1) as f64;
        if percent > gates.flipped_percent {
            let text = format!(
                "{shape} turns {} triangles over ({percent:.2} %)",
                check.flipped
            );
            let vertex = seen.flipped.first().copied();
            self.add("flipped_percent", shape, percent, vertex, text);
            marked.extend(&seen.flipped);
        }
        for (what, crossed) in [("lips", &seen.lips), ("lids", &seen.lids)] {
            if crossed.pairs > 0 && crossed.depth > gates.crossing_mm {
                let text = format!(
                    "{shape}: {what} stand {:.2} mm deep in each other ({} crossings): contact \
                     keeps them apart (--contact sphincter)",
                    crossed.depth, crossed.pairs
                );
                self.add("crossing_mm", shape, crossed.depth, crossed.vertex, text);
                marked.extend(crossed.vertex);
            }
        }
        marked.sort_unstable();
        marked.dedup();
        marked
    }

    pub(super) fn of_muscles(&mut self, muscles: &[MuscleCheck]) {
        for muscle in muscles {
            if muscle.direction < self.gates.muscle_direction {
                let text = format!(
                    "{} runs against the template's (cosine {:.2})",
                    muscle.name, muscle.direction
                );
                let (name, value) = (muscle.name.clone(), muscle.direction);
                self.add("muscle_direction", &name, value, None, text);
            }
        }
    }

    pub(super) fn of_distance(&mut self, face: &DistanceStatistics, of_vertex: &[Option<f64>]) {
        if face.p95 <= self.gates.distance_mm {
            return;
        }
        let pairs = of_vertex.iter().enumerate();
        let farthest = pairs
            .filter_map(|(v, d)| Some((v, (*d)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        self.found.push(Finding {
            gate: "distance_mm",
            shape: None,
            value: face.p95,
            limit: self.gates.distance_mm,
            vertex: farthest.map(|(v, _)| v as u32),
            text: format!(
                "5 % of the face are {:.1} mm or more from the registered template: look at \
                 `fabrig rig --report`, or give landmarks",
                face.p95
            ),
        });
    }
}
