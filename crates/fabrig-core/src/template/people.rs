//! Other people in the template's topology: what a registration of them should find.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::geometry::{Steps, to_steps, to_vector, unpack};
use super::{Template, TemplateError, human};
use crate::Point;

/// Somebody whose vertices correspond to those of the bundled template.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// Name in the list of faces.
    pub name: String,
    /// Positions of the template's skin vertices on this person. (mm, head frame)
    pub positions: Vec<Point>,
}

/// As kept: names and differences from the template's skin.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct StoredPeople(Vec<(String, Vec<Steps>)>);

/// For packing.
pub(super) fn store_people(template: &Template, people: &[(String, Vec<Point>)]) -> StoredPeople {
    let skin = template.skin.positions();
    StoredPeople(
        people
            .iter()
            .map(|(name, positions)| {
                let deltas = positions.iter().zip(skin).map(|(p, q)| to_steps(&(p - q)));
                (name.clone(), deltas.collect())
            })
            .collect(),
    )
}

fn load() -> Result<Vec<Person>, TemplateError> {
    let bytes = include_bytes!("../../../../templates/demo/people.bin");
    let stored: StoredPeople = unpack(bytes)?;
    let skin = human().skin.positions();
    stored
        .0
        .into_iter()
        .map(|(name, deltas)| {
            if deltas.len() != skin.len() {
                return Err(TemplateError::Source {
                    reason: format!(
                        "{name} has {} vertices, the template {}",
                        deltas.len(),
                        skin.len()
                    ),
                });
            }
            let positions = skin.iter().zip(&deltas).map(|(p, d)| p + to_vector(d));
            Ok(Person {
                name,
                positions: positions.collect(),
            })
        })
        .collect()
}

static PEOPLE: LazyLock<Vec<Person>> = LazyLock::new(|| match load() {
    Ok(people) => people,
    // Part of the binary and loaded by a test, like the template itself.
    Err(error) => panic!("the embedded people are damaged: {error}"),
});

/// Everyone bundled, by name: men and women of several ages, a goblin and an ogre.
pub fn people() -> &'static [Person] {
    &PEOPLE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everyone_has_every_vertex_and_differs_from_the_template() {
        let skin = human().skin.positions();
        assert!(people().len() >= 5);
        for person in people() {
            let moved = person
                .positions
                .iter()
                .zip(skin)
                .map(|(p, q)| (p - q).norm())
                .fold(0.0, f64::max);
            assert!(moved > 5.0 && moved < 150.0, "{}: {moved}", person.name);
        }
    }
}
