//! Contact of a cloth with itself and with the world, as a hook of its substeps.

use nalgebra::{Isometry3, Point3};

use super::collect::Workbench;
use super::detect::{PairList, Watch};
use super::mesh::Part;
use super::project::{Active, SmoothContact};
use super::rules::Rules;
use super::sticky::{Bond, Lip};
use super::tile::{Extent, Tiles, Way};
use super::tile_shape::TileShape;
use super::world::WorldCollider;
use super::zones::Zones;
use super::{
    Collider, CollisionError, ContactOptions, ContactPoint, ContactReport, PairMask, StarSurface,
};
use crate::anatomy::GridShape;
use crate::cloth::{HookSubstep, MovedNode, SubstepHook};

/// Furthest that a node or a collider goes in one pass. (mm)
pub(super) const PASS_LENGTH: f64 = 1.0;
/// A collider that goes further in a frame did not move there: it was put there. (mm)
const CUT: f64 = 500.0;
/// Most passes of a substep; faster things are cut short, and counted as held.
const MOST_PASSES: usize = 256;

/// A patch as contact sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPatch {
    /// Its grid.
    pub shape: GridShape,
    /// Nodes at rest. [mm, head frame]
    pub rest: Vec<Point3<f32>>,
    /// How much tissue covers each node: how near a collider may come. (mm)
    pub cover: Vec<f32>,
    /// Patches that it is attached to.
    pub attached_to: Vec<usize>,
    /// Whether it is a ring around an opening.
    pub is_ring: bool,
    /// Whether its margin is that of the lips, which may stick.
    pub is_mouth: bool,
    /// Mass of a node. (g)
    pub node_mass: f64,
    /// Smooth built-in bodies ([`ContactBody`]) that hold it out, by index.
    pub bodies: Vec<usize>,
}

/// A rigid body of the face itself that holds patches out: an eyeball, teeth and gums.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactBody {
    /// Its surface about its centre.
    pub surface: StarSurface,
    /// Coulomb's friction coefficient.
    pub friction: f64,
    /// Its pose at rest. [mm, head frame]
    pub rest: Isometry3<f64>,
}

/// Contact of one cloth.
///
/// # Limitations
///
/// - Contact is rigid: no restitution, no rolling friction.
/// - Round colliders hold nodes out of their round surface, and cells out of a mesh of twenty
///   divisions inside it.
/// - Between two colliders that meet, something must give: pairs caught there are counted as
///   pinched.
#[derive(Debug)]
pub struct Contact {
    pub(super) options: ContactOptions,
    /// Patch of the cloth of each part that is one.
    pub(super) patches: Vec<usize>,
    pub(super) parts: Vec<Part>,
    pub(super) rules: Rules,
    pub(super) cloth_count: usize,
    pub(super) rest: Vec<Point3<f32>>,
    pub(super) cover: Vec<f32>,
    pub(super) node_mass: Vec<f64>,
    /// Rows of the mouth's ring that may stick: part and first node past them.
    pub(super) sticky: Option<(usize, u32)>,
    /// For nodes of these rows their lip, and whether their skin touches the other.
    pub(super) lip_of: Vec<Lip>,
    pub(super) touching: Vec<Option<Lip>>,
    pub(super) positions: Vec<Point3<f32>>,
    pub(super) wanted: Vec<Point3<f32>>,
    pub(super) reference: Vec<Point3<f32>>,
    pub(super) part_of: Vec<u32>,
    /// Parts that are patches; the others are colliders.
    pub(super) cloth_parts: usize,
    /// Largest cover of each part. (mm)
    pub(super) thickest_cover: Vec<f32>,
    pub(super) tiles: Tiles,
    /// How tiles lie, as of the passes in which that was asked, and the pass that this is.
    pub(super) shapes: Vec<TileShape>,
    pub(super) moment: u64,
    pub(super) workbench: Workbench,
    pub(super) watch: Watch,
    /// Tiles in which something is pushed in this pass, and whether there are any.
    pub(super) is_pushed: Vec<bool>,
    pub(super) is_any_pushed: bool,
    /// Collections of actives until now, and how many there were when something in each tile was
    /// pushed last.
    pub(super) collection: u64,
    pub(super) changed: Vec<u64>,
    /// Nodes that were moved from where they were wanted in this substep.
    pub(super) altered: Vec<u32>,
    /// How many of them the ways of tiles have been told of in this pass.
    pub(super) followed: usize,
    /// Nodes that go together in this pass.
    pub(super) zones: Zones,
    /// The pass in which each node was touched last.
    pub(super) touched: Vec<u64>,
    pub(super) lists: Vec<PairList>,
    /// Bodies of the face, then colliders.
    pub(super) world: Vec<WorldCollider>,
    pub(super) body_count: usize,
    pub(super) actives: Vec<Active>,
    pub(super) smooth: Vec<SmoothContact>,
    pub(super) bonds: Vec<Bond>,
    pub(super) was_touched: Vec<bool>,
    pub(super) is_touched: Vec<bool>,
    pub(super) carried_by: Vec<u32>,
    pub(super) has_carried: bool,
    pub(super) moved: Vec<MovedNode>,
    /// Where everything was before a substep of several passes. (mm)
    pub(super) departed: Vec<Point3<f32>>,
    pub(super) stopped: Vec<bool>,
    pub(super) points: Vec<ContactPoint>,
    pub(super) report: ContactReport,
}

impl Contact {
    /// Contact among `patches` (those of a cloth, all of them) and with bodies and colliders.
    ///
    /// # Errors
    ///
    /// [`CollisionError`] for options out of range and colliders that cannot be.
    pub fn new(
        patches: &[ContactPatch],
        bodies: &[ContactBody],
        colliders: &[Collider],
        options: &ContactOptions,
    ) -> Result<Self, CollisionError> {
        options.check()?;
        let all = options.pairs == PairMask::All || !colliders.is_empty();
        let seen: Vec<usize> = (0..patches.len())
            .filter(|&p| all || (patches[p].is_ring && options.pairs != PairMask::None))
            .collect();
        let mut index_of = vec![None; patches.len()];
        let mut parts = Vec::new();
        let (mut rest, mut cover, mut node_mass) = (Vec::new(), Vec::new(), Vec::new());
        let mut sticky = None;
        for (index, &p) in seen.iter().enumerate() {
            let patch = &patches[p];
            index_of[p] = Some(index);
            let first = rest.len() as u32;
            if let (true, Some(s)) = (patch.is_mouth, &options.sticky_lips) {
                let rows = s.rows.min(patch.shape.v_count);
                sticky = Some((index, first + rows * patch.shape.u_count));
            }
            parts.push(Part::of_grid(patch.shape, first));
            rest.extend_from_slice(&patch.rest);
            cover.extend_from_slice(&patch.cover);
            node_mass.extend(std::iter::repeat_n(patch.node_mass, patch.rest.len()));
        }
        let of_parts: Vec<&ContactPatch> = seen.iter().map(|&p| &patches[p]).collect();
        let rules = Rules::new(options.pairs, &of_parts, &parts, &rest, &index_of);
        let cloth_count = rest.len();
        let mut lists: Vec<PairList> = rules
            .parts
            .iter()
            .map(|&[a, b]| PairList::new(a, b, options.friction, None))
            .collect();
        let mut world = Vec::new();
        let own = if options.bones { bodies } else { &[] };
        for (index, body) in own.iter().enumerate() {
            let holds = |part: usize| patches[seen[part]].bodies.contains(&index);
            let held: Vec<usize> = (0..parts.len()).filter(|&p| holds(p)).collect();
            let mut c = WorldCollider::of_body(body, held);
            c.keep_rest_gaps(&parts, &rest, options.thickness);
            world.push(c);
        }
        let body_count = world.len();
        for (index, collider) in colliders.iter().enumerate() {
            let held = (0..parts.len()).collect();
            world.push(WorldCollider::new(collider, index, held)?);
        }
        let cloth_parts = parts.len();
        for (index, collider) in world.iter_mut().enumerate() {
            // The face's own bodies are larger than cells and have no mesh, nor have planes.
            if collider.shape.mesh.1.is_empty() {
                continue;
            }
            let (vertices, triangles) = &collider.shape.mesh;
            let first = rest.len() as u32;
            collider.part = Some(parts.len());
            for &held in &collider.held {
                lists.push(PairList::new(
                    held,
                    parts.len(),
                    collider.friction,
                    Some(index),
                ));
            }
            parts.push(Part::of_mesh(vertices.len(), triangles, first));
            rest.extend(vertices.iter().map(|p| p.cast::<f32>()));
            cover.extend(std::iter::repeat_n(0.0, vertices.len()));
        }
        let count = rest.len();
        let mut part_of = vec![0; count];
        for (index, part) in parts.iter().enumerate() {
            part_of[part.first as usize..(part.first + part.count) as usize].fill(index as u32);
        }
        let tiles = Tiles::new(&parts, &rest);
        for collider in &mut world {
            collider.watch_tiles(&tiles, &parts);
        }
        let thickest_cover = parts.iter().map(|part: &Part| {
            let own = &cover[part.first as usize..(part.first + part.count) as usize];
            own.iter().fold(0.0, |m: f32, &c| m.max(c))
        });
        let forces = vec![crate::Vector::zeros(); colliders.len()];
        Ok(Self {
            options: *options,
            patches: seen,
            rules,
            cloth_count,
            positions: rest.clone(),
            wanted: rest.clone(),
            reference: rest.clone(),
            part_of,
            cloth_parts,
            thickest_cover: thickest_cover.collect(),
            watch: Watch::new(tiles.len(), parts.len()),
            is_pushed: vec![false; tiles.len()],
            is_any_pushed: false,
            collection: 0,
            changed: vec![0; tiles.len()],
            altered: Vec::new(),
            followed: 0,
            zones: Zones::default(),
            touched: vec![0; rest.len()],
            shapes: vec![TileShape::UNKNOWN; tiles.len()],
            moment: 0,
            workbench: Workbench::default(),
            tiles,
            stopped: vec![false; cloth_parts],
            parts,
            rest,
            cover,
            node_mass,
            sticky,
            lip_of: Vec::new(),
            touching: Vec::new(),
            lists,
            world,
            body_count,
            actives: Vec::new(),
            smooth: Vec::new(),
            bonds: Vec::new(),
            was_touched: vec![false; cloth_count],
            is_touched: vec![false; cloth_count],
            carried_by: vec![u32::MAX; cloth_count],
            has_carried: false,
            moved: Vec::new(),
            departed: Vec::new(),
            points: Vec::new(),
            report: ContactReport {
                forces,
                ..ContactReport::default()
            },
        })
    }

    /// Forgets what was known of parts that were put elsewhere.
    pub(super) fn forget(&mut self, is_moved: impl Fn(Option<usize>) -> bool) {
        self.watch.is_stale = true;
        let lists = self.lists.iter_mut();
        for list in lists.filter(|list| is_moved(list.collider)) {
            list.pairs.clear();
            list.look_again();
        }
        for (index, collider) in self.world.iter_mut().enumerate() {
            if is_moved(Some(index)) {
                collider.free.fill(f64::NEG_INFINITY);
            }
        }
    }

    /// Whether there is anything that could touch.
    pub fn is_idle(&self) -> bool {
        self.lists.is_empty() && self.world.is_empty()
    }

    /// Says where bodies and colliders will be at the end of the next frame.
    ///
    /// - `bodies`, `colliders`: poses in the head frame, one each (mm)
    pub fn begin_frame(&mut self, bodies: &[Isometry3<f64>], colliders: &[Isometry3<f64>]) {
        let poses = bodies.iter().take(self.body_count).chain(colliders);
        let mut cut = Vec::new();
        for (index, (collider, pose)) in self.world.iter_mut().zip(poses).enumerate() {
            collider.start = collider.pose;
            collider.end = *pose;
            if index >= self.body_count && collider.way([0.0, 1.0]) > CUT {
                cut.push(index);
            }
        }
        let started = (self.report.started_inside, self.report.started_depth);
        self.report = ContactReport {
            forces: std::mem::take(&mut self.report.forces),
            started_inside: started.0,
            started_depth: started.1,
            ..ContactReport::default()
        };
        if !cut.is_empty() {
            let goal = self.positions[..self.cloth_count].to_vec();
            self.bring_in_colliders(&cut, &goal);
        }
    }

    /// What was done in the last frame.
    pub fn report(&self) -> &ContactReport {
        &self.report
    }

    /// Where things touched at the end of the last frame.
    pub fn points(&self) -> &[ContactPoint] {
        &self.points
    }

    /// Moves everything from where it is to where it is wanted, in passes short enough that
    /// nothing is overlooked.
    fn walk(&mut self, goal: &[Point3<f32>], progress: [f64; 2], force_per_shift: f64) -> usize {
        let furthest = self.longest_way(goal, progress);
        let passes = ((furthest / PASS_LENGTH).ceil() as usize).clamp(1, MOST_PASSES);
        self.departed.clear();
        if passes > 1 {
            self.departed
                .extend_from_slice(&self.positions[..self.cloth_count]);
        }
        self.points.clear();
        for f in &mut self.report.forces {
            *f = crate::Vector::zeros();
        }
        self.is_touched.fill(false);
        for pass in 0..passes {
            if passes > 1 {
                // What parts go is measured for the substep, not for each pass.
                self.lists.iter_mut().for_each(PairList::look_again);
            }
            let left = (passes - pass) as f64;
            let share = 1.0 / left;
            if passes == 1 {
                self.wanted[..self.cloth_count].copy_from_slice(goal);
            } else {
                for ((w, x), g) in self.wanted.iter_mut().zip(&self.positions).zip(goal) {
                    let way = g - x;
                    let length = f64::from(way.norm()) * share;
                    // Nodes that were held up come after, but no faster than the pass allows.
                    let s = share * (PASS_LENGTH / length.max(PASS_LENGTH));
                    *w = x + way * s as f32;
                }
            }
            let s = progress[0] + (progress[1] - progress[0]) * (pass + 1) as f64 / passes as f64;
            self.place_colliders(s);
            for bond in &mut self.bonds {
                bond.pull = 0.0;
            }
            self.pass(force_per_shift, passes);
        }
        passes
    }

    /// The longest way of anything in a substep (mm); marks the colliders that are away.
    fn longest_way(&mut self, goal: &[Point3<f32>], progress: [f64; 2]) -> f64 {
        let mut furthest = 0.0_f64;
        for (part, step) in self.parts[..self.cloth_parts]
            .iter()
            .zip(&mut self.watch.steps)
        {
            let range = part.first as usize..(part.first + part.count) as usize;
            let (goal, from) = (&goal[range.clone()], &self.positions[range]);
            *step = Way::of(&Extent::of_ways(from, goal));
            let mut way = f64::from(step.longest());
            if way > PASS_LENGTH {
                way = longest(goal, from);
            }
            furthest = furthest.max(way);
        }
        for index in 0..self.world.len() {
            let c = &self.world[index];
            // The face's own bodies are always there.
            let may_leave = index >= self.body_count && c.shape.radius.is_finite();
            let is_away = may_leave && !self.may_meet(c, progress);
            if !is_away {
                furthest = furthest.max(c.way(progress));
            }
            let was_away = std::mem::replace(&mut self.world[index].is_away, is_away);
            self.watch.is_stale |= was_away != is_away;
        }
        furthest
    }

    /// One substep of contact; leaves where everything is in `positions`.
    pub(super) fn resolve(
        &mut self,
        goal: &[Point3<f32>],
        progress: [f64; 2],
        force_per_shift: f64,
    ) {
        std::mem::swap(&mut self.was_touched, &mut self.is_touched);
        self.altered.clear();
        let passes = self.walk(goal, progress, force_per_shift);
        self.moved.clear();
        // A pass leaves in `wanted` where it began.
        let departed = if passes == 1 {
            &self.wanted
        } else {
            &self.departed
        };
        let moved = |node: u32| {
            let i = node as usize;
            let (from, to) = (departed[i], self.positions[i]);
            (to != goal[i]).then_some(MovedNode { node, from, to })
        };
        if passes == 1 {
            self.altered.sort_unstable();
            self.altered.dedup();
            self.moved
                .extend(self.altered.iter().copied().filter_map(moved));
        } else {
            self.moved.extend((0..goal.len() as u32).filter_map(moved));
        }
        self.report.contacts = self.points.len();
        if progress[1] >= 1.0 {
            let pairs = self.lists.iter().flat_map(|list| &list.pairs);
            self.report.candidates = pairs.map(|pair| pair.near.candidates.len()).sum();
        }
    }
}

impl SubstepHook for Contact {
    fn patches(&self) -> &[usize] {
        &self.patches
    }

    fn reset(&mut self, wanted: &mut [Point3<f32>]) {
        let count = self.cloth_count;
        self.positions[..count].copy_from_slice(&self.rest[..count]);
        self.forget(|_| true);
        self.bonds.clear();
        let goal = wanted.to_vec();
        // First without the world, from rest, where nothing crosses; then the world comes in
        // from outside.
        let mut aside = std::mem::take(&mut self.world);
        let colliders = aside.split_off(self.body_count);
        self.world = aside;
        let lists = std::mem::take(&mut self.lists);
        let (own, outer): (Vec<_>, Vec<_>) = lists.into_iter().partition(|l| l.collider.is_none());
        self.lists = own;
        for body in &mut self.world {
            body.start = body.end;
            body.pose = body.end;
        }
        self.resolve(&goal, [0.0, 1.0], 0.0);
        self.lists.extend(outer);
        self.world.extend(colliders);
        self.watch.is_stale = true;
        let all: Vec<usize> = (self.body_count..self.world.len()).collect();
        self.bring_in_colliders(&all, &goal);
        self.resolve(&goal, [1.0, 1.0], 0.0);
        self.report.held = 0;
        wanted.copy_from_slice(&self.positions[..count]);
        self.stopped.fill(true);
    }

    fn correct(&mut self, substep: &HookSubstep, nodes: &[Point3<f32>]) {
        // A shift of a node of mass 1 g by 1 mm takes this force. (N)
        let force_per_shift = substep.effective_mass / (substep.h_e * substep.h_e) * 1e-6;
        self.stopped.fill(false);
        self.resolve(nodes, substep.progress, force_per_shift);
        if substep.progress[1] >= 1.0 {
            self.drop_broken();
        }
    }

    fn stride(&self) -> u32 {
        self.options.every
    }

    fn moved(&self) -> &[MovedNode] {
        &self.moved
    }

    fn stopped(&self) -> &[bool] {
        &self.stopped
    }
}

/// The longest way from `from` to `to`. (mm)
fn longest(to: &[Point3<f32>], from: &[Point3<f32>]) -> f64 {
    let squares = to.iter().zip(from).map(|(a, b)| (a - b).norm_squared());
    f64::from(squares.fold(0.0, f32::max)).sqrt()
}
