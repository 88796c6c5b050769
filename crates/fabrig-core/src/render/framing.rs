//! What a picture of a face is framed on: named points of the template, wherever they lie on
//! this face.

use crate::Point;
use crate::template::{JawHinge, Template};
use crate::transfer::{JawPose, JawShapes};

/// A part of a face that a picture is framed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Framing {
    /// Everything there is.
    #[default]
    All,
    /// From the hairline to the chin of an open jaw.
    Face,
    /// From the wings of the nose to the chin.
    Mouth,
    /// Brows to cheekbones.
    Eyes,
    /// The left eye.
    Eye,
    /// Brows to hairline.
    Forehead,
    /// The outer corner of the left eye with the skin beside it.
    EyeCorner,
}

/// Points on both sides are named by their left one.
const FACE: [&str; 4] = ["hairline_mid", "zygion_l", "gonion_l", "menton"];
const MOUTH: [&str; 4] = ["subnasale", "nasolabial_mid_l", "buccal_l", "gnathion"];
const EYES: [&str; 3] = ["brow_mid_top_l", "orbit_lateral_l", "malar_l"];
const EYE: [&str; 5] = [
    "brow_mid_l",
    "orbit_medial_l",
    "orbit_lateral_l",
    "orbit_bottom_l",
    "eye_inner_l",
];
const FOREHEAD: [&str; 4] = [
    "hairline_mid",
    "hairline_lateral_l",
    "brow_outer_l",
    "nasion",
];
const EYE_CORNER: [&str; 4] = [
    "brow_outer_l",
    "cheekbone_l",
    "orbit_lateral_l",
    "lower_lid_crease_l",
];

impl Framing {
    /// The points that a picture holds (mm); nothing for a picture of everything.
    ///
    /// - `positions`: the face in the template's topology (mm)
    /// - `jaw`: its hinge; pictures of the whole face leave room for the chin of an open jaw
    pub fn points(self, template: &Template, positions: &[Point], jaw: &JawHinge) -> Vec<Point> {
        let names: &[&str] = match self {
            Self::All => return Vec::new(),
            Self::Face => &FACE,
            Self::Mouth => &MOUTH,
            Self::Eyes => &EYES,
            Self::Eye => &EYE,
            Self::Forehead => &FOREHEAD,
            Self::EyeCorner => &EYE_CORNER,
        };
        let at = |name: &str| {
            let vertex = template.landmarks.get(name)?;
            positions.get(*vertex as usize).copied()
        };
        let mut points: Vec<Point> = names.iter().filter_map(|name| at(name)).collect();
        if !matches!(self, Self::Eye | Self::EyeCorner) {
            let partners = names.iter().filter_map(|name| name.strip_suffix("_l"));
            points.extend(partners.filter_map(|stem| at(&format!("{stem}_r"))));
        }
        if let (Self::Face, Some(chin)) = (self, at("menton")) {
            let open = JawShapes {
                open: Some(0),
                ..JawShapes::default()
            };
            let (turn, slide) = JawPose::at(jaw, &open, 1.0, &[0.8]).affine(jaw);
            points.push(Point::from(turn * chin.coords + slide));
        }
        points
    }
}
