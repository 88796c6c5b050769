//! What is compared: poses, methods, and where weights come from.

use serde::Serialize;

use crate::transfer::{AlphaMode, OffsetMode};

/// A pose of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Pose {
    /// Name, as in the paper.
    pub name: &'static str,
    /// Shapes at weight 1.
    pub shapes: &'static [&'static str],
}

/// The four poses of the paper.
pub const POSES: [Pose; 4] = [
    Pose {
        name: "mouth corners up",
        shapes: &["mouthSmileLeft", "mouthSmileRight"],
    },
    Pose {
        name: "eyebrows down",
        shapes: &["browDownLeft", "browDownRight"],
    },
    Pose {
        name: "mouth open",
        shapes: &["jawOpen"],
    },
    Pose {
        name: "sneer",
        shapes: &["noseSneerLeft", "noseSneerRight"],
    },
];

/// How expressions are put on a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Method {
    /// Name in tables.
    pub name: &'static str,
    /// How the rig does it; `None` for delta transfer.
    pub offsets: Option<OffsetMode>,
    /// What examples are fitted by.
    pub alpha: AlphaMode,
    /// Whether the shapes of the poses are among the examples.
    pub sees_poses: bool,
}

const fn method(
    name: &'static str,
    offsets: Option<OffsetMode>,
    alpha: AlphaMode,
    sees_poses: bool,
) -> Method {
    Method {
        name,
        offsets,
        alpha,
        sees_poses,
    }
}

/// Everything that is compared. The first is the yardstick; examples are the face's other
/// shapes, or all of them where a method `sees_poses`.
pub const METHODS: [Method; 13] = {
    use AlphaMode::{Map, Own, Patch, PatchAndShape, Size};
    const GLOBAL: Option<OffsetMode> = Some(OffsetMode::Global);
    const FRAME: Option<OffsetMode> = Some(OffsetMode::Frame);
    const TRANSFER: Option<OffsetMode> = Some(OffsetMode::DeformationTransfer);
    [
        method("delta", None, Size, false),
        method("delta, fitted size", None, Patch, false),
        method("global, size", GLOBAL, Size, false),
        method("global, patch", GLOBAL, Patch, false),
        method("global, patch, all", GLOBAL, Patch, true),
        method("global, shape, all", GLOBAL, PatchAndShape, true),
        method("global, map", GLOBAL, Map, false),
        method("global, map, all", GLOBAL, Map, true),
        method("own shapes", GLOBAL, Own, true),
        method("frame, size", FRAME, Size, false),
        method("frame, map", FRAME, Map, false),
        method("transfer, size", TRANSFER, Size, false),
        method("transfer, map", TRANSFER, Map, false),
    ]
};

/// Where the weights of a pose come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// The pose's own shapes at weight 1, as action units give them.
    Units,
    /// Fitted to the pose.
    BestFit,
}
