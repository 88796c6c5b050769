//! The forces and constraints of the cloth, one file each.
//!
//! Linear in a node's own position or velocity, and therefore folded exactly into the
//! inertial target: [`magnet`], anchors of [`attachment`], [`damping`]. External, evaluated
//! where the time stencil expects the cloth: [`inertia`] (gravity too), [`wind`]. Projected,
//! in this order: pairs of [`attachment`], [`pressure`], [`bend`], [`shear`], [`stretch`].

pub(crate) mod attachment;
pub(crate) mod bend;
pub(crate) mod damping;
pub(crate) mod grid_lists;
pub(crate) mod inertia;
pub(crate) mod magnet;
pub(crate) mod pressure;
pub(crate) mod shear;
pub(crate) mod stretch;
pub(crate) mod wind;
