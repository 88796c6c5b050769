//! From the layout's text to charts on the template.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::attachments::attach;
use super::error::AnatomyError;
use super::lay::lay_patches;
use super::layout::{Layout, PatchText};
use super::patch::{PatchChart, PatchKind, Resolution, Side, SurfaceNode};
use super::places::Places;
use super::quality::check_grid;
use super::ring::chart_ring;
use super::sheet::chart_sheet;
use crate::template::Template;

/// Charts every patch of the template's layout: where its nodes lie, how deep, and what they
/// are held to.
///
/// Patches come in the layout's order, a left one right before its mirror image. Right sides
/// are exact mirrors: same (u, v), the mirrored triangle, the same barycentrics and depth.
///
/// # Errors
///
/// [`AnatomyError`] says which patch and key of `patches.toml` is wrong and what is expected.
pub fn charts(
    template: &Template,
    resolution: Resolution,
) -> Result<Vec<PatchChart>, AnatomyError> {
    check_resolution(resolution)?;
    let layout = Layout::parse(&template.patch_layout)?;
    let places = Places::new(template, &layout)?;
    let mirror = TriangleMirror::new(template, &places.triangles);

    let drawn: Vec<Vec<SurfaceNode>> = layout
        .patches
        .par_iter()
        .map(|text| chart_drawn(&places, text, resolution))
        .collect::<Result<_, _>>()?;
    let mut charts = Vec::new();
    for (text, nodes) in layout.patches.iter().zip(drawn) {
        let index = charts.len() as u32;
        let chart = PatchChart {
            name: text.name.clone(),
            kind: text.kind,
            side: Side::Mid,
            grid: resolution.grid(text.kind),
            nodes,
            material: text.material.clone(),
            attachments: Vec::new(),
            color: text.rgb()?,
            mirror: index,
        };
        if text.is_pair {
            let nodes = chart
                .nodes
                .iter()
                .map(|n| mirror.node(&text.name, n))
                .collect::<Result<_, _>>()?;
            charts.push(PatchChart {
                name: format!("{}_l", text.name),
                side: Side::Left,
                mirror: index + 1,
                ..chart.clone()
            });
            charts.push(PatchChart {
                name: format!("{}_r", text.name),
                side: Side::Right,
                nodes,
                ..chart
            });
        } else {
            charts.push(mirror_halves(chart, &mirror)?);
        }
    }
    let patches = lay_patches(template, &charts, template.skin.positions())?;
    for patch in &patches {
        if patch.chart.side != Side::Right {
            check_grid(&places.skin, patch)?;
        }
    }
    attach(&layout, &template.eyes, &mut charts, &patches)?;
    Ok(charts)
}

fn chart_drawn(
    places: &Places<'_>,
    text: &PatchText,
    resolution: Resolution,
) -> Result<Vec<SurfaceNode>, AnatomyError> {
    let grid = resolution.grid(text.kind);
    match text.kind {
        PatchKind::Sphincter => chart_ring(places, text, grid),
        PatchKind::LinearMuscle | PatchKind::FatPad => chart_sheet(places, text, grid),
    }
}

fn check_resolution(resolution: Resolution) -> Result<(), AnatomyError> {
    let [u_count, v_count] = resolution.sheet;
    if u_count < 3 || v_count < 4 || v_count % 2 != 0 || u_count.max(v_count) > 4096 {
        return Err(AnatomyError::BadResolution {
            u_count,
            v_count,
            what: "linear muscles and fat pads",
            expected: "at least 3 along, at least 4 across, an even number across",
        });
    }
    let [u_count, v_count] = resolution.ring;
    if u_count < 8 || u_count % 4 != 0 || v_count < 3 || u_count.max(v_count) > 4096 {
        return Err(AnatomyError::BadResolution {
            u_count,
            v_count,
            what: "sphincters",
            expected: "at least 8 around, a multiple of 4, and at least 3 outwards",
        });
    }
    Ok(())
}

/// Makes one half of a patch on the mid line the mirror image of the drawn one.
fn mirror_halves(
    mut chart: PatchChart,
    mirror: &TriangleMirror,
) -> Result<PatchChart, AnatomyError> {
    let u_count = chart.grid.u_count as usize;
    for node in 0..chart.nodes.len() {
        let is_drawn = if chart.grid.is_periodic {
            let u = node % u_count;
            (u_count / 4..u_count - u_count / 4).contains(&u)
        } else {
            node < chart.nodes.len() / 2
        };
        if !is_drawn {
            chart.nodes[node] = mirror.node(&chart.name, &chart.nodes[chart.mirror_node(node)])?;
        }
    }
    Ok(chart)
}

/// The mirror image of every triangle of the skin.
struct TriangleMirror {
    /// Triangle and, for each of its corners, the corner of the original that it images.
    images: Vec<Option<(u32, [usize; 3])>>,
}

impl TriangleMirror {
    fn new(template: &Template, triangles: &[[u32; 3]]) -> Self {
        let sorted = |mut t: [u32; 3]| {
            t.sort_unstable();
            t
        };
        let by_corners: BTreeMap<[u32; 3], u32> = triangles
            .iter()
            .enumerate()
            .map(|(index, t)| (sorted(*t), index as u32))
            .collect();
        let images = triangles
            .iter()
            .map(|t| {
                let image = t.map(|v| template.mirror[v as usize]);
                let index = *by_corners.get(&sorted(image))?;
                let corners = triangles[index as usize]
                    .map(|v| image.iter().position(|i| *i == v).unwrap_or_default());
                Some((index, corners))
            })
            .collect();
        Self { images }
    }

    fn node(&self, patch: &str, node: &SurfaceNode) -> Result<SurfaceNode, AnatomyError> {
        let (triangle, corners) =
            self.images[node.triangle as usize].ok_or_else(|| AnatomyError::NoMirror {
                patch: patch.to_owned(),
                triangle: node.triangle,
            })?;
        Ok(SurfaceNode {
            triangle,
            barycentric: corners.map(|k| node.barycentric[k]),
            depth: node.depth,
        })
    }
}
