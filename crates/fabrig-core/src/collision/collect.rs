//! Contacts to be: elements that may come nearer than they should on the way to where they are
//! wanted.

use nalgebra::Vector3;

use super::certificate::{Candidate, TilePair, flat_way, slab};
use super::contact::Contact;
use super::detect::{GUARD_THICKNESS, MARGIN, PairList};
use super::distance::{PairKind, closest_weights, weighted, wide};
use super::judge::Side;
use super::plane::{approach, are_apart, direction, is_beyond, parted};
use super::project::Active;
use super::tile::{Extent, Way, least, most};
use crate::Vector;

/// A slab this much wider than the thickness needs no wider one. (mm)
const WIDE_ENOUGH: f32 = 1.0;
/// Share of the distance at rest that is kept, where that is less than the thickness.
const REST_SHARE: f64 = 0.5;
/// Candidates of a list looked at in one pass, and how far the tiles have gone since it was
/// made (mm), after which it is made anew.
const MOST_LOOKED_AT: usize = 96;
const FAR_GONE: f32 = 0.15;
/// Cells of two tiles of a grid.
const MOST_NORMALS: usize = 32;
/// What making a list takes, in findings of a certificate.
const LIST_COST: usize = 25;

impl Contact {
    /// Finds elements that may come nearer than their thickness on the way to `wanted`.
    ///
    /// First without allowance, to see which tiles are in contact at all; then, for these, with
    /// what pushing them apart may add.
    pub(super) fn collect(&mut self) {
        self.actives.clear();
        let mut lists = std::mem::take(&mut self.lists);
        for list in &mut lists {
            if list.pairs.is_empty() {
                continue;
            }
            let [a, b] = [list.a, list.b].map(|p| &self.watch.steps[p]);
            list.gone += f64::from(a.against(b).longest());
            let gone = list.gone;
            if list.collider.is_none() && list.first_due > gone {
                continue;
            }
            let mut pairs = std::mem::take(&mut list.pairs);
            let mut due = std::mem::take(&mut list.due);
            let mut first = f64::INFINITY;
            for (pair, due) in pairs.iter_mut().zip(&mut due) {
                if *due > gone && list.collider.is_none() {
                    first = first.min(*due);
                    continue;
                }
                let clearance = pair.clearance(&self.watch.way_of(pair));
                *due = gone + f64::from(clearance);
                first = first.min(*due);
                if clearance <= 0.0 && !pair.tiles.iter().all(|&t| self.is_pushed[t as usize]) {
                    self.find_touching(list, pair);
                }
            }
            list.pairs = pairs;
            (list.due, list.first_due) = (due, first);
        }
        self.lists = lists;
        self.collect_pushed();
    }

    /// Finds the same for tiles that are pushed, with allowance.
    pub(super) fn collect_pushed(&mut self) {
        self.actives.clear();
        if !self.is_any_pushed {
            return;
        }
        let more = 2.0 * MARGIN;
        let mut lists = std::mem::take(&mut self.lists);
        let mut actives = std::mem::take(&mut self.actives);
        for (index, list) in lists.iter_mut().enumerate() {
            let watch = &self.watch;
            if !watch.is_pushed[list.a] && !watch.is_pushed[list.b] {
                continue;
            }
            let mut pairs = std::mem::take(&mut list.pairs);
            for pair in &mut pairs {
                if !pair.tiles.iter().any(|&t| self.is_pushed[t as usize])
                    || pair.clearance(&self.watch.way_of(pair)) > more as f32
                    || !self.has_list(list, pair, more as f32)
                {
                    continue;
                }
                let (since, known) = self.since_and_known(pair);
                for c in &mut pair.candidates {
                    if c.gap - since > more as f32 {
                        continue;
                    }
                    let Some((weights, r)) = self.may_close(c, more, known) else {
                        continue;
                    };
                    let distance = r.norm();
                    actives.push(Active {
                        nodes: c.nodes,
                        kind: c.kind,
                        weights,
                        normal: r / distance.max(1e-12),
                        distance,
                        thickness: f64::from(c.thickness),
                        list: index as u32,
                        push: 0.0,
                    });
                }
            }
            list.pairs = pairs;
        }
        self.actives = actives;
        self.lists = lists;
    }

    /// Marks the tiles of a node. Returns whether one was not yet.
    pub(super) fn push_node(&mut self, node: u32) -> bool {
        self.is_any_pushed = true;
        self.watch.is_pushed[self.part_of[node as usize] as usize] = true;
        let mut any = false;
        for &t in self.tiles.of_node(node) {
            any |= !std::mem::replace(&mut self.is_pushed[t as usize], true);
        }
        any
    }

    /// Marks the tiles of elements that may come nearer than their thickness, of a pair that has
    /// no certificate.
    fn find_touching(&mut self, list: &PairList, pair: &mut TilePair) {
        if !self.has_list(list, pair, 0.0) {
            return;
        }
        let (since, known) = self.since_and_known(pair);
        let mut looked_at = 0;
        let mut candidates = std::mem::take(&mut pair.candidates);
        let mut nearest = f32::INFINITY;
        for c in &mut candidates {
            if c.gap <= since {
                looked_at += 1;
                if self.may_close(c, 0.0, known).is_some() {
                    for node in c.nodes {
                        self.push_node(node);
                    }
                }
            }
            nearest = least(nearest, c.gap);
        }
        pair.candidates = candidates;
        pair.know_nearest(nearest);
        if looked_at > MOST_LOOKED_AT && since > FAR_GONE {
            // From where the tiles are now, fewer may close.
            self.list_candidates(list, pair);
        }
    }

    /// Whether elements of a pair have to be looked at one by one, with allowance for `more`
    /// (mm); its list then holds all that count.
    fn has_list(&mut self, list: &PairList, pair: &mut TilePair, more: f32) -> bool {
        if pair.reach - self.since_list(pair) > more {
            return true;
        }
        if std::mem::replace(&mut pair.round, self.watch.round) == self.watch.round {
            self.watch.repeated += 1;
        }
        let own = list.a == list.b;
        let tiles = pair.tiles.map(|t| &self.tiles.tiles[t as usize]);
        let mut normals = [Vector3::zeros(); MOST_NORMALS];
        let mut count = 0;
        let [a, b] = [(tiles[0], list.a), (tiles[1], list.b)].map(|(tile, part)| {
            let part = &self.parts[part];
            tile.normal(part, &self.positions, |n| {
                if let Some(slot) = normals.get_mut(count) {
                    *slot = *n;
                }
                count += 1;
            })
        });
        if own
            && self
                .tiles
                .are_adjacent(&self.parts[list.a], pair.tiles[0], pair.tiles[1])
        {
            // What they go in this pass counts from where they are, too.
            let way = normals.get(..count).map_or(0.0, flat_way);
            if way > 0.0 && self.way_of_pass(pair) + more < way {
                pair.keep_length(way, &self.watch.way_until_now(pair));
                return false;
            }
        } else {
            let thickness = self.thickest(list) as f32;
            let states = [self.positions.as_slice(), &self.wanted];
            let (n, gap) = slab(tiles, states, [a, b], thickness + WIDE_ENOUGH);
            if gap - thickness > more {
                pair.keep_slab(n, gap - thickness, &self.watch.way_until_now(pair));
                return false;
            }
        }
        self.list_candidates(list, pair);
        true
    }

    /// How far elements of a pair may have gone against each other since its list was made.
    /// (mm)
    fn since_list(&self, pair: &TilePair) -> f32 {
        pair.since_list(&self.watch.way_of(pair), self.watch.stamp)
    }

    /// How far the tiles of a pair go against each other in this pass, at most. (mm)
    fn way_of_pass(&self, pair: &TilePair) -> f32 {
        let [a, b] = pair.tiles.map(|t| {
            let tile = &self.tiles.tiles[t as usize];
            Way::of(&tile.ways(&self.positions, &self.wanted))
        });
        a.against(&b).longest()
    }

    /// Lists the elements of a pair that are near each other where they are now.
    fn list_candidates(&mut self, list: &PairList, pair: &mut TilePair) {
        if pair.reach >= 0.0 {
            self.watch.repeated += LIST_COST;
        }
        let mut candidates = std::mem::take(&mut pair.candidates);
        candidates.clear();
        let own = list.a == list.b;
        let [part_a, part_b] = [list.a, list.b].map(|p| &self.parts[p]);
        let [a, b] = pair.tiles.map(|t| &self.tiles.tiles[t as usize]);
        let is_cloth = list.collider.is_none();
        let is_round = list.collider.is_some_and(|c| self.world[c].shape.is_round);
        let pass = self.way_of_pass(pair);
        let reach = f64::from(pair.wish).max(f64::from(pass) + 3.0 * MARGIN);
        let pass = (self.watch.stamp, pass);
        let longest = self.thickest(list) + reach;
        let at = |n: u32| {
            let p = &self.positions[n as usize];
            [p.x, p.y, p.z]
        };
        let around = |nodes: &[u32]| {
            let mut out = Extent::EMPTY;
            nodes.iter().for_each(|&n| out.take(&at(n)));
            out
        };
        let mut offer = |kind: PairKind, nodes: [u32; 4], normals: [&Vector3<f32>; 2]| {
            let (first, second) = nodes.split_at(kind.first_count());
            if is_beyond(kind, &nodes, normals, longest as f32, &self.positions) {
                return;
            }
            if own && self.rules.side(part_a, first, second) != Side::Apart {
                return;
            }
            let x = nodes.map(|n| wide(&self.positions[n as usize]));
            let r = weighted(&closest_weights(kind, &x), &x);
            let distance = r.norm();
            let most = if is_cloth {
                self.options.thickness
            } else if is_round {
                GUARD_THICKNESS
            } else {
                self.covered(&nodes)
            };
            if distance > most + reach {
                return;
            }
            let normal = direction(&r, distance);
            let thickness = if is_cloth {
                self.at_most_rest(kind, &nodes, &normal)
            } else {
                most
            };
            candidates.push(Candidate {
                nodes,
                kind,
                gap: (distance - thickness) as f32,
                thickness: thickness as f32,
                normal,
            });
        };
        let boxes_of = |part: &super::mesh::Part, cells: &[u32]| -> Vec<Extent> {
            let cells = cells.iter();
            cells
                .map(|&c| around(&part.cells[c as usize].hull))
                .collect()
        };
        let (boxes_a, boxes_b) = (boxes_of(part_a, &a.cells), boxes_of(part_b, &b.cells));
        let [normals_a, normals_b] = [(a, part_a), (b, part_b)].map(|(tile, part)| {
            let mut normals = Vec::with_capacity(tile.cells.len());
            let unit = |n: &Vector3<f32>| n.try_normalize(0.0).unwrap_or_default();
            tile.normal(part, &self.positions, |n| normals.push(unit(n)));
            normals
        });
        for (i, (&ca, box_a)) in a.cells.iter().zip(&boxes_a).enumerate() {
            for (j, (&cb, box_b)) in b.cells.iter().zip(&boxes_b).enumerate() {
                // Of a tile with itself every two cells once.
                if (own && (part_a.are_next_cells(ca, cb) || a.hull == b.hull && cb < ca))
                    || !box_a.is_near(box_b, longest as f32)
                {
                    continue;
                }
                let (ca, cb) = (&part_a.cells[ca as usize], &part_b.cells[cb as usize]);
                let hulls = [ca.hull.as_slice(), &cb.hull];
                let normals = [&normals_a[i], &normals_b[j]];
                if are_apart(hulls, normals, longest as f32, &self.positions) {
                    continue;
                }
                for &v in &ca.nodes {
                    for &[x, y, z] in &cb.triangles {
                        offer(PairKind::VertexTriangle, [v, x, y, z], normals);
                    }
                }
                for &v in &cb.nodes {
                    for &[x, y, z] in &ca.triangles {
                        offer(PairKind::VertexTriangle, [v, x, y, z], normals);
                    }
                }
                for &[p, q] in &ca.edges {
                    for &[r, s] in &cb.edges {
                        offer(PairKind::EdgeEdge, [p, q, r, s], normals);
                    }
                }
            }
        }
        pair.candidates = candidates;
        pair.keep_list(reach as f32, &self.watch.way_until_now(pair), pass);
    }

    /// What covers the cloth's nodes of a pair with a collider, at least. (mm)
    fn covered(&self, nodes: &[u32; 4]) -> f64 {
        nodes
            .iter()
            .filter(|&&n| (n as usize) < self.cloth_count)
            .map(|&n| f64::from(self.cover[n as usize]))
            .fold(f64::INFINITY, f64::min)
    }

    /// The thickness, or half the distance at rest where that is less. (mm)
    ///
    /// - `normal`: unit direction between them now, which mostly shows that they are far enough
    ///   apart at rest, too
    fn at_most_rest(&self, kind: PairKind, nodes: &[u32; 4], normal: &[f32; 3]) -> f64 {
        let [parted, _] = parted(kind, nodes, normal, [&self.rest, &self.rest]);
        if REST_SHARE * f64::from(parted) > self.options.thickness {
            return self.options.thickness;
        }
        let at = nodes.map(|n| wide(&self.rest[n as usize]));
        let rest = weighted(&closest_weights(kind, &at), &at).norm();
        self.options.thickness.min(REST_SHARE * rest)
    }

    /// Weights and vector between the closest points of a candidate, if it may come within
    /// `more` of its thickness on the way.
    ///
    /// - `known`: what a distance that is known now adds to the candidate's gap (mm)
    #[inline]
    fn may_close(&self, c: &mut Candidate, more: f64, known: f32) -> Option<([f64; 4], Vector)> {
        let limit = f64::from(c.thickness) + more;
        // First by the plane that parted them before: it costs little, and sliding along it
        // costs nothing.
        let states = [self.positions.as_slice(), &self.wanted];
        let [now, ever] = parted(c.kind, &c.nodes, &c.normal, states);
        c.gap = most(c.gap, now - c.thickness + known);
        if f64::from(ever) > limit {
            return None;
        }
        let at = c.nodes.map(|n| wide(&self.positions[n as usize]));
        let weights = closest_weights(c.kind, &at);
        let r = weighted(&weights, &at);
        let distance = r.norm();
        c.gap = most(c.gap, distance as f32 - c.thickness + known);
        c.normal = direction(&r, distance);
        let to = c.nodes.map(|n| wide(&self.wanted[n as usize]));
        (distance - approach(c.kind, &at, &to) <= limit).then_some((weights, r))
    }

    /// [`Self::since_list`], and what a distance that is known now is more than one that was
    /// known when the list was made. (mm)
    fn since_and_known(&self, pair: &TilePair) -> (f32, f32) {
        let known = pair.known(&self.watch.way_until_now(pair));
        (self.since_list(pair), known)
    }
}
