//! Storms before they come.
//!
//! In a storm a difference to the full model grows, however small it is. So nothing may be left out
//! for a while *before* one, until what was left out earlier has died away. A take says what it will
//! do: [`Foresight`] runs ahead of the face with what is cheapest and still buckles at the same
//! time, a lone node of every material on its magnet,
//!
//! `x'' = a - c x' - w0^2 x`,
//!
//! one moved by fields, and one for each muscle shape. They sum to how far a patch will be from its
//! muscle shapes: `|x| + sum |x_i| way_i`. Neighbours and lengths hold a patch closer than that.

use nalgebra::Vector3;

use super::STORM;
use super::patch::Frugal;
use crate::Vector;
use crate::cloth::Material;

/// Share of [`STORM`] at which a storm is foreseen.
const OMEN: f64 = 0.9;

/// Longest step of a node. (s)
const STEP: f64 = 1.0 / 120.0;

/// What acts on the face at a time ahead.
pub(in crate::scene) struct Omen<'a> {
    /// Rates of the weights. (1/s)
    pub(in crate::scene) rates: &'a [f32],
    /// Acceleration at the middle of the face. (mm/s^2)
    pub(in crate::scene) acceleration: Vector,
    /// What the wind does. (mm/s^2)
    pub(in crate::scene) air: f64,
}

/// Lone nodes that run ahead of the face.
pub(super) struct Foresight {
    materials: Vec<Lone>,
    /// Of each patch of the rig that is cloth.
    material_of: Vec<Option<usize>>,
    /// Until when it has looked, and the rates then; none: it is to begin anew.
    seen: Option<f64>,
    rates: Vec<f32>,
}

/// Nodes of one material.
struct Lone {
    /// w0^2 (1/s^2) and c (1/s).
    spring: [f64; 2],
    by_fields: Node<Vector3<f64>>,
    /// At a way of 1.
    by_shapes: Vec<Node<f64>>,
}

/// Displacement and velocity.
#[derive(Clone, Copy)]
struct Node<T> {
    x: T,
    v: T,
}

impl Foresight {
    /// - `materials`: of each patch that is cloth
    pub(super) fn new(materials: &[Option<Material>], shape_count: usize) -> Self {
        let mut out = Self {
            materials: Vec::new(),
            material_of: Vec::with_capacity(materials.len()),
            seen: None,
            rates: Vec::new(),
        };
        for material in materials {
            let of = material.as_ref().map(|material| {
                let frequency = std::f64::consts::TAU * material.magnet_frequency_hz;
                let spring = [
                    frequency * frequency,
                    material.magnet_damping() + material.damping,
                ];
                let known = out.materials.iter().position(|m| m.spring == spring);
                known.unwrap_or_else(|| {
                    out.materials.push(Lone::new(spring, shape_count));
                    out.materials.len() - 1
                })
            });
            out.material_of.push(of);
        }
        out
    }

    /// Begins anew with the next look.
    pub(super) fn forget(&mut self) {
        self.seen = None;
    }

    /// Where it is to look next, to see as far as `until`; nowhere once it has.
    ///
    /// - `start`: of the frame, and `rates` of the weights then
    /// - `dt`: between looks (s)
    pub(super) fn next(&mut self, [start, until]: [f64; 2], rates: &[f32], dt: f64) -> Option<f64> {
        let seen = *self.seen.get_or_insert_with(|| {
            for lone in &mut self.materials {
                lone.rest();
            }
            self.rates.clear();
            self.rates.extend_from_slice(rates);
            start
        });
        (seen + 0.5 * dt < until).then_some(seen + dt)
    }

    /// Looks; returns whether there is a storm.
    pub(super) fn see(&mut self, time: f64, omen: &Omen<'_>, dt: f64, patches: &[Frugal]) -> bool {
        self.seen = Some(time);
        let count = (dt / STEP).ceil().max(1.0);
        for lone in &mut self.materials {
            lone.go(omen, &self.rates, dt, count as u32);
        }
        self.rates.copy_from_slice(omen.rates);
        let furthest = patches.iter().zip(&self.material_of).map(|(patch, of)| {
            let lone = of.map(|of| &self.materials[of]);
            lone.map_or(0.0, |lone| lone.furthest(&patch.shapes))
        });
        furthest.fold(0.0, f64::max) > OMEN * STORM
    }
}

impl Lone {
    fn new(spring: [f64; 2], shape_count: usize) -> Self {
        Self {
            spring,
            by_fields: Node::at_rest(Vector3::zeros()),
            by_shapes: vec![Node::at_rest(0.0); shape_count],
        }
    }

    fn rest(&mut self) {
        self.by_fields = Node::at_rest(Vector3::zeros());
        self.by_shapes.fill(Node::at_rest(0.0));
    }

    /// - `rates`: of the weights, before; `count`: steps
    fn go(&mut self, omen: &Omen<'_>, rates: &[f32], dt: f64, count: u32) {
        let h = dt / f64::from(count);
        let spring = self.spring;
        let changes = omen.rates.iter().zip(rates);
        for (node, (now, before)) in self.by_shapes.iter_mut().zip(changes) {
            let acceleration = -f64::from(now - before) / dt;
            if acceleration == 0.0 && node.x == 0.0 && node.v == 0.0 {
                continue;
            }
            for _ in 0..count {
                *node = node.after(acceleration, spring, h);
            }
        }
        for _ in 0..count {
            self.by_fields = self.by_fields.after(omen.acceleration, spring, h);
        }
    }

    /// - `shapes`: that move a patch, each with its way
    fn furthest(&self, shapes: &[(u32, f64)]) -> f64 {
        let of_shapes = shapes
            .iter()
            .map(|&(shape, way)| self.by_shapes[shape as usize].x.abs() * way);
        self.by_fields.x.norm() + of_shapes.sum::<f64>()
    }
}

impl<T> Node<T>
where
    T: Copy
        + std::ops::Add<Output = T>
        + std::ops::Sub<Output = T>
        + std::ops::Mul<f64, Output = T>,
{
    fn at_rest(nothing: T) -> Self {
        Self {
            x: nothing,
            v: nothing,
        }
    }

    /// The trapezoidal rule: it grows for no step.
    fn after(self, acceleration: T, [stiffness, damping]: [f64; 2], h: f64) -> Self {
        let (half, quarter) = (0.5 * h * damping, 0.25 * h * h * stiffness);
        let driven = (acceleration - self.x * stiffness) * h;
        let v = (self.v * (1.0 - half - quarter) + driven) * (1.0 / (1.0 + half + quarter));
        Self {
            x: self.x + (self.v + v) * (0.5 * h),
            v,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lone_nodes_hang_and_ring_as_springs_do() {
        let (stiffness, damping) = (44.0f64 * 44.0, 10.0);
        let mut node = Node::at_rest(0.0);
        let mut highest = 0.0f64;
        for _ in 0..2000 {
            node = node.after(1000.0, [stiffness, damping], STEP);
            highest = highest.max(node.x);
        }
        let hangs = 1000.0 / stiffness;
        assert!((node.x - hangs).abs() < 1e-9 && node.v.abs() < 1e-6);
        // The overshoot of a damped step is exp(-pi z / sqrt(1 - z^2)).
        let z = damping / (2.0 * stiffness.sqrt());
        let over = (-std::f64::consts::PI * z / (1.0 - z * z).sqrt()).exp();
        assert!(
            (highest / hangs - 1.0 - over).abs() < 0.05,
            "{highest} {hangs} {over}"
        );
    }

    #[test]
    fn foresight_looks_as_far_as_it_is_asked_and_no_further() {
        let mut foresight = Foresight::new(&[Some(Material::FAT), None], 1);
        let mut looks = 0;
        let omen = Omen {
            rates: &[0.0],
            acceleration: Vector::new(0.0, 1e5, 0.0),
            air: 0.0,
        };
        let mut is_stormy = false;
        while let Some(time) = foresight.next([2.0, 2.5], &[0.0], 0.1) {
            looks += 1;
            is_stormy |= foresight.see(time, &omen, 0.1, &[]);
        }
        assert_eq!((looks, is_stormy), (5, false));
        assert!(foresight.materials[0].furthest(&[]) > STORM);
        assert_eq!(foresight.next([2.0, 2.5], &[0.0], 0.1), None);
        assert!(foresight.next([2.1, 2.6], &[0.0], 0.1).is_some());
    }
}
