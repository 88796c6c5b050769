//! Every key that a scene's text may have: what it takes, what it means, and an example of those
//! that have no default.
//!
//! Tests hold this against the types that it describes and the ranges that other modules check.

mod cloth;
mod scene;
mod world;

#[cfg(test)]
pub(super) use cloth::MATERIAL;
pub(super) use scene::SCENE;

/// A key of a table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    pub(super) name: &'static str,
    pub(super) kind: Kind,
    /// One line, with the unit.
    pub(super) about: &'static str,
    /// A value, as text, of a key that has no default.
    pub(super) example: &'static str,
    pub(super) is_required: bool,
}

impl Key {
    pub(super) const fn new(name: &'static str, kind: Kind, about: &'static str) -> Self {
        Self::optional(name, kind, about, "")
    }

    pub(super) const fn optional(
        name: &'static str,
        kind: Kind,
        about: &'static str,
        example: &'static str,
    ) -> Self {
        Self {
            name,
            kind,
            about,
            example,
            is_required: false,
        }
    }

    pub(super) const fn required(
        name: &'static str,
        kind: Kind,
        about: &'static str,
        example: &'static str,
    ) -> Self {
        Self {
            is_required: true,
            ..Self::optional(name, kind, about, example)
        }
    }
}

/// What a key takes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Flag,
    Number {
        low: f64,
        high: f64,
    },
    Integer {
        low: u64,
        high: u64,
    },
    Text,
    /// Millimetres up to the first, or a text of percent up to the second.
    Tolerance([f64; 2]),
    /// A file.
    Path,
    Word(&'static [&'static str]),
    /// Three numbers, each up to `limit` in size.
    Vector {
        limit: f64,
    },
    Table(&'static [Key]),
    /// Tables by names of the writer's own.
    Named(&'static [Key]),
    List(&'static Kind),
    /// Tables with a rising `time`, at least one.
    Keys(&'static [Key]),
    /// A value, or keys with `time` and `value`.
    OverTime(&'static Kind),
    /// Whether the take moves the head, or keys.
    Head(&'static [Key]),
    /// A table whose `type` says what other keys it has.
    Tagged(&'static [(&'static str, &'static [Key])]),
}

impl Kind {
    /// What is expected, in words.
    pub(super) fn in_words(&self) -> String {
        match self {
            Self::Flag => "true or false".to_owned(),
            Self::Number { low, high } if *low == f64::MIN_POSITIVE => {
                format!("a number above 0, at most {high}")
            }
            Self::Number { low, high } => format!("a number from {low} to {high}"),
            Self::Integer { low, high } => format!("a whole number from {low} to {high}"),
            Self::Text => "a text".to_owned(),
            Self::Tolerance([mm, percent]) => {
                format!(
                    "a number from 0 to {mm} (mm), or a text of 0 to {percent} %, such as '0.05 %'"
                )
            }
            Self::Path => "the path of a file, as text".to_owned(),
            Self::Word(words) => format!("one of {}", quoted(words.iter())),
            Self::Vector { .. } => "three numbers [x, y, z]".to_owned(),
            Self::Table(_) | Self::Named(_) => "a table".to_owned(),
            Self::List(inner) => format!("a list, each {}", inner.in_words()),
            Self::Keys(_) => "a list of at least one key, a table each".to_owned(),
            Self::OverTime(inner) => {
                format!(
                    "{}, or {{ join = \"straight\", keys = [{{ time = 0, value = ... }}, ...] }}",
                    inner.in_words()
                )
            }
            Self::Head(_) => "true, false, or { keys = [{ time = 0, position = [0, 0, 0], \
                              rotation = [0, 0, 0] }, ...] }"
                .to_owned(),
            Self::Tagged(variants) => {
                format!("one of {}", quoted(variants.iter().map(|(name, _)| name)))
            }
        }
    }
}

fn quoted<'a>(words: impl Iterator<Item = &'a &'a str>) -> String {
    let words: Vec<String> = words.map(|word| format!("'{word}'")).collect();
    words.join(", ")
}

const fn from_to(low: f64, high: f64) -> Kind {
    Kind::Number { low, high }
}

const fn positive(high: f64) -> Kind {
    Kind::Number {
        low: f64::MIN_POSITIVE,
        high,
    }
}

const fn vector(limit: f64) -> Kind {
    Kind::Vector { limit }
}

const SEED: Kind = Kind::Integer {
    low: 0,
    high: i64::MAX as u64,
};
const TIME: Kind = from_to(-1e6, 1e6);
const PLACE: Kind = vector(1e6);
const RATE: Kind = from_to(0.0, 1e6);
const FRAME: Kind = Kind::Word(&["world", "head"]);
const NAMES: Kind = Kind::List(&Kind::Text);

/// How keys are joined.
pub(super) const JOIN: Kind = Kind::Word(&["straight", "smooth"]);
