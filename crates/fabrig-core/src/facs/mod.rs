//! Names of facial movements: ARKit's 52 shapes and FACS action units.
//!
//! Knows no meshes. [`ARKIT_SHAPES`] is the one place where ARKit's spellings stand;
//! [`match_shape`] finds them under the names that applications write. An
//! [`ActionUnitTable`] turns intensities of action units (Ekman & Friesen's Facial Action
//! Coding System) into weights of shapes.

mod action_unit;
mod arkit;
mod expressions;
mod pose;
mod unit_map;
mod unit_name;

pub use action_unit::{ActionUnit, ActionUnitTable, Corrective, FacsError};
pub use arkit::{
    ARKIT_SHAPES, JAW_OPEN, MOUTH_CLOSE, ShapeMatch, match_shape, mirrored_shape, nearest_name,
};
pub use expressions::{NamedExpression, named_expressions};
pub use pose::{expression_sheet, named_weights};
pub use unit_map::{ActionUnitMap, UnitIntensity};
pub use unit_name::{Side, UnitName, match_unit};
