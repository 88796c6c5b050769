//! Substeps with a hook between constraints and new state.

use nalgebra::Point3;
use rayon::prelude::*;

use super::assembly::PatchLayout;
use super::group::{PatchGroup, Ports, Substep};
use super::hook::{HookSubstep, SubstepHook};

/// Where the nodes that a hook sees come from.
pub(super) struct SeenNodes {
    patches: Vec<PatchLayout>,
    /// First node of each patch, and the end.
    starts: Vec<usize>,
}

impl SeenNodes {
    pub(super) fn new(patches: &[usize], layout: &[PatchLayout]) -> Self {
        let patches: Vec<PatchLayout> = patches.iter().map(|&p| layout[p]).collect();
        let mut starts = vec![0];
        for at in &patches {
            starts.push(starts[starts.len() - 1] + at.node_count);
        }
        Self { patches, starts }
    }

    /// Calls `work` with layout, node and index of each of the nodes in `moved`.
    pub(super) fn for_each(
        &self,
        moved: &[(u32, Point3<f32>)],
        mut work: impl FnMut(&PatchLayout, usize, usize),
    ) {
        for (index, _) in moved {
            let index = *index as usize;
            let patch = self.starts.partition_point(|&s| s <= index) - 1;
            work(&self.patches[patch], index - self.starts[patch], index);
        }
    }

    fn gather(&self, groups: &[Box<dyn PatchGroup>], nodes: &mut [Point3<f32>]) {
        for (at, start) in self.patches.iter().zip(&self.starts) {
            groups[at.group].write_solution(at.lane, &mut nodes[*start..*start + at.node_count]);
        }
    }
}

/// Runs all substeps of a frame, with `hook` moving nodes in each.
pub(super) fn advance_hooked(
    groups: &mut [Box<dyn PatchGroup>],
    ports: &mut [Vec<Ports>; 2],
    substeps: &[Substep],
    layout: &[PatchLayout],
    hook: &mut dyn SubstepHook,
) {
    let [now, next] = ports;
    let Some(first) = substeps.first() else {
        return;
    };
    let seen = SeenNodes::new(hook.patches(), layout);
    let count = seen.starts[seen.patches.len()];
    let mut nodes = vec![Point3::origin(); count];
    let mut squared = vec![0.0; seen.patches.len()];
    let mut is_seen = vec![false; groups.len()];
    seen.patches.iter().for_each(|at| is_seen[at.group] = true);
    groups
        .par_iter_mut()
        .zip(now.par_iter_mut())
        .zip(&is_seen)
        .for_each(|((g, p), is_seen)| {
            g.set_hooked(*is_seen);
            g.predict(first, p);
        });
    for (k, substep) in substeps.iter().enumerate() {
        let shared: &[Ports] = now;
        groups
            .par_iter_mut()
            .zip(&is_seen)
            .for_each(|(g, is_seen)| {
                g.solve(substep, shared);
                if *is_seen {
                    g.hold_back();
                }
            });
        if !seen.patches.is_empty() {
            seen.gather(groups, &mut nodes);
            let at = &seen.patches[0];
            let [h_e, effective_mass] = groups[at.group].effective_step(at.lane);
            let of_hook = HookSubstep {
                progress: substep.progress,
                h: substep.h,
                h_e,
                effective_mass,
            };
            hook.correct(&of_hook, &nodes);
            squared.fill(0.0);
            for (index, to) in hook.moved() {
                let i = *index as usize;
                let patch = seen.starts.partition_point(|&s| s <= i) - 1;
                let from = nodes[i];
                let by = [0, 1, 2].map(|axis| f64::from(to[axis]) - f64::from(from[axis]));
                squared[patch] += by.iter().map(|x| x * x).sum::<f64>();
                let at = &seen.patches[patch];
                groups[at.group].shift(at.lane, i - seen.starts[patch], by);
            }
            for ((at, &squared), &stopped) in seen.patches.iter().zip(&squared).zip(hook.stopped())
            {
                if squared > 0.0 || stopped {
                    groups[at.group].note_shifts(at.lane, squared, stopped);
                }
            }
        }
        let following = substeps.get(k + 1);
        groups
            .par_iter_mut()
            .zip(next.par_iter_mut())
            .for_each(|(g, p)| match following {
                Some(following) => g.turn(following, p),
                None => g.finish(),
            });
        std::mem::swap(now, next);
    }
    groups.iter_mut().for_each(|g| g.set_hooked(false));
}
