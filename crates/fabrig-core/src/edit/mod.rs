//! Edits: what an artist changes on a rig, as a small text file beside it.
//!
//! `face.edits.toml` stands beside `face.fabrig` and is applied whenever that is loaded, so
//! edits outlive the rig being built again. Everything is addressed by name:
//!
//! ```toml
//! preset = "looser_skin" # edits that come with the program, before the file's own
//!
//! [shapes."zygomaticus_major_l.mouthSmileLeft"]
//! strength = 1.4        # scales the muscle shape; 0 switches it off
//!
//! [shapes."frontalis_r.browInnerUp"]
//! weight = 0.3          # holds it on this muscle, whatever the action units say
//!
//! [shapes."risorius_l.mouthStretchLeft".moved]
//! 118 = [0.0, 0.4, 0.2] # a node is displaced further at weight 1 (mm)
//!
//! [patches.malar_fat_l]
//! alpha = 1.2           # amplitude of all of the patch's shapes, Eq. 3
//! material = "soft_fat"
//! thickness = 2.0       # the pad is thicker in its middle, and the face over it fuller (mm)
//!
//! [materials.soft_fat]  # a new material, or changes to one that there is
//! like = "fat"
//! bend_resistance = 1.0
//!
//! [wrinkles.forehead]   # skin that folds where the map is white
//! map = "forehead.png"  # in texture coordinates, or a text of one number per vertex
//! patches = ["frontalis_l", "frontalis_r", "forehead_fat"]
//! stretch = 2.0         # factors where the map is 1
//! bend = 0.5
//! rest_blend = 0.0      # lengths stay neutral
//! narrow = 1.0          # skin there hangs on these patches alone, and shows each fold
//! ```
//!
//! A patch that is named without its side (`malar_fat`) stands for both.
//!
//! # Source
//!
//! Zhu & Joslin 2024, section 4, Fig. 4: edits at the level of single muscles.

mod apply;
mod error;
mod file;
mod muscle_mesh;
mod preset;
mod thickness;
mod wrinkle_map;

pub use apply::load_edited_rig;
pub use error::EditError;
pub use file::{Edits, MaterialEdit, PatchEdit, ShapeEdit, WrinkleEdit, edits_path};
pub use muscle_mesh::{export_muscle_shape, import_muscle_shape, muscle_shape_names};
pub use preset::{Preset, apply_preset, presets};
pub use wrinkle_map::{WrinkleMap, apply_wrinkle_map};
