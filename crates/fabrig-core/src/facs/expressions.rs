//! Expressions by name, from `expressions.toml`: sheets to look at a face by.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

/// An expression as weights of ARKit's shapes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedExpression {
    /// The sheet that it is drawn on.
    pub sheet: String,
    /// Name, such as `surprise`.
    pub name: String,
    /// Weight by shape, 0 to 1; a name without its side means both sides.
    pub weights: BTreeMap<String, f32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    expression: Vec<NamedExpression>,
}

static BUNDLED: LazyLock<Vec<NamedExpression>> = LazyLock::new(|| {
    let text = include_str!("../../../../templates/human/expressions.toml");
    match toml::from_str::<File>(text) {
        Ok(file) => file.expression,
        // Part of the binary, and loaded by a test.
        Err(error) => panic!("the embedded expressions are damaged: {error}"),
    }
});

/// The bundled expressions, sheet after sheet.
pub fn named_expressions() -> &'static [NamedExpression] {
    &BUNDLED
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facs::match_shape;

    #[test]
    fn two_sheets_of_twelve_name_shapes_that_there_are() {
        for sheet in ["motion", "emotions"] {
            let all = named_expressions().iter().filter(|e| e.sheet == sheet);
            assert_eq!(all.clone().count(), 12, "{sheet}");
            for expression in all {
                assert!(expression.weights.values().any(|w| *w >= 0.5));
                for (shape, weight) in &expression.weights {
                    assert!(match_shape(shape).is_some(), "{}: {shape}", expression.name);
                    assert!((0.0..=1.0).contains(weight), "{}", expression.name);
                }
            }
        }
    }
}
