//! Contacts pushed apart, with friction.
//!
//! A contact is a plane between two elements, taken where they stood before the pass:
//! `C = n . sum w_i x_i - d >= 0`, with n from the second element to the first. So it knows on
//! which side each element belongs however far a node is flung. A contact nearer than its
//! distance d is let out at a bounded rate: what starts too near comes apart without a kick.
//!
//! Friction is positional: the tangential way of the contact in this pass is taken back, by at
//! most the friction coefficient times the push.
//!
//! Source: Müller et al. 2007, *Position Based Dynamics*, 3.3-3.4, for the form; Coulomb's law
//! per pass.

use super::ContactPoint;
use super::contact::Contact;
use super::detect::MARGIN;
use super::distance::{PairKind, places, wide};
use crate::Vector;

/// Sweeps over all contacts in a pass.
const SWEEPS: usize = 6;
/// Contacts apart to this need no further sweep. (mm)
const ENOUGH: f64 = 2e-3;
/// How fast contacts that are too near are let out, per pass. (mm)
const RELEASE: f64 = 0.05;

/// Distances to smooth bodies are exact to first order: so much of them is believed.
const ROOM_SHARE: f64 = 0.8;

/// A pair that may meet in this pass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Active {
    pub(crate) nodes: [u32; 4],
    pub(crate) kind: PairKind,
    /// `sum w_i x_i` is the vector between the closest points before the pass.
    pub(crate) weights: [f64; 4],
    pub(crate) normal: Vector,
    /// Distance before the pass. (mm)
    pub(crate) distance: f64,
    /// Distance to keep. (mm)
    pub(crate) thickness: f64,
    /// Index of its list.
    pub(crate) list: u32,
    /// How far it was pushed apart in this pass. (mm)
    pub(crate) push: f64,
}

/// A node at a round collider.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SmoothContact {
    pub(crate) node: u32,
    pub(crate) collider: u32,
    pub(crate) normal: Vector,
    /// `n . x` where the node keeps its distance. (mm)
    pub(crate) offset: f64,
    /// How far the collider goes at the node. (mm)
    pub(crate) carried: Vector,
    pub(crate) push: f64,
}

impl Contact {
    /// Inverse mass of a node: 1 for the cloth, 0 for what moves as it is told.
    #[inline]
    pub(super) fn mobility(&self, node: u32) -> f64 {
        if (node as usize) < self.cloth_count {
            1.0
        } else {
            0.0
        }
    }

    /// Finds the nodes that round colliders touch on the way to `wanted`.
    pub(super) fn collect_smooth(&mut self) {
        let mut smooth = std::mem::take(&mut self.smooth);
        smooth.clear();
        for index in 0..self.world.len() {
            let c = &mut self.world[index];
            if !c.shape.is_round || c.is_away {
                continue;
            }
            let mut free = std::mem::take(&mut c.free);
            let c = &self.world[index];
            for (free, &(tile, first_gap)) in free.iter_mut().zip(&c.watched) {
                let gone = c.gone + f64::from(self.watch.ways[tile as usize].longest());
                if gone >= *free {
                    let room = self.touch_tile(index, tile, first_gap, &mut smooth);
                    // What it may go from here, less what it may have gone to here.
                    *free = ROOM_SHARE * room + 2.0 * c.gone - gone;
                }
            }
            self.world[index].free = free;
        }
        for s in &smooth {
            self.push_node(s.node);
        }
        self.smooth = smooth;
    }

    /// Finds the nodes of a tile that a round collider touches. Returns how far the others are
    /// at least from being found. (mm)
    fn touch_tile(
        &self,
        index: usize,
        tile: u32,
        first_gap: i64,
        out: &mut Vec<SmoothContact>,
    ) -> f64 {
        let c = &self.world[index];
        let inverse = c.pose.inverse();
        let center = c.pose.translation.vector;
        let mut room = f64::INFINITY;
        for &node in &self.tiles.tiles[tile as usize].own {
            let i = node as usize;
            let gap = if c.gaps.is_empty() {
                f64::from(self.cover[i])
            } else {
                f64::from(c.gaps[(first_gap + i64::from(node)) as usize])
            };
            let x = wide(&self.wanted[i]);
            let reach = c.shape.radius + gap.max(0.0) + MARGIN;
            let squared = (x - center).norm_squared();
            if squared > reach * reach {
                room = room.min(squared.sqrt() - reach);
                continue;
            }
            let place = c.shape.nearest(&(inverse * crate::Point::from(x)).coords);
            if place.distance > gap + MARGIN {
                room = room.min(place.distance - gap - MARGIN);
                continue;
            }
            room = 0.0;
            let Some(local) = place.normal else {
                continue;
            };
            let normal = c.pose.rotation * local;
            // A node that is deeper than its way in this pass allows started there: it is let
            // out slowly.
            let before = c.pose_before.inverse() * crate::Point::from(wide(&self.positions[i]));
            let was = c.shape.nearest(&before.coords).distance;
            let keep = gap.min(was.max(place.distance) + RELEASE);
            let target = (c.pose * before).coords;
            out.push(SmoothContact {
                node,
                collider: index as u32,
                normal,
                offset: normal.dot(&x) - place.distance + keep,
                carried: target - wide(&self.positions[i]),
                push: 0.0,
            });
        }
        room
    }

    /// Moves `wanted` until contacts are apart, then takes friction off.
    pub(super) fn project(&mut self, force_per_shift: f64) {
        let mut actives = std::mem::take(&mut self.actives);
        let mut smooth = std::mem::take(&mut self.smooth);
        for _ in 0..SWEEPS {
            let mut worst = 0.0_f64;
            for a in &mut actives {
                worst = worst.max(self.push_apart(a));
            }
            for s in &mut smooth {
                let i = s.node as usize;
                let x = wide(&self.wanted[i]);
                let lack = s.offset - s.normal.dot(&x);
                if lack > 0.0 {
                    self.wanted[i] = narrow(&(x + s.normal * lack));
                    s.push += lack;
                    worst = worst.max(lack);
                }
            }
            self.pull_bonds(force_per_shift);
            if worst < ENOUGH {
                break;
            }
        }
        for a in &actives {
            if a.push > 0.0 {
                self.rub(a);
            }
        }
        for s in &smooth {
            if s.push > 0.0 {
                let friction = self.world[s.collider as usize].friction;
                let i = s.node as usize;
                let x = wide(&self.wanted[i]);
                let slip = x - wide(&self.positions[i]) - s.carried;
                let slip = slip - s.normal * s.normal.dot(&slip);
                let length = slip.norm();
                if length > 1e-12 {
                    let take = (friction * s.push / length).min(1.0);
                    self.wanted[i] = narrow(&(x - slip * take));
                }
            }
        }
        self.actives = actives;
        self.smooth = smooth;
    }

    /// Returns by how much it was too near. (mm)
    fn push_apart(&mut self, a: &mut Active) -> f64 {
        let x = places(&a.nodes, &self.wanted);
        let mut now = 0.0;
        for k in 0..4 {
            now += a.weights[k] * a.normal.dot(&(x[k] - x[0]));
        }
        let keep = a.thickness.min(a.distance + RELEASE);
        let lack = keep - now;
        if lack <= 0.0 {
            return 0.0;
        }
        let mut sum = 0.0;
        for k in 0..4 {
            sum += a.weights[k] * a.weights[k] * self.mobility(a.nodes[k]);
        }
        if sum < 1e-9 {
            return 0.0;
        }
        let scale = lack / sum;
        for k in 0..4 {
            let by = scale * a.weights[k] * self.mobility(a.nodes[k]);
            if by != 0.0 {
                self.wanted[a.nodes[k] as usize] = narrow(&(x[k] + a.normal * by));
            }
        }
        a.push += lack;
        lack
    }

    fn rub(&mut self, a: &Active) {
        let friction = self.lists[a.list as usize].friction;
        let x = places(&a.nodes, &self.wanted);
        let mut slip = Vector::zeros();
        let mut sum = 0.0;
        for k in 0..4 {
            slip += (x[k] - wide(&self.positions[a.nodes[k] as usize])) * a.weights[k];
            sum += a.weights[k] * a.weights[k] * self.mobility(a.nodes[k]);
        }
        let slip = slip - a.normal * a.normal.dot(&slip);
        let length = slip.norm();
        if length < 1e-12 || sum < 1e-9 {
            return;
        }
        let take = (friction * a.push / length).min(1.0) / sum;
        for k in 0..4 {
            let by = take * a.weights[k] * self.mobility(a.nodes[k]);
            if by != 0.0 {
                self.wanted[a.nodes[k] as usize] = narrow(&(x[k] - slip * by));
            }
        }
    }

    /// Notes what pushed what, for the report.
    ///
    /// - `force_per_shift`: what a shift of a node of 1 g by 1 mm takes (N)
    pub(super) fn note_contacts(&mut self, force_per_shift: f64) {
        self.points.clear();
        for a in &self.actives {
            if a.push <= 0.0 {
                continue;
            }
            let mut sum = 0.0;
            let mut mass = 0.0;
            let mut at = Vector::zeros();
            for k in 0..4 {
                let n = a.nodes[k] as usize;
                at += wide(&self.positions[n]) * (0.5 * a.weights[k].abs());
                sum += a.weights[k] * a.weights[k] * self.mobility(a.nodes[k]);
                if n < self.cloth_count {
                    mass = self.node_mass[n];
                    let strong = a.push / sum.max(1e-9) * a.weights[k].abs() > 0.02;
                    self.is_touched[n] = true;
                    if strong && !self.was_touched[n] {
                        self.stopped[self.part_of[n] as usize] = true;
                    }
                }
            }
            let force = a.push / sum.max(1e-9) * mass * force_per_shift;
            let collider = self.lists[a.list as usize].collider;
            // From the collider to the face, whichever of the two has the vertex.
            let is_turned = collider.is_some() && a.nodes[0] as usize >= self.cloth_count;
            let normal = if is_turned { -a.normal } else { a.normal };
            self.points.push(ContactPoint {
                position: narrow(&at),
                normal,
                force,
                collider: collider.and_then(|c| c.checked_sub(self.body_count)),
            });
            if let Some(c) = collider.and_then(|c| c.checked_sub(self.body_count)) {
                self.report.forces[c] -= normal * force;
            }
        }
        for s in &self.smooth {
            if s.push <= 0.0 {
                continue;
            }
            let n = s.node as usize;
            self.is_touched[n] = true;
            if s.push > 0.02 && !self.was_touched[n] {
                self.stopped[self.part_of[n] as usize] = true;
            }
            let force = s.push * self.node_mass[n] * force_per_shift;
            let collider = (s.collider as usize).checked_sub(self.body_count);
            self.points.push(ContactPoint {
                position: self.positions[n],
                normal: s.normal,
                force,
                collider,
            });
            if let Some(c) = collider {
                self.report.forces[c] -= s.normal * force;
            }
        }
    }
}

/// Stored precision of a position.
#[inline]
pub(super) fn narrow(v: &Vector) -> nalgebra::Point3<f32> {
    nalgebra::Point3::new(v.x as f32, v.y as f32, v.z as f32)
}
