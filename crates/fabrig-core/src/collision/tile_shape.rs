//! How the cells of a tile lie where its nodes are now: found once a pass, however many pairs
//! the tile is in.

use nalgebra::{Point3, Vector3};

use super::tile::{Extent, Tile, least, most};
use crate::machine::vectorized;

/// Most cells of a tile.
pub(super) const MOST_CELLS: usize = 16;
/// Least cosine between the normals of flat tiles and their mean: 50 degrees.
const FLAT: f32 = 0.64;
/// What nodes go against each other before a triangle has turned by a radian, in its height over its
/// longest side: `1 / sqrt 2`, for apex and side may both go.
const WAY_PER_RADIAN: f32 = 0.7;
/// Triangles of a cell: one at each corner, as either diagonal may be folded.
const CORNERS: usize = 4;

/// Boxes and normals of the cells of a tile, beside each other.
#[derive(Debug, Clone)]
pub(crate) struct TileShape {
    /// The pass that it is of.
    moment: u64,
    count: usize,
    low: [[f32; MOST_CELLS]; 3],
    high: [[f32; MOST_CELLS]; 3],
    /// Unit normals; zero where a cell has no area.
    normals: [[f32; MOST_CELLS]; 3],
    /// The same of the triangles at the corners of cells, corner after corner.
    corners: [[[f32; MOST_CELLS]; 3]; CORNERS],
    /// Square of the least height of those over their longest side. (mm^2)
    slimmest: f32,
    /// Sum of the normals, each as long as twice the cell's area. [mm^2]
    pub(crate) sum: Vector3<f32>,
}

impl TileShape {
    pub(crate) const UNKNOWN: Self = Self {
        moment: 0,
        count: 0,
        low: [[f32::INFINITY; MOST_CELLS]; 3],
        high: [[f32::NEG_INFINITY; MOST_CELLS]; 3],
        normals: [[0.0; MOST_CELLS]; 3],
        corners: [[[0.0; MOST_CELLS]; 3]; CORNERS],
        slimmest: f32::INFINITY,
        sum: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Looks at a tile, unless that was done in this pass.
    #[inline]
    pub(crate) fn refresh(&mut self, moment: u64, tile: &Tile, places: &[Point3<f32>]) {
        if self.moment != moment {
            vectorized(Look {
                shape: self,
                tile,
                places,
            });
            self.moment = moment;
        }
    }

    #[inline(always)]
    fn look(&mut self, tile: &Tile, places: &[Point3<f32>]) {
        (self.count, self.sum) = (0, Vector3::zeros());
        self.slimmest = f32::INFINITY;
        for corners in &tile.corners {
            self.take(corners.map(|node| places[node as usize]));
        }
        self.finish();
    }

    /// Takes one more cell by its corners, in turn.
    #[inline(always)]
    fn take(&mut self, [a, b, c, d]: [Point3<f32>; 4]) {
        let (cell, across) = (self.count, [c - a, d - b]);
        let normal = across[0].cross(&across[1]);
        for k in 0..3 {
            self.low[k][cell] = least(least(a[k], b[k]), least(c[k], d[k]));
            self.high[k][cell] = most(most(a[k], b[k]), most(c[k], d[k]));
            self.normals[k][cell] = normal[k];
        }
        let sides = [b - a, c - b, d - c, a - d];
        for corner in 0..CORNERS {
            let (before, after) = (sides[(corner + 3) % 4], sides[corner]);
            let normal = before.cross(&after);
            let longest = most(
                most(before.norm_squared(), after.norm_squared()),
                across[(corner + 1) % 2].norm_squared(),
            );
            let longest = most(longest, f32::MIN_POSITIVE);
            self.slimmest = least(self.slimmest, normal.norm_squared() / longest);
            for k in 0..3 {
                self.corners[corner][k][cell] = normal[k];
            }
        }
        self.sum += normal;
        self.count += 1;
    }

    /// Makes the normals units, when all cells are taken.
    #[inline(always)]
    fn finish(&mut self) {
        make_units(&mut self.normals);
        self.corners.iter_mut().for_each(make_units);
    }

    /// Unit normal of a cell, by its place in the tile; zero where it has no area.
    #[inline]
    pub(crate) fn normal(&self, cell: usize) -> Vector3<f32> {
        Vector3::new(
            self.normals[0][cell],
            self.normals[1][cell],
            self.normals[2][cell],
        )
    }

    /// The box of a cell, by its place in the tile.
    #[inline]
    pub(crate) fn bounds(&self, cell: usize) -> Extent {
        Extent {
            low: [self.low[0][cell], self.low[1][cell], self.low[2][cell]],
            high: [self.high[0][cell], self.high[1][cell], self.high[2][cell]],
        }
    }

    /// Which cells have boxes within `reach` (mm) of another: a bit each.
    #[inline(always)]
    pub(crate) fn near(&self, other: &Extent, reach: f32) -> u32 {
        let mut gaps = [f32::NEG_INFINITY; MOST_CELLS];
        for k in 0..3 {
            for (cell, gap) in gaps.iter_mut().enumerate() {
                let below = other.low[k] - self.high[k][cell];
                let above = self.low[k][cell] - other.high[k];
                *gap = most(*gap, most(below, above));
            }
        }
        let mut bits = 0;
        for (cell, gap) in gaps.iter().enumerate() {
            bits |= u32::from(*gap <= reach) << cell;
        }
        bits & ((1 << self.count) - 1)
    }

    /// The least cosine between the normals of its triangles and a unit direction.
    fn least_cosine(&self, along: &Vector3<f32>) -> f32 {
        let mut cosines = [1.0; MOST_CELLS];
        for [x, y, z] in &self.corners {
            for (cell, cosine) in cosines.iter_mut().enumerate() {
                let own = x[cell] * along.x + y[cell] * along.y + z[cell] * along.z;
                *cosine = least(*cosine, own);
            }
        }
        cosines[..self.count].iter().copied().fold(1.0, least)
    }
}

/// Makes normals units; those that are nothing stay so.
#[inline(always)]
fn make_units([x, y, z]: &mut [[f32; MOST_CELLS]; 3]) {
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        let length = (*x * *x + *y * *y + *z * *z).sqrt();
        // Less is none: squares of what is less than this are not exact any more.
        let scale = if length > 1e-15 { 1.0 / length } else { 0.0 };
        (*x, *y, *z) = (*x * scale, *y * scale, *z * scale);
    }
}

struct Look<'a> {
    shape: &'a mut TileShape,
    tile: &'a Tile,
    places: &'a [Point3<f32>],
}

impl pulp::NullaryFnOnce for Look<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.shape.look(self.tile, self.places);
    }
}

/// How far nodes of two tiles of a sheet may go against each other while it cannot reach
/// itself; zero where the two together are not flat. (mm)
pub(crate) fn flat_way(shapes: [&TileShape; 2]) -> f32 {
    let sum = shapes[0].sum + shapes[1].sum;
    let Some(along) = sum.try_normalize(0.0) else {
        return 0.0;
    };
    let cosine = least(
        shapes[0].least_cosine(&along),
        shapes[1].least_cosine(&along),
    );
    let height = least(shapes[0].slimmest, shapes[1].slimmest).sqrt();
    if cosine > FLAT && height > 0.0 {
        // What is left to 90 degrees.
        WAY_PER_RADIAN * height * cosine.asin()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::GridShape;
    use crate::collision::mesh::Part;
    use crate::collision::tile::Tiles;
    use rand::{RngExt, SeedableRng};

    fn of_normals(normals: &[Vector3<f32>]) -> TileShape {
        let mut shape = TileShape::UNKNOWN;
        for n in normals {
            let (along, middle) = (n.cross(&Vector3::new(0.3, 0.9, 0.2)), Point3::origin());
            let along = along.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            let side = n.norm().sqrt();
            let across = n
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros)
                .cross(&along);
            let corner = |x: f32, y: f32| middle + (along * x + across * y) * side;
            shape.take([
                corner(0.0, 0.0),
                corner(1.0, 0.0),
                corner(1.0, 1.0),
                corner(0.0, 1.0),
            ]);
        }
        shape.finish();
        shape
    }

    #[test]
    fn slim_cells_turn_sooner() {
        let grid = GridShape {
            u_count: 5,
            v_count: 5,
            is_periodic: false,
        };
        let way = |slim: f32| {
            let place = |i: u32| Point3::new((i % 5) as f32, (i / 5) as f32 * slim, 0.0);
            let places: Vec<Point3<f32>> = (0..25).map(place).collect();
            let tiles = Tiles::new(&[Part::of_grid(grid, 0)], &places);
            let mut shape = TileShape::UNKNOWN;
            shape.refresh(1, &tiles.tiles[0], &places);
            flat_way([&shape, &shape])
        };
        assert!(
            way(1.0) > 0.7 && way(0.1) < 0.12,
            "{} {}",
            way(1.0),
            way(0.1)
        );
        assert_eq!(way(0.0), 0.0);
        // A cell folded along a diagonal is not flat, though its mean normal does not tell.
        let mut shape = TileShape::UNKNOWN;
        let at = Point3::new;
        shape.take([
            at(0.0, 0.0, 0.0),
            at(1.0, 0.0, 2.0),
            at(1.0, 1.0, 0.0),
            at(0.0, 1.0, 2.0),
        ]);
        shape.finish();
        assert_eq!(flat_way([&shape, &shape]), 0.0);
    }

    #[test]
    fn a_sheet_that_is_bent_double_or_has_no_area_is_not_flat() {
        let way =
            |a: Vector3<f32>, b: Vector3<f32>| flat_way([&of_normals(&[a, a]), &of_normals(&[b])]);
        assert!(way(Vector3::z() * 2.0, Vector3::new(0.1, 0.0, 1.0)) > 0.6);
        assert_eq!(way(Vector3::z(), Vector3::x() * 3.0), 0.0);
        assert_eq!(way(Vector3::z(), -Vector3::z() * 2.0), 0.0);
        assert_eq!(way(Vector3::z(), Vector3::zeros()), 0.0);
    }

    #[test]
    fn cells_that_boxes_find_are_those_that_are_near() {
        let shape = GridShape {
            u_count: 5,
            v_count: 5,
            is_periodic: false,
        };
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(31);
        let mut at = || random.random_range(-1.0..1.0_f32);
        let mut place = |i: u32| {
            let (x, y) = (2.0 * (i % 5) as f32, 2.0 * (i / 5 % 5) as f32);
            Point3::new(x + at(), y + at(), at())
        };
        let places: Vec<Point3<f32>> = (0..50).map(&mut place).collect();
        let parts = [Part::of_grid(shape, 0), Part::of_grid(shape, 25)];
        let tiles = Tiles::new(&parts, &places);
        let mut shapes = [TileShape::UNKNOWN, TileShape::UNKNOWN];
        for (shape, tile) in shapes.iter_mut().zip(&tiles.tiles) {
            shape.refresh(1, tile, &places);
        }
        let around = |part: usize, cell: u32| {
            let mut out = Extent::EMPTY;
            for &n in &parts[part].cells[cell as usize].hull {
                let p = places[n as usize];
                out.take(&[p.x, p.y, p.z]);
            }
            out
        };
        let mut found = 0;
        for (i, &a) in tiles.tiles[0].cells.iter().enumerate() {
            assert_eq!(shapes[0].bounds(i), around(0, a));
            let bits = shapes[1].near(&shapes[0].bounds(i), 0.1);
            for (j, &b) in tiles.tiles[1].cells.iter().enumerate() {
                let is_near = around(0, a).is_near(&around(1, b), 0.1);
                assert_eq!(bits >> j & 1 == 1, is_near);
                found += usize::from(is_near);
            }
        }
        assert!(found > 20 && found < 240, "{found} of 256");
    }
}
