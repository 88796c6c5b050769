//! ARKit's 52 face shapes and the many ways their names are written.

/// The shapes of Apple's `ARFaceAnchor.BlendShapeLocation`, in the order of its documentation.
pub const ARKIT_SHAPES: [&str; 52] = [
    "eyeBlinkLeft",
    "eyeLookDownLeft",
    "eyeLookInLeft",
    "eyeLookOutLeft",
    "eyeLookUpLeft",
    "eyeSquintLeft",
    "eyeWideLeft",
    "eyeBlinkRight",
    "eyeLookDownRight",
    "eyeLookInRight",
    "eyeLookOutRight",
    "eyeLookUpRight",
    "eyeSquintRight",
    "eyeWideRight",
    "jawForward",
    "jawLeft",
    "jawRight",
    "jawOpen",
    "mouthClose",
    "mouthFunnel",
    "mouthPucker",
    "mouthLeft",
    "mouthRight",
    "mouthSmileLeft",
    "mouthSmileRight",
    "mouthFrownLeft",
    "mouthFrownRight",
    "mouthDimpleLeft",
    "mouthDimpleRight",
    "mouthStretchLeft",
    "mouthStretchRight",
    "mouthRollLower",
    "mouthRollUpper",
    "mouthShrugLower",
    "mouthShrugUpper",
    "mouthPressLeft",
    "mouthPressRight",
    "mouthLowerDownLeft",
    "mouthLowerDownRight",
    "mouthUpperUpLeft",
    "mouthUpperUpRight",
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "cheekPuff",
    "cheekSquintLeft",
    "cheekSquintRight",
    "noseSneerLeft",
    "noseSneerRight",
    "tongueOut",
];

/// Index of `jawOpen` in [`ARKIT_SHAPES`].
pub const JAW_OPEN: usize = 17;

/// Index of `mouthClose` in [`ARKIT_SHAPES`]: the corrective that brings the lips together
/// while the jaw is open, which makes sense up to the weight of `jawOpen` only.
pub const MOUTH_CLOSE: usize = 18;

/// Shapes that move something to the left and have an opposite that moves it to the right.
const OPPOSITES: [&str; 2] = ["jawLeft", "mouthLeft"];

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapeMatch {
    /// One shape, as an index into [`ARKIT_SHAPES`].
    One(usize),
    /// A name without its side (`eyeBlink`): the left and the right shape.
    Both(usize, usize),
}

impl ShapeMatch {
    /// The shapes, as indices into [`ARKIT_SHAPES`], left before right.
    pub fn shapes(self) -> Vec<usize> {
        match self {
            Self::One(shape) => vec![shape],
            Self::Both(left, right) => vec![left, right],
        }
    }

    /// Their names.
    pub fn names(self) -> Vec<&'static str> {
        let shapes = self.shapes().into_iter();
        shapes.map(|shape| ARKIT_SHAPES[shape]).collect()
    }
}

/// Finds the ARKit shape that `name` means.
///
/// Letter case and separators do not matter (`EyeBlinkLeft`, `eye_blink_left`), a final `L`
/// or `R` of its own stands for the side (`mouthSmile_L`, `mouthSmileR`), and anything may
/// stand before the name if it ends at a separator or a change of case
/// (`head_geo.blendShape1.jawOpen`, `ARKitJawOpen`).
pub fn match_shape(name: &str) -> Option<ShapeMatch> {
    let letters = Letters::new(name);
    let whole = |words: &Letters| {
        ARKIT_SHAPES
            .iter()
            .position(|shape| words.ends_with(&shape.to_ascii_lowercase()))
    };
    if let Some(shape) = whole(&letters) {
        return Some(ShapeMatch::One(shape));
    }
    if let Some(shape) = letters.with_side_spelled_out().and_then(|l| whole(&l)) {
        return Some(ShapeMatch::One(shape));
    }
    let left = whole(&letters.followed_by("left"))?;
    let right = whole(&letters.followed_by("right"))?;
    // Moving the jaw or the mouth left and right are opposites, not two sides of a pair.
    if OPPOSITES.contains(&ARKIT_SHAPES[left]) {
        return None;
    }
    Some(ShapeMatch::Both(left, right))
}

/// The shape that does on the other side what `shape` does; itself where it has no side.
///
/// # Panics
///
/// If `shape` is no index into [`ARKIT_SHAPES`].
pub fn mirrored_shape(shape: usize) -> usize {
    let name = ARKIT_SHAPES[shape];
    let other = match (name.strip_suffix("Left"), name.strip_suffix("Right")) {
        (Some(stem), _) => format!("{stem}Right"),
        (_, Some(stem)) => format!("{stem}Left"),
        _ => return shape,
    };
    let found = ARKIT_SHAPES.iter().position(|s| *s == other);
    found.unwrap_or(shape)
}

/// The candidate that is spelled most like `name`, letter case and separators aside.
///
/// Of those with as few letters to change, the one with more letters in common: `rame` is `frame`
/// rather than `name`.
pub fn nearest_name<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let name = Letters::new(name).text;
    candidates
        .into_iter()
        .map(|candidate| {
            let spelled = Letters::new(candidate).text;
            let changes = strsim::damerau_levenshtein(&name, &spelled);
            ((changes, 1.0 - strsim::jaro(&name, &spelled)), candidate)
        })
        .min_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
        .map(|(_, candidate)| candidate)
}

/// The letters and digits of a name in lower case, and where its words begin.
struct Letters {
    text: String,
    /// Byte offsets into `text`.
    word_starts: Vec<usize>,
}

impl Letters {
    fn new(name: &str) -> Self {
        let mut text = String::with_capacity(name.len());
        let mut word_starts = Vec::new();
        let mut previous = ' ';
        for c in name.chars() {
            if c.is_ascii_alphanumeric() {
                let is_start = !previous.is_ascii_alphanumeric()
                    || previous.is_ascii_digit()
                    || c.is_ascii_uppercase();
                if is_start {
                    word_starts.push(text.len());
                }
                text.push(c.to_ascii_lowercase());
            }
            previous = c;
        }
        Self { text, word_starts }
    }

    fn ends_with(&self, words: &str) -> bool {
        self.text
            .strip_suffix(words)
            .is_some_and(|prefix| self.word_starts.contains(&prefix.len()))
    }

    /// A last word of `l` or `r` becomes `left` or `right`.
    fn with_side_spelled_out(&self) -> Option<Self> {
        let last = *self.word_starts.last()?;
        let side = match &self.text[last..] {
            "l" => "left",
            "r" => "right",
            _ => return None,
        };
        Some(Self {
            text: self.text[..last].to_owned() + side,
            word_starts: self.word_starts.clone(),
        })
    }

    fn followed_by(&self, word: &str) -> Self {
        Self {
            text: self.text.clone() + word,
            word_starts: self.word_starts.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(name: &str) -> &'static str {
        match match_shape(name) {
            Some(ShapeMatch::One(i)) => ARKIT_SHAPES[i],
            other => panic!("{name}: {other:?}"),
        }
    }

    #[test]
    fn every_name_is_distinct_and_matches_itself_however_written() {
        for (i, shape) in ARKIT_SHAPES.iter().enumerate() {
            let capital = shape[..1].to_uppercase() + &shape[1..];
            for spelling in [
                (*shape).to_owned(),
                shape.to_uppercase(),
                format!("Head.{shape}"),
                format!("ARKit{capital}"),
            ] {
                assert_eq!(
                    match_shape(&spelling),
                    Some(ShapeMatch::One(i)),
                    "{spelling}"
                );
            }
        }
    }

    #[test]
    fn sides_may_be_letters() {
        assert_eq!(one("mouthSmile_L"), "mouthSmileLeft");
        assert_eq!(one("mouth_smile_r"), "mouthSmileRight");
        assert_eq!(one("eyeBlinkR"), "eyeBlinkRight");
        assert_eq!(one("geo:mouth.L"), "mouthLeft");
    }

    #[test]
    fn a_name_without_its_side_is_both() {
        let Some(ShapeMatch::Both(left, right)) = match_shape("eyeBlink") else {
            panic!("eyeBlink is both eyes");
        };
        assert_eq!(
            (ARKIT_SHAPES[left], ARKIT_SHAPES[right]),
            ("eyeBlinkLeft", "eyeBlinkRight")
        );
    }

    #[test]
    fn shapes_have_mirrors_and_the_named_indices_are_right() {
        assert_eq!(ARKIT_SHAPES[JAW_OPEN], "jawOpen");
        assert_eq!(ARKIT_SHAPES[MOUTH_CLOSE], "mouthClose");
        let mirror = |name: &str| {
            let shape = ARKIT_SHAPES.iter().position(|s| *s == name).unwrap();
            ARKIT_SHAPES[mirrored_shape(shape)]
        };
        assert_eq!(mirror("eyeBlinkLeft"), "eyeBlinkRight");
        assert_eq!(mirror("jawRight"), "jawLeft");
        assert_eq!(mirror("cheekPuff"), "cheekPuff");
        for shape in 0..ARKIT_SHAPES.len() {
            assert_eq!(mirrored_shape(mirrored_shape(shape)), shape);
        }
    }

    #[test]
    fn other_names_match_nothing() {
        for name in ["", "jaw", "notjawopen", "jawOpened", "smile", "l", "time"] {
            assert_eq!(match_shape(name), None, "{name}");
        }
        assert_eq!(
            nearest_name("jaw_opne", ARKIT_SHAPES.iter().copied()),
            Some("jawOpen")
        );
    }
}
