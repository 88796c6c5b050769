//! Turns the region rules of `template.toml` into one label a vertex.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use crate::Point;
use crate::template::description::{Description, mirrored_name};
use crate::template::{Landmarks, TemplateError};

/// Vertices joined by edges, and how long the edges are.
pub(super) struct EdgeGraph {
    neighbours: Vec<Vec<u32>>,
}

impl EdgeGraph {
    pub(super) fn new(faces: &[Vec<u32>], vertex_count: usize) -> Self {
        let mut neighbours = vec![BTreeSet::new(); vertex_count];
        for face in faces {
            for (k, &a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                neighbours[a as usize].insert(b);
                neighbours[b as usize].insert(a);
            }
        }
        Self {
            neighbours: neighbours
                .into_iter()
                .map(|set| set.into_iter().collect())
                .collect(),
        }
    }

    pub(super) fn neighbours(&self, vertex: u32) -> &[u32] {
        &self.neighbours[vertex as usize]
    }

    /// The shortest way along edges from `to` back to `from`, both included; equal lengths go to the lower vertex.
    pub(super) fn shortest_path(&self, positions: &[Point], from: u32, to: u32) -> Vec<u32> {
        // Lengths in picometres, so that they have a total order.
        let length = |a: u32, b: u32| {
            ((positions[a as usize] - positions[b as usize]).norm() * 1e9).round() as u64
        };
        let mut best = vec![(u64::MAX, u32::MAX); self.neighbours.len()];
        let mut open = BinaryHeap::from([Reverse((0u64, from))]);
        best[from as usize] = (0, from);
        while let Some(Reverse((distance, vertex))) = open.pop() {
            if vertex == to {
                break;
            }
            if distance > best[vertex as usize].0 {
                continue;
            }
            for &next in self.neighbours(vertex) {
                let candidate = (distance + length(vertex, next), vertex);
                if candidate < best[next as usize] {
                    best[next as usize] = candidate;
                    open.push(Reverse((candidate.0, next)));
                }
            }
        }
        let mut path = vec![to];
        while let Some(&last) = path.last() {
            let previous = best[last as usize].1;
            if last == from || previous == u32::MAX {
                break;
            }
            path.push(previous);
        }
        path
    }
}

/// Labels by the rules, painted in order; a rule that ends in `_l` paints its mirror too.
pub(super) fn paint_regions(
    description: &Description,
    landmarks: &Landmarks,
    positions: &[Point],
    faces: &[Vec<u32>],
    mirror: &[u32],
) -> Result<Vec<u8>, TemplateError> {
    let graph = EdgeGraph::new(faces, positions.len());
    let mut labels = vec![0u8; positions.len()];
    let mut label = 0u8;
    for entry in &description.regions {
        let landmark = |name: &str| {
            landmarks
                .get(name)
                .copied()
                .ok_or_else(|| TemplateError::Missing {
                    what: format!("region {:?}", entry.name),
                    name: name.to_owned(),
                })
        };
        let inside = if entry.outline.is_empty() {
            vec![true; positions.len()]
        } else {
            let corners = entry
                .outline
                .iter()
                .map(|name| landmark(name))
                .collect::<Result<Vec<_>, _>>()?;
            let mut border = BTreeSet::new();
            for (k, &corner) in corners.iter().enumerate() {
                let next = corners[(k + 1) % corners.len()];
                border.extend(graph.shortest_path(positions, corner, next));
            }
            let seed = match &entry.inside {
                Some(name) => Some(landmark(name)?),
                None => None,
            };
            fill(&graph, &border, seed, entry.with_outline)
        };
        let has_mirror = mirrored_name(&entry.name).is_some();
        for (vertex, _) in inside.iter().enumerate().filter(|(_, is_in)| **is_in) {
            labels[vertex] = label;
            if has_mirror {
                labels[mirror[vertex] as usize] = label + 1;
            }
        }
        label += if has_mirror { 2 } else { 1 };
    }
    Ok(labels)
}

fn fill(
    graph: &EdgeGraph,
    border: &BTreeSet<u32>,
    seed: Option<u32>,
    with_outline: bool,
) -> Vec<bool> {
    let mut inside = vec![false; graph.neighbours.len()];
    let mut open: Vec<u32> = seed.into_iter().collect();
    for &v in &open {
        inside[v as usize] = true;
    }
    while let Some(vertex) = open.pop() {
        for &next in graph.neighbours(vertex) {
            if !inside[next as usize] && !border.contains(&next) {
                inside[next as usize] = true;
                open.push(next);
            }
        }
    }
    if with_outline {
        for &v in border {
            inside[v as usize] = true;
        }
    }
    inside
}
