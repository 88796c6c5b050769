//! Lids that meet on the face's own skin.
//!
//! [`LidClosing`](crate::transfer::LidClosing) closes the lids of the normalized face; the
//! margins of the user's mesh lie a few tenths of a millimetre beside it, which leaves a slit
//! or an overlap. Here the user's own lids are posed with both eyes closed, and seen from the
//! middle of each eyeball: the lower edge of the upper lid and the upper edge of the lower
//! lid are two curves of height over azimuth. What is left between them is shared between
//! both lids, spread smoothly over the skin around, and added to the muscle shapes of the
//! blink; skin inside the eyeball is lifted over it. A few rounds of pose and correction.

use nalgebra::{Point3, Vector3};

use crate::Vector;
use crate::rig::Rig;
use crate::skin::{NodeAffine, NodeFrames};
use crate::template::{EyeSocket, RegionId, RigidBody, Template};
use crate::transfer::ShapeWeights;

/// Rounds of pose and correction.
const ROUNDS: usize = 4;
/// Distance of the places where the margins are compared. (mm)
const STEP: f64 = 0.5;
/// How far the upper lid goes beyond the lower, least and most: a little keeps a line from
/// showing through, and what the shapes draw within these bounds stays. (mm)
const OVERLAP: [f64; 2] = [0.2, 0.5];
/// A larger gap is no slit but lids that do not close, or margins that were not found. (mm)
const LARGEST_GAP: f64 = 6.0;
/// Width of the kernel that spreads a correction. (mm)
const WIDTH: f64 = 3.0;
/// Least height of closed lids over the eyeball. (mm)
const CLEARANCE: f64 = 0.15;

/// The lids of one eye on the user's mesh.
struct EyeLids {
    eye: usize,
    blink: u32,
    socket: EyeSocket,
    has_ball: bool,
    /// Azimuths of the corners, towards -x and +x. (rad)
    corners: [f64; 2],
    upper: Lid,
    lower: Lid,
}

struct Lid {
    region: RegionId,
    vertices: Vec<usize>,
    /// Edges between them, as slots of `vertices`.
    edges: Vec<[usize; 2]>,
}

/// A place on the margin of a lid.
#[derive(Clone, Copy)]
struct Edge {
    rest: Vector,
    now: Vector,
    height: f64,
}

/// What a place of the skin lacks.
struct Mark {
    rest: Vector,
    /// How far the blink moves it. (mm)
    amount: f64,
    correction: Vector,
}

/// Corrects the blinks of a rig until the user's own lids meet.
///
pub(super) fn close_lids(rig: &mut Rig, template: &Template) {
    let triangles = template.skin.triangles();
    let mut eyes = find_lids(rig, template);
    eyes.retain(|eye| !eye.upper.edges.is_empty() && !eye.lower.edges.is_empty());
    if eyes.is_empty() {
        return;
    }
    let rest: Vec<Point3<f32>> = rig.skin_at_rest();
    let frames: Vec<NodeFrames> = rig
        .neutral_nodes()
        .into_iter()
        .map(|(grid, nodes)| NodeFrames::new(grid, nodes))
        .collect();
    for _ in 0..ROUNDS {
        let affines = closed(rig, &frames, &eyes);
        let posed = |v: usize| -> Vector {
            let mut moved = Vector3::<f32>::zeros();
            for (node, weight) in rig.binding.row(v) {
                moved += affines[node as usize].displacement(&rest[v]) * weight;
            }
            (rest[v] + moved).coords.cast()
        };
        let found: Vec<_> = eyes
            .iter()
            .map(|eye| {
                let [upper, lower] = [&eye.upper, &eye.lower].map(|lid| {
                    let now: Vec<Vector> = lid.vertices.iter().map(|&v| posed(v)).collect();
                    let at: Vec<Vector> = lid
                        .vertices
                        .iter()
                        .map(|&v| rest[v].coords.cast())
                        .collect();
                    (at, now)
                });
                let marks = gaps(eye, &upper, &lower);
                let lifts = if eye.has_ball {
                    [lifts(eye, &upper), lifts(eye, &lower)].concat()
                } else {
                    Vec::new()
                };
                (marks, lifts)
            })
            .collect();
        for (eye, ([upper, lower], lifts)) in eyes.iter().zip(found) {
            correct(rig, template, &triangles, eye, &upper, &lower);
            lift(rig, eye, &lifts);
        }
    }
}

fn find_lids(rig: &Rig, template: &Template) -> Vec<EyeLids> {
    let mut eyes = Vec::new();
    for (eye, side) in ["l", "r"].into_iter().enumerate() {
        let region = |lid: &str| template.regions.find(&format!("{lid}_{side}"));
        let mark = |name: &str| template.landmarks.get(&format!("{name}_{side}"));
        let (Some(blink), Some(upper), Some(lower), Some(&inner), Some(&outer)) = (
            rig.eye_shapes[eye].blink,
            region("upper_lid"),
            region("lower_lid"),
            mark("eye_inner"),
            mark("eye_outer"),
        ) else {
            continue;
        };
        let socket = rig.eyes[eye];
        let body = [RigidBody::EyeLeft, RigidBody::EyeRight][eye];
        let mut corners =
            [inner, outer].map(|v| azimuth(&socket, &rig.positions[v as usize].coords));
        corners.sort_by(f64::total_cmp);
        let lid = |region| Lid {
            region,
            vertices: Vec::new(),
            edges: Vec::new(),
        };
        eyes.push(EyeLids {
            eye,
            blink,
            socket,
            has_ball: rig.parts.iter().any(|p| p.follows == body),
            corners,
            upper: lid(upper),
            lower: lid(lower),
        });
    }
    // (eye, is upper, slot) of each vertex on a lid.
    let mut slots = vec![None; rig.regions.len()];
    for (v, region) in rig.regions.iter().enumerate() {
        let Some(region) = *region else {
            continue;
        };
        for (e, eye) in eyes.iter_mut().enumerate() {
            for (is_upper, lid) in [(true, &mut eye.upper), (false, &mut eye.lower)] {
                if lid.region == region {
                    slots[v] = Some((e, is_upper, lid.vertices.len()));
                    lid.vertices.push(v);
                }
            }
        }
    }
    for triangle in rig.face.triangles() {
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]].map(|v| slots[v as usize]);
            if let (Some((e, is_upper, a)), Some((f, other, b))) = (a, b)
                && (e, is_upper) == (f, other)
            {
                let eye = &mut eyes[e];
                let lid = if is_upper {
                    &mut eye.upper
                } else {
                    &mut eye.lower
                };
                lid.edges.push([a, b]);
            }
        }
    }
    eyes
}

/// What every node does with all eyes closed; the mandible rests.
fn closed(rig: &Rig, frames: &[NodeFrames], eyes: &[EyeLids]) -> Vec<NodeAffine> {
    let mut weights = vec![0.0; rig.shape_names.len()];
    for eye in eyes {
        weights[eye.blink as usize] = 1.0;
    }
    let at = ShapeWeights {
        weights: &weights,
        rates: None,
    };
    let context = rig.transfer_context();
    let mut affines = Vec::new();
    for (patch, frames) in rig.patches.iter().zip(frames) {
        let start = affines.len();
        let rest = frames.rest();
        affines.resize(start + rest.len(), NodeAffine::identity());
        let blinks = |s: &crate::transfer::MuscleShape| weights[s.shape as usize] != 0.0;
        if !patch.transfer.shapes.iter().any(blinks) {
            continue;
        }
        let mut now = rest.to_vec();
        let mut velocities = vec![Vector3::zeros(); rest.len()];
        patch
            .transfer
            .evaluate(&context, rest, at, &mut now, &mut velocities);
        frames.affines(&now, &mut affines[start..]);
    }
    affines.push(NodeAffine::identity());
    affines
}

fn azimuth(socket: &EyeSocket, at: &Vector) -> f64 {
    let arm = at - socket.center.coords;
    arm.x.atan2(arm.z)
}

/// Height of a place over the eye's middle, along the eyeball. (mm)
fn height(socket: &EyeSocket, at: &Vector) -> f64 {
    let arm = at - socket.center.coords;
    socket.radius * arm.y.atan2(arm.x.hypot(arm.z))
}

/// The margin of a posed lid at each azimuth: its lowest or highest edge there.
///
/// - `sign`: 1 for the lower margin of an upper lid, -1 for the upper margin of a lower lid
fn margin(
    eye: &EyeLids,
    lid: &Lid,
    (rest, now): &(Vec<Vector>, Vec<Vector>),
    azimuths: &[f64],
    sign: f64,
) -> Vec<Option<Edge>> {
    let mut found: Vec<Option<Edge>> = vec![None; azimuths.len()];
    let step = STEP / eye.socket.radius;
    for &[a, b] in &lid.edges {
        let (p, q) = (azimuth(&eye.socket, &now[a]), azimuth(&eye.socket, &now[b]));
        let (low, high) = (p.min(q), p.max(q));
        let first = ((low - azimuths[0]) / step).ceil().max(0.0) as usize;
        for (k, &at) in azimuths.iter().enumerate().skip(first) {
            if at > high {
                break;
            }
            let t = if q == p { 0.0 } else { (at - p) / (q - p) };
            let now = now[a].lerp(&now[b], t);
            let height = height(&eye.socket, &now);
            if found[k].is_none_or(|e| sign * height < sign * e.height) {
                found[k] = Some(Edge {
                    rest: rest[a].lerp(&rest[b], t),
                    now,
                    height,
                });
            }
        }
    }
    found
}

/// What both margins have to go to meet: marks of the upper lid and of the lower.
fn gaps(
    eye: &EyeLids,
    upper: &(Vec<Vector>, Vec<Vector>),
    lower: &(Vec<Vector>, Vec<Vector>),
) -> [Vec<Mark>; 2] {
    let step = STEP / eye.socket.radius;
    let [from, to] = eye.corners;
    let count = ((to - from) / step).max(0.0) as usize;
    let azimuths: Vec<f64> = (1..count).map(|k| from + k as f64 * step).collect();
    let mut marks = [Vec::new(), Vec::new()];
    if azimuths.is_empty() {
        return marks;
    }
    let uppers = margin(eye, &eye.upper, upper, &azimuths, 1.0);
    let lowers = margin(eye, &eye.lower, lower, &azimuths, -1.0);
    for (upper, lower) in uppers.iter().zip(&lowers) {
        let (Some(upper), Some(lower)) = (upper, lower) else {
            continue;
        };
        let gap = upper.height - lower.height;
        if gap.abs() > LARGEST_GAP {
            continue;
        }
        let missing = gap - gap.clamp(-OVERLAP[1], -OVERLAP[0]);
        let amounts = [upper, lower].map(|e| (e.now - e.rest).norm());
        let share = amounts[0] / (amounts[0] + amounts[1]).max(f64::EPSILON);
        for (k, (edge, part)) in [(upper, -share), (lower, 1.0 - share)]
            .into_iter()
            .enumerate()
        {
            let arm = edge.now - eye.socket.center.coords;
            let across = Vector::y().cross(&arm);
            let Some(up) = arm.cross(&across).try_normalize(f64::EPSILON) else {
                continue;
            };
            marks[k].push(Mark {
                rest: edge.rest,
                amount: amounts[k],
                correction: up * (part * missing),
            });
        }
    }
    marks
}

/// How much each lid vertex is missing to lie over the eyeball; zero for those that do.
fn lifts(eye: &EyeLids, (rest, now): &(Vec<Vector>, Vec<Vector>)) -> Vec<(Vector, f64)> {
    let [from, to] = eye.corners;
    rest.iter()
        .zip(now)
        .filter(|(_, now)| (from..to).contains(&azimuth(&eye.socket, now)))
        .map(|(rest, now)| {
            let radius = (now - eye.socket.center.coords).norm();
            (*rest, (eye.socket.radius + CLEARANCE - radius).max(0.0))
        })
        .collect()
}

fn kernel(a: &Vector, b: &Vector) -> f64 {
    (-(a - b).norm_squared() / (WIDTH * WIDTH)).exp()
}

/// Adds what the marks lack to the blink of every patch.
fn correct(
    rig: &mut Rig,
    template: &Template,
    triangles: &[[u32; 3]],
    eye: &EyeLids,
    upper: &[Mark],
    lower: &[Mark],
) {
    let mut corrections = vec![Vector::zeros(); template.skin.vertex_count()];
    let blink = &template.shapes[eye.blink as usize];
    for &(v, delta) in &blink.deltas {
        let v = v as usize;
        let at = rig.positions[v].coords;
        let region = template.regions.vertex_regions[v];
        // Skin around the lids belongs to whichever margin is nearer.
        let uppers = upper.iter().filter(|_| region != eye.lower.region);
        let lowers = lower.iter().filter(|_| region != eye.upper.region);
        let (mut sum, mut total) = (Vector::zeros(), 0.0);
        for mark in uppers.chain(lowers) {
            let weight = kernel(&at, &mark.rest);
            sum += weight * (delta.norm() / mark.amount.max(0.1)).min(1.0) * mark.correction;
            total += weight;
        }
        if total > 1e-6 {
            corrections[v] = sum / total;
        }
    }
    for patch in &mut rig.patches {
        let alpha = patch.transfer.alpha;
        let shapes = &mut patch.transfer.shapes;
        let Some(shape) = shapes.iter_mut().find(|s| s.shape == eye.blink) else {
            continue;
        };
        for (delta, node) in shape.deltas.iter_mut().zip(&patch.patch.chart.nodes) {
            *delta += (node.blend(triangles, &corrections) / alpha).cast::<f32>();
        }
    }
}

/// Raises the blink over the eyeball where skin lies inside it.
fn lift(rig: &mut Rig, eye: &EyeLids, lifts: &[(Vector, f64)]) {
    if lifts.iter().all(|l| l.1 == 0.0) {
        return;
    }
    for patch in &mut rig.patches {
        let shapes = &patch.transfer.shapes;
        let Some(slot) = shapes.iter().position(|s| s.shape == eye.blink) else {
            continue;
        };
        let Some(lids) = &mut patch.transfer.lids else {
            continue;
        };
        for lid in &mut lids.nodes {
            if usize::from(lid.eye) != eye.eye {
                continue;
            }
            let at = patch.patch.neutral[lid.node as usize].coords;
            let (mut sum, mut total) = (0.0, 1e-3);
            for (rest, missing) in lifts {
                let weight = kernel(&at, rest);
                sum += weight * missing;
                total += weight;
            }
            lid.radius_changes[slot] += (sum / total) as f32;
            let deepest = lid.radius_changes.iter().copied().fold(0.0, f32::min);
            lid.least_radius = lid.rest_radius + deepest;
        }
    }
}
