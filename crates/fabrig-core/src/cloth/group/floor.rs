//! Floors: what lies under the pads of a group, whose volume is counted from there.

use super::interface::GroupFloor;
use super::ports::Ports;
use super::state::Group;
use crate::cloth::constraints::pressure::{PadFaces, pad_volume};
use crate::cloth::input::PatchMotion;
use crate::machine::{Real, Vec3};

/// The floor of the pads of a group.
#[derive(Debug, Clone)]
pub(super) struct Floor<R> {
    nodes: GroupFloor,
    /// The same in the order of memory: node, lane and the port of what lies under it.
    under: Vec<[u32; 3]>,
    /// From the targets of the floor to those of the pads at the start and the end of the frame,
    /// one per node; zero over nothing. (mm)
    spans: [Vec<Vec3<R>>; 2],
    /// Volume between the targets then. [mm^3]
    volumes: [R; 2],
    /// From the floor, where it is in this substep, to the targets of the pads. (mm)
    pub(super) heights: Vec<Vec3<R>>,
    /// Volume between the targets in this substep. [mm^3]
    pub(super) rest: R,
}

impl<R: Real> Floor<R> {
    /// No floor, for pads of `node_count` nodes.
    pub(super) fn none(node_count: usize) -> Self {
        let zero = vec![Vec3::zero(); node_count];
        Self {
            nodes: GroupFloor::default(),
            under: Vec::new(),
            spans: [zero.clone(), zero.clone()],
            volumes: [R::splat(0.0); 2],
            heights: zero,
            rest: R::splat(0.0),
        }
    }

    pub(super) fn set(&mut self, nodes: GroupFloor) {
        let under = nodes.iter().map(|n| [n.node, n.lane, n.port]);
        self.under = under.collect();
        self.under.sort_unstable();
        self.nodes = nodes;
    }

    /// Takes the targets at the end of a frame.
    pub(super) fn load(&mut self, patches: &[usize], targets: &[PatchMotion]) {
        let [start, end] = &mut self.spans;
        start.copy_from_slice(end);
        for under in &self.nodes {
            let pad = &targets[patches[under.lane as usize]].positions[under.over as usize];
            let floor = &targets[under.patch].positions[under.patch_node as usize];
            let span = [0, 1, 2].map(|axis| f64::from(pad[axis]) - f64::from(floor[axis]));
            end[under.node as usize].set_lane(under.lane as usize, span);
        }
    }

    /// Starts a frame at whose end the targets of the pads are at `ends`.
    ///
    /// - `gradient`: room for one vector per node
    #[inline(always)]
    pub(super) fn begin_frame(
        &mut self,
        cells: &[[u32; 4]],
        ends: &[Vec3<R>],
        gradient: &mut [Vec3<R>],
    ) {
        self.heights.fill(Vec3::zero());
        let faces = PadFaces {
            cells,
            targets: ends,
            heights: &self.spans[1],
        };
        let volume = pad_volume(&faces, &self.heights, gradient);
        self.volumes = [self.volumes[1], volume];
        self.heights.copy_from_slice(&self.spans[1]);
        self.rest = volume;
    }

    /// Forgets motion: from now on the floor is where it is at the end of the frame.
    pub(super) fn hold(&mut self) {
        let [start, end] = &mut self.spans;
        start.copy_from_slice(end);
        self.volumes[0] = self.volumes[1];
    }
}

impl<R: Real> Group<R> {
    /// Puts the floor where the ports say that it is.
    ///
    /// - `progress`: how far through the frame, 0 to 1
    #[inline(always)]
    pub(super) fn place_floor(&mut self, progress: f64, ports: &Ports) {
        let floor = &mut self.floor;
        if floor.under.is_empty() {
            return;
        }
        let progress = R::splat(progress);
        let [start, end] = &floor.spans;
        for ((height, start), end) in floor.heights.iter_mut().zip(start).zip(end) {
            *height = *start + (*end - *start) * progress;
        }
        floor.rest = floor.volumes[0] + (floor.volumes[1] - floor.volumes[0]) * progress;
        for &[node, lane, port] in &floor.under {
            let [x, y, z, _] = ports.displacements[port as usize];
            let (height, lane) = (&mut floor.heights[node as usize], lane as usize);
            height.x.set_lane(lane, height.x.lane(lane) - x);
            height.y.set_lane(lane, height.y.lane(lane) - y);
            height.z.set_lane(lane, height.z.lane(lane) - z);
        }
    }
}
