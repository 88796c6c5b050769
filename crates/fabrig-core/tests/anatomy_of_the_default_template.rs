//! The default layout holds the paper's 44 grids, mirrors itself bit for bit, keeps its layers
//! in order and hugs lips and lids.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use fabrig_core::Point;
use fabrig_core::anatomy::{
    Attachment, Patch, PatchChart, PatchKind, Resolution, Side, Spacing, charts, coverage,
    lay_patches,
};
use fabrig_core::template::{RigidBody, Template, human};

static CHARTS: LazyLock<Vec<PatchChart>> =
    LazyLock::new(|| charts(human(), Resolution::STANDARD).expect("the default layout"));
static PATCHES: LazyLock<Vec<Patch>> = LazyLock::new(|| {
    lay_patches(human(), &CHARTS, human().skin.positions()).expect("laid on the template")
});

fn find(name: &str) -> usize {
    CHARTS.iter().position(|c| c.name == name).expect(name)
}

fn skin_places(chart: &PatchChart, positions: &[Point]) -> Vec<Point> {
    let triangles = human().skin.triangles();
    let values: Vec<_> = positions.iter().map(|p| p.coords).collect();
    let at = |n: &fabrig_core::anatomy::SurfaceNode| Point::from(n.blend(&triangles, &values));
    chart.nodes.iter().map(at).collect()
}

#[test]
fn there_are_29_linear_muscles_3_sphincters_and_12_fat_pads_with_19380_nodes() {
    let mut counts = BTreeMap::new();
    for chart in CHARTS.iter() {
        *counts.entry(format!("{:?}", chart.kind)).or_insert(0) += 1;
        assert_eq!(chart.nodes.len(), chart.grid.node_count(), "{}", chart.name);
    }
    let expected = [("FatPad", 12), ("LinearMuscle", 29), ("Sphincter", 3)];
    assert_eq!(counts, expected.map(|(k, n)| (k.to_owned(), n)).into());
    assert_eq!(CHARTS.iter().map(|c| c.nodes.len()).sum::<usize>(), 19_380);
}

#[test]
fn the_same_layout_gives_2k_50k_and_200k_nodes() {
    for (resolution, expected) in [(Resolution::FINE, 50_080), (Resolution::FINEST, 200_320)] {
        let charts = charts(human(), resolution).expect("the default layout");
        let count: usize = charts.iter().map(|c| c.nodes.len()).sum();
        assert_eq!(count, expected);
    }
}

#[test]
fn left_and_right_are_mirrors_to_the_last_bit() {
    for (index, patch) in PATCHES.iter().enumerate() {
        let image = &PATCHES[patch.chart.mirror as usize];
        assert_eq!(image.chart.mirror as usize, index, "{}", patch.chart.name);
        for (node, p) in patch.neutral.iter().enumerate() {
            let q = image.neutral[patch.chart.mirror_node(node)];
            assert_eq!(
                [p.x, p.y, p.z],
                [-q.x, q.y, q.z],
                "{} {node}",
                patch.chart.name
            );
        }
    }
}

/// A face that is not symmetric, in the template's topology.
fn uneven_face(template: &Template) -> Vec<Point> {
    let bend = |p: &Point| {
        let (x, y, z) = (p.x, p.y, p.z);
        Point::new(
            1.1 * x + 0.02 * y + 2.0 * (0.03 * y).sin(),
            0.95 * y + 1.5 * (0.05 * x + 0.3).sin(),
            1.05 * z + 0.03 * x + 2.0 * (0.04 * x).cos(),
        )
    };
    template.skin.positions().iter().map(bend).collect()
}

#[test]
fn a_mirrored_face_gives_mirrored_patches_to_the_last_bit() {
    let template = human();
    let face = uneven_face(template);
    let mirrored: Vec<Point> = template
        .mirror
        .iter()
        .map(|&m| face[m as usize])
        .map(|p| Point::new(-p.x, p.y, p.z))
        .collect();
    let one = lay_patches(template, &CHARTS, &face).expect("laid");
    let other = lay_patches(template, &CHARTS, &mirrored).expect("laid");
    for patch in &one {
        let image = &other[patch.chart.mirror as usize];
        for (node, p) in patch.neutral.iter().enumerate() {
            let q = image.neutral[patch.chart.mirror_node(node)];
            assert_eq!(
                [p.x, p.y, p.z],
                [-q.x, q.y, q.z],
                "{} {node}",
                patch.chart.name
            );
        }
    }
}

#[test]
fn a_scaled_face_gives_scaled_patches() {
    let template = human();
    let scaled: Vec<Point> = template.skin.positions().iter().map(|p| p * 1.25).collect();
    let patches = lay_patches(template, &CHARTS, &scaled).expect("laid");
    for (patch, rest) in patches.iter().zip(PATCHES.iter()) {
        for (p, q) in patch.neutral.iter().zip(&rest.neutral) {
            assert!((p - q * 1.25).norm() < 1e-6, "{}", patch.chart.name);
        }
    }
}

#[test]
fn nodes_lie_under_the_skin_by_no_more_than_their_depth() {
    for patch in PATCHES.iter() {
        let places = skin_places(&patch.chart, human().skin.positions());
        for (node, (p, q)) in places.iter().zip(&patch.neutral).enumerate() {
            let depth = patch.chart.nodes[node].depth;
            let found = (p - q).norm();
            assert!(
                found > 0.2 && found <= depth + 1e-9,
                "{} {node}: {found} mm deep, charted {depth}",
                patch.chart.name
            );
        }
    }
}

#[test]
fn fat_lies_outside_the_muscle_under_it() {
    // Compared along the skin's normal where a muscle node lies right below a fat node.
    for fat in PATCHES.iter().filter(|p| p.chart.kind == PatchKind::FatPad) {
        for attachment in &fat.chart.attachments {
            let Attachment::Patch { patch, pairs, .. } = attachment else {
                continue;
            };
            let under = &CHARTS[*patch as usize];
            for &(a, b) in pairs {
                let (above, below) = (
                    fat.chart.nodes[a as usize].depth,
                    under.nodes[b as usize].depth,
                );
                let (p, q) = (
                    skin_places(&fat.chart, human().skin.positions())[a as usize],
                    fat.neutral[a as usize],
                );
                let r = PATCHES[*patch as usize].neutral[b as usize];
                let inwards = (q - p).normalize();
                let lateral = (r - q) - inwards * (r - q).dot(&inwards);
                if lateral.norm() < 1.0 {
                    assert!(
                        above < below,
                        "{} {a} at {above} mm over {} {b} at {below} mm",
                        fat.chart.name,
                        under.name
                    );
                }
            }
        }
    }
}

#[test]
fn grids_are_even() {
    for patch in PATCHES.iter() {
        let s = Spacing::of(patch);
        let name = &patch.chart.name;
        assert!(s.least > 0.1, "{name}: nodes {} mm apart", s.least);
        assert!(s.greatest < 9.0, "{name}: nodes {} mm apart", s.greatest);
    }
}

#[test]
fn the_innermost_rings_lie_on_the_margins_of_lips_and_lids() {
    let template = human();
    let edge = |name: &str, chart: &str, from: &str, count: usize, above: bool| {
        let chart = &CHARTS[find(chart)];
        let places = skin_places(chart, template.skin.positions());
        let u_count = chart.grid.u_count as usize;
        let half: Vec<Point> = (0..u_count)
            .filter(|u| (*u < u_count / 2) == above)
            .map(|u| places[u])
            .collect();
        assert_eq!(half.len(), count, "{name}");
        let landmark = template.landmark(from).expect(from);
        half.iter()
            .map(|p| (p - landmark).norm())
            .fold(f64::INFINITY, f64::min)
    };
    for (chart, landmark, above) in [
        ("orbicularis_oculi_l", "upper_lid_mid_l", true),
        ("orbicularis_oculi_l", "upper_lid_inner_l", true),
        ("orbicularis_oculi_l", "upper_lid_outer_l", true),
        ("orbicularis_oculi_l", "lower_lid_mid_l", false),
        ("orbicularis_oculi_l", "lower_lid_inner_l", false),
        ("orbicularis_oculi_l", "lower_lid_outer_l", false),
        ("orbicularis_oculi_r", "upper_lid_mid_r", true),
        ("orbicularis_oris", "upper_lip_inner", true),
        ("orbicularis_oris", "lower_lip_inner", false),
        ("orbicularis_oris", "lip_corner_l", true),
        ("orbicularis_oris", "lip_corner_r", false),
    ] {
        let distance = edge(chart, chart, landmark, 24, above);
        // Half a column's width: the landmark is a vertex, the nodes are spread by length. The
        // corner's landmark is the outermost end of the red of the lips, the contact line ends
        // a little further in.
        let limit = if landmark.contains("corner") {
            3.0
        } else {
            1.6
        };
        assert!(distance < limit, "{landmark}: {distance} mm from {chart}");
    }
}

#[test]
fn upper_nodes_of_the_mouth_lie_on_the_upper_lip_and_lower_nodes_on_the_lower() {
    let template = human();
    let regions = &template.regions;
    let label = |name: &str| regions.find(name).expect(name);
    let (upper, lower) = (label("upper_lip"), label("lower_lip"));
    let triangles = template.skin.triangles();
    let chart = &CHARTS[find("orbicularis_oris")];
    for (node, n) in chart.nodes.iter().enumerate() {
        let is_upper = (node as u32 % chart.grid.u_count) < chart.grid.u_count / 2;
        let forbidden = if is_upper { lower } else { upper };
        let corners = triangles[n.triangle as usize];
        let count = corners
            .iter()
            .filter(|v| regions.vertex_regions[**v as usize] == forbidden)
            .count();
        assert!(count < 2, "node {node} lies on the other lip");
    }
}

#[test]
fn muscles_hold_to_bone_and_to_their_neighbours_on_their_own_side() {
    let bodies = |name: &str| -> Vec<RigidBody> {
        let attachments = CHARTS[find(name)].attachments.iter();
        attachments
            .filter_map(|a| match a {
                Attachment::Body { body, .. } => Some(*body),
                Attachment::Patch { .. } => None,
            })
            .collect()
    };
    assert_eq!(bodies("zygomaticus_major_l"), [RigidBody::Skull]);
    assert_eq!(
        bodies("masseter_r"),
        [RigidBody::Skull, RigidBody::Mandible]
    );
    assert_eq!(bodies("mentalis_l"), [RigidBody::Mandible]);
    for chart in CHARTS.iter() {
        for attachment in &chart.attachments {
            let Attachment::Patch { patch, pairs, .. } = attachment else {
                continue;
            };
            let other = &CHARTS[*patch as usize];
            let opposite = (chart.side == Side::Left && other.side == Side::Right)
                || (chart.side == Side::Right && other.side == Side::Left);
            assert!(!opposite, "{} holds to {}", chart.name, other.name);
            assert!(pairs.iter().all(|&(a, b)| {
                (a as usize) < chart.nodes.len() && (b as usize) < other.nodes.len()
            }));
        }
        let image = &CHARTS[chart.mirror as usize];
        assert_eq!(chart.attachments.len(), image.attachments.len());
    }
}

#[test]
fn lids_lie_on_the_eyeball() {
    for (eye, side) in human().eyes.iter().zip(["l", "r"]) {
        let mut held_count = 0;
        for (name, reach) in [("orbicularis_oculi", 1.5), ("periorbital_fat", 3.0)] {
            let patch = &PATCHES[find(&format!("{name}_{side}"))];
            let held: Vec<u32> = patch
                .chart
                .attachments
                .iter()
                .filter_map(|a| match a {
                    Attachment::Body { body, nodes, .. } => Some((body, nodes)),
                    Attachment::Patch { .. } => None,
                })
                .flat_map(|(body, nodes)| {
                    assert!(matches!(body, RigidBody::EyeLeft | RigidBody::EyeRight));
                    assert_eq!(*body == RigidBody::EyeLeft, side == "l");
                    nodes.clone()
                })
                .collect();
            let mut unique = held.clone();
            unique.sort_unstable();
            unique.dedup();
            assert_eq!(unique.len(), held.len(), "{name} holds a node twice");
            for (node, at) in patch.neutral.iter().enumerate() {
                let height = (at - eye.center).norm() - eye.radius;
                let is_held = unique.binary_search(&(node as u32)).is_ok();
                assert!(
                    is_held || height >= reach,
                    "{name} {node}: {height} mm, free"
                );
            }
            held_count += held.len();
        }
        assert!(held_count > 200, "{held_count}");
    }
}

#[test]
fn skin_that_moves_has_a_patch_under_it() {
    for shape in coverage(human(), &CHARTS, 0.5, 6.0) {
        // The tongue moves no skin that is seen.
        if shape.moving_count == 0 {
            assert_eq!(shape.shape, "tongueOut");
            continue;
        }
        let share = shape.covered_count as f64 / shape.moving_count as f64;
        assert!(
            share >= 0.98,
            "{}: {} of {} moving vertices covered, vertex {} is {:.1} mm away",
            shape.shape,
            shape.covered_count,
            shape.moving_count,
            shape.farthest_vertex,
            shape.greatest_distance
        );
    }
}
