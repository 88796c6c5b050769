//! Names of facial movements: ARKit's 52 shapes and FACS action units.
//!
//! Knows no meshes. [`ARKIT_SHAPES`] is the one place where ARKit's spellings stand;
//! [`match_shape`] finds them under the names that applications write. An
//! [`ActionUnitTable`] turns intensities of action units (Ekman & Friesen's Facial Action
//! Coding System) into weights of shapes.

mod action_unit;
mod arkit;

pub use action_unit::{
    ActionUnit, ActionUnitMap, ActionUnitTable, Corrective, FacsError, UnitIntensity,
};
pub use arkit::{ARKIT_SHAPES, ShapeMatch, match_shape, nearest_name};
