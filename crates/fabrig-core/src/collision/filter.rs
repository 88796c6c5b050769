//! The guarantee: no pass ends in a crossing.
//!
//! After contacts are projected, every pair that could have met is followed along its straight
//! way by conservative advancement: its distance can fall by no more than its nodes move
//! against each other. A pair that would lose nine tenths of its distance is not safe. Its
//! nodes are then held back: from half of what they go against each other, so that what goes
//! together goes on; after some rounds to a way that is the same for all of them
//! ([`super::zones`]); and at last to no way at all, as where they stood nothing crossed. A
//! collider cannot be held back, so nodes in front of it are carried along with it instead, and
//! what they meet is carried too.
//!
//! Source: Li et al. 2021, *Codimensional Incremental Potential Contact*, additive CCD.

use nalgebra::{Point3, Vector3};

use super::contact::Contact;
use super::detect::MARGIN;
use super::distance::{PairKind, closest_weights, places, weighted, wide};
use super::plane::approach;
use super::project::{Active, narrow};
use crate::Vector;

/// Times that pairs are looked for while ways are halved, before nodes go together.
const HALVINGS: usize = 3;
/// Times that they are while nodes do, before they are held.
const JOININGS: usize = 6;
/// Rounds over known pairs, before others are looked for.
const ROUNDS: usize = 8;
/// Share of its distance that a pair keeps in a pass.
const KEPT: f64 = 0.1;
/// Pairs nearer than this come no nearer: stored positions are not finer. (mm)
const NEAREST: f64 = 5e-5;

/// How nodes of unsafe pairs are held back.
#[derive(Debug, Clone, Copy)]
enum Stage {
    /// From half of what they go against each other.
    SlowDown,
    /// To a way that all of their zone go.
    Join,
    /// To no way at all.
    Hold,
}

impl Stage {
    /// The stage after pairs were looked for `count` times.
    fn after(count: usize) -> Self {
        if count < HALVINGS {
            Self::SlowDown
        } else if count < HALVINGS + JOININGS {
            Self::Join
        } else {
            Self::Hold
        }
    }
}

/// What a round over the known pairs came to.
#[derive(Debug, Default)]
struct Round {
    unsafe_count: usize,
    /// Whether any node is wanted elsewhere than before.
    is_changed: bool,
}

impl Contact {
    /// One pass: from `positions` to `wanted`, or as far as that is safe.
    ///
    /// - `force_per_shift`: what a shift of a node of 1 g by 1 mm takes (N)
    pub(super) fn pass(&mut self, force_per_shift: f64, passes: usize) {
        if std::mem::take(&mut self.has_carried) {
            self.carried_by.fill(u32::MAX);
        }
        if std::mem::take(&mut self.is_any_pushed) {
            self.is_pushed.fill(false);
            self.watch.is_pushed.fill(false);
        }
        self.moment += 1;
        // What the last pass collected is of another way.
        self.collection += 1;
        self.followed = self.altered.len();
        self.refresh_pairs();
        self.collect_smooth();
        let bonds = std::mem::take(&mut self.bonds);
        for &node in bonds.iter().flat_map(|bond| &bond.nodes) {
            self.push_node(node);
        }
        self.bonds = bonds;
        self.collect();
        if !self.actives.is_empty() || !self.smooth.is_empty() || !self.bonds.is_empty() {
            let went_far = self.project_within(force_per_shift);
            self.make_safe(went_far);
            self.note_contacts(force_per_shift / passes as f64);
        }
        std::mem::swap(&mut self.positions, &mut self.wanted);
        // Colliders' nodes are wanted where they are until they are placed anew.
        let count = self.cloth_count;
        let (positions, wanted) = (&self.positions, &mut self.wanted);
        wanted[count..].copy_from_slice(&positions[count..]);
        self.arrive();
    }

    /// Projects, and returns whether nodes went further than collecting allowed for.
    fn project_within(&mut self, force_per_shift: f64) -> bool {
        let (moment, last) = (self.moment, &mut self.touched);
        let touched: Vec<(u32, Vector)> = (self.actives.iter())
            .flat_map(|a| a.nodes)
            .chain(self.smooth.iter().map(|s| s.node))
            .chain(self.bonds.iter().flat_map(|b| b.nodes))
            .filter(|&n| (n as usize) < self.cloth_count)
            // A node is of many pairs.
            .filter(|&n| std::mem::replace(&mut last[n as usize], moment) != moment)
            .map(|n| (n, wide(&self.wanted[n as usize])))
            .collect();
        self.project(force_per_shift);
        let mut went_far = false;
        for (node, before) in touched {
            let way = (wide(&self.wanted[node as usize]) - before).norm();
            if way > 0.0 {
                self.altered.push(node);
                let is_new = self.push_node(node);
                went_far |= is_new || way > MARGIN;
            }
        }
        went_far
    }

    /// Holds back and carries until no pair is unsafe.
    ///
    /// The pairs that are known are made safe, then those that may meet now are looked for:
    /// looking costs much more than holding back, and finds little.
    fn make_safe(&mut self, mut went_far: bool) {
        let mut has_zones = false;
        for stage in (0..).map(Stage::after) {
            if went_far {
                // What was pushed may now meet what was not looked at.
                let pushes: Vec<Active> = self
                    .actives
                    .iter()
                    .filter(|a| a.push > 0.0)
                    .copied()
                    .collect();
                self.follow();
                self.collect_pushed();
                self.remember(pushes);
            }
            went_far = false;
            let mut unsafe_count = 0;
            for _ in 0..ROUNDS {
                let round = self.hold_back(stage, &mut has_zones);
                unsafe_count = round.unsafe_count;
                went_far |= round.is_changed;
                if !round.is_changed {
                    break;
                }
            }
            if !went_far {
                // All their nodes are held or carried: caught between colliders.
                self.report.pinched += unsafe_count;
                return;
            }
        }
    }

    /// Holds back or carries the nodes of every known pair that is unsafe.
    fn hold_back(&mut self, stage: Stage, has_zones: &mut bool) -> Round {
        let mut round = Round::default();
        let mut is_joined = false;
        let actives = std::mem::take(&mut self.actives);
        for a in &actives {
            if self.is_safe(a) {
                continue;
            }
            round.unsafe_count += 1;
            if let Some(c) = self.carrier(a) {
                if self.carry(a, c) {
                    round.is_changed = true;
                    continue;
                }
                if self.lists[a.list as usize].collider.is_some() {
                    continue;
                }
            }
            self.report.held += 1;
            if !std::mem::replace(has_zones, true) {
                self.zones.begin(&self.wanted[..self.cloth_count]);
            }
            // What went the same way as they did may now run into them.
            round.is_changed |= match stage {
                // A way of one rounding has no half.
                Stage::SlowDown => self.slow_down(a) || self.hold(a),
                // A pair without a collider has nodes of cloth alone.
                Stage::Join if self.zones.join(&a.nodes) => {
                    is_joined = true;
                    true
                }
                // Nothing more to join.
                Stage::Join | Stage::Hold => self.hold(a),
            };
        }
        self.actives = actives;
        if is_joined {
            self.go_together();
        }
        round.is_changed |= self.carry_out_of_round();
        round
    }

    /// Takes half off what the nodes of a pair go against each other, and leaves what they go
    /// together. Returns whether that is any less than before.
    fn slow_down(&mut self, a: &Active) -> bool {
        let at = places(&a.nodes, &self.positions);
        let to = places(&a.nodes, &self.wanted);
        let mut mean = Vector::zeros();
        for k in 0..4 {
            mean += (to[k] - at[k]) * (0.5 * a.weights[k].abs());
        }
        let mut any = false;
        for k in 0..4 {
            if self.can_yield(a.nodes[k]) {
                let half = at[k] + (to[k] - at[k] + mean) * 0.5;
                any |= self.send(a.nodes[k], narrow(&half));
            }
        }
        any
    }

    /// Holds the nodes of a pair where they are. Returns whether any was to go.
    fn hold(&mut self, a: &Active) -> bool {
        let mut any = false;
        for node in a.nodes {
            if self.can_yield(node) {
                any |= self.send(node, self.positions[node as usize]);
            }
        }
        any
    }

    /// Whether a node is of the cloth and no collider carries it.
    fn can_yield(&self, node: u32) -> bool {
        (node as usize) < self.cloth_count && self.carried_by[node as usize] == u32::MAX
    }

    /// Wants a node elsewhere. Returns whether that is new.
    fn send(&mut self, node: u32, to: Point3<f32>) -> bool {
        let i = node as usize;
        if self.wanted[i] == to {
            return false;
        }
        self.wanted[i] = to;
        self.altered.push(node);
        self.push_node(node);
        true
    }

    /// Lets the nodes of each zone go the same way.
    fn go_together(&mut self) {
        let mut ways: Vec<(u32, Vector3<f32>)> = Vec::new();
        for (nodes, way) in self.zones.ways(&self.positions) {
            ways.extend(nodes.iter().map(|&node| (node, way)));
        }
        for (node, way) in ways {
            let i = node as usize;
            if self.can_yield(node) {
                self.send(node, self.positions[i] + way);
            }
        }
    }

    /// Keeps what pushed before candidates were collected anew, for the report.
    fn remember(&mut self, mut pushes: Vec<Active>) {
        let key = |a: &Active| (a.kind, a.nodes);
        pushes.sort_by_key(key);
        pushes.dedup_by_key(|a| key(a));
        // Hardly any active has four nodes that all were pushed.
        let mut is_pushed = vec![false; self.positions.len()];
        for node in pushes.iter().flat_map(|p| p.nodes) {
            is_pushed[node as usize] = true;
        }
        let mut is_missing = vec![true; pushes.len()];
        for a in &mut self.actives {
            if !a.nodes.iter().all(|&n| is_pushed[n as usize]) {
                continue;
            }
            if let Ok(k) = pushes.binary_search_by_key(&key(a), key) {
                a.push = pushes[k].push;
                is_missing[k] = false;
            }
        }
        let missing = pushes.iter().zip(is_missing).filter(|(_, m)| *m);
        self.actives.extend(missing.map(|(push, _)| *push));
    }

    /// The collider of a pair, or the one that carries one of its nodes.
    fn carrier(&self, a: &Active) -> Option<usize> {
        if let Some(c) = self.lists[a.list as usize].collider {
            return Some(c);
        }
        a.nodes
            .iter()
            .map(|&n| self.carried_by[n as usize])
            .filter(|&c| c != u32::MAX)
            .min()
            .map(|c| c as usize)
    }

    /// Carries the nodes of a pair along with a collider. Returns whether any was not yet.
    fn carry(&mut self, a: &Active, collider: usize) -> bool {
        let mut any = false;
        for n in a.nodes {
            if (n as usize) < self.cloth_count && self.carried_by[n as usize] == u32::MAX {
                self.carry_node(n as usize, collider);
                any = true;
            }
        }
        any
    }

    fn carry_node(&mut self, node: usize, collider: usize) {
        let c = &self.world[collider];
        let local = c.pose_before.inverse() * crate::Point::from(wide(&self.positions[node]));
        self.wanted[node] = narrow(&(c.pose * local).coords);
        self.carried_by[node] = collider as u32;
        self.has_carried = true;
        self.altered.push(node as u32);
        self.push_node(node as u32);
        self.report.carried += 1;
    }

    /// Carries nodes that would end inside a round collider.
    fn carry_out_of_round(&mut self) -> bool {
        let mut any = false;
        let smooth = std::mem::take(&mut self.smooth);
        for s in &smooth {
            let i = s.node as usize;
            let c = &self.world[s.collider as usize];
            if self.carried_by[i] != u32::MAX || !c.gaps.is_empty() {
                continue;
            }
            let place = |pose: &nalgebra::Isometry3<f64>, x| {
                let local = pose.inverse() * crate::Point::from(x);
                c.shape.nearest(&local.coords).distance
            };
            let now = place(&c.pose, wide(&self.wanted[i]));
            if now < 0.0 && now < place(&c.pose_before, wide(&self.positions[i])) {
                self.carry_node(i, s.collider as usize);
                any = true;
            }
        }
        self.smooth = smooth;
        any
    }

    fn is_safe(&self, a: &Active) -> bool {
        let at = places(&a.nodes, &self.positions);
        let to = places(&a.nodes, &self.wanted);
        let way = to[0] - at[0];
        if (1..4).all(|k| to[k] - at[k] == way) {
            return true;
        }
        stays_beside(a, &to) || stays_apart(a.kind, &at, &to, a.distance)
    }
}

/// Whether the plane between two elements still parts them at the end: then it does all along
/// the straight ways there.
fn stays_beside(a: &Active, to: &[Vector; 4]) -> bool {
    let height = to.map(|x| a.normal.dot(&(x - to[0])));
    let (first, second) = height.split_at(a.kind.first_count());
    let lowest = first.iter().fold(f64::INFINITY, |m, &h| m.min(h));
    let highest = second.iter().fold(f64::NEG_INFINITY, |m, &h| m.max(h));
    lowest - highest >= (KEPT * a.distance).max(NEAREST.min(a.distance))
}

/// Whether a pair `distance` apart keeps a share of that on the way from `at` to `to`.
fn stays_apart(kind: PairKind, at: &[Vector; 4], to: &[Vector; 4], distance: f64) -> bool {
    let nearer = approach(kind, at, to);
    let floor = (KEPT * distance).max(NEAREST.min(distance));
    if nearer <= distance - floor {
        return true;
    }
    let mut t = 0.0;
    let mut d = distance;
    for _ in 0..64 {
        let step = 0.9 * (d - floor) / nearer;
        // Steps that shrink to nothing mean that the floor is reached.
        if step < 1e-4 {
            return false;
        }
        t += step;
        if t >= 1.0 {
            return true;
        }
        let now: [Vector; 4] = std::array::from_fn(|k| at[k] + (to[k] - at[k]) * t);
        d = weighted(&closest_weights(kind, &now), &now).norm();
        if d <= floor {
            return false;
        }
    }
    false
}
