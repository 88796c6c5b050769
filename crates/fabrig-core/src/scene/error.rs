use std::fmt;
use std::path::PathBuf;

use crate::cloth::{ClothError, MaterialError};
use crate::collision::CollisionError;
use crate::edit::EditError;
use crate::skin::SkinError;
use crate::transfer::TransferError;

/// What can go wrong when a scene is set up or stepped.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A time step is not a positive number.
    #[error("the time step must be a positive number of seconds, got {dt}")]
    TimeStep {
        /// What was given.
        dt: f64,
    },
    /// The tolerance of the economy is out of range.
    #[error(
        "'{found}' is no tolerance: expected 0 (all is modelled) to 10 mm, or 0 to 5 % of the face's \
         height, such as '0.05 %'"
    )]
    Tolerance {
        /// What was given.
        found: Box<str>,
    },
    /// A scene file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// The text of a scene is not TOML (or JSON).
    #[error("{place}the scene cannot be read: {reason}")]
    Text {
        /// Where.
        place: TextPlace,
        /// What is wrong.
        reason: String,
    },
    /// A key that is not known there.
    #[error("{place}`{key}` is no key of {table}{hint} (known: {known})")]
    UnknownKey {
        /// Where.
        place: TextPlace,
        /// The key, with the tables that it stands in.
        key: Box<str>,
        /// Where it stands: `a scene`, `contact`, ...
        table: Box<str>,
        /// The known key that is spelled most like it.
        hint: Hint,
        /// All known keys, separated by commas.
        known: Box<str>,
    },
    /// A value that cannot be meant so.
    #[error("{place}`{key}`: expected {expected}, found {found}{hint}")]
    Value {
        /// Where.
        place: TextPlace,
        /// The key, with the tables that it stands in.
        key: Box<str>,
        /// What it may be.
        expected: Box<str>,
        /// What it is.
        found: Box<str>,
        /// The known name that is spelled most like it, where it is to be one.
        hint: Hint,
    },
    /// A scene with faces of its own is to be simulated with a rig from elsewhere.
    #[error(
        "the scene has {count} faces of its own, but a rig was given: take `Scene::for_face`, or \
         leave the rig out"
    )]
    HasFaces {
        /// How many there are.
        count: usize,
    },
    /// What another module refuses of a scene's text.
    #[error("{place}`{key}`")]
    At {
        /// Where.
        place: TextPlace,
        /// The key, with the tables that it stands in.
        key: String,
        /// What is wrong.
        #[source]
        source: Box<SceneError>,
    },
    /// A file that the scene names cannot be used.
    #[error(transparent)]
    File(Box<crate::Error>),
    /// A take cannot be played so.
    #[error(transparent)]
    Clip(#[from] crate::motion::ClipError),
    /// Contact refused its options or a collider.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The cloth refused its input.
    #[error(transparent)]
    Cloth(#[from] ClothError),
    /// The rig's materials cannot be read, or lack one that a patch names.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// A material or a wrinkle map of the scene does not fit the rig.
    #[error(transparent)]
    Edit(Box<EditError>),
    /// The weights do not fit the rig.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The skin does not fit the rig.
    #[error(transparent)]
    Skin(#[from] SkinError),
}

/// A place in a text; says nothing where it is not known, as in a scene that no file has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TextPlace {
    /// Line, from 1; 0 where it is not known.
    pub line: usize,
    /// Column, in characters from 1.
    pub column: usize,
}

impl fmt::Display for TextPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => Ok(()),
            line => write!(f, "line {line}, column {}: ", self.column),
        }
    }
}

/// A name that may have been meant.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Hint(pub Option<Box<str>>);

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(name) => write!(f, "; did you mean `{name}`?"),
            None => Ok(()),
        }
    }
}
