//! A physical face rig from one neutral mesh.
//!
//! The folders are the map; data flows one way through them:
//!
//! ```text
//! mesh -> template -> registration -> anatomy -> transfer -> skin -> rig -> scene -> recording
//!                                                         facs, motion ----^
//!                                                    cloth, collision -----^
//! ```
//!
//! # Units and axes
//!
//! Millimetres at true head size, seconds, +Y up, +Z out of the face, the character's left
//! is +X, unless an item says otherwise (a user's own mesh keeps its own units).
//!
//! # Source
//!
//! Zhu & Joslin, *Fabrig: A Cloth-Simulated Transferable 3D Face Parameterization*,
//! SIGGRAPH Asia 2024. Equation numbers in the documentation are that paper's.

pub mod anatomy;
pub mod atomic_file;
pub mod batch;
pub mod cloth;
pub mod collision;
pub mod edit;
mod error;
pub mod evaluation;
pub mod export;
pub mod facs;
pub mod machine;
pub mod mesh;
pub mod motion;
pub mod pipeline;
pub mod recording;
pub mod registration;
#[cfg(feature = "render")]
pub mod render;
pub mod retarget;
pub mod rig;
pub mod scene;
pub mod skin;
pub mod template;
pub mod transfer;

pub use error::Error;

/// A position, double precision. (mm) unless stated.
pub type Point = nalgebra::Point3<f64>;
/// A displacement or direction, double precision. (mm) unless stated.
pub type Vector = nalgebra::Vector3<f64>;

/// Compiles the README's Rust example.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
