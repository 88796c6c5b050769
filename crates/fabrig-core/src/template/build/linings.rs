//! Keeps inner skin from following outer skin that it does not belong to.
//!
//! The source's shapes were painted with soft selections in space, which drag the back of the
//! eye sockets along with a brow and the roof of the mouth with a blink. By rule:
//!
//! - skin of a socket moves with its rim, less and less with distance, and not at all deep inside;
//! - shapes of eyes and brows leave the mouth cavity still;
//! - under shapes that the recipe names, the cavity's lining moves with the flesh that it lines:
//!   as the outer skin around it does on its own side of the mouth, from the lips inwards more
//!   and more so, and less and less where no outer skin is near.

use super::fairing::smooth_step;
use crate::template::description::LiningRecipe;
use crate::{Point, Vector};

/// How much of its motion each vertex keeps.
pub(super) struct Linings<'a> {
    recipe: &'a LiningRecipe,
    /// (vertex, share kept under any shape), where it is less than one.
    sockets: Vec<(u32, f64)>,
    /// Vertices that shapes of other parts leave still.
    cavity: Vec<u32>,
    /// Lining that moves with the flesh around it.
    flesh: Vec<Lining>,
}

/// A vertex of the cavity and the flesh around it.
struct Lining {
    vertex: u32,
    /// How much of its motion is the flesh's.
    share: f64,
    /// Outer vertices and weights; their sum fades where none is near.
    around: Vec<(u32, f64)>,
}

impl<'a> Linings<'a> {
    /// - `region_of`: name of the region of each vertex
    pub(super) fn new(
        recipe: &'a LiningRecipe,
        rest: &[Point],
        region_of: &dyn Fn(u32) -> &'a str,
    ) -> Self {
        let all = 0..rest.len() as u32;
        let is_socket = |v: u32| region_of(v).starts_with("socket");
        let rim: Vec<Point> = all
            .clone()
            .filter(|&v| region_of(v).contains("_lid_"))
            .map(|v| rest[v as usize])
            .collect();
        let [full, none] = recipe.socket;
        let sockets = all
            .clone()
            .filter(|&v| is_socket(v))
            .map(|v| {
                let nearest = rim
                    .iter()
                    .map(|p| (p - rest[v as usize]).norm())
                    .fold(f64::INFINITY, f64::min);
                let t = ((nearest - full) / (none - full)).clamp(0.0, 1.0);
                (v, 1.0 - t * t * (3.0 - 2.0 * t))
            })
            .collect();
        let cavity: Vec<u32> = all
            .filter(|&v| region_of(v).starts_with("mouth_interior"))
            .collect();
        let flesh = cavity
            .iter()
            .map(|&v| lining(recipe, rest, region_of, v))
            .collect();
        Self {
            recipe,
            sockets,
            cavity,
            flesh,
        }
    }

    /// Lets the lining of the cavity move with the flesh, under the shapes that ask for it.
    pub(super) fn follow_flesh(&self, name: &str, deltas: &mut [Vector]) {
        if !self.recipe.follow_flesh.iter().any(|n| n == name) {
            return;
        }
        for lining in &self.flesh {
            let around = lining.around.iter();
            let flesh: Vector = around.map(|&(v, w)| w * deltas[v as usize]).sum();
            let delta = &mut deltas[lining.vertex as usize];
            *delta += lining.share * (flesh - *delta);
        }
    }

    /// Corrects one shape.
    pub(super) fn correct(&self, name: &str, deltas: &mut [Vector]) {
        for &(vertex, share) in &self.sockets {
            deltas[vertex as usize] *= share;
        }
        let still = &self.recipe.leave_mouth_still;
        if still.iter().any(|prefix| name.starts_with(prefix.as_str())) {
            for &vertex in &self.cavity {
                deltas[vertex as usize] = Vector::zeros();
            }
        }
    }
}

/// What is outer skin to the upper and to the lower half of the cavity.
const OVER: [&str; 5] = ["upper_lip", "upper_lip_skin", "cheek_l", "cheek_r", "face"];
const UNDER: [&str; 5] = ["lower_lip", "jaw", "cheek_l", "cheek_r", "face"];

fn lining<'r>(
    recipe: &LiningRecipe,
    rest: &[Point],
    region_of: &dyn Fn(u32) -> &'r str,
    vertex: u32,
) -> Lining {
    let outer = if region_of(vertex) == "mouth_interior_upper" {
        OVER
    } else {
        UNDER
    };
    let p = rest[vertex as usize];
    let near: Vec<(u32, f64)> = (0..rest.len() as u32)
        .filter(|&v| outer.contains(&region_of(v)))
        .map(|v| (v, (rest[v as usize] - p).norm()))
        .collect();
    let least = |lips_only: bool| {
        near.iter()
            .filter(|(v, _)| !lips_only || region_of(*v).ends_with("_lip"))
            .map(|(_, d)| *d)
            .fold(f64::INFINITY, f64::min)
    };
    let (to_lip, to_skin) = (least(true), least(false));
    let blur = recipe.flesh_blur;
    let mut around: Vec<(u32, f64)> = near
        .iter()
        .map(|&(v, d)| (v, (to_skin * to_skin - d * d) / (2.0 * blur * blur)))
        .filter(|(_, e)| *e > -8.0)
        .map(|(v, e)| (v, e.exp()))
        .collect();
    let total: f64 = around.iter().map(|(_, w)| w).sum();
    let [full, none] = recipe.flesh_depth;
    let reach = 1.0 - smooth_step((to_skin - full) / (none - full));
    for (_, weight) in &mut around {
        *weight *= reach / total;
    }
    let [drawn, flesh] = recipe.flesh_from;
    Lining {
        vertex,
        share: smooth_step((to_lip - drawn) / (flesh - drawn)),
        around,
    }
}
