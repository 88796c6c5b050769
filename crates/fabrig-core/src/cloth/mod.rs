//! The cloth solver: grids drawn to moving targets, with stretch, shear, bend and pressure.
//!
//! It knows nothing of faces. Grids, targets and materials go in; positions come out:
//!
//! ```
//! use fabrig_core::cloth::{Cloth, ClothOptions, ClothPatch, FrameInput, GridShape, Material};
//! use fabrig_core::cloth::PatchMotion;
//! use nalgebra::Point3;
//!
//! let shape = GridShape { u_count: 10, v_count: 8, is_periodic: false };
//! let rest: Vec<Point3<f32>> = (0..80)
//!     .map(|i| Point3::new((i % 10) as f32 * 2.0, (i / 10) as f32 * 2.0, 0.0))
//!     .collect();
//! let patch = ClothPatch { shape, rest: rest.clone(), material: Material::FAT, attachments: vec![], variations: vec![] };
//! let mut cloth = Cloth::new(&[patch], &ClothOptions::default())?;
//!
//! // The target jumps up by 5 mm in one frame and stays there; the cloth follows and rings.
//! let up: Vec<_> = rest.iter().map(|p| Point3::new(p.x, p.y + 5.0, p.z)).collect();
//! let targets = [PatchMotion::still(&up)];
//! for _ in 0..240 {
//!     let report = cloth.step(&FrameInput::new(1.0 / 60.0, &targets))?;
//!     assert_eq!(report.counters.frozen_patches, 0);
//! }
//! assert!((cloth.positions(0)[33] - up[33]).norm() < 0.01);
//! # Ok::<(), fabrig_core::cloth::ClothError>(())
//! ```
//!
//! # Method
//!
//! XPBD in small steps: every frame is cut into substeps, every substep projects every
//! constraint once. Time is stepped by BDF2 (backward Euler at the start and after resets), of
//! which backward Euler is the first-order kin. With the step ratio r = h_n/h_(n-1),
//!
//! ```text
//! h_e = h (1+r)/(1+2r),   g = r^2/(1+2r)     (Euler: h_e = h, g = 0)
//! x_b = x_n + g (x_n - x_(n-1)),   v_b likewise,   y = x_b + h_e v_b + h_e^2 f/m
//! m_h = m (1 + (c + c_m) h_e) + (k_magnet + k_anchor) h_e^2
//! x^  = (m y + m c h_e x_b + m c_m h_e (X + u_b) + k_magnet h_e^2 X + k_anchor h_e^2 A) / m_h
//! x_(n+1) = x^ projected with inverse masses 1/m_h and compliances 1/(k h_e^2)
//! v_(n+1) = (x_(n+1) - x_b) / h_e
//! ```
//!
//! Around that stand a robust mode (vertex block descent in which the energy of a step never
//! rises) and, as a baseline, position-based dynamics as in the paper's Algorithm 1; see
//! [`Mode`]. Guards watch every patch: displacements are clamped to half an edge per substep,
//! a patch whose energy rises beyond what was put in, or stays where damping must have taken it,
//! falls back to backward Euler, then to the robust mode, and in the end is put back to its
//! target. All are counted in [`Counters`].
//!
//! The state is the displacement u = x - X from the target, in single precision; while edges
//! are projected, positions are relative to the patch's centre. Forces and constraints are in
//! [`constraints`](self#modules), materials in [`Material`].
//!
//! # Limitations
//!
//! - No contact of its own: [`Cloth::step_with`] lets contact move nodes in every substep.
//! - One sweep per substep: the error grows with the ratio of stretch to magnet stiffness (see
//!   [`Material::stiffness_ratio`]); beyond about 1,000 nothing is promised but finiteness.
//! - The rest curvature is always that of the target.
//!
//! # Source
//!
//! Macklin, Müller & Chentanez 2016, *XPBD*; Macklin et al. 2019, *Small steps in physics
//! simulation*; the BDF2 form and the folding of diagonal terms are fabrig's.

mod assembly;
pub mod bench;
mod constraints;
mod error;
mod group;
mod guard;
mod hook;
mod hooked;
mod input;
mod linear;
mod materials;
mod report;
mod solver;
mod time;
mod validate;

#[cfg(test)]
mod tests;

pub use error::ClothError;
pub use hook::{HookSubstep, MovedNode, SubstepHook};
pub use input::{
    ClothAttachment, ClothOptions, ClothPatch, FrameInput, GridShape, HeadMotion, Integrator, Mode,
    NodeVariation, PatchMotion, Precision, STANDING_GRAVITY,
};
pub use linear::{LinearCloth, NodeVectors};
pub use materials::{Material, MaterialError, Materials, TIME_UNIT};
pub use report::{Counters, Energies, StepReport};
pub use solver::Cloth;
