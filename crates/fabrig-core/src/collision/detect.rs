//! Which tiles may meet before parts are looked at again.
//!
//! When parts are looked at, every tile gets a box in which its nodes may go about. Tiles whose
//! boxes are apart cannot meet; the others are pairs ([`super::certificate`]). When nodes leave
//! their box, all parts are looked at anew: together, so that certificates know how tiles that
//! go the same way have gone against each other. Pairs take that into their certificates when
//! they are asked for them next.
//!
//! Source: the displacement bounds of Chen et al. 2025, *Offset Geometric Contact*, kept per
//! tile and relative to the other tile here, so that they last over many substeps.

use std::collections::VecDeque;

use super::certificate::TilePair;
use super::contact::Contact;
use super::tile::{Extent, Way, least, most};

/// How far projection may move nodes before candidates are collected again. (mm)
pub(super) const MARGIN: f64 = 0.02;
/// Room that every tile has around where it is and where it is going. (mm)
const ROOM: f32 = 0.5;
/// Passes for which the room of a tile is foreseen, and the furthest that it goes then (mm).
const FORESEEN: (f32, f32) = (12.0, 3.0);
/// Certificates found for the second time since parts were looked at, after which they are
/// looked at anew.
const MOST_REPEATED: usize = 600;
/// Times that parts were looked at of which ways are kept.
const MOST_REMEMBERED: usize = 16;
/// What is kept from the mesh inside a round collider, which only stops cells that are
/// stretched across it: nodes are held out by its round surface. (mm)
pub(super) const GUARD_THICKNESS: f64 = 0.05;

/// Pairs of tiles of two parts, or of one.
#[derive(Debug)]
pub(crate) struct PairList {
    pub(crate) a: usize,
    pub(crate) b: usize,
    pub(crate) friction: f64,
    /// The collider that `b` is of.
    pub(crate) collider: Option<usize>,
    /// Rising.
    pub(crate) pairs: Vec<TilePair>,
    /// How far the two parts have gone against each other, substep after substep. (mm)
    pub(super) gone: f64,
    /// For each pair how far they have gone when it has to be looked at again. (mm)
    pub(super) due: Vec<f64>,
    /// The least of these. (mm)
    pub(super) first_due: f64,
}

impl PairList {
    pub(crate) fn new(a: usize, b: usize, friction: f64, collider: Option<usize>) -> Self {
        Self {
            a,
            b,
            friction,
            collider,
            pairs: Vec::new(),
            gone: 0.0,
            due: Vec::new(),
            first_due: f64::NEG_INFINITY,
        }
    }

    /// All pairs have to be looked at.
    pub(super) fn look_again(&mut self) {
        self.due.clear();
        self.due.resize(self.pairs.len(), f64::NEG_INFINITY);
        self.first_due = f64::NEG_INFINITY;
    }
}

/// Where tiles are against where they were last looked at.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Ways of each tile's nodes to where they are, and to where they are wanted. (mm)
    pub(super) now: Vec<Extent>,
    pub(super) next: Vec<Extent>,
    /// Both together.
    pub(super) ways: Vec<Way>,
    /// Ways that a tile may go before parts are looked at anew. (mm)
    rooms: Vec<Extent>,
    /// Boxes that tiles stay in, and parts. (mm)
    boxes: Vec<Extent>,
    part_boxes: Vec<Extent>,
    /// Ways of each patch's nodes in this substep. (mm)
    pub(super) steps: Vec<Way>,
    /// Parts in which something is pushed in this pass.
    pub(super) is_pushed: Vec<bool>,
    /// Whether parts are to be looked at, whatever they do.
    pub(super) is_stale: bool,
    /// How often parts were looked at, and certificates that were found again since.
    pub(super) round: u64,
    pub(super) repeated: usize,
    /// Counts the moments at which ways were measured.
    pub(super) stamp: u64,
    rows: [Vec<f32>; 2],
    /// Ways of tiles to where parts were looked at, the last times that they were.
    history: VecDeque<Vec<Way>>,
}

impl Watch {
    /// The way of the first tile of a pair against the second: where they are and are wanted.
    #[inline]
    pub(super) fn way_of(&self, pair: &TilePair) -> Way {
        let [a, b] = pair.tiles;
        self.ways[a as usize].against(&self.ways[b as usize])
    }

    /// Keeps what tiles have gone to where parts are looked at anew.
    fn remember_ways(&mut self) {
        self.round += 1;
        let mut oldest = match self.history.len() {
            MOST_REMEMBERED => self.history.pop_front().unwrap_or_default(),
            _ => Vec::new(),
        };
        oldest.clone_from(&self.ways);
        self.history.push_back(oldest);
    }

    /// Brings the certificates of a pair to where parts were last looked at; one that has not
    /// been asked for long enough loses them.
    #[inline]
    pub(super) fn catch_up(&self, pair: &mut TilePair) {
        let missed = (self.round - pair.round) as usize;
        if missed == 0 {
            return;
        }
        pair.round = self.round;
        let Some(first) = self.history.len().checked_sub(missed) else {
            pair.forget();
            return;
        };
        let [a, b] = pair.tiles.map(|t| t as usize);
        for ways in self.history.range(first..) {
            pair.renew(&ways[a].against(&ways[b]));
        }
    }

    /// The same, to where they are alone.
    #[inline]
    pub(super) fn way_until_now(&self, pair: &TilePair) -> Way {
        let [a, b] = pair.tiles;
        Way::of(&self.now[a as usize]).against(&Way::of(&self.now[b as usize]))
    }

    /// The same, to where they are wanted alone.
    pub(super) fn way_until_wanted(&self, pair: &TilePair) -> Way {
        let [a, b] = pair.tiles;
        Way::of(&self.next[a as usize]).against(&Way::of(&self.next[b as usize]))
    }

    pub(super) fn new(tile_count: usize, part_count: usize) -> Self {
        Self {
            now: vec![Extent::STILL; tile_count],
            next: vec![Extent::STILL; tile_count],
            ways: vec![Way::default(); tile_count],
            rooms: vec![Extent::EMPTY; tile_count],
            boxes: vec![Extent::EMPTY; tile_count],
            part_boxes: vec![Extent::EMPTY; part_count],
            steps: vec![Way::default(); part_count],
            is_pushed: vec![false; part_count],
            is_stale: true,
            ..Self::default()
        }
    }
}

impl Contact {
    /// Measures how far tiles are from where they were last looked at, and looks at all parts
    /// anew where that is too far.
    pub(super) fn refresh_pairs(&mut self) {
        self.watch.stamp += 1;
        let mut is_stale = self.watch.is_stale;
        for index in 0..self.parts.len() {
            if self.is_away(index) {
                continue;
            }
            self.measure(index);
            let watch = &mut self.watch;
            for t in self.tiles.of_part[index].clone() {
                let both = watch.now[t].union(&watch.next[t]);
                watch.ways[t] = Way::of(&both);
                is_stale |= !watch.rooms[t].holds(&both);
            }
        }
        if is_stale || self.watch.repeated > MOST_REPEATED {
            self.renew(is_stale);
        }
    }

    /// Takes what was altered in this pass into the ways of tiles.
    pub(super) fn follow(&mut self) {
        self.watch.stamp += 1;
        for &node in &self.altered[self.followed..] {
            let n = node as usize;
            let by = self.wanted[n] - self.reference[n];
            for &t in self.tiles.of_node(node) {
                let t = t as usize;
                let watch = &mut self.watch;
                watch.next[t].take(&[by.x, by.y, by.z]);
                let both = watch.now[t].union(&watch.next[t]);
                watch.ways[t] = Way::of(&both);
                watch.is_stale |= !watch.rooms[t].holds(&both);
            }
        }
        self.followed = self.altered.len();
        if self.watch.is_stale {
            self.renew(true);
        }
    }

    /// At the end of a pass: tiles are where their nodes went.
    pub(super) fn arrive(&mut self) {
        let watch = &mut self.watch;
        std::mem::swap(&mut watch.now, &mut watch.next);
        if !self.is_any_pushed {
            return;
        }
        let is_pushed = |t: &u32| self.is_pushed[*t as usize];
        for list in &mut self.lists {
            if watch.is_pushed[list.a] || watch.is_pushed[list.b] {
                let pairs = list.pairs.iter().zip(&mut list.due);
                for (_, due) in pairs.filter(|(p, _)| p.tiles.iter().any(is_pushed)) {
                    *due = f64::NEG_INFINITY;
                    list.first_due = f64::NEG_INFINITY;
                }
            }
        }
        for (t, _) in self.is_pushed.iter().enumerate().filter(|(_, p)| **p) {
            watch.now[t] = self.tiles.tiles[t].ways(&self.reference, &self.positions);
        }
    }

    /// Measures the ways of a part's tiles to where their nodes are wanted.
    fn measure(&mut self, index: usize) {
        self.tiles.measure(
            index,
            &self.parts[index],
            [&self.reference, &self.wanted],
            &mut self.watch.next,
            &mut self.watch.rows,
        );
    }

    /// Whether a part is that of a collider which cannot meet anything now.
    pub(super) fn is_away(&self, part: usize) -> bool {
        part >= self.cloth_parts && self.world.iter().any(|c| c.part == Some(part) && c.is_away)
    }

    /// Takes where parts are now for what ways count from, and finds anew which tiles may meet
    /// where `is_whole` or a tile has left its room.
    fn renew(&mut self, mut is_whole: bool) {
        for (way, now) in self.watch.ways.iter_mut().zip(&self.watch.now) {
            *way = Way::of(now);
        }
        for collider in &mut self.world {
            for (free, (tile, _)) in collider.free.iter_mut().zip(&collider.watched) {
                *free -= f64::from(self.watch.ways[*tile as usize].longest());
            }
        }
        self.reference.copy_from_slice(&self.positions);
        self.watch.is_stale = false;
        self.watch.repeated = 0;
        self.watch.remember_ways();
        for index in 0..self.parts.len() {
            let is_away = self.is_away(index);
            if !is_away {
                self.measure(index);
            }
            for t in self.tiles.of_part[index].clone() {
                let watch = &mut self.watch;
                let gone = std::mem::replace(&mut watch.now[t], Extent::STILL);
                if is_away {
                    watch.next[t] = Extent::STILL;
                }
                let both = watch.now[t].union(&watch.next[t]);
                watch.ways[t] = Way::of(&both);
                // What is left of it for the node that has gone furthest.
                watch.rooms[t].shrink(&gone);
                is_whole |= !is_away && !watch.rooms[t].holds(&both);
            }
        }
        if is_whole {
            self.find_pairs();
        }
    }

    /// Gives every tile new room, and finds the tiles that may meet in it.
    fn find_pairs(&mut self) {
        self.report.detections += 1;
        for index in 0..self.parts.len() {
            let mut whole = Extent::EMPTY;
            for t in self.tiles.of_part[index].clone() {
                let watch = &mut self.watch;
                let room = room(&watch.next[t]);
                let mut bounds = self.tiles.tiles[t].bounds(&self.positions);
                for k in 0..3 {
                    bounds.low[k] += room.low[k];
                    bounds.high[k] += room.high[k];
                }
                watch.rooms[t] = room;
                watch.boxes[t] = bounds;
                whole = whole.union(&bounds);
            }
            self.watch.part_boxes[index] = whole;
        }
        let mut lists = std::mem::take(&mut self.lists);
        let mut near = Vec::new();
        for list in &mut lists {
            near.clear();
            if !self.is_away(list.b) {
                self.near_tiles(list, &mut near);
            }
            merge(list, &near);
        }
        self.lists = lists;
    }

    /// Tiles of a list whose boxes may touch, rising.
    fn near_tiles(&self, list: &PairList, near: &mut Vec<[u32; 2]>) {
        let reach = (self.thickest(list) + 2.0 * MARGIN) as f32;
        let watch = &self.watch;
        let [whole_a, whole_b] = [list.a, list.b].map(|p| &watch.part_boxes[p]);
        if !whole_a.is_near(whole_b, reach) {
            return;
        }
        for a in self.tiles.of_part[list.a].clone() {
            let own = &watch.boxes[a];
            if !own.is_near(whole_b, reach) {
                continue;
            }
            let others = self.tiles.of_part[list.b].clone();
            for b in others.start.max(if list.a == list.b { a } else { 0 })..others.end {
                if own.is_near(&watch.boxes[b], reach) {
                    near.push([a as u32, b as u32]);
                }
            }
        }
    }

    /// How much two elements of a list keep apart at most. (mm)
    pub(super) fn thickest(&self, list: &PairList) -> f64 {
        match list.collider {
            None => self.options.thickness,
            Some(c) if self.world[c].shape.is_round => GUARD_THICKNESS,
            Some(_) => f64::from(self.thickest_cover[list.a]),
        }
    }
}

/// Ways that a tile may go which now goes `next`.
fn room(next: &Extent) -> Extent {
    let (passes, furthest) = FORESEEN;
    Extent {
        low: next
            .low
            .map(|x| least(least(x, 0.0), most(passes * x, -furthest)) - ROOM),
        high: next
            .high
            .map(|x| most(most(x, 0.0), least(passes * x, furthest)) + ROOM),
    }
}

/// Makes the pairs of a list those of `near`; both rise. What was known of pairs that stay is
/// kept.
fn merge(list: &mut PairList, near: &[[u32; 2]]) {
    let pairs = &mut list.pairs;
    if pairs.len() == near.len() && pairs.iter().zip(near).all(|(p, n)| p.tiles == *n) {
        return;
    }
    let due = std::mem::take(&mut list.due);
    let mut old = std::mem::take(pairs).into_iter().zip(due).peekable();
    pairs.reserve(near.len());
    for tiles in near {
        while old.next_if(|(p, _)| p.tiles < *tiles).is_some() {}
        let kept = old.next_if(|(p, _)| p.tiles == *tiles);
        let (pair, due) = kept.unwrap_or_else(|| (TilePair::new(*tiles), f64::NEG_INFINITY));
        pairs.push(pair);
        list.due.push(due);
    }
    list.first_due = list.due.iter().copied().fold(f64::INFINITY, f64::min);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_pair_that_catches_up_knows_what_one_that_kept_up_knows() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(41);
        for missed in 1..=MOST_REMEMBERED + 3 {
            let mut watch = Watch::new(2, 1);
            let mut kept_up = TilePair::new([0, 1]);
            kept_up.keep_slab(Vector3::z(), 9.0, &Way::default());
            kept_up.keep_length(90.0, &Way::default());
            let mut late = kept_up.clone();
            for _ in 0..missed {
                for way in &mut watch.ways {
                    let mut extent = Extent::EMPTY;
                    for _ in 0..3 {
                        extent.take(&[0; 3].map(|_| random.random_range(-0.1..0.1)));
                    }
                    *way = Way::of(&extent);
                }
                watch.remember_ways();
                watch.catch_up(&mut kept_up);
            }
            watch.catch_up(&mut late);
            let [kept_up, late] = [&kept_up, &late].map(|p| p.clearance(&Way::default()));
            assert!(kept_up > 0.0 && kept_up < 90.0);
            if missed > MOST_REMEMBERED {
                assert_eq!(late, f32::NEG_INFINITY, "it knows nothing any more");
            } else {
                assert_eq!(late, kept_up, "{missed} times");
            }
        }
    }
}
