//! Values of USD's text format.

use std::fmt::Write;

use crate::mesh::Polygons;

/// `[1, 2, 3]`
pub(super) fn list<T: std::fmt::Display>(values: impl IntoIterator<Item = T>) -> String {
    let mut text = String::from("[");
    for (k, value) in values.into_iter().enumerate() {
        if k > 0 {
            text.push_str(", ");
        }
        // Writing to a string cannot fail.
        let _ = write!(text, "{value}");
    }
    text.push(']');
    text
}

/// `[(1, 2, 3), ...]`
pub(super) fn tuples<const N: usize>(values: impl IntoIterator<Item = [f32; N]>) -> String {
    list(values.into_iter().map(tuple))
}

/// `(1, 2, 3)`
pub(super) fn tuple<const N: usize>(values: [f32; N]) -> String {
    let inner = list(values);
    format!("({})", &inner[1..inner.len() - 1])
}

/// Quoted, with what would end it escaped.
pub(super) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Names of prims: letters, digits and underscores, not a digit first, each once.
pub(super) fn prim_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken: Vec<String> = Vec::new();
    for name in names {
        let mut plain: String = name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        if plain.is_empty() || plain.starts_with(|c: char| c.is_ascii_digit()) {
            plain.insert(0, '_');
        }
        let base = plain.clone();
        let mut number = 2;
        while taken.contains(&plain) {
            plain = format!("{base}_{number}");
            number += 1;
        }
        taken.push(plain);
    }
    taken
}

/// Corners of every polygon.
pub(super) fn counts(polygons: &Polygons) -> String {
    list(polygons.iter().map(<[u32]>::len))
}

/// A rigid motion as USD writes matrices: rows, for points from the left.
pub(super) fn matrix(motion: &nalgebra::Isometry3<f64>) -> String {
    let m = motion.to_homogeneous();
    let rows = (0..4).map(|c| {
        format!(
            "({}, {}, {}, {})",
            m[(0, c)],
            m[(1, c)],
            m[(2, c)],
            m[(3, c)]
        )
    });
    format!("( {} )", rows.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_and_names_are_safe() {
        assert_eq!(quoted("a \"b\"\\\n"), r#""a \"b\"\\ ""#);
        assert_eq!(
            prim_names(["my face", "2", "my_face"]),
            ["my_face", "_2", "my_face_2"]
        );
        assert_eq!(tuples([[0.5f32, 1.0], [-0.0, 2.0]]), "[(0.5, 1), (-0, 2)]");
    }
}
