//! Contacts to be: elements that may come nearer than they should on the way to where they are
//! wanted.

use super::certificate::{Candidate, NearElements, ROUNDING, TilePair, slab};
use super::contact::Contact;
use super::detect::{GUARD_THICKNESS, MARGIN, PairList};
use super::distance::{PairKind, closest_weights, places, weighted};
use super::judge::Side;
use super::parting::Partings;
use super::plane::{approach, are_apart};
use super::project::Active;
use super::tile::{Extent, Way, most};
use super::tile_shape::flat_way;
use crate::Vector;
use crate::machine::vectorized;

/// A slab this much wider than the thickness needs no wider one. (mm)
const WIDE_ENOUGH: f32 = 1.0;
/// Share of the distance at rest that is kept, where that is less than the thickness.
const REST_SHARE: f64 = 0.5;
/// Candidates of a list looked at in one pass, and how far the tiles have gone since it was
/// made (mm), after which it is made anew.
const MOST_LOOKED_AT: usize = 200;
const FAR_GONE: f32 = 0.15;
/// What making a list takes, in findings of a certificate.
const LIST_COST: usize = 25;
/// In the order that lists have them.
const KINDS: [PairKind; 2] = [PairKind::VertexTriangle, PairKind::EdgeEdge];

/// Room to look at pairs of elements in, many at a time.
#[derive(Debug, Default)]
pub(super) struct Workbench {
    /// Places of candidates in their list.
    picked: Vec<u32>,
    /// Nodes of pairs of one kind, and of the other.
    nodes: [Vec<[u32; 4]>; 2],
    /// Edges of a cell with their boxes.
    ends: Vec<([u32; 2], Extent)>,
    planes: Partings,
    /// Those that may close.
    closing: Vec<Closing>,
}

/// A candidate that may come too near on the way to where it is wanted.
#[derive(Debug, Clone, Copy)]
struct Closing {
    candidate: Candidate,
    /// Of the vector between the closest points, and that vector. (mm)
    weights: [f64; 4],
    between: Vector,
}

impl Closing {
    /// As a pair of a list that may meet.
    fn active(&self, list: u32) -> Active {
        let distance = self.between.norm();
        Active {
            nodes: self.candidate.nodes,
            kind: self.candidate.kind,
            weights: self.weights,
            normal: self.between / distance.max(1e-12),
            distance,
            thickness: f64::from(self.candidate.thickness),
            list,
            push: 0.0,
        }
    }
}

struct Offer<'a> {
    contact: &'a Contact,
    list: &'a PairList,
    pair: &'a TilePair,
    reach: f32,
    bench: &'a mut Workbench,
}

impl pulp::NullaryFnOnce for Offer<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.contact
            .offer_elements(self.list, self.pair, self.reach, self.bench);
    }
}

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
                self.watch.catch_up(pair);
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

    /// Finds the same for tiles that are pushed, with allowance. What was found before in this
    /// pass is still so for tiles in which nothing was pushed since.
    pub(super) fn collect_pushed(&mut self) {
        if !self.is_any_pushed {
            self.actives.clear();
            return;
        }
        let before = self.collection;
        self.collection += 1;
        let more = 2.0 * MARGIN;
        let mut lists = std::mem::take(&mut self.lists);
        let old = std::mem::take(&mut self.actives);
        let mut actives = Vec::with_capacity(old.len());
        for (index, list) in lists.iter_mut().enumerate() {
            let watch = &self.watch;
            if !watch.is_pushed[list.a] && !watch.is_pushed[list.b] {
                continue;
            }
            let mut pairs = std::mem::take(&mut list.pairs);
            for pair in &mut pairs {
                if !pair.tiles.iter().any(|&t| self.is_pushed[t as usize]) {
                    continue;
                }
                let first = actives.len();
                let is_known = pair.near.collection == before
                    && pair
                        .tiles
                        .iter()
                        .all(|&t| self.changed[t as usize] < before);
                if is_known {
                    actives.extend_from_slice(&old[pair.near.found.clone()]);
                } else {
                    self.watch.catch_up(pair);
                    if pair.clearance(&self.watch.way_of(pair)) > more as f32 {
                        continue;
                    }
                    if self.has_list(list, pair, more as f32) {
                        self.find_closing(pair, more);
                        let closing = self.workbench.closing.iter();
                        actives.extend(closing.map(|c| c.active(index as u32)));
                    }
                }
                pair.near.collection = self.collection;
                pair.near.found = first..actives.len();
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
            self.changed[t as usize] = self.collection;
        }
        any
    }

    /// Marks the tiles of elements that may come nearer than their thickness, of a pair that has
    /// no certificate.
    fn find_touching(&mut self, list: &PairList, pair: &mut TilePair) {
        if !self.has_list(list, pair, 0.0) {
            return;
        }
        let since = self.since_list(pair);
        let looked_at = self.find_closing(pair, 0.0);
        let closing = std::mem::take(&mut self.workbench.closing);
        for node in closing.iter().flat_map(|c| c.candidate.nodes) {
            self.push_node(node);
        }
        self.workbench.closing = closing;
        pair.know_nearest();
        if looked_at > MOST_LOOKED_AT && since > FAR_GONE {
            // From where the tiles are now, fewer may close.
            self.list_candidates(list, pair);
        }
    }

    /// Finds the candidates of a list that may come within `more` (mm) of their thickness on the
    /// way to where they are wanted. Returns how many were looked at.
    fn find_closing(&mut self, pair: &mut TilePair, more: f64) -> usize {
        let bench = &mut self.workbench;
        bench.closing.clear();
        let way = self.watch.way_of(pair);
        let since = pair.since_list(&way, self.watch.stamp);
        pair.nearer_than(since + more as f32, &mut bench.picked);
        if bench.picked.is_empty() {
            return 0;
        }
        let known = pair.known(&self.watch.way_until_now(pair));
        let (from, to) = (self.positions.as_slice(), self.wanted.as_slice());
        let NearElements {
            candidates, gaps, ..
        } = &mut *pair.near;
        let second = bench
            .picked
            .partition_point(|&k| candidates[k as usize].kind == KINDS[0]);
        let (of_first, of_second) = bench.picked.split_at(second);
        for (kind, picked) in KINDS.into_iter().zip([of_first, of_second]) {
            let nodes = &mut bench.nodes[0];
            nodes.clear();
            nodes.extend(picked.iter().map(|&k| candidates[k as usize].nodes));
            bench.planes.part(kind, nodes, from, Some(to));
            let planes = bench.planes.now.iter().zip(&bench.planes.ever);
            for (&k, (&now, &ever)) in picked.iter().zip(planes) {
                let (c, gap) = (&candidates[k as usize], &mut gaps[k as usize]);
                *gap = most(*gap, now - c.thickness + known);
                let limit = f64::from(c.thickness) + more;
                if f64::from(ever) > limit {
                    continue;
                }
                let at = places(&c.nodes, &self.positions);
                let weights = closest_weights(kind, &at);
                let between = weighted(&weights, &at);
                let distance = between.norm();
                let to = places(&c.nodes, &self.wanted);
                if distance - approach(kind, &at, &to) <= limit {
                    bench.closing.push(Closing {
                        candidate: *c,
                        weights,
                        between,
                    });
                }
            }
        }
        bench.picked.len()
    }

    /// Whether elements of a pair have to be looked at one by one, with allowance for `more`
    /// (mm); its list then holds all that count.
    fn has_list(&mut self, list: &PairList, pair: &mut TilePair, more: f32) -> bool {
        if pair.reach - self.since_list(pair) > more {
            return true;
        }
        if std::mem::replace(&mut pair.found, self.watch.round) == self.watch.round {
            self.watch.repeated += 1;
        }
        let own = list.a == list.b;
        self.look_at_tiles(pair);
        let shapes = pair.tiles.map(|t| &self.shapes[t as usize]);
        if own
            && self
                .tiles
                .are_adjacent(&self.parts[list.a], pair.tiles[0], pair.tiles[1])
        {
            // What they go in this pass counts from where they are, too.
            let way = flat_way(shapes);
            if way > 0.0 && self.stays_flat(pair, way - more) {
                pair.keep_length(way, &self.watch.way_until_now(pair));
                return false;
            }
        } else {
            let thickness = self.thickest(list) as f32;
            let states = [self.positions.as_slice(), &self.wanted];
            let tiles = pair.tiles.map(|t| &self.tiles.tiles[t as usize]);
            let normals = shapes.map(|shape| shape.sum);
            let (n, gap) = slab(tiles, states, normals, thickness + WIDE_ENOUGH);
            if gap - thickness > more {
                pair.keep_slab(n, gap - thickness, &self.watch.way_until_now(pair));
                return false;
            }
        }
        self.list_candidates(list, pair);
        true
    }

    /// Sees how the tiles of a pair lie in this pass.
    fn look_at_tiles(&mut self, pair: &TilePair) {
        for t in pair.tiles.map(|t| t as usize) {
            self.shapes[t].refresh(self.moment, &self.tiles.tiles[t], &self.positions);
        }
    }

    /// How far elements of a pair may have gone against each other since its list was made.
    /// (mm)
    fn since_list(&self, pair: &TilePair) -> f32 {
        pair.since_list(&self.watch.way_of(pair), self.watch.stamp)
    }

    /// Whether the tiles of a pair go less than `way` (mm) against each other in this pass.
    fn stays_flat(&self, pair: &TilePair, way: f32) -> bool {
        // What they have gone until now and will have gone tells most times.
        let gone = self.watch.way_until_now(pair).longest();
        let will_have = self.watch.way_until_wanted(pair).longest();
        gone + will_have + ROUNDING < way || self.way_of_pass(pair) < way
    }

    /// How far the tiles of a pair go against each other in this pass, at most. (mm)
    fn way_of_pass(&self, pair: &TilePair) -> f32 {
        let way = |t: u32| {
            let tile = &self.tiles.tiles[t as usize];
            Way::of(&tile.ways(&self.positions, &self.wanted))
        };
        let [a, b] = pair.tiles;
        way(a).against(&way(b)).longest()
    }

    /// Lists the elements of a pair that are near each other where they are now.
    fn list_candidates(&mut self, list: &PairList, pair: &mut TilePair) {
        if pair.reach >= 0.0 {
            self.watch.repeated += LIST_COST;
        }
        self.look_at_tiles(pair);
        let mut bench = std::mem::take(&mut self.workbench);
        let pass = self.way_of_pass(pair);
        let reach = pair.near.wish.max(pass + 3.0 * MARGIN as f32);
        let longest = self.thickest(list) as f32 + reach;
        vectorized(Offer {
            contact: self,
            list,
            pair,
            reach: longest,
            bench: &mut bench,
        });
        let own = list.a == list.b;
        let is_cloth = list.collider.is_none();
        let is_round = list.collider.is_some_and(|c| self.world[c].shape.is_round);
        pair.near.candidates.clear();
        pair.near.gaps.clear();
        for (k, kind) in KINDS.into_iter().enumerate() {
            let first_new = pair.near.candidates.len();
            let planes = &mut bench.planes;
            planes.part(kind, &bench.nodes[k], &self.positions, None);
            for (nodes, &now) in bench.nodes[k].iter().zip(&planes.now) {
                let thickness = if is_cloth {
                    self.options.thickness
                } else if is_round {
                    GUARD_THICKNESS
                } else if now > longest {
                    continue;
                } else {
                    self.covered(nodes)
                } as f32;
                let gap = now - thickness;
                let (first, second) = nodes.split_at(kind.first_count());
                if gap > reach
                    || own && self.rules.side(&self.parts[list.a], first, second) != Side::Apart
                {
                    continue;
                }
                pair.near.gaps.push(gap);
                pair.near.candidates.push(Candidate {
                    nodes: *nodes,
                    kind,
                    thickness,
                });
            }
            if is_cloth {
                let nodes = &mut bench.nodes[k];
                nodes.clear();
                nodes.extend(pair.near.candidates[first_new..].iter().map(|c| c.nodes));
                planes.part(kind, nodes, &self.rest, None);
                self.keep_at_most_rest(pair, first_new, reach, &planes.now);
            }
        }
        self.workbench = bench;
        let pass = (self.watch.stamp, pass);
        pair.keep_list(reach, &self.watch.way_until_now(pair), pass);
    }

    /// Takes half the distance at rest for the thickness of the candidates from `first` on,
    /// where that is less, and drops those that are then further than `reach` from it.
    ///
    /// - `rest`: how far each of them is apart at rest, at least (mm)
    fn keep_at_most_rest(&self, pair: &mut TilePair, first: usize, reach: f32, rest: &[f32]) {
        let mut kept = first;
        for (k, rest) in (first..).zip(rest) {
            let mut candidate = pair.near.candidates[k];
            // Mostly the plane shows that they are far enough apart; where it does not, only the
            // distance tells, for what is kept is never to be less than its share.
            let mut thickness = self.options.thickness;
            if REST_SHARE * f64::from(*rest) <= thickness {
                let at = places(&candidate.nodes, &self.rest);
                let at_rest = weighted(&closest_weights(candidate.kind, &at), &at).norm();
                thickness = thickness.min(REST_SHARE * at_rest);
            }
            let thickness = thickness as f32;
            let gap = pair.near.gaps[k] + (candidate.thickness - thickness);
            candidate.thickness = thickness;
            if gap <= reach {
                pair.near.candidates[kept] = candidate;
                pair.near.gaps[kept] = gap;
                kept += 1;
            }
        }
        pair.near.candidates.truncate(kept);
        pair.near.gaps.truncate(kept);
    }

    /// Collects the elements of all cells of two tiles that boxes and planes do not show to be
    /// further apart than `reach`. (mm)
    #[inline(always)]
    fn offer_elements(&self, list: &PairList, pair: &TilePair, reach: f32, bench: &mut Workbench) {
        let ends = &mut bench.ends;
        let [vertices, edges] = &mut bench.nodes;
        vertices.clear();
        edges.clear();
        let own = list.a == list.b;
        let is_one = pair.tiles[0] == pair.tiles[1];
        let [part_a, part_b] = [list.a, list.b].map(|p| &self.parts[p]);
        let [a, b] = pair.tiles.map(|t| &self.tiles.tiles[t as usize]);
        let [shape_a, shape_b] = pair.tiles.map(|t| &self.shapes[t as usize]);
        for (i, &ca) in a.cells.iter().enumerate() {
            let mut near = shape_b.near(&shape_a.bounds(i), reach);
            while near != 0 {
                let j = near.trailing_zeros() as usize;
                near &= near - 1;
                let cb = b.cells[j];
                // Of a tile with itself every two cells once.
                if own && (part_a.are_next_cells(ca, cb) || is_one && cb < ca) {
                    continue;
                }
                let normals = [shape_a.normal(i), shape_b.normal(j)];
                let corners = [&a.corners[i], &b.corners[j]];
                if are_apart(corners, normals, reach, &self.positions) {
                    continue;
                }
                let [of_a, of_b] = [&part_a.cells[ca as usize], &part_b.cells[cb as usize]];
                // Of elements those that are near the other cell's box.
                let (box_a, box_b) = (shape_a.bounds(i), shape_b.bounds(j));
                for (from, to, around) in [(of_a, of_b, &box_b), (of_b, of_a, &box_a)] {
                    for &v in &from.nodes {
                        if around.is_near(&self.box_of([v, v]), reach) {
                            vertices.extend(to.triangles.iter().map(|&[x, y, z]| [v, x, y, z]));
                        }
                    }
                }
                ends.clear();
                let of_b = of_b.edges.iter().map(|&edge| (edge, self.box_of(edge)));
                ends.extend(of_b.filter(|(_, own)| box_a.is_near(own, reach)));
                for &[p, q] in &of_a.edges {
                    let own = self.box_of([p, q]);
                    if box_b.is_near(&own, reach) {
                        let near = ends.iter().filter(|(_, other)| own.is_near(other, reach));
                        edges.extend(near.map(|&([r, s], _)| [p, q, r, s]));
                    }
                }
            }
        }
    }

    /// The box of an edge where its nodes are now.
    #[inline]
    fn box_of(&self, [p, q]: [u32; 2]) -> Extent {
        let [p, q] = [self.positions[p as usize], self.positions[q as usize]];
        let mut out = Extent {
            low: [p.x, p.y, p.z],
            high: [p.x, p.y, p.z],
        };
        out.take(&[q.x, q.y, q.z]);
        out
    }

    /// What covers the cloth's nodes of a pair with a collider, at least. (mm)
    fn covered(&self, nodes: &[u32; 4]) -> f64 {
        nodes
            .iter()
            .filter(|&&n| (n as usize) < self.cloth_count)
            .map(|&n| f64::from(self.cover[n as usize]))
            .fold(f64::INFINITY, f64::min)
    }
}
