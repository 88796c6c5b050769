//! The skin where contact is: it does not pass through what its patches do not pass through.
//!
//! Patches keep apart by contact of their own; the skin hangs on them, and bends less finely
//! than what it meets. So after it is deformed, the few vertices that are where they must not
//! be ask to be moved: lips off each other and off the teeth, lids off the eyeball with its
//! cornea, all skin off colliders. What they ask is spread over the skin around them
//! ([`SkinSpreader`]), so that no dent shows, and a few rounds later nothing is left to ask.
//!
//! What crossed at rest may stay as deep as it was.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::collision::{
    Collider, CollisionError, Lip, PairMask, Sheet, SheetPlace, Stickiness, WorldShape,
};
use crate::rig::Rig;
use crate::scene::Scene;
use crate::scene::bodies::Body;
use crate::scene::contact::is_mouth_ring;
use crate::skin::SkinSpreader;
use crate::template::RigidBody;

/// Rounds of asking and spreading.
const ROUNDS: usize = 10;
/// What is asked for less than this stays. (mm)
const ENOUGH: f32 = 0.01;
/// Furthest that a vertex is moved in a round. (mm)
const LONGEST_STEP: f32 = 1.0;
/// What single vertices may be moved by, without those around them. (mm)
const SINGLE: f64 = 0.1;
/// How far the other lip is looked for. (mm)
const LIP_REACH: f32 = 3.0;
/// How far behind the lips their lining takes part. (mm)
const LINING: f32 = 8.0;
/// Skin further from a node of the ring than its nearest by no more than this tells whether
/// the lips touch there. (mm)
const TOUCH_AROUND: f32 = 1.5;
/// Height that lids keep over the eyeball and lips over teeth, where they have it at rest. (mm)
const LID_HEIGHT: f32 = 0.15;
/// What is kept from a collider. (mm)
const GAP: f32 = 0.02;
/// How far corrections spread: of lips and lids, of skin under colliders. (mm)
const WIDTHS: [f32; 2] = [4.0, 8.0];

/// What contact did to the skin in a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SkinContactReport {
    /// How deep the deepest vertex stood in what it must not enter, as the patches left it.
    /// (mm)
    pub deepest_before: f64,
    /// The same when the skin was corrected. (mm)
    pub deepest_after: f64,
    /// Vertices that were moved, with those around them.
    pub corrected: usize,
}

/// The skin's part of contact.
pub(super) struct SkinContact {
    spreader: SkinSpreader,
    triangles: Vec<[u32; 3]>,
    is_skin: Vec<bool>,
    lips: Option<Lips>,
    touch: Option<LipTouch>,
    over: Vec<Over>,
    shapes: Vec<WorldShape>,
}

struct Lips {
    /// Upper, lower.
    sheets: [Sheet; 2],
    /// For each vertex of each sheet how far it may be behind the other: zero, or what it was
    /// at rest. (mm)
    allowed: [Vec<f32>; 2],
    /// Where each vertex was when it was last looked at (mm).
    last: [Vec<Point3<f32>>; 2],
    /// How far both sheets have gone since the start, at most (mm): no vertex has come nearer to
    /// the other sheet by more than that.
    way: f32,
    /// The way up to which each vertex cannot be behind the other sheet. (mm)
    free: [Vec<f32>; 2],
}

/// What tells where lips stick: skin near the nodes of the mouth's ring.
struct LipTouch {
    lip_of: Vec<Lip>,
    /// For each node vertices near it, as slots of its lip's sheet.
    near: Vec<Vec<u32>>,
    gap: f32,
}

/// Skin over a body of the face: lids over an eyeball, lips and the lining of the mouth over
/// teeth and gums.
struct Over {
    /// Index of the body.
    body: usize,
    shape: WorldShape,
    vertices: Vec<u32>,
    /// Height over the body that each keeps. (mm)
    heights: Vec<f32>,
}

/// What is asked for, and by whom.
#[derive(Default)]
struct Asked {
    /// By vertex. (mm)
    near: BTreeMap<u32, Vector3<f32>>,
    under: BTreeMap<u32, Vector3<f32>>,
    deepest: f32,
}

impl SkinContact {
    /// As a scene asks for it; none where nothing could touch.
    pub(super) fn new(
        rig: &Rig,
        scene: &Scene,
        bodies: &[Body],
        rest: &[Point3<f32>],
    ) -> Result<Option<Self>, CollisionError> {
        if !scene.has_contact() {
            return Ok(None);
        }
        let has_own = scene.contact.pairs != PairMask::None;
        let mut is_skin = vec![true; rest.len()];
        for &v in rig.parts.iter().flat_map(|part| &part.vertices) {
            is_skin[v as usize] = false;
        }
        let mut triangles = rig.face.triangles();
        triangles.retain(|t| t.iter().all(|&v| is_skin[v as usize]));
        let shape = |(index, c): (usize, &Collider)| WorldShape::new(&c.shape, index, &c.name);
        let shapes = scene.colliders.iter().enumerate().map(shape);
        let mut contact = Self {
            spreader: SkinSpreader::new(rest, &triangles),
            shapes: shapes.collect::<Result<_, _>>()?,
            lips: None,
            touch: None,
            over: Vec::new(),
            triangles,
            is_skin,
        };
        if has_own {
            contact.lips = Lips::new(rig, &contact.triangles, rest);
            contact.touch = contact.lips.as_ref().and_then(|lips| {
                LipTouch::new(rig, lips, scene.contact.sticky_lips.as_ref()?, rest)
            });
        }
        if has_own {
            // None where bones hold nothing out.
            let own = bodies.iter().enumerate().filter(|(_, b)| b.is_own);
            contact.over = own
                .map(|(index, b)| Over::new(rig, index, b, rest))
                .collect();
        }
        Ok(Some(contact))
    }

    /// Moves the skin out of what it is in.
    ///
    /// - `colliders`, `bodies`: poses now [mm, head frame], those of bodies about their centres
    pub(super) fn settle(
        &mut self,
        skin: &mut [Point3<f32>],
        colliders: &[Isometry3<f64>],
        bodies: &[Isometry3<f64>],
    ) -> SkinContactReport {
        let mut report = SkinContactReport::default();
        let mut best: Option<(f32, Vec<Point3<f32>>)> = None;
        for round in 0..=ROUNDS {
            let mut asked = self.ask(skin, colliders, bodies);
            let largest = asked.largest();
            if round == 0 {
                report.deepest_before = f64::from(asked.deepest);
            }
            // Lips that are drawn into each other may resist: the best round counts.
            let is_enough = largest < ENOUGH;
            let lack = asked.deepest + largest;
            if is_enough || best.as_ref().is_none_or(|(least, _)| lack < *least) {
                report.deepest_after = f64::from(asked.deepest);
                best = (!is_enough).then(|| (lack, skin.to_vec()));
            }
            if is_enough || round == ROUNDS {
                break;
            }
            asked.limit(LONGEST_STEP);
            let mut moved = 0;
            for (asked, width) in [&asked.near, &asked.under].into_iter().zip(WIDTHS) {
                moved += self.spreader.spread(asked, width, skin);
            }
            report.corrected = report.corrected.max(moved);
        }
        if let Some((_, best)) = best {
            skin.copy_from_slice(&best);
        }
        self.finish(skin, colliders, bodies, &mut report);
        report
    }

    /// What is left, if it is hundredths, is a matter of single vertices.
    fn finish(
        &mut self,
        skin: &mut [Point3<f32>],
        colliders: &[Isometry3<f64>],
        bodies: &[Isometry3<f64>],
        report: &mut SkinContactReport,
    ) {
        if report.deepest_after == 0.0 || report.deepest_after > SINGLE {
            return;
        }
        let asked = self.ask(skin, colliders, bodies);
        let before: Vec<(u32, Point3<f32>)> = asked
            .near
            .keys()
            .chain(asked.under.keys())
            .map(|&v| (v, skin[v as usize]))
            .collect();
        for (&v, by) in asked.near.iter().chain(&asked.under) {
            skin[v as usize] += by;
        }
        let left = f64::from(self.ask(skin, colliders, bodies).deepest);
        if left < report.deepest_after {
            report.deepest_after = left;
        } else {
            before.into_iter().for_each(|(v, p)| skin[v as usize] = p);
        }
    }

    /// Which lip the nodes of the mouth's ring that may stick belong to; none where nothing
    /// sticks.
    pub(super) fn sticky_lips(&self) -> &[Lip] {
        self.touch.as_ref().map_or(&[], |touch| &touch.lip_of)
    }

    /// For each of these nodes whether the skin near it touches the other lip.
    pub(super) fn touching(&self, skin: &[Point3<f32>]) -> Vec<bool> {
        match (&self.lips, &self.touch) {
            (Some(lips), Some(touch)) => touch.is_touching(lips, skin),
            _ => Vec::new(),
        }
    }

    fn ask(
        &mut self,
        skin: &[Point3<f32>],
        colliders: &[Isometry3<f64>],
        bodies: &[Isometry3<f64>],
    ) -> Asked {
        let mut asked = Asked::default();
        if let Some(lips) = &mut self.lips {
            lips.ask(skin, &mut asked);
        }
        for over in &self.over {
            over.ask(skin, &bodies[over.body], &mut asked);
        }
        for (shape, pose) in self.shapes.iter().zip(colliders) {
            self.ask_off(shape, pose, skin, &mut asked);
        }
        asked
    }

    /// Asks all skin off a collider: at its vertices, in the middle of its triangles, and at
    /// the corners of a collider that has such.
    fn ask_off(
        &self,
        shape: &WorldShape,
        pose: &Isometry3<f64>,
        skin: &[Point3<f32>],
        asked: &mut Asked,
    ) {
        let inverse = pose.inverse();
        let center: Point3<f32> = Point3::from(pose.translation.vector).cast();
        let reach = (shape.radius + 1.0) as f32;
        let is_near =
            |p: &Point3<f32>| !reach.is_finite() || (p - center).norm_squared() < reach * reach;
        let depth_at = |p: &Point3<f32>| {
            let place = shape.nearest(&(inverse * p.cast::<f64>()).coords);
            let lack = GAP - place.distance as f32;
            let normal = (pose.rotation * place.normal?).cast::<f32>();
            (lack > 0.0).then_some((lack, normal, -place.distance as f32))
        };
        let mut near = vec![false; skin.len()];
        let mut any = false;
        for (v, p) in skin.iter().enumerate() {
            if !self.is_skin[v] || !is_near(p) {
                continue;
            }
            near[v] = true;
            any = true;
            if let Some((lack, normal, depth)) = depth_at(p) {
                ask(&mut asked.under, v as u32, &normal, lack);
                asked.deepest = asked.deepest.max(depth);
            }
        }
        if !any {
            return;
        }
        let third = 1.0 / 3.0;
        for t in &self.triangles {
            if !t.iter().any(|&v| near[v as usize]) {
                continue;
            }
            let [a, b, c] = t.map(|v| skin[v as usize].coords);
            let middle = Point3::from((a + b + c) * third);
            if let Some((lack, normal, depth)) = depth_at(&middle) {
                // Moved alike, the corners take the middle along.
                t.iter()
                    .for_each(|&v| ask(&mut asked.under, v, &normal, lack));
                asked.deepest = asked.deepest.max(depth);
            }
            if shape.is_round {
                continue;
            }
            let Some(outward) = (b - a).cross(&(c - a)).try_normalize(1e-9) else {
                continue;
            };
            for corner in &shape.mesh.0 {
                let q = (pose * corner).coords.cast::<f32>();
                let behind = -(q - a).dot(&outward);
                let on = barycentric([a, b, c], q);
                if (0.0..LIP_REACH).contains(&behind) && on.iter().all(|&w| w >= 0.0) {
                    let lack = behind + GAP;
                    t.iter()
                        .for_each(|&v| ask(&mut asked.under, v, &-outward, lack));
                    asked.deepest = asked.deepest.max(behind);
                }
            }
        }
    }
}

impl Asked {
    /// Cuts what is asked for to a length. (mm)
    fn limit(&mut self, longest: f32) {
        for by in self.near.values_mut().chain(self.under.values_mut()) {
            *by *= longest / by.norm().max(longest);
        }
    }

    fn largest(&self) -> f32 {
        let all = self.near.values().chain(self.under.values());
        all.map(|by| by.norm()).fold(0.0, f32::max)
    }
}

impl Lips {
    fn new(rig: &Rig, triangles: &[[u32; 3]], rest: &[Point3<f32>]) -> Option<Self> {
        let sheets = ["upper", "lower"].map(|which| {
            let lip = rig.vertices_in(&[&format!("{which}_lip")]);
            let lining = rig.vertices_in(&[&format!("mouth_interior_{which}")]);
            let mut is_of_lip = vec![false; rest.len()];
            let near = |p: &Point3<f32>| {
                lip.iter()
                    .any(|&v| (rest[v as usize] - p).norm_squared() < LINING * LINING)
            };
            for &v in &lip {
                is_of_lip[v as usize] = true;
            }
            for &v in lining.iter().filter(|&&v| near(&rest[v as usize])) {
                is_of_lip[v as usize] = true;
            }
            let own = triangles.iter().copied();
            let own = own.filter(|t| t.iter().all(|&v| is_of_lip[v as usize]));
            Sheet::new(own.collect(), rest)
        });
        if sheets.iter().any(Sheet::is_empty) {
            return None;
        }
        let allowed = [0, 1].map(|side| {
            let (own, other) = (&sheets[side], &sheets[1 - side]);
            let behind = |&v: &u32| {
                let place = other.nearest(&rest[v as usize], LIP_REACH, rest);
                let place = place.filter(|place| !place.is_border);
                place.map_or(0.0, |place| place.distance.min(0.0))
            };
            own.vertices().iter().map(behind).collect()
        });
        let free = sheets.each_ref().map(|s| vec![0.0; s.vertices().len()]);
        let last = sheets.each_ref().map(|s| at(s, rest));
        Some(Self {
            sheets,
            allowed,
            last,
            way: 0.0,
            free,
        })
    }

    fn ask(&mut self, skin: &[Point3<f32>], asked: &mut Asked) {
        for (sheet, last) in self.sheets.iter_mut().zip(&mut self.last) {
            sheet.refit(skin);
            let now = at(sheet, skin);
            let ways = now.iter().zip(last.iter()).map(|(a, b)| (a - b).norm());
            self.way += ways.fold(0.0, f32::max);
            *last = now;
        }
        let way = self.way;
        for side in [0, 1] {
            let (own, other) = (&self.sheets[side], &self.sheets[1 - side]);
            let allowed = &self.allowed[side];
            let behind = |((slot, &v), free): ((usize, &u32), &mut f32)| {
                if way < *free {
                    return None;
                }
                let Some(place) = other.nearest(&skin[v as usize], LIP_REACH, skin) else {
                    *free = way + LIP_REACH;
                    return None;
                };
                // Beyond a border there is no behind, only a distance.
                let is_clear = place.is_border || place.distance > 0.0;
                *free = way + if is_clear { place.distance.abs() } else { 0.0 };
                let lack = allowed[slot] - place.distance;
                // Skin that looks the same way is beside the other lip, not behind its front.
                let faces = own.normals()[slot].dot(&place.normal) < 0.0;
                (lack > 0.0 && faces && !place.is_border).then_some((v, place, lack))
            };
            let found: Vec<(u32, SheetPlace, f32)> = own
                .vertices()
                .par_iter()
                .enumerate()
                .zip(&mut self.free[side])
                .with_min_len(64)
                .filter_map(behind)
                .collect();
            for (v, place, lack) in found {
                // Each lip gives way by half.
                let half = 0.5 * lack;
                ask(&mut asked.near, v, &place.normal, half);
                let squares: f32 = place.barycentric.iter().map(|b| b * b).sum();
                for (corner, b) in place.corners.iter().zip(place.barycentric) {
                    ask(&mut asked.near, *corner, &-place.normal, half * b / squares);
                }
                asked.deepest = asked.deepest.max(lack);
            }
        }
    }
}

/// Where the vertices of a sheet are.
fn at(sheet: &Sheet, skin: &[Point3<f32>]) -> Vec<Point3<f32>> {
    let vertices = sheet.vertices().iter();
    vertices.map(|&v| skin[v as usize]).collect()
}

impl LipTouch {
    fn new(rig: &Rig, lips: &Lips, sticky: &Stickiness, rest: &[Point3<f32>]) -> Option<Self> {
        let ring = rig
            .patches
            .iter()
            .find(|patch| is_mouth_ring(&patch.patch.chart))?;
        let grid = ring.patch.chart.grid;
        let count = (sticky.rows.min(grid.v_count) * grid.u_count) as usize;
        let mut lip_of = Vec::with_capacity(count);
        let mut near = Vec::with_capacity(count);
        for node in &ring.patch.neutral[..count] {
            let node: Point3<f32> = node.cast();
            let of_sheet = |side: usize| {
                let vertices = lips.sheets[side].vertices().iter();
                let ways = vertices.map(|&v| (rest[v as usize] - node).norm());
                ways.collect::<Vec<f32>>()
            };
            let ways = [of_sheet(0), of_sheet(1)];
            let nearest = ways
                .each_ref()
                .map(|w| w.iter().copied().fold(f32::MAX, f32::min));
            let side = usize::from(nearest[1] < nearest[0]);
            let slots = (0u32..).zip(&ways[side]);
            let slots = slots.filter(|(_, way)| **way < nearest[side] + TOUCH_AROUND);
            near.push(slots.map(|(slot, _)| slot).collect());
            lip_of.push([Lip::Upper, Lip::Lower][side]);
        }
        Some(Self {
            lip_of,
            near,
            gap: sticky.gap as f32,
        })
    }

    fn is_touching(&self, lips: &Lips, skin: &[Point3<f32>]) -> Vec<bool> {
        let sides = [Lip::Upper, Lip::Lower];
        let gaps = [0, 1].map(|side| {
            let (own, other) = (&lips.sheets[side], &lips.sheets[1 - side]);
            let is_near = |v: &u32| other.nearest(&skin[*v as usize], self.gap, skin).is_some();
            own.vertices()
                .par_iter()
                .map(is_near)
                .collect::<Vec<bool>>()
        });
        let nodes = self.lip_of.iter().zip(&self.near);
        nodes
            .map(|(lip, near)| {
                let side = usize::from(*lip == sides[1]);
                near.iter().any(|&slot| gaps[side][slot as usize])
            })
            .collect()
    }
}

impl Over {
    fn new(rig: &Rig, index: usize, body: &Body, rest: &[Point3<f32>]) -> Self {
        let regions: &[&str] = match body.follows {
            RigidBody::EyeLeft => &["upper_lid_l", "lower_lid_l"],
            RigidBody::EyeRight => &["upper_lid_r", "lower_lid_r"],
            RigidBody::Skull => &["upper_lip", "mouth_interior_upper"],
            RigidBody::Mandible => &["lower_lip", "mouth_interior_lower"],
        };
        let vertices = rig.vertices_in(regions);
        let height = |v: u32| {
            let at = rest[v as usize].cast::<f64>() - body.center;
            body.visible.distance(&at) as f32
        };
        let heights = vertices.iter().map(|&v| height(v).min(LID_HEIGHT));
        Self {
            body: index,
            heights: heights.collect(),
            shape: WorldShape::of_star(body.visible.clone()),
            vertices,
        }
    }

    fn ask(&self, skin: &[Point3<f32>], pose: &Isometry3<f64>, asked: &mut Asked) {
        let inverse = pose.inverse();
        for (&v, &height) in self.vertices.iter().zip(&self.heights) {
            let local = (inverse * skin[v as usize].cast::<f64>()).coords;
            let reach = self.shape.radius + f64::from(LID_HEIGHT);
            if local.norm_squared() > reach * reach {
                continue;
            }
            let place = self.shape.nearest(&local);
            let lack = height - place.distance as f32;
            let Some(normal) = place.normal.filter(|_| lack > 0.0) else {
                continue;
            };
            let normal = (pose.rotation * normal).cast();
            ask(&mut asked.near, v, &normal, lack);
            let depth = height.min(0.0) - place.distance as f32;
            asked.deepest = asked.deepest.max(depth);
        }
    }
}

/// Asks for `lack` along `normal`, over what is asked for already.
fn ask(asked: &mut BTreeMap<u32, Vector3<f32>>, vertex: u32, normal: &Vector3<f32>, lack: f32) {
    let by = asked.entry(vertex).or_insert_with(Vector3::zeros);
    let more = lack - by.dot(normal);
    if more > 0.0 {
        *by += normal * more;
    }
}

/// Barycentric coordinates of the foot of a point on the plane of a triangle.
fn barycentric([a, b, c]: [Vector3<f32>; 3], p: Vector3<f32>) -> [f32; 3] {
    let normal = (b - a).cross(&(c - a));
    let area = normal.norm_squared();
    let share = |x: Vector3<f32>, y: Vector3<f32>| (y - x).cross(&(p - x)).dot(&normal) / area;
    [share(b, c), share(c, a), share(a, b)]
}
