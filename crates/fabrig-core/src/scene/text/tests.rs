//! The schema is that of the types, and what is wrong with a text is told where it is.

use proptest::prelude::*;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::annotated_scene;
use super::schema::{Key, Kind, MATERIAL, SCENE};
use crate::cloth::{Cloth, ClothOptions, Material};
use crate::collision::{Collider, ContactOptions, Stickiness};
use crate::edit::WrinkleEdit;
use crate::scene::fields::{RadialForce, Shake, Turbulence};
use crate::scene::{
    Economy, Placement, RecordingChoice, Scene, SceneError, SceneFace, Simulate, TextPlace,
};

type Wrap<'a> = &'a dyn Fn(Value) -> Value;

/// Calls `see` with every table of the schema: its keys, and what makes a scene of one.
fn visit(keys: &'static [Key], wrap: Wrap<'_>, see: &mut dyn FnMut(&'static [Key], Wrap<'_>)) {
    see(keys, wrap);
    for key in keys {
        let at = |own: Value| wrap(json!({ key.name: own }));
        match &key.kind {
            Kind::Table(inner) => visit(inner, &at, see),
            Kind::Named(inner) => visit(inner, &|own| at(json!({ "a": own })), see),
            Kind::List(Kind::Table(inner)) | Kind::Keys(inner) => {
                visit(inner, &|own| at(json!([own])), see);
            }
            Kind::Head(inner) => visit(inner, &|own| at(json!({ "keys": [own] })), see),
            Kind::Tagged(variants) => {
                for (tag, inner) in *variants {
                    let tagged = |mut own: Value| {
                        own["type"] = json!(tag);
                        at(own)
                    };
                    visit(inner, &tagged, see);
                }
            }
            _ => {}
        }
    }
}

/// Every spelling of a name with one letter too few, too many, wrong or exchanged.
fn misspelt(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut found = Vec::new();
    for k in 0..letters.len() {
        let mut less = letters.clone();
        less.remove(k);
        found.push(less);
        for letter in ['q', 'e', '_'] {
            let mut more = letters.clone();
            more.insert(k, letter);
            found.push(more);
            let mut other = letters.clone();
            other[k] = letter;
            found.push(other);
        }
        let mut exchanged = letters.clone();
        exchanged.swap(k, (k + 1) % letters.len());
        found.push(exchanged);
    }
    let names = found
        .into_iter()
        .map(|letters| letters.into_iter().collect());
    names.filter(|other: &String| other != name).collect()
}

#[test]
fn every_key_misspelt_by_one_letter_is_answered_with_itself() {
    let mut count = 0;
    visit(SCENE, &|own| own, &mut |keys, wrap| {
        for key in keys {
            for name in misspelt(key.name) {
                if keys.iter().any(|key| key.name == name) {
                    continue;
                }
                let error = Scene::from_json(&wrap(json!({ name.clone(): 1 })).to_string());
                let Err(SceneError::UnknownKey {
                    key: found, hint, ..
                }) = error
                else {
                    panic!("{name} for {}: {error:?}", key.name);
                };
                assert_eq!(*found, *name);
                assert_eq!(hint.0.as_deref(), Some(key.name), "for {name}");
                count += 1;
            }
        }
    });
    assert!(count > 5000, "{count}");
}

/// The fields of a type, as `serde` lists them where one is not known.
fn fields<T: DeserializeOwned + std::fmt::Debug>() -> Vec<String> {
    let error = toml::from_str::<T>("no_such_key = 1").unwrap_err();
    let message = error.message().to_owned();
    let names = message.split("expected").nth(1).unwrap_or_default();
    names
        .split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

#[test]
fn the_schema_has_the_fields_of_the_types() {
    let keys_of = |name: &str| -> &'static [Key] {
        match SCENE.iter().find(|key| key.name == name).map(|k| k.kind) {
            Some(Kind::Table(keys) | Kind::Named(keys)) => keys,
            Some(Kind::List(Kind::Table(keys))) => keys,
            other => panic!("{name}: {other:?}"),
        }
    };
    let sticky = |keys: &'static [Key]| match keys.iter().find(|k| k.name == "sticky_lips") {
        Some(Key {
            kind: Kind::Table(keys),
            ..
        }) => *keys,
        other => panic!("{other:?}"),
    };
    for (mut expected, keys) in [
        (fields::<Scene>(), SCENE),
        (fields::<Placement>(), keys_of("place")),
        (fields::<ClothOptions>(), keys_of("cloth")),
        (fields::<ContactOptions>(), keys_of("contact")),
        (fields::<Stickiness>(), sticky(keys_of("contact"))),
        (fields::<Turbulence>(), keys_of("turbulence")),
        (fields::<Shake>(), keys_of("shake")),
        (fields::<Simulate>(), keys_of("simulate")),
        (fields::<Economy>(), keys_of("economy")),
        (fields::<RecordingChoice>(), keys_of("recording")),
        (fields::<WrinkleEdit>(), keys_of("wrinkles")),
        (fields::<RadialForce>(), keys_of("forces")),
        (fields::<Collider>(), keys_of("colliders")),
        (fields::<SceneFace>(), keys_of("faces")),
    ] {
        let mut names: Vec<&str> = keys.iter().map(|key| key.name).collect();
        names.sort_unstable();
        expected.sort_unstable();
        assert_eq!(names, expected);
    }
    let numbers = fields::<Material>();
    for key in MATERIAL.iter().filter(|key| key.name != "like") {
        assert!(numbers.contains(&key.name.to_owned()), "{}", key.name);
    }
    let known = |name: &String| MATERIAL.iter().any(|key| key.name == *name);
    // `overall_damping` is another name of `damping`.
    assert!(
        numbers
            .iter()
            .filter(|name| *name != "overall_damping")
            .all(known),
        "{numbers:?}"
    );
}

/// `base` with a number of it changed.
fn changed<T: serde::Serialize + DeserializeOwned>(base: &T, key: &str, value: f64) -> T {
    let mut plain = serde_json::to_value(base).unwrap();
    plain[key] = if plain[key].is_u64() {
        json!(value.round() as u64)
    } else {
        json!(value)
    };
    serde_json::from_value(plain).unwrap()
}

#[test]
fn ranges_are_those_that_are_checked_elsewhere() {
    let ends = |kind: &Kind| match *kind {
        Kind::Number { low, high } => Some([low, high]),
        Kind::Integer { low, high } if high < 1 << 40 => Some([low as f64, high as f64]),
        _ => None,
    };
    let table = |name: &str| match SCENE.iter().find(|key| key.name == name).map(|k| k.kind) {
        Some(Kind::Table(keys)) => keys,
        other => panic!("{other:?}"),
    };
    let cloth = |o: &ClothOptions| Cloth::new(&[], o).is_ok();
    let mut count = 0;
    let mut hold = |key: &Key, is_fine: &dyn Fn(f64) -> bool| {
        let Some([low, high]) = ends(&key.kind) else {
            return;
        };
        assert!(
            is_fine(low) && is_fine(high),
            "{}: an end is refused",
            key.name
        );
        assert!(
            !is_fine(high * 1.01 + 1.0),
            "{}: the upper end is not one",
            key.name
        );
        if low > 1.0 {
            assert!(
                !is_fine(low - 1.0),
                "{}: the lower end is not one",
                key.name
            );
        }
        count += 1;
    };
    for key in table("cloth") {
        hold(key, &|x| {
            cloth(&changed(&ClothOptions::default(), key.name, x))
        });
    }
    for key in table("contact") {
        let base = ContactOptions::default();
        hold(key, &|x| changed(&base, key.name, x).check().is_ok());
    }
    for key in MATERIAL {
        hold(key, &|x| {
            changed(&Material::FAT, key.name, x).validate().is_ok()
        });
    }
    assert!(count > 18, "{count}");
}

fn said(text: &str) -> (TextPlace, String) {
    let error = Scene::from_toml(text).unwrap_err();
    let place = match &error {
        SceneError::Text { place, .. }
        | SceneError::UnknownKey { place, .. }
        | SceneError::Value { place, .. }
        | SceneError::At { place, .. } => *place,
        other => panic!("{other:?}"),
    };
    let mut message = error.to_string();
    let mut cause = std::error::Error::source(&error);
    while let Some(inner) = cause {
        message = format!("{message}: {inner}");
        cause = inner.source();
    }
    (place, message)
}

#[test]
fn what_is_wrong_is_told_with_place_key_expectation_and_nearest_name() {
    let cases: [(&str, [usize; 2], &[&str]); 21] = [
        (
            "[economy]\ntolerance = \"6 %\"",
            [2, 13],
            &["`economy.tolerance`", "0 to 5 %", "found '6 %'"],
        ),
        (
            "[economy]\ntolerance = -0.1",
            [2, 13],
            &["`economy.tolerance`", "from 0 to 10 (mm)", "-0.1"],
        ),
        (
            "[place]\nposition = [0, 0, 1]\n[[faces]]\nrig = \"a.fabrig\"",
            [1, 1],
            &["`place`", "in each of the `faces`"],
        ),
        (
            "[[faces]]\nrig = \"a.fabrig\"\n[[faces]]\nrig = \"b c.fabrig\"",
            [3, 1],
            &["`faces[1].name`", "found 'b c'"],
        ),
        (
            "gravty = [0, 0, 0]",
            [1, 1],
            &["`gravty` is no key of a scene", "`gravity`"],
        ),
        (
            "\n[contact]\n  frction = 1",
            [3, 3],
            &["of `contact`", "`friction`"],
        ),
        (
            "fps = \"fast\"",
            [1, 7],
            &["`fps`", "a number above 0", "found 'fast'"],
        ),
        (
            "[cloth]\nsubsteps = 0",
            [2, 12],
            &["`cloth.substeps`", "from 1 to 4096", "found 0"],
        ),
        (
            "gravity = [0, 0]",
            [1, 11],
            &["three numbers", "a list of 2"],
        ),
        (
            "gravity = [0, nan, 0]",
            [1, 15],
            &["`gravity[1]`", "found NaN"],
        ),
        ("gravity = { keys = [] }", [1, 20], &["at least one key"]),
        ("gravity = { kesy = [] }", [1, 13], &["`kesy`", "`keys`"]),
        (
            "wind = { keys = [{ time = 1, value = [0, 0, 0] }, { time = 1, value = [0, 0, 0] }] }",
            [1, 60],
            &["`wind.keys[1].time`", "after the key before it (1)"],
        ),
        (
            "[contact]\npairs = \"sphinctr\"",
            [2, 9],
            &["'sphincter'", "mean `sphincter`"],
        ),
        (
            "[recording]\nrecord = [\"skin\", \"stain\"]",
            [2, 19],
            &["`strain`"],
        ),
        (
            "[[forces]]\nname = \"f\"",
            [1, 1],
            &["`forces[0].center`", "found nothing"],
        ),
        (
            "[[colliders]]\nname = \"b\"\nshape = { type = \"bal\", radius = 3 }\nkeys = []",
            [3, 18],
            &["`colliders[0].shape.type`", "`ball`"],
        ),
        (
            "[[colliders]]\nname = \"b\"\nshape = { type = \"ball\", radius = 3 }\n\
             keys = [{ time = 0, position = [0, 0, 0] }]\n[[colliders]]\nname = \"b\"\n\
             shape = { type = \"ball\", radius = 3 }\nkeys = [{ time = 0, position = [0, 0, 0] }]",
            [6, 8],
            &["`colliders[1].name`", "colliders[0] too"],
        ),
        (
            "[contact]\nsticky_lips = { gap = 3, break_gap = 1 }",
            [1, 1],
            &["`contact`", "sticky_lips.break_gap"],
        ),
        (
            "[materials.fat]\nmas = 1",
            [2, 1],
            &["`materials.fat`", "`mass`"],
        ),
        ("a = = 3", [1, 5], &["cannot be read"]),
    ];
    for (text, [line, column], parts) in cases {
        let (place, message) = said(text);
        assert_eq!(place, TextPlace { line, column }, "{text}: {message}");
        for part in parts {
            assert!(message.contains(part), "{text}: no '{part}' in: {message}");
        }
    }
}

#[test]
fn mappings_are_checked_by_the_same_schema() {
    let error = Scene::from_json("{\"contact\": {\"pair\": \"all\"}}").unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("`pair` is no key of `contact`; did you mean `pairs`?")
    );
    let scene = Scene {
        wind: [1.0, 2.0, 3.0].into(),
        fps: Some(30.0),
        ..Scene::default()
    };
    let text = serde_json::to_string(&scene).unwrap();
    assert_eq!(Scene::from_json(&text).unwrap(), scene);
}

#[test]
fn every_word_of_the_schema_is_read() {
    visit(SCENE, &|own| own, &mut |keys, wrap| {
        for key in keys {
            let Kind::Word(words) = key.kind else {
                continue;
            };
            for word in words {
                let text = wrap(json!({ key.name: word })).to_string();
                // What else is missing is another matter; the word must be known.
                if let Err(error) = Scene::from_json(&text) {
                    assert!(!error.to_string().contains(word), "{text}: {error}");
                }
            }
        }
    });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_text_makes_it_panic(text in "\\PC*") {
        let _ = Scene::from_toml(&text);
        let _ = Scene::from_json(&text);
    }

    #[test]
    fn no_damage_makes_it_panic(
        at in 0.0..1.0f64,
        take in 0..40usize,
        put in "[\\[\\]{}=\\.,\"#a-z0-9\n -]{0,6}",
    ) {
        let text = annotated_scene().replace("\n#", "\n");
        let mut letters: Vec<char> = text.chars().collect();
        let start = (at * letters.len() as f64) as usize;
        let end = (start + take).min(letters.len());
        letters.splice(start..end, put.chars());
        let _ = Scene::from_toml(&letters.into_iter().collect::<String>());
    }
}
