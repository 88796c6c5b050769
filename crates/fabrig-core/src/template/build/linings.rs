//! Keeps inner skin from following outer skin that it does not belong to.
//!
//! The source's shapes were painted with soft selections in space, which drag the back of the
//! eye sockets along with a brow and the roof of the mouth with a blink. By rule:
//!
//! - skin of a socket moves with its rim, less and less with distance, and not at all deep inside;
//! - shapes of eyes and brows leave the mouth cavity still.

use crate::template::description::LiningRecipe;
use crate::{Point, Vector};

/// How much of its motion each vertex keeps.
pub(super) struct Linings<'a> {
    recipe: &'a LiningRecipe,
    /// (vertex, share kept under any shape), where it is less than one.
    sockets: Vec<(u32, f64)>,
    /// Vertices that shapes of other parts leave still.
    cavity: Vec<u32>,
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
        let cavity = all
            .filter(|&v| region_of(v).starts_with("mouth_interior"))
            .collect();
        Self {
            recipe,
            sockets,
            cavity,
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
