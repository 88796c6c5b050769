//! The text of a scene: what keys there are (`schema`), whether a text keeps to them (`check`),
//! where everything stands in it (`source`), and a scene with every key explained (`show`).
//!
//! A text is checked against the schema before it becomes a [`Scene`], so that what is wrong is
//! told with line, column, key, what was expected, and the nearest known name.

mod check;
mod node;
mod schema;
mod show;
mod source;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

pub use show::annotated_scene;
pub use source::SceneSource;

use super::{Scene, SceneError, TextPlace};
use crate::recording::is_name_of_several;
use check::check_scene;
use node::{Node, line_and_column};

/// - `folder`: where files are that the text names
pub(super) fn from_toml(text: &str, folder: &Path) -> Result<Scene, SceneError> {
    let node = Node::of_toml(text)?;
    let places = check_scene(&node, Some(text))?;
    let scene = toml::from_str(text).map_err(|error| no_toml(text, &error))?;
    finish(scene, places, folder)
}

pub(super) fn from_json(text: &str) -> Result<Scene, SceneError> {
    let failed = |error: serde_json::Error| SceneError::Text {
        place: TextPlace::default(),
        reason: one_line(&error.to_string()),
    };
    let value: serde_json::Value = serde_json::from_str(text).map_err(failed)?;
    let node = Node::of_json(&value);
    let places = check_scene(&node, None)?;
    let scene = serde_json::from_value(value).map_err(failed)?;
    finish(scene, places, Path::new(""))
}

/// What the schema cannot say: what options, colliders and names must be among each other.
fn finish(
    mut scene: Scene,
    places: BTreeMap<String, TextPlace>,
    folder: &Path,
) -> Result<Scene, SceneError> {
    scene.source = SceneSource::new(folder, places);
    let source = &scene.source;
    scene
        .contact
        .check()
        .map_err(|error| source.at("contact", error))?;
    for (index, collider) in scene.colliders.iter().enumerate() {
        collider
            .check(index)
            .map_err(|error| source.at(&format!("colliders[{index}]"), error))?;
    }
    if !scene.faces.is_empty() && scene.place != super::Placement::default() {
        return Err(source.value(
            "place",
            "`position` and `turn` in each of the `faces`".to_owned(),
            "a place for all of them".to_owned(),
            None,
        ));
    }
    for (index, face) in scene.faces.iter().enumerate() {
        let name = face.display_name();
        if scene.faces.len() > 1 && !is_name_of_several(&name) {
            return Err(source.value(
                &format!("faces[{index}].name"),
                "letters from a to z, digits and any of _ - . alone, as it goes into topics"
                    .to_owned(),
                format!("'{name}'"),
                None,
            ));
        }
    }
    let names = |list: &str, names: Vec<String>| {
        for (index, name) in names.iter().enumerate() {
            if let Some(first) = names[..index].iter().position(|other| other == name) {
                return Err(source.value(
                    &format!("{list}[{index}].name"),
                    "a name of its own".to_owned(),
                    format!("'{name}', which is that of {list}[{first}] too"),
                    None,
                ));
            }
        }
        Ok(())
    };
    names(
        "colliders",
        scene.colliders.iter().map(|c| c.name.clone()).collect(),
    )?;
    names(
        "forces",
        scene.forces.iter().map(|f| f.name.clone()).collect(),
    )?;
    names(
        "faces",
        scene
            .faces
            .iter()
            .map(super::SceneFace::display_name)
            .collect(),
    )?;
    Ok(scene)
}

/// Where and why a text is no TOML, or no scene.
fn no_toml(text: &str, error: &toml::de::Error) -> SceneError {
    let span = error.span();
    SceneError::Text {
        place: span.map_or_else(TextPlace::default, |span| line_and_column(text, span.start)),
        reason: one_line(error.message()),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
