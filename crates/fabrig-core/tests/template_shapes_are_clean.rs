//! The template's shapes, as the pack has them: lips do not pass through each other, alone and
//! in usual combinations, and meet where a shape closes them; skin around the mouth is neither
//! folded nor torn; lids stay outside the eyeball and close on a clean line; a shape of one side
//! leaves the other alone. All bars in millimetres at true head size, or degrees.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::collections::BTreeMap;

use fabrig_core::mesh::{closest_on_triangle, vertex_normals};
use fabrig_core::template::human;
use fabrig_core::{Point, Vector};

/// Deepest crossing of the lips under one shape, or one and its mirror image. (mm)
const CROSSING: f64 = 0.2;
/// Deepest crossing in a combination: a sum of shapes is not corrected as a whole. (mm)
const COMBINED_CROSSING: f64 = 0.4;
/// Both lips rolled in half way at once press on each other by this much; contact, not the
/// shapes, has to keep them apart. (mm)
const ROLLED_CROSSING: f64 = 1.3;
/// Widest gap where lips are closed, seen from the front: they stand up to 0.45 mm apart at
/// rest. (mm)
const SEALED: f64 = 0.5;

/// Usual combinations: a name without a side is both.
const COMBINATIONS: [&[(&str, f64)]; 14] = [
    &[("jawOpen", 1.0), ("mouthClose", 1.0)],
    &[("jawOpen", 0.5), ("mouthClose", 0.5)],
    &[("jawOpen", 0.25), ("mouthClose", 0.25)],
    &[("mouthSmile", 1.0), ("cheekSquint", 0.7)],
    &[("mouthSmile", 0.6), ("jawOpen", 0.3)],
    &[("mouthSmile", 0.5), ("mouthPress", 0.5)],
    &[("mouthFrown", 1.0), ("mouthShrugLower", 0.5)],
    &[("mouthFunnel", 0.8), ("jawOpen", 0.2)],
    &[("mouthFunnel", 0.5), ("mouthPucker", 0.5)],
    &[("mouthPucker", 0.7), ("jawOpen", 0.2)],
    &[("noseSneer", 1.0), ("mouthUpperUp", 0.7)],
    &[("mouthStretch", 1.0), ("mouthLowerDown", 0.8)],
    &[("mouthRollLower", 0.5), ("mouthRollUpper", 0.5)],
    &[("mouthSmile", 0.5), ("mouthDimple", 0.5)],
];

fn posed(weights: &[(&str, f64)]) -> Vec<Point> {
    let template = human();
    let mut positions = template.skin.positions().to_vec();
    for (name, weight) in weights {
        let both = [format!("{name}Left"), format!("{name}Right")];
        let names = match template.shape_index(name) {
            Some(_) => vec![(*name).to_owned()],
            None => both.to_vec(),
        };
        for name in names {
            let shape = &template.shapes[template.shape_index(&name).unwrap()];
            for (v, d) in &shape.deltas {
                positions[*v as usize] += *weight * d;
            }
        }
    }
    positions
}

/// Every shape that is not the mirror of another, closing of an open jaw on top of it, and all
/// combinations.
fn poses() -> Vec<(String, Vec<Point>)> {
    let names = human().shapes.iter().map(|s| s.name.as_str());
    let mut poses: Vec<(String, Vec<Point>)> = names
        .filter(|name| !name.ends_with("Right") && *name != "mouthClose")
        .map(|name| (name.to_owned(), posed(&[(name, 1.0)])))
        .collect();
    let lefts: Vec<&str> = human()
        .shapes
        .iter()
        .filter_map(|s| s.name.strip_suffix("Left"))
        .filter(|stem| !["mouth", "jaw"].contains(stem))
        .collect();
    for stem in lefts {
        poses.push((format!("both {stem}"), posed(&[(stem, 1.0)])));
    }
    poses.extend(COMBINATIONS.map(|c| (format!("{c:?}"), posed(c))));
    poses
}

fn region(v: u32) -> &'static str {
    let regions = &human().regions;
    &regions.regions[regions.vertex_regions[v as usize].0 as usize].name
}

/// Triangles whose corners all lie in regions that begin with one of `names`.
fn triangles_in(names: &[&str]) -> Vec<[u32; 3]> {
    let is_in = |v: u32| names.iter().any(|n| region(v).starts_with(n));
    let triangles = human().skin.triangles();
    triangles
        .into_iter()
        .filter(|t| t.iter().all(|&v| is_in(v)))
        .collect()
}

/// A patch of skin that a point may be inside or outside of.
struct Side {
    triangles: Vec<[u32; 3]>,
    /// Whether an edge opposite each corner ends the patch.
    ends: Vec<[bool; 3]>,
}

impl Side {
    fn new(triangles: Vec<[u32; 3]>) -> Self {
        let mut uses: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let key = |a: u32, b: u32| [a.min(b), a.max(b)];
        for t in &triangles {
            for k in 0..3 {
                *uses.entry(key(t[k], t[(k + 1) % 3])).or_default() += 1;
            }
        }
        let ends = triangles
            .iter()
            .map(|t| std::array::from_fn(|k| uses[&key(t[(k + 1) % 3], t[(k + 2) % 3])] == 1))
            .collect();
        Self { triangles, ends }
    }

    /// How deep inside a point is, negative outside; `None` where the nearest place is on an
    /// end of the patch and so does not tell.
    fn depth(&self, p: &Point, now: &[Point], normals: &[Vector]) -> Option<f64> {
        let mut best = (f64::INFINITY, 0, [0.0; 3], Point::origin());
        for (i, t) in self.triangles.iter().enumerate() {
            let (q, b) = closest_on_triangle(p, t.map(|v| now[v as usize]));
            let d = (q - p).norm();
            if d < best.0 {
                best = (d, i, b, q);
            }
        }
        let (distance, i, b, q) = best;
        if (0..3).any(|k| self.ends[i][k] && b[k] < 1e-9) {
            return None;
        }
        let t = self.triangles[i];
        let normal: Vector = (0..3).map(|k| b[k] * normals[t[k] as usize]).sum();
        Some(if (p - q).dot(&normal) < 0.0 {
            distance
        } else {
            -distance
        })
    }
}

/// Corners and middles of triangles no further back than the lips' own lining.
fn samples(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let template = human();
    let rest = template.skin.positions();
    let back = rest[template.landmarks["lip_corner_l"] as usize].z - 6.0;
    let mut samples = Vec::new();
    for &t in triangles {
        if t.iter().all(|&v| rest[v as usize].z > back) {
            samples.push(t);
            samples.extend(t.map(|v| [v; 3]));
        }
    }
    samples.sort_unstable();
    samples.dedup();
    samples
}

fn middle(sample: &[u32; 3], now: &[Point]) -> Point {
    let sum: Vector = sample.iter().map(|&v| now[v as usize].coords).sum();
    Point::from(sum / 3.0)
}

/// How often the skin goes round a point: 1 inside the flesh, 0 outside.
///
/// Source: van Oosterom & Strackee 1983, The solid angle of a plane triangle.
fn windings(p: &Point, now: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let angles = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| now[v as usize] - p);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    });
    angles.sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn lips_do_not_pass_through_each_other() {
    let all = human().skin.triangles();
    let lips = [
        ["upper_lip", "mouth_interior_upper"],
        ["lower_lip", "mouth_interior_lower"],
    ]
    .map(|names| triangles_in(&names));
    let [upper, lower] = [
        ["upper_lip", "mouth_interior_upper", "nose"],
        ["lower_lip", "mouth_interior_lower", "jaw"],
    ]
    .map(|names| Side::new(triangles_in(&names)));
    let mut broken = Vec::new();
    for (name, now) in poses() {
        let normals = vertex_normals(&now, &all);
        let mut deepest: f64 = 0.0;
        for (own, other) in [(&lips[0], &lower), (&lips[1], &upper)] {
            for sample in samples(own) {
                let p = middle(&sample, &now);
                let depth = other.depth(&p, &now, &normals).unwrap_or(0.0);
                if depth <= deepest.max(0.05) {
                    continue;
                }
                // The nearest place of a folded surface may look away: ask the whole skin.
                let outwards: Vector = sample.iter().map(|&v| normals[v as usize]).sum();
                let just_outside = p + 0.02 * outwards.normalize();
                if windings(&just_outside, &now, &all) > 0.5 {
                    deepest = depth;
                }
            }
        }
        let bar = match name.as_str() {
            n if n.contains("mouthRollLower\",") => ROLLED_CROSSING,
            n if n.starts_with('[') => COMBINED_CROSSING,
            _ => CROSSING,
        };
        if deepest > bar {
            broken.push(format!("{name}: {deepest:.2} mm"));
        }
    }
    assert!(broken.is_empty(), "crossing lips:\n{}", broken.join("\n"));
}

/// The widest opening between the lips as seen from the front, corners left out. (mm)
fn opening(now: &[Point], upper: &[[u32; 3]], lower: &[[u32; 3]]) -> f64 {
    const COLUMNS: usize = 40;
    let corner = now[human().landmarks["lip_corner_l"] as usize].x;
    let edge = |triangles: &[[u32; 3]], up: f64| {
        let mut edge = [f64::INFINITY; COLUMNS];
        for t in triangles {
            let [a, b, c] = t.map(|v| now[v as usize]);
            for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i, j))) {
                let p = a + (b - a) * (f64::from(i) / 8.0) + (c - a) * (f64::from(j) / 8.0);
                let place = (p.x / corner + 1.0) / 2.0 * COLUMNS as f64;
                if (0.0..COLUMNS as f64).contains(&place) {
                    let edge = &mut edge[place as usize];
                    *edge = edge.min(up * p.y);
                }
            }
        }
        edge
    };
    let (above, below) = (edge(upper, 1.0), edge(lower, -1.0));
    (3..COLUMNS - 3)
        .map(|k| above[k] + below[k])
        .fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn lips_meet_where_a_shape_closes_them() {
    let rest = human().skin.positions();
    let back = rest[human().landmarks["lip_corner_l"] as usize].z - 6.0;
    let [upper, lower] = [
        ["upper_lip", "mouth_interior_upper"],
        ["lower_lip", "mouth_interior_lower"],
    ]
    .map(|names| -> Vec<[u32; 3]> {
        let lip = triangles_in(&names).into_iter();
        let near = lip.filter(|t| t.iter().all(|&v| rest[v as usize].z > back));
        near.filter(|t| t.iter().all(|&v| !region(v).ends_with("_skin")))
            .collect()
    });
    for weights in [
        &[("jawOpen", 1.0), ("mouthClose", 1.0)][..],
        &[("jawOpen", 0.5), ("mouthClose", 0.5)],
        &[("jawOpen", 0.25), ("mouthClose", 0.25)],
        &[("mouthPucker", 1.0)],
        &[("mouthRollLower", 1.0)],
        &[("mouthRollUpper", 1.0)],
        &[("mouthShrugLower", 1.0)],
        &[("mouthSmile", 1.0)],
        &[("mouthFrown", 1.0)],
        &[("cheekPuff", 1.0)],
    ] {
        let gap = opening(&posed(weights), &upper, &lower);
        assert!(gap < SEALED, "{weights:?} leaves {gap:.2} mm");
    }
    assert!(opening(&posed(&[("jawOpen", 1.0)]), &upper, &lower) > 20.0);
    let funnel = opening(&posed(&[("mouthFunnel", 1.0)]), &upper, &lower);
    assert!(funnel > 6.0, "a funnel opens {funnel:.2} mm");
}

/// Least and greatest principal stretch of a triangle.
fn stretches(rest: [Point; 3], now: [Point; 3]) -> (f64, f64) {
    let flat = |[a, b, c]: [Point; 3]| {
        let (u, v) = (b - a, c - a);
        let x = u.normalize();
        let y = u.cross(&v).normalize().cross(&x);
        nalgebra::Matrix2::new(u.dot(&x), v.dot(&x), u.dot(&y), v.dot(&y))
    };
    let map = flat(now) * flat(rest).try_inverse().unwrap();
    let values = map.singular_values();
    (values.min(), values.max())
}

#[test]
fn skin_around_the_mouth_is_neither_folded_nor_torn() {
    let template = human();
    let rest = template.skin.positions();
    let at = |name: &str| rest[template.landmarks[name] as usize];
    let middle = nalgebra::center(&at("lip_corner_l"), &at("lip_corner_r"));
    let outer = [
        "face",
        "cheek",
        "jaw",
        "upper_lip_skin",
        "upper_lip",
        "lower_lip",
    ];
    let triangles: Vec<[u32; 3]> = triangles_in(&outer)
        .into_iter()
        .filter(|t| t.iter().all(|&v| (rest[v as usize] - middle).norm() < 60.0))
        .collect();
    let is_lip = |t: &[u32; 3]| t.iter().any(|&v| region(v).ends_with("_lip"));
    let mut neighbours: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            neighbours.entry([a.min(b), a.max(b)]).or_default().push(i);
        }
    }
    let normal = |t: &[u32; 3], p: &[Point]| {
        let [a, b, c] = t.map(|v| p[v as usize]);
        (b - a).cross(&(c - a)).normalize()
    };
    let mut broken = Vec::new();
    for (name, now) in poses() {
        // An open jaw stretches the lips around the corners most, lips that close over it the
        // skin of the chin; (least, most, fold in degrees).
        let opens = name.contains("jawOpen");
        let closes = name.contains("mouthClose");
        let bars = |is_lip: bool| match (is_lip, opens) {
            (false, _) if closes => (0.35, 4.0, 45.0),
            (true, true) => (0.3, 4.0, 70.0),
            (true, false) => (0.3, 2.6, 70.0),
            (false, true) => (0.4, 2.3, 45.0),
            (false, false) => (0.45, 1.9, 45.0),
        };
        let mut worst = [(f64::INFINITY, 0.0f64, 0.0f64); 2];
        for t in &triangles {
            let (low, high) = stretches(t.map(|v| rest[v as usize]), t.map(|v| now[v as usize]));
            let worst = &mut worst[usize::from(is_lip(t))];
            *worst = (worst.0.min(low), worst.1.max(high), worst.2);
        }
        for pair in neighbours.values().filter(|p| p.len() == 2) {
            let (s, t) = (&triangles[pair[0]], &triangles[pair[1]]);
            let angle = |p: &[Point]| normal(s, p).angle(&normal(t, p)).to_degrees();
            let worst = &mut worst[usize::from(is_lip(s) || is_lip(t))];
            worst.2 = worst.2.max(angle(&now) - angle(rest));
        }
        for (k, (low, high, fold)) in worst.into_iter().enumerate() {
            let (least, most, folded) = bars(k == 1);
            if low < least || high > most || fold > folded {
                let what = ["skin", "lips"][k];
                broken.push(format!(
                    "{name}: {what} {low:.2} to {high:.2}, fold {fold:.0}"
                ));
            }
        }
    }
    assert!(
        broken.is_empty(),
        "stretch and folds:\n{}",
        broken.join("\n")
    );
}

#[test]
fn lids_meet_on_one_line_outside_the_eyeball() {
    let template = human();
    let eye = template.eyes[0];
    let is_lid = |v: u32| region(v) == "upper_lid_l" || region(v) == "lower_lid_l";
    for shape in &template.shapes {
        let now = posed(&[(&shape.name, 1.0)]);
        let depth = (0..now.len() as u32)
            .filter(|&v| is_lid(v))
            .map(|v| eye.radius - (now[v as usize] - eye.center).norm())
            .fold(f64::NEG_INFINITY, f64::max);
        assert!(
            depth <= 0.0,
            "{}: a lid is {depth:.3} mm inside the eyeball",
            shape.name
        );
    }
    // Front edges of the margins: lid vertices beside the socket.
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let mut beside = vec![false; template.skin.vertex_count()];
    let polygons = template.skin.polygons();
    for face in polygons.iter() {
        if face.iter().any(|&v| region(v) == "socket_l") {
            for &v in face {
                beside[v as usize] |= is_lid(v);
            }
        }
    }
    for face in polygons.iter() {
        for (k, &a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            if beside[a as usize] && beside[b as usize] {
                edges.push([a, b]);
            }
        }
    }
    let now = posed(&[("eyeBlinkLeft", 1.0)]);
    let seen = |v: u32| Point::new(now[v as usize].x, now[v as usize].y, 0.0);
    let mut met = 0;
    for v in (0..now.len() as u32).filter(|&v| beside[v as usize] && region(v) == "upper_lid_l") {
        let p = seen(v);
        let gap = edges
            .iter()
            .filter(|e| e.iter().all(|&v| region(v) == "lower_lid_l"))
            .map(|e| e.map(seen))
            .map(|[a, b]| (closest_on_triangle(&p, [a, b, b]).0 - p).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(
            gap < 0.5,
            "vertex {v} of the upper margin ends {gap:.2} mm off the lower lid, seen from the front"
        );
        met += 1;
    }
    assert!(met >= 9, "only {met} vertices of the upper margin found");
}

#[test]
fn shapes_of_one_side_leave_the_other_alone() {
    let template = human();
    let rest = template.skin.positions();
    for shape in &template.shapes {
        let side = match &shape.name {
            n if n == "jawLeft" || n == "mouthLeft" => continue,
            n if n == "jawRight" || n == "mouthRight" => continue,
            n if n.ends_with("Left") => 1.0,
            n if n.ends_with("Right") => -1.0,
            _ => continue,
        };
        for (v, d) in &shape.deltas {
            let p = rest[*v as usize];
            assert!(
                side * p.x > -10.0,
                "{} moves vertex {v} at x = {} by {d}",
                shape.name,
                p.x
            );
        }
    }
}
