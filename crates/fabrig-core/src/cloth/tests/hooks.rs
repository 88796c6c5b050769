//! Hooks that are called after several substeps.

use nalgebra::{Point3, Vector3};

use super::support::*;
use crate::cloth::{ClothOptions, FrameInput, HookSubstep, Material, MovedNode, SubstepHook};

/// Moves every node, but by next to nothing.
struct Touch {
    stride: u32,
    /// Where the last call left them. [mm, head frame]
    left: Vec<Point3<f32>>,
    moved: Vec<MovedNode>,
}

impl SubstepHook for Touch {
    fn patches(&self) -> &[usize] {
        &[0]
    }

    fn stride(&self) -> u32 {
        self.stride
    }

    fn reset(&mut self, wanted: &mut [Point3<f32>]) {
        self.left = wanted.to_vec();
    }

    fn correct(&mut self, _: &HookSubstep, nodes: &[Point3<f32>]) {
        self.moved.clear();
        for (index, (node, left)) in nodes.iter().zip(&mut self.left).enumerate() {
            let to = node + Vector3::z() * 1e-4;
            self.moved.push(MovedNode {
                node: index as u32,
                from: *left,
                to,
            });
            *left = to;
        }
    }

    fn moved(&self) -> &[MovedNode] {
        &self.moved
    }

    fn stopped(&self) -> &[bool] {
        &[false]
    }
}

#[test]
fn nodes_that_a_hook_hardly_moves_follow_their_targets_as_others_do() {
    let patch = dome(21, 20, 10.0, 1.0, Material::LINEAR_MUSCLE);
    let pose = shifted(&patch.rest, Vector3::new(0.0, 12.0, 0.0));
    for stride in [1, 2, 3] {
        let mut touch = Touch {
            stride,
            left: Vec::new(),
            moved: Vec::new(),
        };
        let options = ClothOptions::default();
        let [mut free, mut touched] = [(); 2].map(|()| alone(&patch, &options));
        let start = [swing(&patch, &pose, 0.0)];
        free.reset(&start, &[]).unwrap();
        touched.reset_with(&start, &[], &mut touch).unwrap();
        for frame in 1..=40 {
            let targets = [swing(&patch, &pose, f64::from(frame) * DT)];
            let input = FrameInput::new(DT, &targets);
            free.step(&input).unwrap();
            touched.step_with(&input, &mut touch).unwrap();
            let gap = rms(&free, 0, touched.positions(0));
            // Without the speed of their targets they would be millimetres behind.
            assert!(gap < 0.1, "stride {stride}, frame {frame}: {gap} mm");
        }
    }
}
