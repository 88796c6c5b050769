//! From patches to groups: who shares a register, and who is paired with whom.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::group::{FloorNode, Group, GroupFloor, GroupPairs, Partner, PatchGroup, Ports};
use super::input::{ClothAttachment, ClothOptions, ClothPatch, Precision};
use crate::machine::{F32x4, F32x8, F64x8, Real};

/// Where a patch is, and what its input must look like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchLayout {
    pub(crate) node_count: usize,
    pub(crate) anchor_count: usize,
    pub(super) group: usize,
    pub(super) lane: usize,
}

/// Groups, the place of every patch in them, and their ports.
pub(super) struct Assembly {
    pub(super) groups: Vec<Box<dyn PatchGroup>>,
    pub(super) layout: Vec<PatchLayout>,
    pub(super) ports: Ports,
}

/// Groups of `patches`, linked by their pairs.
pub(super) fn assemble(patches: &[ClothPatch], options: &ClothOptions) -> Assembly {
    let mut groups: Vec<Box<dyn PatchGroup>> = Vec::new();
    let mut layout: Vec<PatchLayout> = patches
        .iter()
        .map(|p| PatchLayout {
            node_count: p.shape.node_count(),
            anchor_count: p.anchor_sets().map(|(nodes, _)| nodes.len()).sum(),
            group: 0,
            lane: 0,
        })
        .collect();
    for members in plan_groups(patches, options.precision) {
        for (lane, &patch) in members.iter().enumerate() {
            layout[patch].group = groups.len();
            layout[patch].lane = lane;
        }
        groups.push(make_group(patches, &members, options));
    }
    let ports = link_pairs(patches, &layout, &mut groups);
    Assembly {
        groups,
        layout,
        ports,
    }
}

/// Patches of one shape, with or without pressure, in chunks that fit into lanes; from the top
/// down, so that what moves together sleeps together. The groups that take longest come first:
/// threads that are done early find small ones left.
fn plan_groups(patches: &[ClothPatch], precision: Precision) -> Vec<Vec<usize>> {
    let widest = match precision {
        Precision::Single => F32x8::LANES,
        Precision::Double => F64x8::LANES,
        Precision::SingleScalar => 1,
    };
    let mut alike: BTreeMap<(u32, u32, bool, bool), Vec<usize>> = BTreeMap::new();
    for (index, p) in patches.iter().enumerate() {
        let key = (
            p.shape.u_count,
            p.shape.v_count,
            p.shape.is_periodic,
            p.material.pressure > 0.0,
        );
        alike.entry(key).or_default().push(index);
    }
    let height = |&patch: &usize| -> f64 {
        let rest = &patches[patch].rest;
        rest.iter().map(|p| f64::from(p.y)).sum::<f64>() / rest.len().max(1) as f64
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for mut members in alike.into_values() {
        members.sort_by(|a, b| height(b).total_cmp(&height(a)));
        groups.extend(members.chunks(widest).map(<[usize]>::to_vec));
    }
    // However many of its lanes are used.
    groups.sort_by_key(|members| {
        let patch = &patches[members[0]];
        Reverse((patch.shape.node_count(), patch.material.pressure > 0.0))
    });
    groups
}

fn make_group(
    patches: &[ClothPatch],
    members: &[usize],
    options: &ClothOptions,
) -> Box<dyn PatchGroup> {
    match options.precision {
        Precision::Double => Box::new(Group::<F64x8>::new(patches, members, options)),
        Precision::SingleScalar => Box::new(Group::<f32>::new(patches, members, options)),
        // Half a register moves half as much memory.
        Precision::Single if members.len() <= F32x4::LANES => {
            Box::new(Group::<F32x4>::new(patches, members, options))
        }
        Precision::Single => Box::new(Group::<F32x8>::new(patches, members, options)),
    }
}

/// Gives every group the pairs of its nodes. Returns the ports for them.
fn link_pairs(
    patches: &[ClothPatch],
    layout: &[PatchLayout],
    groups: &mut [Box<dyn PatchGroup>],
) -> Ports {
    /// A node of a pair: group, node, lane.
    type End = (usize, u32, u32);
    let end = |patch: usize, node: u32| -> End {
        let at = &layout[patch];
        (at.group, node, at.lane as u32)
    };
    let mut pairs: Vec<(End, End, f64)> = Vec::new();
    for (a, patch) in patches.iter().enumerate() {
        for attachment in &patch.attachments {
            let ClothAttachment::Patch {
                patch: b,
                pairs: nodes,
                strength,
            } = attachment
            else {
                continue;
            };
            let b = *b as usize;
            let stiffness = pair_stiffness(patches, [a, b], *strength);
            for &(node, other) in nodes {
                pairs.push((end(a, node), end(b, other), stiffness));
            }
        }
    }
    let mut counts: BTreeMap<End, usize> = BTreeMap::new();
    for &(a, b, _) in &pairs {
        *counts.entry(a).or_default() += 1;
        *counts.entry(b).or_default() += 1;
    }
    // Those with equally many pairs follow each other, so that the processor can tell where a
    // row of partners ends; among them they are in the order of memory.
    let mut ends: Vec<End> = counts.keys().copied().collect();
    ends.sort_by_key(|end| (end.0, counts[end]));
    let mut ports: BTreeMap<End, usize> = BTreeMap::new();
    let mut lists = vec![GroupPairs::default(); groups.len()];
    for (port, &(group, node, lane)) in ends.iter().enumerate() {
        let list = &mut lists[group];
        ports.insert((group, node, lane), port);
        list.nodes.push((node, lane));
        list.partners.push(Vec::with_capacity(counts[&ends[port]]));
    }
    let port_counts: Vec<usize> = lists.iter().map(|list| list.nodes.len()).collect();
    let first_ports: Vec<usize> = port_counts
        .iter()
        .scan(0, |next, count| {
            Some(std::mem::replace(next, *next + count))
        })
        .collect();
    for &(a, b, stiffness) in &pairs {
        for (own, other) in [(a, b), (b, a)] {
            let node = ports[&own] - first_ports[own.0];
            lists[own.0].partners[node].push(Partner {
                port: ports[&other],
                stiffness,
            });
        }
    }
    let mut floors = vec![GroupFloor::new(); groups.len()];
    for (pad, patch) in patches.iter().enumerate() {
        let at = &layout[pad];
        floors[at.group].extend(floor_under(patch).into_iter().map(|under| {
            let floor = end(under.patch, under.patch_node);
            FloorNode {
                lane: at.lane as u32,
                port: ports[&floor] as u32,
                ..under
            }
        }));
    }
    let links = lists.into_iter().zip(floors);
    for ((group, first_port), (pairs, floor)) in groups.iter_mut().zip(first_ports).zip(links) {
        group.set_pairs(first_port, pairs);
        group.set_floor(floor);
    }
    Ports::new(port_counts)
}

/// Stiffness of a pair of nodes of two patches. [mass/s^2]
pub(super) fn pair_stiffness(patches: &[ClothPatch], ends: [usize; 2], strength: f64) -> f64 {
    let [a, b] = ends.map(|p| patches[p].material.stretch_stiffness());
    strength * a.min(b)
}

/// What lies under each node of a pad: the node it is stitched to, or else that of the nearest
/// node that is stitched to one. Lane and port are left to be filled in.
pub(super) fn floor_under(pad: &ClothPatch) -> GroupFloor {
    if pad.material.pressure <= 0.0 {
        return GroupFloor::new();
    }
    let mut stitched: Vec<(u32, usize, u32)> = Vec::new();
    for attachment in &pad.attachments {
        if let ClothAttachment::Patch { patch, pairs, .. } = attachment {
            stitched.extend(
                pairs
                    .iter()
                    .map(|&(own, other)| (own, *patch as usize, other)),
            );
        }
    }
    stitched.sort_unstable();
    stitched.dedup_by_key(|stitch| stitch.0);
    let place = |node: u32| pad.rest[node as usize];
    (0..pad.rest.len() as u32)
        .filter_map(|node| {
            let away = |s: &(u32, usize, u32)| (place(s.0) - place(node)).norm_squared();
            let nearest = stitched.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            nearest.map(|&(over, patch, patch_node)| FloorNode {
                node,
                lane: 0,
                over,
                patch,
                patch_node,
                port: 0,
            })
        })
        .collect()
}
