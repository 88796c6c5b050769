//! A voxel grid of closest surface samples: constant-time, approximate closest points.
//!
//! Made by seeding voxels with samples of the surface and sweeping the nearest one outwards.
//! Good to about a voxel; alignment uses it to judge many thousands of guesses.
//!
//! Source: Danielsson 1980, Euclidean Distance Mapping (vector propagation).

use crate::{Point, Vector};

/// A point of the surface with its unit normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) point: Point,
    pub(super) normal: Vector,
    /// How much it tells, relative to others.
    pub(super) weight: f64,
}

/// Samples spread evenly over triangles: about one every `spacing`, at least one a triangle.
pub(super) fn sample_surface(
    positions: &[Point],
    triangles: &[[u32; 3]],
    spacing: f64,
) -> Vec<Sample> {
    let mut samples = Vec::new();
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let normal = (b - a).cross(&(c - a));
        let Some(normal) = normal.try_normalize(0.0) else {
            continue;
        };
        let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        let steps = ((longest / spacing).ceil() as usize).clamp(1, 64);
        for i in 0..steps {
            for j in 0..steps - i {
                let u = (i as f64 + 1.0 / 3.0) / steps as f64;
                let v = (j as f64 + 1.0 / 3.0) / steps as f64;
                samples.push(Sample {
                    point: a + (b - a) * u + (c - a) * v,
                    normal,
                    weight: 1.0,
                });
            }
        }
    }
    samples
}

/// The grid.
pub(super) struct ClosestGrid {
    samples: Vec<Sample>,
    low: Point,
    cell: f64,
    counts: [usize; 3],
    nearest: Vec<u32>,
}

impl ClosestGrid {
    /// Over the samples' box grown by `margin` on every side, with voxels of edge `cell`.
    pub(super) fn new(samples: Vec<Sample>, cell: f64, margin: f64) -> Self {
        let (mut low, mut high) = (samples[0].point, samples[0].point);
        for s in &samples {
            low = low.inf(&s.point);
            high = high.sup(&s.point);
        }
        low -= Vector::repeat(margin);
        high += Vector::repeat(margin);
        let counts = [0, 1, 2].map(|k| ((high[k] - low[k]) / cell).ceil().max(1.0) as usize);
        let mut grid = Self {
            samples,
            low,
            cell,
            counts,
            nearest: vec![u32::MAX; counts.iter().product()],
        };
        for k in 0..grid.samples.len() {
            let cell = grid.cell_of(&grid.samples[k].point);
            grid.offer(cell, k as u32);
        }
        // Two rounds of a forward and a backward pass reach every voxel.
        for _ in 0..2 {
            for is_forward in [true, false] {
                grid.sweep(is_forward);
            }
        }
        grid
    }

    /// The samples.
    pub(super) fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// A sample close to `point` (exact to about a voxel).
    pub(super) fn closest(&self, point: &Point) -> &Sample {
        let [x, y, z] = self.cell_of(point);
        let k = self.nearest[self.index(x, y, z)];
        &self.samples[if k == u32::MAX { 0 } else { k as usize }]
    }

    fn cell_of(&self, p: &Point) -> [usize; 3] {
        [0, 1, 2].map(|k| {
            (((p[k] - self.low[k]) / self.cell).floor().max(0.0) as usize).min(self.counts[k] - 1)
        })
    }

    fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    fn offer(&mut self, [x, y, z]: [usize; 3], sample: u32) {
        let center =
            self.low + Vector::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5) * self.cell;
        let index = self.index(x, y, z);
        let held = self.nearest[index];
        if held == sample {
            return;
        }
        let distance = |k: u32| (self.samples[k as usize].point - center).norm_squared();
        if held == u32::MAX || distance(sample) < distance(held) {
            self.nearest[index] = sample;
        }
    }

    fn sweep(&mut self, is_forward: bool) {
        let [nx, ny, nz] = self.counts;
        let order = |n: usize, k: usize| if is_forward { k } else { n - 1 - k };
        let step = |n: usize, k: usize| {
            if is_forward {
                k.checked_sub(1)
            } else {
                (k + 1 < n).then_some(k + 1)
            }
        };
        for kz in 0..nz {
            let z = order(nz, kz);
            for ky in 0..ny {
                let y = order(ny, ky);
                for kx in 0..nx {
                    let x = order(nx, kx);
                    if let Some(z0) = step(nz, z) {
                        self.pass_on([x, y, z0], [x, y, z]);
                    }
                    if let Some(y0) = step(ny, y) {
                        self.pass_on([x, y0, z], [x, y, z]);
                    }
                    if let Some(x0) = step(nx, x) {
                        self.pass_on([x0, y, z], [x, y, z]);
                    }
                }
                for kx in (0..nx).rev() {
                    let x = order(nx, kx);
                    if kx + 1 < nx {
                        self.pass_on([order(nx, kx + 1), y, z], [x, y, z]);
                    }
                }
            }
        }
    }

    fn pass_on(&mut self, [x, y, z]: [usize; 3], to: [usize; 3]) {
        let held = self.nearest[self.index(x, y, z)];
        if held != u32::MAX {
            self.offer(to, held);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_knows_a_sample_that_is_nearly_the_closest() {
        let p = vec![
            Point::new(0., 0., 0.),
            Point::new(10., 0., 2.),
            Point::new(0., 10., -3.),
            Point::new(9., 9., 9.),
        ];
        let samples = sample_surface(&p, &[[0, 1, 2], [1, 3, 2]], 0.5);
        let grid = ClosestGrid::new(samples, 1.0, 4.0);
        for k in 0..500 {
            let k = f64::from(k);
            let q = Point::new(
                5.0 + 8.0 * (k * 0.73).sin(),
                5.0 + 8.0 * (k * 1.31).sin(),
                3.0 + 8.0 * (k * 2.17).sin(),
            );
            let exact = grid
                .samples()
                .iter()
                .map(|s| (s.point - q).norm())
                .fold(f64::INFINITY, f64::min);
            let found = (grid.closest(&q).point - q).norm();
            assert!(found <= exact + 2.0, "{found} {exact}");
        }
    }
}
