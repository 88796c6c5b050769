//! Fitted weights in a file: they depend on the template alone, so a pack brings them.
//!
//! Each weight is kept in whole steps, and right vertices are the mirror images of left ones.
//! The file says what it was fitted from by a fingerprint; weights fitted from anything else
//! are not taken.

use serde::{Deserialize, Serialize};

use crate::anatomy::PatchChart;
use crate::skin::{NodeMirror, TemplateWeights};
use crate::template::Template;

#[derive(Serialize, Deserialize)]
struct Stored {
    fingerprint: u64,
    /// Of each vertex of one half, (gap to the last node, steps) entry after entry.
    rows: Vec<Vec<(u32, i32)>>,
}

impl TemplateWeights {
    /// All weights are whole multiples of this.
    pub const STEP: f32 = 1.0 / 16384.0;

    /// Rounds every weight to whole steps and drops those that are none.
    pub(super) fn in_steps(mut self) -> Self {
        for row in &mut self.by_vertex {
            for entry in row.iter_mut() {
                entry.1 = (entry.1 / Self::STEP).round() * Self::STEP;
            }
            row.retain(|entry| entry.1 != 0.0);
        }
        self
    }

    /// The bytes of `skin_weights.bin`.
    ///
    /// - `fingerprint`: of what the weights were fitted from
    ///
    /// Returns `None` where they cannot be encoded.
    pub fn to_bytes(&self, template: &Template, fingerprint: u64) -> Option<Vec<u8>> {
        let rows = template
            .one_half()
            .into_iter()
            .map(|v| {
                let mut last = 0;
                self.by_vertex[v]
                    .iter()
                    .map(|&(node, weight)| {
                        let gap = node - last;
                        last = node;
                        (gap, (weight / Self::STEP).round() as i32)
                    })
                    .collect()
            })
            .collect();
        let plain = postcard::to_allocvec(&Stored { fingerprint, rows }).ok()?;
        zstd::bulk::compress(&plain, 19).ok()
    }

    /// Reads what [`Self::to_bytes`] wrote; `None` where the bytes are damaged, or are weights
    /// fitted from something else.
    pub fn from_bytes(
        bytes: &[u8],
        template: &Template,
        charts: &[PatchChart],
        fingerprint: u64,
    ) -> Option<Self> {
        let size = zstd::zstd_safe::get_frame_content_size(bytes).ok()??;
        let limit = 1 << 28;
        let capacity = usize::try_from(size).ok().filter(|&s| s <= limit)?;
        let plain = zstd::bulk::decompress(bytes, capacity).ok()?;
        let stored: Stored = postcard::from_bytes(&plain).ok()?;
        let half = template.one_half();
        if stored.fingerprint != fingerprint || stored.rows.len() != half.len() {
            return None;
        }
        let mirror = NodeMirror::new(charts);
        let mut by_vertex = vec![Vec::new(); template.skin.vertex_count()];
        for (v, row) in half.into_iter().zip(stored.rows) {
            let mut node = 0u32;
            let mut entries = Vec::with_capacity(row.len());
            for (gap, steps) in row {
                node = node.checked_add(gap).filter(|&n| n <= mirror.mandible())?;
                entries.push((node, steps as f32 * Self::STEP));
            }
            by_vertex[template.mirror[v] as usize] = mirror.row(&entries);
            by_vertex[v] = entries;
        }
        Some(Self { by_vertex })
    }
}
