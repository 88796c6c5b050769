//! A scene with every key explained.

use std::fmt::Write;

use serde_json::Value;

use super::schema::{Key, Kind, SCENE};
use crate::scene::Scene;

/// Names for examples of tables that have names of the writer's own.
const NAMES: [(&str, &str); 2] = [("materials", "fat"), ("wrinkles", "forehead")];

/// The default scene as TOML with every key, its meaning and unit; what has no default is
/// commented out. Reading it gives the default scene.
pub fn annotated_scene() -> String {
    let defaults = serde_json::to_value(Scene::default()).unwrap_or_default();
    let mut text = String::from(
        "# A scene: every key with its meaning, unit and default. What is commented out has no\n\
         # default. Every key may be left out, but for those that say they are needed.\n\n",
    );
    for key in SCENE {
        let default = &defaults[key.name];
        let (header, keys) = match key.kind {
            Kind::Table(keys) => (format!("[{}]", key.name), keys),
            Kind::Named(keys) => {
                let name = NAMES.iter().find(|(table, _)| *table == key.name);
                let name = name.map_or("name", |(_, name)| name);
                (format!("[{}.{name}]", key.name), keys)
            }
            Kind::List(Kind::Table(keys)) => (format!("[[{}]]", key.name), *keys),
            _ => {
                line(&mut text, key, default);
                continue;
            }
        };
        let is_default = matches!(key.kind, Kind::Table(_)) && default.is_object();
        let mark = if is_default { "" } else { "#" };
        // Writing to a string cannot fail.
        let _ = write!(text, "\n# {}\n{mark}{header}\n", key.about);
        for inner in keys {
            let none = Value::Null;
            let default = if is_default {
                &default[inner.name]
            } else {
                &none
            };
            line(&mut text, inner, default);
        }
    }
    text
}

fn line(text: &mut String, key: &Key, default: &Value) {
    let needed = if key.is_required { "; needed" } else { "" };
    let words = match key.kind {
        Kind::Word(words) => format!(" ({})", words.join(", ")),
        Kind::List(Kind::Word(words)) => format!(" ({})", words.join(", ")),
        _ => String::new(),
    };
    let (mark, value) = if default.is_null() {
        ("#", key.example.to_owned())
    } else {
        ("", in_toml(default))
    };
    let _ = write!(
        text,
        "# {}{words}{needed}\n{mark}{} = {value}\n",
        key.about, key.name
    );
}

/// A plain value as TOML writes it.
fn in_toml(value: &Value) -> String {
    match value {
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(in_toml).collect();
            format!("[{}]", items.join(", "))
        }
        Value::String(text) => format!("{text:?}"),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reads_as_the_default_scene() {
        let text = annotated_scene();
        assert_eq!(Scene::from_toml(&text).unwrap(), Scene::default());
    }

    #[test]
    fn with_nothing_commented_out_it_is_a_scene_with_everything() {
        let text: String = annotated_scene()
            .lines()
            .map(|line| match line.strip_prefix('#') {
                Some(rest) if !rest.starts_with(' ') => format!("{rest}\n"),
                _ => format!("{line}\n"),
            })
            .collect();
        let scene = Scene::from_toml(&text).unwrap();
        assert!(scene.turbulence.is_some() && scene.shake.is_some() && scene.fps.is_some());
        assert_eq!(scene.forces.len(), 1);
        assert_eq!(scene.colliders.len(), 1);
        assert_eq!(scene.faces.len(), 1);
        assert!(scene.materials.contains_key("fat") && scene.wrinkles.contains_key("forehead"));
        let defaults = scene.contact.sticky_lips;
        assert_eq!(defaults, Some(crate::collision::Stickiness::default()));
        assert_eq!(scene.turbulence, Some(Default::default()));
        assert_eq!(scene.shake, Some(Default::default()));
    }
}
