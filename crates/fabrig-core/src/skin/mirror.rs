//! Mirror images of nodes.

use crate::anatomy::PatchChart;

/// For every node, patch after patch, its mirror image; the mandible is its own.
#[derive(Debug, Clone)]
pub struct NodeMirror {
    images: Vec<u32>,
}

impl NodeMirror {
    /// Reads the images from the charts.
    pub fn new(charts: &[PatchChart]) -> Self {
        let mut starts = vec![0];
        for chart in charts {
            starts.push(starts[starts.len() - 1] + chart.nodes.len());
        }
        let mut images: Vec<u32> = Vec::with_capacity(starts[charts.len()] + 1);
        for chart in charts {
            let start = starts[chart.mirror as usize];
            images.extend((0..chart.nodes.len()).map(|n| (start + chart.mirror_node(n)) as u32));
        }
        images.push(images.len() as u32);
        Self { images }
    }

    /// Index that stands for the mandible.
    pub fn mandible(&self) -> u32 {
        self.images.len() as u32 - 1
    }

    /// What the mirror image of a vertex hangs on.
    pub fn row(&self, row: &[(u32, f32)]) -> Vec<(u32, f32)> {
        let mut image: Vec<(u32, f32)> = row
            .iter()
            .map(|&(node, weight)| (self.images[node as usize], weight))
            .collect();
        image.sort_by_key(|entry| entry.0);
        image
    }

    /// The mean of a row and its mirror image: for vertices on the mid plane.
    pub fn symmetric_row(&self, row: &[(u32, f32)]) -> Vec<(u32, f32)> {
        let mut both = self.row(row);
        both.extend_from_slice(row);
        both.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        both.chunk_by(|a, b| a.0 == b.0)
            .map(|same| (same[0].0, 0.5 * same.iter().map(|e| e.1).sum::<f32>()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{self, Resolution};
    use crate::template::human;

    #[test]
    fn mirroring_twice_leads_back() {
        let charts = anatomy::charts(human(), Resolution::COARSE).unwrap();
        let mirror = NodeMirror::new(&charts);
        for (node, image) in mirror.images.iter().enumerate() {
            assert_eq!(mirror.images[*image as usize] as usize, node);
        }
        let row = [(3, 0.25), (700, 0.5), (mirror.mandible(), 0.25)];
        assert_eq!(mirror.row(&mirror.row(&row)), row);
        let even = mirror.symmetric_row(&row);
        assert_eq!(mirror.row(&even), even);
    }
}
