//! What can be wrong with a patch layout or with the face it is laid under.

use crate::mesh::SurfaceError;

/// Why a layout cannot be read, charted or laid.
#[derive(Debug, thiserror::Error)]
pub enum AnatomyError {
    /// The text is not TOML of the expected form.
    #[error("the patch layout cannot be read: {source}")]
    Syntax {
        /// Where and what.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// A point expression cannot be read.
    #[error(
        "{patch}.{key}: cannot read the point `{text}`: {reason}; write `landmark`, \
         `0.4 a + 0.6 b` or `landmark + (dx, dy, dz)`"
    )]
    BadExpression {
        /// Patch, or `points`.
        patch: String,
        /// Key of the layout.
        key: String,
        /// The expression.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A name is neither a landmark of the template nor a point of the layout.
    #[error(
        "{patch}.{key}: there is no landmark or point `{name}`; the nearest name is `{nearest}`"
    )]
    UnknownPoint {
        /// Patch, or `points`.
        patch: String,
        /// Key of the layout.
        key: String,
        /// The name.
        name: String,
        /// The known name most like it.
        nearest: String,
    },
    /// A name is not a patch of the layout.
    #[error("{patch}.{key}: there is no patch `{name}`; the nearest name is `{nearest}`")]
    UnknownPatch {
        /// Patch that names the other.
        patch: String,
        /// Key of the layout.
        key: String,
        /// The name.
        name: String,
        /// The known name most like it.
        nearest: String,
    },
    /// A name is not a region of the template.
    #[error("{patch}.{key}: there is no region `{name}`; the nearest name is `{nearest}`")]
    UnknownRegion {
        /// Patch, or `skin`.
        patch: String,
        /// Key of the layout.
        key: String,
        /// The name.
        name: String,
        /// The known name most like it.
        nearest: String,
    },
    /// Two patches have the same name.
    #[error("patch `{name}` is defined twice")]
    DuplicatePatch {
        /// The name.
        name: String,
    },
    /// A value is not what the key needs.
    #[error("{patch}.{key}: expected {expected}, found {found}")]
    BadValue {
        /// Patch.
        patch: String,
        /// Key of the layout.
        key: String,
        /// What the key needs.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The grid has too few or odd counts.
    #[error(
        "resolution {u_count} x {v_count} does not fit {what}: \
         expected {expected}"
    )]
    BadResolution {
        /// Nodes along the fibres.
        u_count: u32,
        /// Nodes across.
        v_count: u32,
        /// Kind of grid.
        what: &'static str,
        /// What fits.
        expected: &'static str,
    },
    /// A place of a patch has no skin near it.
    #[error("{patch}: no skin within {reach} mm of ({x:.1}, {y:.1}, {z:.1})")]
    OffSkin {
        /// Patch.
        patch: String,
        /// How far was searched. (mm)
        reach: f64,
        /// Where. (mm)
        x: f64,
        /// Where. (mm)
        y: f64,
        /// Where. (mm)
        z: f64,
    },
    /// A margin is not one closed loop through both corners.
    #[error("{patch}.{key}: {reason}")]
    BadMargin {
        /// Patch.
        patch: String,
        /// Key of the layout.
        key: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A triangle has no mirror image.
    #[error("{patch}: triangle {triangle} of the template's skin has no mirror image")]
    NoMirror {
        /// Patch.
        patch: String,
        /// The triangle.
        triangle: u32,
    },
    /// A grid is folded over or turned inside out.
    #[error(
        "{patch}: the quad at (u {u}, v {v}) faces inwards; check the order of its ribs \
         (u x v must point outwards) and whether they cross"
    )]
    Folded {
        /// Patch.
        patch: String,
        /// Column of the quad.
        u: u32,
        /// Row of the quad.
        v: u32,
    },
    /// Neighbouring nodes are too close.
    #[error(
        "{patch}: nodes at (u {u}, v {v}) and its neighbour are {distance:.4} mm apart, \
         less than {limit:.4} mm"
    )]
    TooClose {
        /// Patch.
        patch: String,
        /// Column.
        u: u32,
        /// Row.
        v: u32,
        /// Distance found. (mm)
        distance: f64,
        /// Least distance. (mm)
        limit: f64,
    },
    /// An attachment reaches nothing.
    #[error(
        "{patch}.{key}: no node of `{other}` within {reach} mm; the nearest is \
         {distance:.1} mm away"
    )]
    OutOfReach {
        /// Patch.
        patch: String,
        /// Key of the layout.
        key: String,
        /// Patch that it should hold to.
        other: String,
        /// How far was searched. (mm)
        reach: f64,
        /// Nearest distance. (mm)
        distance: f64,
    },
    /// A face does not have the template's vertices.
    #[error("expected {expected} positions, one per vertex of the template, got {found}")]
    PositionCount {
        /// The template's vertex count.
        expected: usize,
        /// Positions given.
        found: usize,
    },
    /// A chart was made for another template.
    #[error("{patch}: node {node} names triangle {triangle}, but the skin has {triangle_count}")]
    ForeignChart {
        /// Patch.
        patch: String,
        /// Node of the patch.
        node: usize,
        /// Triangle it names.
        triangle: u32,
        /// Triangles of the skin.
        triangle_count: usize,
    },
    /// The skin cannot be searched.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// The name in `known` most like `name`, by edit distance.
pub(super) fn nearest_name<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    known
        .min_by_key(|k| (edit_distance(name, k), k.to_string()))
        .unwrap_or_default()
        .to_owned()
}

/// Levenshtein distance.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_the_one_with_fewest_edits() {
        let known = ["mouth_corner_l", "mouth_corner_r", "eye_outer_l"];
        assert_eq!(
            nearest_name("mouth_cornr_l", known.into_iter()),
            "mouth_corner_l"
        );
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
    }
}
