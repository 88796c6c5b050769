//! Bodies and colliders on their way, and how they come in.

use nalgebra::{Isometry3, Point3, Translation3};

use super::cloth_shape::WorldShape;
use super::collider::between;
use super::contact::{Contact, ContactBody, PASS_LENGTH};
use super::mesh::Part;
use super::tile::Tiles;
use super::{Collider, CollisionError};
use crate::{Point, Vector};

/// A collider and where it is.
#[derive(Debug)]
pub(super) struct WorldCollider {
    pub(super) shape: WorldShape,
    pub(super) friction: f64,
    /// Parts that it holds out.
    pub(super) held: Vec<usize>,
    /// Its own part, if it has a mesh.
    pub(super) part: Option<usize>,
    /// Whether it cannot meet anything in this substep.
    pub(super) is_away: bool,
    /// For each node of the held parts, one after the other, the distance it must keep (mm);
    /// empty: what covers the node.
    pub(super) gaps: Vec<f32>,
    /// For each tile of the held parts how far it and this may go before it can touch, against
    /// [`Self::gone`]. (mm)
    pub(super) free: Vec<f64>,
    /// The tiles, and the first gap of each one's part less the part's first node.
    pub(super) watched: Vec<(u32, i64)>,
    /// How far any of its points has gone since the start, at most. (mm)
    pub(super) gone: f64,
    /// Pose that the cloth has seen, and before the pass. [mm, head frame]
    pub(super) pose: Isometry3<f64>,
    pub(super) pose_before: Isometry3<f64>,
    /// Poses at the ends of the frame.
    pub(super) start: Isometry3<f64>,
    pub(super) end: Isometry3<f64>,
}

impl WorldCollider {
    pub(super) fn new(
        collider: &Collider,
        index: usize,
        held: Vec<usize>,
    ) -> Result<Self, CollisionError> {
        collider.check(index)?;
        let shape = WorldShape::new(&collider.shape, index, &collider.name)?;
        let pose = collider.pose_at(f64::NEG_INFINITY);
        Ok(Self::placed(shape, collider.friction, pose, held))
    }

    pub(super) fn of_body(body: &ContactBody, held: Vec<usize>) -> Self {
        let shape = WorldShape::of_star(body.surface.clone());
        Self::placed(shape, body.friction, body.rest, held)
    }

    fn placed(shape: WorldShape, friction: f64, pose: Isometry3<f64>, held: Vec<usize>) -> Self {
        Self {
            shape,
            friction,
            held,
            part: None,
            is_away: false,
            gaps: Vec::new(),
            free: Vec::new(),
            watched: Vec::new(),
            gone: 0.0,
            pose,
            pose_before: pose,
            start: pose,
            end: pose,
        }
    }

    /// Keeps nodes as far away as they are at rest, but no further than `thickness` asks. (mm)
    pub(super) fn keep_rest_gaps(&mut self, parts: &[Part], rest: &[Point3<f32>], thickness: f64) {
        for &part in &self.held {
            let first = parts[part].first as usize;
            for p in &rest[first..first + parts[part].count as usize] {
                let local = self.pose.inverse() * p.cast::<f64>();
                let distance = self.shape.nearest(&local.coords).distance;
                // A little less, so that rest itself is free of contact.
                self.gaps.push((distance - 0.02).min(thickness) as f32);
            }
        }
    }

    /// Takes the tiles of the parts that it holds out, if it does so node by node.
    pub(super) fn watch_tiles(&mut self, tiles: &Tiles, parts: &[Part]) {
        if !self.shape.is_round {
            return;
        }
        let mut gaps = 0;
        for &held in &self.held {
            let part = &parts[held];
            let first = gaps - i64::from(part.first);
            let own = tiles.of_part[held].clone();
            self.watched.extend(own.map(|t| (t as u32, first)));
            gaps += i64::from(part.count);
        }
        self.free = vec![f64::NEG_INFINITY; self.watched.len()];
    }

    fn at(&self, s: f64) -> Isometry3<f64> {
        if self.start == self.end {
            return self.end;
        }
        between(&self.start, &self.end, s)
    }

    /// How far any of its points goes between two times of the frame, at most. (mm)
    pub(super) fn way(&self, progress: [f64; 2]) -> f64 {
        let (a, b) = (self.pose, self.at(progress[1]));
        let turn = (b.rotation * a.rotation.inverse()).angle();
        let reach = if self.shape.radius.is_finite() {
            self.shape.radius
        } else {
            100.0
        };
        (b.translation.vector - a.translation.vector).norm() + turn * reach
    }
}

impl Contact {
    /// Whether a collider comes near any node between two times of the frame.
    pub(super) fn may_meet(&self, c: &WorldCollider, progress: [f64; 2]) -> bool {
        let Some((low, high)) = self.cloth_bounds() else {
            return false;
        };
        let (a, b) = (
            c.pose.translation.vector,
            c.at(progress[1]).translation.vector,
        );
        let reach = c.shape.radius + 20.0;
        (0..3).all(|k| {
            a[k].min(b[k]) - reach <= f64::from(high[k])
                && f64::from(low[k]) <= a[k].max(b[k]) + reach
        })
    }

    /// Box of all patches as they were last looked at.
    fn cloth_bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let mut nodes = self.positions[..self.cloth_count].iter();
        let first = nodes.next()?;
        let (mut low, mut high) = (*first, *first);
        // Every seventh node will do: the caller adds more than a few cells.
        for p in nodes.step_by(7) {
            low = low.inf(p);
            high = high.sup(p);
        }
        Some((low.coords.into(), high.coords.into()))
    }

    /// Puts colliders where they are at a time of the frame, as wanted.
    pub(super) fn place_colliders(&mut self, s: f64) {
        for c in &mut self.world {
            c.gone += c.way([s, s]);
            c.pose_before = c.pose;
            c.pose = c.at(s);
            let Some(part) = c.part else {
                continue;
            };
            let first = self.parts[part].first as usize;
            for (k, p) in c.shape.mesh.0.iter().enumerate() {
                self.wanted[first + k] = (c.pose * p).cast();
                if c.is_away {
                    self.positions[first + k] = self.wanted[first + k];
                }
            }
        }
    }

    /// Brings colliders from outside to where they start, pushing what is in the way, and
    /// notes how many nodes stood inside.
    pub(super) fn bring_in_colliders(&mut self, which: &[usize], goal: &[Point3<f32>]) {
        self.report.started_inside = 0;
        self.report.started_depth = 0.0;
        let Some((low, high)) = self.cloth_bounds() else {
            return;
        };
        let (low, high) = (
            Vector::from(low.map(f64::from)),
            Vector::from(high.map(f64::from)),
        );
        let center = (low + high) * 0.5;
        let size = (high - low).norm() * 0.5;
        let ways: Vec<[Isometry3<f64>; 2]> = self.world.iter().map(|c| [c.start, c.end]).collect();
        for c in &mut self.world {
            (c.start, c.end) = (c.pose, c.pose);
        }
        for &index in which {
            self.note_inside(index, &ways[index][1], goal);
            let outside = outside(&self.world[index].shape, &ways[index][1], &center, size);
            let c = &mut self.world[index];
            (c.start, c.end, c.pose) = (outside, outside, outside);
            if let Some(part) = c.part {
                let first = self.parts[part].first as usize;
                for (k, p) in c.shape.mesh.0.iter().enumerate() {
                    self.positions[first + k] = (outside * p).cast();
                    self.wanted[first + k] = self.positions[first + k];
                }
            }
        }
        self.forget(|collider| collider.is_some_and(|c| which.contains(&c)));
        for &index in which {
            self.world[index].end = ways[index][1];
            let way = self.world[index].way([0.0, 1.0]);
            let steps = (way / (64.0 * PASS_LENGTH)).ceil().max(1.0) as usize;
            for step in 0..steps {
                let progress = [step, step + 1].map(|i| i as f64 / steps as f64);
                self.resolve(goal, progress, 0.0);
            }
            self.world[index].start = ways[index][1];
        }
        for (index, (c, [start, end])) in self.world.iter_mut().zip(ways).enumerate() {
            if !which.contains(&index) {
                (c.start, c.end) = (start, end);
            }
        }
    }

    /// Counts the nodes that a collider at a pose would have inside.
    fn note_inside(&mut self, index: usize, pose: &Isometry3<f64>, goal: &[Point3<f32>]) {
        let shape = &self.world[index].shape;
        let (mut inside, mut deepest) = (0, 0.0_f64);
        for p in goal {
            let local = pose.inverse() * p.cast::<f64>();
            let distance = shape.nearest(&local.coords).distance;
            if distance < 0.0 {
                inside += 1;
                deepest = deepest.max(-distance);
            }
        }
        self.report.started_inside += inside;
        self.report.started_depth = self.report.started_depth.max(deepest);
    }
}

/// A pose from which a collider comes in without having touched anything.
fn outside(shape: &WorldShape, end: &Isometry3<f64>, center: &Vector, size: f64) -> Isometry3<f64> {
    let out = if shape.radius.is_finite() {
        let away = end.translation.vector - center;
        let direction = away.try_normalize(1e-9).unwrap_or_else(Vector::z);
        let far = size + shape.radius + 20.0;
        direction * (far - away.norm()).max(0.0)
    } else {
        end.rotation * Vector::y() * -(2.0 * size + 20.0)
    };
    Isometry3::from_parts(
        Translation3::from(end.translation.vector + out),
        end.rotation,
    )
}

/// Corners of the mesh of a collider at a pose, for showing and judging. [mm, head frame]
///
/// # Errors
///
/// [`CollisionError`] for a collider that cannot be.
pub fn collider_mesh(
    collider: &Collider,
    index: usize,
) -> Result<(Vec<Point>, Vec<[u32; 3]>), CollisionError> {
    collider.check(index)?;
    Ok(WorldShape::new(&collider.shape, index, &collider.name)?.shown_mesh())
}
