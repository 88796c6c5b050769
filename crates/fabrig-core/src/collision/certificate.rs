//! Pairs of tiles, and what proves that they do not meet.
//!
//! A pair keeps two certificates; each is found by looking at all nodes once, and is then tested
//! in a few operations by how far the two tiles have gone against each other since:
//!
//! - a *slab*: along a direction n the first tile stays in front of the second with a gap to
//!   spare. Tiles that slide along each other do not use it up;
//! - a *length*: they may go this far against each other in any direction. For two tiles beside
//!   each other in one grid it says that they are flat, for others that no two of their
//!   elements are nearer.
//!
//! Where neither holds, the pair has a list of its elements that are near each other, from which
//! the second certificate comes, and those that may close are contacts to be.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::distance::PairKind;
use super::tile::{Tile, Way, least, most};
use crate::machine::vectorized;

/// A slab this much wider than needed makes any length superfluous. (mm)
const AMPLE: f32 = 0.3;
/// Lists go at first up to this beyond the thickness, and then between these bounds: those that
/// have few candidates further, those that have many less far. (mm)
const LIST_REACH: f32 = 0.5;
const REACHES: [f32; 2] = [0.5, 2.5];
/// What few and many are.
const FEW_AND_MANY: [usize; 2] = [4, 60];
/// What a wish changes by from list to list.
const REACH_STEP: f32 = 1.6;
/// Most nodes of a tile, in two states: 5 x 5 of a grid, 3 of each of 8 triangles of a mesh.
const MOST_PLACES: usize = 56;
/// What stored positions and their differences may be off by. (mm)
pub(super) const ROUNDING: f32 = 1e-4;

/// A pair of elements that may collide.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) nodes: [u32; 4],
    pub(crate) kind: PairKind,
    /// Distance to keep. (mm)
    pub(crate) thickness: f32,
}

/// Two tiles that may meet, of two parts or of one.
#[derive(Debug, Clone)]
pub(crate) struct TilePair {
    pub(crate) tiles: [u32; 2],
    /// Direction of the slab, from the second tile to the first; the fourth number is nothing.
    normal: [f32; 4],
    /// Gap along it at the references beyond the thickness; negative infinity: none known. (mm)
    gap: f32,
    /// How far the tiles may go against each other from the references. (mm)
    length: f32,
    /// How far they had gone against each other, at most, from where the list was made to the
    /// references. (mm)
    spent: f32,
    /// Up to which gap the list holds all candidates; negative: there is no list. (mm)
    pub(crate) reach: f32,
    /// When parts were looked at last before certificates were brought there, and before one
    /// was found.
    pub(crate) round: u64,
    pub(crate) found: u64,
    /// Apart from what every pair is asked for.
    pub(crate) near: Box<NearElements>,
}

/// The elements of two tiles that are near each other.
#[derive(Debug, Clone)]
pub(crate) struct NearElements {
    /// Vertices and triangles first.
    pub(crate) candidates: Vec<Candidate>,
    /// For each candidate a distance beyond its thickness that it had, at least, when the list
    /// was made: beside each other, as most of them are all that is looked at. (mm)
    pub(crate) gaps: Vec<f32>,
    /// The moment at which the list was made, and how far the tiles went against each other in
    /// that pass. (mm)
    stamp: u64,
    pass: f32,
    /// Up to which gap the next list shall go. (mm)
    pub(crate) wish: f32,
    /// Which collection looked at these tiles last, and what it found among its actives.
    pub(crate) collection: u64,
    pub(crate) found: Range<usize>,
}

impl TilePair {
    pub(crate) fn new(tiles: [u32; 2]) -> Self {
        Self {
            tiles,
            normal: [0.0; 4],
            gap: f32::NEG_INFINITY,
            length: f32::NEG_INFINITY,
            spent: 0.0,
            reach: -1.0,
            round: 0,
            found: 0,
            near: Box::new(NearElements {
                candidates: Vec::new(),
                gaps: Vec::new(),
                stamp: 0,
                pass: 0.0,
                wish: LIST_REACH,
                collection: 0,
                found: 0..0,
            }),
        }
    }

    /// How far beyond the thickness a certificate shows the tiles to stay apart; less than zero
    /// where none does. (mm)
    ///
    /// - `way`: of the first tile against the second, from the references
    #[inline]
    pub(crate) fn clearance(&self, way: &Way) -> f32 {
        let gap = self.gap + way.along(&self.normal)[0];
        let clearance = if gap > AMPLE {
            gap
        } else {
            most(gap, self.length - way.longest())
        };
        clearance - ROUNDING
    }

    /// Takes what the tiles have gone off the certificates, so that they hold from references
    /// that are where the tiles are now.
    pub(crate) fn renew(&mut self, way: &Way) {
        if self.gap > f32::NEG_INFINITY {
            self.gap += way.along(&self.normal)[0] - ROUNDING;
        }
        if self.length > 0.0 || self.reach >= 0.0 {
            let length = way.longest() + ROUNDING;
            self.length -= length;
            self.spent += length;
        }
    }

    /// Knows nothing of how the tiles stand to each other any more.
    pub(crate) fn forget(&mut self) {
        (self.gap, self.length) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        self.drop_list();
    }

    fn drop_list(&mut self) {
        self.reach = -1.0;
        self.near.candidates.clear();
        self.near.gaps.clear();
    }

    /// Keeps a slab that was found where the tiles are now.
    ///
    /// - `gap`: along `normal`, beyond the thickness (mm)
    /// - `way`: to where they are
    pub(crate) fn keep_slab(&mut self, normal: Vector3<f32>, gap: f32, way: &Way) {
        self.normal = [normal.x, normal.y, normal.z, 0.0];
        self.gap = gap - way.along(&self.normal)[1] - ROUNDING;
        self.drop_list();
    }

    /// Keeps a length found where the tiles are now. (mm)
    pub(crate) fn keep_length(&mut self, length: f32, way: &Way) {
        self.length = length - way.longest() - ROUNDING;
    }

    /// Says that the list was made where the tiles are now.
    ///
    /// - `stamp`, `pass`: of this moment, and how far the tiles go against each other from now
    ///   to where they are wanted (mm)
    pub(crate) fn keep_list(&mut self, reach: f32, way: &Way, (stamp, pass): (u64, f32)) {
        self.reach = reach;
        self.spent = way.longest() + ROUNDING;
        let near = &mut *self.near;
        (near.stamp, near.pass) = (stamp, pass + ROUNDING);
        let count = near.candidates.len();
        if count <= FEW_AND_MANY[0] {
            near.wish = least(near.wish * REACH_STEP, REACHES[1]);
        } else if count > FEW_AND_MANY[1] {
            near.wish = most(near.wish / REACH_STEP, REACHES[0]);
        }
        self.length = f32::NEG_INFINITY;
        self.know_nearest();
    }

    /// Takes what no candidate is nearer than as the length that the tiles may go.
    pub(crate) fn know_nearest(&mut self) {
        let (rows, rest) = self.near.gaps.as_chunks::<8>();
        let mut nearest = [self.reach; 8];
        for row in rows {
            for (nearest, gap) in nearest.iter_mut().zip(row) {
                *nearest = least(*nearest, *gap);
            }
        }
        let nearest = nearest.iter().chain(rest).copied().fold(self.reach, least);
        self.length = most(self.length, nearest - self.spent);
    }

    /// Puts the places of candidates whose gap is no more than `since` (mm) into `out`, rising.
    pub(crate) fn nearer_than(&self, since: f32, out: &mut Vec<u32>) {
        out.clear();
        for (row, gaps) in self.near.gaps.chunks(8).enumerate() {
            if gaps.iter().fold(false, |any, gap| any | (*gap <= since)) {
                let near = gaps.iter().enumerate().filter(|(_, gap)| **gap <= since);
                out.extend(near.map(|(k, _)| (8 * row + k) as u32));
            }
        }
    }

    /// What a distance that is known where the tiles are now is more than one that was known when
    /// the list was made, for [`NearElements::gaps`]. (mm)
    ///
    /// - `way`: to where they are
    #[inline]
    pub(crate) fn known(&self, way: &Way) -> f32 {
        self.spent - way.longest() - ROUNDING
    }

    /// How far elements may have gone against each other since the list was made. (mm)
    #[inline]
    pub(crate) fn since_list(&self, way: &Way, stamp: u64) -> f32 {
        if self.near.stamp == stamp {
            return self.near.pass;
        }
        self.spent + way.longest() + ROUNDING
    }
}

/// The widest slab between two tiles of those that their normals and middles suggest: direction
/// from the second to the first, and gap (mm).
///
/// - `states`: positions between which nodes go
/// - `normals`: of the tiles, of any length
/// - `enough`: a gap that needs no better one (mm)
pub(crate) fn slab(
    [a, b]: [&Tile; 2],
    states: [&[Point3<f32>]; 2],
    normals: [Vector3<f32>; 2],
    enough: f32,
) -> (Vector3<f32>, f32) {
    vectorized(Slab {
        tiles: [a, b],
        states,
        normals,
        enough,
    })
}

struct Slab<'a> {
    tiles: [&'a Tile; 2],
    states: [&'a [Point3<f32>]; 2],
    normals: [Vector3<f32>; 2],
    enough: f32,
}

impl pulp::NullaryFnOnce for Slab<'_> {
    type Output = (Vector3<f32>, f32);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let [a, b] = self.tiles;
        let (a, b) = (Hull::of(a, self.states), Hull::of(b, self.states));
        slab_of_hulls([&a, &b], self.normals, self.enough)
    }
}

#[inline(always)]
fn slab_of_hulls(
    [a, b]: [&Hull; 2],
    normals: [Vector3<f32>; 2],
    enough: f32,
) -> (Vector3<f32>, f32) {
    let mut best = (Vector3::zeros(), f32::NEG_INFINITY);
    let between = a.middle - b.middle;
    for k in 0..4 {
        let direction = match k {
            0 => normals[0],
            1 => normals[1],
            2 => between,
            _ => {
                // Across the mean normal: tiles side by side in one layer.
                let n = normals[0] + normals[1];
                between - n * (between.dot(&n) / n.norm_squared().max(f32::MIN_POSITIVE))
            }
        };
        let Some(n) = direction.try_normalize(1e-12) else {
            continue;
        };
        let (of_a, of_b) = (a.range(&n), b.range(&n));
        for (n, gap) in [(n, of_a[0] - of_b[1]), (-n, of_b[0] - of_a[1])] {
            if gap > best.1 {
                best = (n, gap);
            }
        }
        if best.1 > enough {
            break;
        }
    }
    best
}

/// Nodes of a tile in two states, beside each other.
struct Hull {
    places: [[f32; MOST_PLACES]; 3],
    /// Mean of the nodes in the first state. (mm)
    middle: Vector3<f32>,
}

impl Hull {
    #[inline(always)]
    fn of(tile: &Tile, states: [&[Point3<f32>]; 2]) -> Self {
        let origin = states[0][tile.hull[0] as usize].coords;
        let [x, y, z] = [origin.x, origin.y, origin.z];
        let mut places = [[x; MOST_PLACES], [y; MOST_PLACES], [z; MOST_PLACES]];
        let mut sum = Vector3::zeros();
        for (i, &node) in tile.hull.iter().enumerate() {
            let now = states[0][node as usize].coords;
            let next = states[1][node as usize].coords;
            for k in 0..3 {
                places[k][2 * i] = now[k];
                places[k][2 * i + 1] = next[k];
            }
            sum += now;
        }
        Self {
            places,
            middle: sum / tile.hull.len() as f32,
        }
    }

    /// The least and the most along a direction. (mm)
    #[inline(always)]
    fn range(&self, n: &Vector3<f32>) -> [f32; 2] {
        let (mut low, mut high) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        let [x, y, z] = &self.places;
        for row in (0..MOST_PLACES).step_by(8) {
            for k in 0..8 {
                let i = row + k;
                let height = n.x * x[i] + n.y * y[i] + n.z * z[i];
                low[k] = least(low[k], height);
                high[k] = most(high[k], height);
            }
        }
        [
            low.into_iter().fold(f32::INFINITY, least),
            high.into_iter().fold(f32::NEG_INFINITY, most),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::GridShape;
    use crate::collision::mesh::Part;
    use crate::collision::tile::Tiles;
    use crate::collision::tile_shape::TileShape;
    use rand::{RngExt, SeedableRng};

    /// Two layers that go the same way, turn, and slide along each other.
    #[test]
    fn a_certificate_never_promises_more_than_there_is() {
        let shape = GridShape {
            u_count: 5,
            v_count: 5,
            is_periodic: false,
        };
        let parts = [Part::of_grid(shape, 0), Part::of_grid(shape, 25)];
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(17);
        let at = |i: u32| {
            let (x, y) = (2.0 * (i % 5) as f32, 2.0 * (i / 5 % 5) as f32);
            Point3::new(x, y, if i < 25 { 1.2 } else { 0.0 } + 0.02 * x * y)
        };
        let start: Vec<Point3<f32>> = (0..50).map(at).collect();
        let tiles = Tiles::new(&parts, &start);
        let [a, b] = [&tiles.tiles[0], &tiles.tiles[1]];
        let mut kept = 0;
        for _ in 0..200 {
            let mut pair = TilePair::new([0, 1]);
            let (mut reference, mut now) = (start.clone(), start.clone());
            let normals = [a, b].map(|tile| {
                let mut shape = TileShape::UNKNOWN;
                shape.refresh(1, tile, &now);
                shape.sum
            });
            let (normal, gap) = slab([a, b], [&now, &now], normals, 9.0);
            pair.keep_slab(normal, gap, &Way::default());
            let mut step = || Vector3::from_fn(|_, _| random.random_range(-1.0..1.0_f32));
            let (common, turn) = (step() * 0.5, step() * 0.01);
            let slide = Vector3::new(0.2, 0.1, 0.0) * step().x;
            for k in 0..12 {
                for (i, p) in now.iter_mut().enumerate() {
                    let own = if i < 25 { slide } else { -slide };
                    *p += common + turn.cross(&p.coords) + own + step() * 0.02;
                }
                let ways = [a, b].map(|t| Way::of(&t.ways(&reference, &now)));
                let way = ways[0].against(&ways[1]);
                let promised = pair.clearance(&way);
                let least = |n: u32| {
                    let others = b.hull.iter();
                    others
                        .map(|&m| (now[n as usize] - now[m as usize]).norm())
                        .fold(f32::MAX, f32::min)
                };
                let there_is = a.hull.iter().map(|&n| least(n)).fold(f32::MAX, f32::min);
                assert!(promised <= there_is, "{promised} of {there_is} mm");
                kept += usize::from(promised > 0.0);
                if k % 5 == 4 {
                    pair.renew(&way);
                    reference.copy_from_slice(&now);
                }
            }
        }
        assert!(kept > 800, "they last: {kept} of 2,400");
    }
}
