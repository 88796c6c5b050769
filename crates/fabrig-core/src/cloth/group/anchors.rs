//! Anchors: nodes that are drawn to places whose motion is known, lane by lane.

use super::state::{Group, relative};
use crate::cloth::constraints::attachment::anchor_pull;
use crate::cloth::input::{ClothPatch, PatchMotion};
use crate::machine::{Real, Vec3};

/// No anchor in this lane.
const NONE: u32 = u32::MAX;

/// One anchor of one node, in every lane that has one there.
#[derive(Debug, Clone)]
pub(super) struct Anchor<R> {
    node: usize,
    /// Index among the anchors of the lane's patch, or [`NONE`].
    indices: Vec<u32>,
    /// k, 0 in lanes without. [mass/s^2]
    pub(super) stiffness: R,
    /// Position at the end of the substep and at the end of the frame. [mm, relative to the
    /// patch's centre]
    now: Vec3<R>,
    end: Vec3<R>,
    /// Hermite segment of the frame: chord, slopes at the start and at the end. (mm)
    segment: [Vec3<R>; 3],
    /// Velocity at the end of the frame. (mm/s)
    velocity: Vec3<R>,
    /// Lanes whose velocity there is known.
    has_velocity: Vec<bool>,
}

/// Anchors of `patches` in lanes, by node; and the sum of their stiffnesses for each node.
pub(super) fn anchors<R: Real>(
    all: &[ClothPatch],
    patches: &[usize],
    rest: &[Vec3<R>],
) -> (Vec<Anchor<R>>, Vec<R>) {
    let mut stiffness_sums = vec![R::splat(0.0); rest.len()];
    // Anchors of each node, the first of every lane, then the second, and so on.
    let mut by_node: Vec<Vec<Anchor<R>>> = vec![Vec::new(); rest.len()];
    for (lane, &patch) in patches.iter().enumerate() {
        let mut index = 0;
        for (nodes, strength) in all[patch].anchor_sets() {
            let stiffness = strength * all[patch].material.stretch_stiffness();
            for &node in nodes {
                let node = node as usize;
                let sum = stiffness_sums[node].lane(lane) + stiffness;
                stiffness_sums[node].set_lane(lane, sum);
                let of_node = &mut by_node[node];
                let place = of_node.iter().position(|a| a.indices[lane] == NONE);
                let place = place.unwrap_or_else(|| {
                    of_node.push(Anchor::unused(node, rest[node]));
                    of_node.len() - 1
                });
                of_node[place].indices[lane] = index;
                of_node[place].stiffness.set_lane(lane, stiffness);
                index += 1;
            }
        }
    }
    (by_node.into_iter().flatten().collect(), stiffness_sums)
}

impl<R: Real> Anchor<R> {
    fn unused(node: usize, rest: Vec3<R>) -> Self {
        Self {
            node,
            indices: vec![NONE; R::LANES],
            stiffness: R::splat(0.0),
            now: rest,
            end: rest,
            segment: [Vec3::zero(); 3],
            velocity: Vec3::zero(),
            has_velocity: vec![false; R::LANES],
        }
    }

    /// Starts a frame of one lane; without motion the anchor stays where it is.
    fn load(&mut self, lane: usize, dt: f64, center: [f64; 3], motion: Option<&PatchMotion>) {
        let had_velocity = std::mem::take(&mut self.has_velocity[lane]);
        let index = self.indices[lane] as usize;
        let start = self.end.lane(lane);
        let Some(motion) = motion else {
            for part in &mut self.segment {
                part.set_lane(lane, [0.0; 3]);
            }
            return;
        };
        // Rounded as the targets are, so that an anchor on its target pulls not at all.
        self.end
            .set_lane(lane, relative(&motion.positions[index], center));
        let end = self.end.lane(lane);
        let chord = [0, 1, 2].map(|axis| end[axis] - start[axis]);
        let old_velocity = self.velocity.lane(lane);
        let velocity = motion.velocities.get(index);
        let slope = |v: Option<[f64; 3]>| v.map_or(chord, |v| v.map(|x| x * dt));
        let slopes = [
            slope(had_velocity.then_some(old_velocity)),
            slope(velocity.map(|v| [0, 1, 2].map(|axis| f64::from(v[axis])))),
        ];
        self.segment[0].set_lane(lane, chord);
        self.segment[1].set_lane(lane, slopes[0]);
        self.segment[2].set_lane(lane, slopes[1]);
        if let Some(v) = velocity {
            self.has_velocity[lane] = true;
            self.velocity
                .set_lane(lane, [0, 1, 2].map(|axis| f64::from(v[axis])));
        }
    }
}

impl<R: Real> Group<R> {
    pub(super) fn load_anchors(&mut self, dt: f64, motions: &[PatchMotion]) {
        for anchor in &mut self.anchors {
            for (lane, &patch) in self.patches.iter().enumerate() {
                if anchor.indices[lane] != NONE {
                    let motion = motions.get(patch).filter(|m| !m.positions.is_empty());
                    anchor.load(lane, dt, self.origin.lane(lane), motion);
                }
            }
        }
    }

    /// Moves the anchors through a substep.
    ///
    /// - `left`: Hermite weights of what is left of the way to the end of the frame, as for the
    ///   targets, so that equal motion is exactly equal
    #[inline(always)]
    pub(super) fn move_anchors(&mut self, [chord, start, end]: [R; 3]) {
        for anchor in &mut self.anchors {
            let [c, a, b] = anchor.segment;
            anchor.now = anchor.end - (c * chord + a * start + b * end);
        }
    }

    /// Draws anchored nodes to their anchors.
    #[inline(always)]
    pub(super) fn pull_to_anchors(&mut self) {
        for k in 0..self.anchors.len() {
            let (node, stiffness) = (self.anchors[k].node, self.anchors[k].stiffness);
            // From x_b, where the rest of the prediction stands.
            let offset = self.anchor_offset(k) - self.past[node];
            let pull = anchor_pull(offset, stiffness, self.h_e);
            let w = self.inv_masses[node];
            self.solution[node] += pull * w;
        }
    }

    /// Goes a share of the way to every anchor, as position-based dynamics does.
    ///
    /// - `share`: of stiffness and mass
    pub(super) fn share_anchors(&mut self, share: impl Fn(f64, f64) -> f64) {
        for k in 0..self.anchors.len() {
            let (node, stiffness) = (self.anchors[k].node, self.anchors[k].stiffness);
            let mut part = R::splat(0.0);
            for lane in 0..R::LANES {
                part.set_lane(lane, share(stiffness.lane(lane), self.mass.lane(lane)));
            }
            let offset = self.anchor_offset(k);
            let u = &mut self.solution[node];
            *u += (offset - *u) * part;
        }
    }

    /// An anchor's offset from its node's target at the end of the substep. (mm)
    #[inline(always)]
    fn anchor_offset(&self, index: usize) -> Vec3<R> {
        let anchor = &self.anchors[index];
        anchor.now - self.targets[anchor.node]
    }

    /// Energy of all anchors at the end of the frame, and what they would have on the target.
    #[inline(always)]
    pub(super) fn anchor_energies(&self) -> [R; 2] {
        let mut sums = [R::splat(0.0); 2];
        for anchor in &self.anchors {
            let half = R::splat(0.5) * anchor.stiffness;
            let away = anchor.end - self.ends[anchor.node];
            let gap = self.displacements[anchor.node] - away;
            sums[0] += half * gap.dot(gap);
            sums[1] += half * away.dot(away);
        }
        sums
    }
}
