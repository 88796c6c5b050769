//! What patches are held to: bone at the origin, neighbours at the insertion, what lies under
//! a fat pad, what a ring opens on, the eyeball that it lies on (Eq. 5).

use super::error::AnatomyError;
use super::layout::{HoldText, Layout};
use super::patch::{Attachment, Patch, PatchChart, Side};
use crate::Point;
use crate::template::{EyeSocket, RigidBody};

/// Fills in the attachments of charts that lie at `patches` on the template.
///
/// - `eyes`: of the template, left and right
pub(super) fn attach(
    layout: &Layout,
    eyes: &[EyeSocket; 2],
    charts: &mut [PatchChart],
    patches: &[Patch],
) -> Result<(), AnatomyError> {
    let mut index = 0;
    for text in &layout.patches {
        let chart = &charts[index];
        let u_count = chart.grid.u_count;
        let columns = |share: f64| ((share * f64::from(u_count)).ceil() as u32).clamp(1, u_count);
        let mut attachments = Vec::new();
        let holds = [
            ("origin", &text.origin),
            ("insertion", &text.insertion),
            ("over", &text.over),
            ("opening", &text.opening),
            ("near", &text.near),
        ];
        for (key, hold) in holds {
            let Some(hold) = hold else { continue };
            let held = columns(hold.share);
            let rows = (hold.share * f64::from(chart.grid.v_count)).ceil() as u32;
            let is_held = |node: &u32| held_by(&attachments, *node);
            let is_near = |node: &u32| {
                let eye = &eyes[usize::from(hold.body == Some(RigidBody::EyeRight))];
                let at = patches[index].neutral[*node as usize];
                (at - eye.center).norm() - eye.radius < hold.reach
            };
            let nodes: Vec<u32> = (0..chart.nodes.len() as u32)
                .filter(|node| match key {
                    "origin" => node % u_count < held,
                    "insertion" => node % u_count >= u_count - held,
                    "opening" => node / u_count < rows,
                    "near" => is_near(node) && !is_held(node),
                    _ => true,
                })
                .collect();
            // Of a coarse patch no node may be near.
            if let Some(body) = hold.body.filter(|_| !nodes.is_empty()) {
                attachments.push(Attachment::Body {
                    body,
                    nodes: nodes.clone(),
                    strength: hold.strength,
                });
            }
            attachments.extend(hold_to_patches(charts, patches, index, key, hold, &nodes)?);
        }
        if text.is_pair {
            charts[index + 1].attachments = mirror_attachments(charts, &attachments);
            charts[index].attachments = attachments;
            index += 2;
        } else {
            charts[index].attachments = attachments;
            index += 1;
        }
    }
    Ok(())
}

/// Whether a body holds a node already.
fn held_by(attachments: &[Attachment], node: u32) -> bool {
    attachments.iter().any(|attachment| match attachment {
        Attachment::Body { nodes, .. } => nodes.contains(&node),
        Attachment::Patch { .. } => false,
    })
}

/// Pairs each node with the nearest node of the named patches, within reach.
fn hold_to_patches(
    charts: &[PatchChart],
    patches: &[Patch],
    index: usize,
    key: &str,
    hold: &HoldText,
    nodes: &[u32],
) -> Result<Vec<Attachment>, AnatomyError> {
    let chart = &charts[index];
    let mut others = Vec::new();
    for name in &hold.patches {
        let same_side = charts
            .iter()
            .enumerate()
            .filter(|(_, other)| match other.side {
                Side::Mid => &other.name == name,
                Side::Left => other.name.strip_suffix("_l") == Some(name),
                // A patch on the mid line holds to both sides.
                Side::Right => {
                    chart.side == Side::Mid && other.name.strip_suffix("_r") == Some(name)
                }
            });
        others.extend(same_side.map(|(other, _)| other));
    }
    let mut pairs: Vec<Vec<(u32, u32)>> = vec![Vec::new(); others.len()];
    let mut least = f64::INFINITY;
    for &node in nodes {
        // Nodes on the right of a patch on the mid line mirror those on the left below.
        let is_drawn = chart.side != Side::Mid || patches[index].neutral[node as usize].x > 0.0;
        if !is_drawn {
            continue;
        }
        let at = patches[index].neutral[node as usize];
        let nearest = others
            .iter()
            .enumerate()
            .map(|(slot, &other)| {
                let (near, distance) = nearest_node(&patches[other].neutral, &at);
                (slot, near, distance)
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((slot, near, distance)) = nearest else {
            continue;
        };
        least = least.min(distance);
        if distance > hold.reach {
            continue;
        }
        pairs[slot].push((node, near));
        if chart.side == Side::Mid {
            let other = &charts[others[slot]];
            let image = others
                .iter()
                .position(|o| *o == other.mirror as usize)
                .unwrap_or(slot);
            pairs[image].push((
                chart.mirror_node(node as usize) as u32,
                other.mirror_node(near as usize) as u32,
            ));
        }
    }
    if !others.is_empty() && pairs.iter().all(Vec::is_empty) {
        return Err(AnatomyError::OutOfReach {
            patch: chart.name.clone(),
            key: key.to_owned(),
            other: hold.patches.join("`, `"),
            reach: hold.reach,
            distance: least,
        });
    }
    Ok(others
        .into_iter()
        .zip(pairs)
        .filter(|(_, pairs)| !pairs.is_empty())
        .map(|(other, mut pairs)| {
            pairs.sort_unstable();
            Attachment::Patch {
                patch: other as u32,
                pairs,
                strength: hold.strength,
            }
        })
        .collect())
}

fn nearest_node(positions: &[Point], to: &Point) -> (u32, f64) {
    let mut best = (0, f64::INFINITY);
    for (node, p) in positions.iter().enumerate() {
        let distance = (p - to).norm_squared();
        if distance < best.1 {
            best = (node as u32, distance);
        }
    }
    (best.0, best.1.sqrt())
}

/// The attachments of a left patch as its mirror image has them.
fn mirror_attachments(charts: &[PatchChart], attachments: &[Attachment]) -> Vec<Attachment> {
    attachments
        .iter()
        .map(|attachment| match attachment {
            Attachment::Body {
                body,
                nodes,
                strength,
            } => Attachment::Body {
                body: body.mirrored(),
                nodes: nodes.clone(),
                strength: *strength,
            },
            Attachment::Patch {
                patch,
                pairs,
                strength,
            } => {
                let other = &charts[*patch as usize];
                Attachment::Patch {
                    patch: other.mirror,
                    pairs: pairs
                        .iter()
                        .map(|&(a, b)| (a, other.mirror_node(b as usize) as u32))
                        .collect(),
                    strength: *strength,
                }
            }
        })
        .collect()
}
