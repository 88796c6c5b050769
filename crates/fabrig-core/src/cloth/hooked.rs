//! Substeps with a hook between constraints and new state.

use nalgebra::Point3;
use rayon::prelude::*;

use super::assembly::PatchLayout;
use super::group::{PatchGroup, Ports, Span, Substep, each_group};
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

    /// The patch of a node, and the node's index there.
    pub(super) fn place_of(&self, node: u32) -> (&PatchLayout, usize) {
        let index = node as usize;
        let patch = self.patch_of(index);
        (&self.patches[patch], index - self.starts[patch])
    }

    fn patch_of(&self, index: usize) -> usize {
        self.starts.partition_point(|&s| s <= index) - 1
    }

    fn gather(&self, groups: &[Box<dyn PatchGroup>], nodes: &mut [Point3<f32>]) {
        for (at, start) in self.patches.iter().zip(&self.starts) {
            groups[at.group].write_solution(at.lane, &mut nodes[*start..*start + at.node_count]);
        }
    }
}

/// Runs all substeps of a frame, with `hook` moving nodes after some of them.
pub(super) fn advance_hooked(
    groups: &mut [Box<dyn PatchGroup>],
    ports: &mut [Ports; 2],
    substeps: &[Substep],
    layout: &[PatchLayout],
    hook: &mut dyn SubstepHook,
) {
    let [now, next] = ports;
    let Some(first) = substeps.first() else {
        return;
    };
    let seen = SeenNodes::new(hook.patches(), layout);
    let mut nodes = vec![Point3::origin(); seen.starts[seen.patches.len()]];
    let mut is_seen = vec![false; groups.len()];
    seen.patches.iter().for_each(|at| is_seen[at.group] = true);
    each_group(groups)
        .zip(now.split())
        .for_each(|(g, p)| g.predict(first, p));
    // Calls are spread evenly over the frame.
    let count = substeps.len();
    let calls = count.div_ceil(hook.stride().max(1) as usize);
    let mut called = 0;
    for (k, substep) in substeps.iter().enumerate() {
        let is_called = !seen.patches.is_empty() && (k + 1) * calls / count > k * calls / count;
        let shared: &Ports = now;
        each_group(groups).zip(&is_seen).for_each(|(g, is_seen)| {
            g.solve(substep, shared);
            g.set_hooked(is_called && *is_seen);
            if is_called && *is_seen {
                g.hold_back();
            }
        });
        if is_called {
            seen.gather(groups, &mut nodes);
            let span = Span {
                progress: [substeps[called].progress[0], substep.progress[1]],
                substeps: k + 1 - called,
                h: substep.h,
            };
            called = k + 1;
            call(groups, &seen, &nodes, span, hook);
        }
        let following = substeps.get(k + 1);
        each_group(groups)
            .zip(next.split())
            .for_each(|(g, p)| match following {
                Some(following) => g.turn(following, p),
                None => g.finish(),
            });
        std::mem::swap(now, next);
    }
    groups.iter_mut().for_each(|g| g.set_hooked(false));
}

/// Lets a hook move `nodes`.
fn call(
    groups: &mut [Box<dyn PatchGroup>],
    seen: &SeenNodes,
    nodes: &[Point3<f32>],
    span: Span,
    hook: &mut dyn SubstepHook,
) {
    let at = &seen.patches[0];
    let [h_e, effective_mass] = groups[at.group].effective_step(at.lane);
    let is_euler = h_e >= span.h;
    hook.correct(
        &HookSubstep {
            progress: span.progress,
            h: span.elapsed(),
            h_e: h_e * response(span.substeps, is_euler, effective_mass).sqrt(),
            effective_mass,
        },
        nodes,
    );
    let is_long = span.substeps > 1;
    let mut squared = vec![0.0; seen.patches.len()];
    for moved in hook.moved() {
        let i = moved.node as usize;
        let patch = seen.patch_of(i);
        let by = [0, 1, 2].map(|axis| f64::from(moved.to[axis]) - f64::from(nodes[i][axis]));
        squared[patch] += by.iter().map(|x| x * x).sum::<f64>();
        let (at, node) = (&seen.patches[patch], i - seen.starts[patch]);
        groups[at.group].shift(at.lane, node, by);
        if is_long {
            groups[at.group].straighten(at.lane, node, moved.from, span);
        }
    }
    for ((at, &squared), &stopped) in seen.patches.iter().zip(&squared).zip(hook.stopped()) {
        // Straight ways have a history.
        let is_stopped = stopped && !is_long;
        if squared > 0.0 || is_stopped {
            groups[at.group].note_shifts(at.lane, squared, is_stopped);
        }
    }
}

/// How far a force that acts for some substeps moves a node that is at rest, against how far it
/// does in one.
///
/// - `effective_mass`: against the material's; what it is more resists like a damper
fn response(substeps: usize, is_euler: bool, effective_mass: f64) -> f64 {
    let history = if is_euler { 0.0 } else { 1.0 / 3.0 };
    let ([mut u, mut v], [mut previous_u, mut previous_v]) = ([0.0; 2], [0.0; 2]);
    for _ in 0..substeps {
        let ub = u + history * (u - previous_u);
        let vb = v + history * (v - previous_v);
        (previous_u, previous_v) = (u, v);
        u = ub + vb / effective_mass + 1.0;
        v = u - ub;
    }
    u
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_moves_a_free_node_with_the_square_of_time() {
        assert_eq!(response(1, false, 1.3), 1.0);
        assert!((response(2, false, 1.0) - 11.0 / 3.0).abs() < 1e-12);
        assert_eq!(response(3, true, 1.0), 6.0);
        // f t^2 / 2, with h_e = 2 h / 3 the effective step.
        let many = 300;
        let exact = 0.5 * (many as f64 * 1.5).powi(2);
        assert!((response(many, false, 1.0) / exact - 1.0).abs() < 0.01);
        assert!(response(3, false, 1.2) < response(3, false, 1.0));
    }
}
