//! Whether a text keeps to the schema.

use std::collections::BTreeMap;
use std::ops::Range;

use super::node::{Entry, Node, Value, line_and_column};
use super::schema::{JOIN, Key, Kind, SCENE};
use crate::facs::nearest_name;
use crate::scene::{Hint, SceneError, TextPlace, Tolerance};

/// Checks the tree of a scene. Returns where the value of each key stands, by path.
///
/// # Errors
///
/// The first thing that is wrong, in the order of the text.
pub(super) fn check_scene(
    node: &Node,
    text: Option<&str>,
) -> Result<BTreeMap<String, TextPlace>, SceneError> {
    let mut walk = Walk {
        text,
        places: BTreeMap::new(),
    };
    match &node.value {
        Value::Table(entries) => walk.table(entries, SCENE, "", node)?,
        _ => return Err(walk.wrong(node, "a scene", "a table of keys".to_owned(), None)),
    }
    Ok(walk.places)
}

struct Walk<'a> {
    text: Option<&'a str>,
    places: BTreeMap<String, TextPlace>,
}

impl Walk<'_> {
    fn place(&self, span: Option<&Range<usize>>) -> TextPlace {
        match (self.text, span) {
            (Some(text), Some(span)) => line_and_column(text, span.start),
            _ => TextPlace::default(),
        }
    }

    fn wrong(&self, node: &Node, path: &str, expected: String, hint: Option<&str>) -> SceneError {
        SceneError::Value {
            place: self.place(node.span.as_ref()),
            key: path.into(),
            expected: expected.into(),
            found: node.in_words().into(),
            hint: Hint(hint.map(Box::from)),
        }
    }

    /// A key that a table needs and has not.
    fn missing(&self, table: &Node, path: &str, expected: String) -> SceneError {
        SceneError::Value {
            place: self.place(table.span.as_ref()),
            key: path.into(),
            expected: expected.into(),
            found: "nothing".into(),
            hint: Hint(None),
        }
    }

    fn table(
        &mut self,
        entries: &[Entry],
        keys: &[Key],
        path: &str,
        node: &Node,
    ) -> Result<(), SceneError> {
        for entry in entries {
            let own = join(path, &entry.name);
            let Some(key) = keys.iter().find(|key| key.name == entry.name) else {
                return Err(self.unknown(entry, keys.iter().map(|key| key.name), path));
            };
            self.node(&entry.node, &key.kind, &own)?;
        }
        let is_there = |key: &&Key| entries.iter().any(|entry| entry.name == key.name);
        match keys.iter().find(|key| key.is_required && !is_there(key)) {
            Some(key) => Err(self.missing(node, &join(path, key.name), key.kind.in_words())),
            None => Ok(()),
        }
    }

    fn unknown<'k>(
        &self,
        entry: &Entry,
        known: impl Iterator<Item = &'k str> + Clone,
        path: &str,
    ) -> SceneError {
        SceneError::UnknownKey {
            place: self.place(entry.span.as_ref()),
            key: entry.name.as_str().into(),
            table: if path.is_empty() {
                "a scene".into()
            } else {
                format!("`{path}`").into()
            },
            hint: Hint(nearest_name(&entry.name, known.clone()).map(Box::from)),
            known: known.collect::<Vec<_>>().join(", ").into(),
        }
    }

    fn node(&mut self, node: &Node, kind: &Kind, path: &str) -> Result<(), SceneError> {
        let place = self.place(node.span.as_ref());
        self.places.insert(path.to_owned(), place);
        let wrong = |walk: &Self| Err(walk.wrong(node, path, kind.in_words(), None));
        match (kind, &node.value) {
            // As if it were not there: what needs it says so.
            (_, Value::Null) => Ok(()),
            (Kind::Flag, Value::Flag(_)) | (Kind::Text | Kind::Path, Value::Text(_)) => Ok(()),
            (Kind::Number { low, high }, value) => match number(value) {
                Some(x) if (*low..=*high).contains(&x) => Ok(()),
                _ => wrong(self),
            },
            (Kind::Tolerance([most, _]), value) => {
                let is_read = match value {
                    Value::Text(text) => text.parse::<Tolerance>().is_ok(),
                    _ => number(value).is_some_and(|x| (0.0..=*most).contains(&x)),
                };
                if is_read { Ok(()) } else { wrong(self) }
            }
            (Kind::Integer { low, high }, Value::Integer(x))
                if (i128::from(*low)..=i128::from(*high)).contains(x) =>
            {
                Ok(())
            }
            (Kind::Word(words), Value::Text(text)) => {
                if words.contains(&text.as_str()) {
                    return Ok(());
                }
                let nearest = nearest_name(text, words.iter().copied());
                Err(self.wrong(node, path, kind.in_words(), nearest))
            }
            (Kind::Vector { limit }, Value::List(items)) => {
                let fits = |item: &Node| number(&item.value).is_some_and(|x| x.abs() <= *limit);
                if items.len() == 3 && items.iter().all(fits) {
                    return Ok(());
                }
                match items.iter().position(|item| !fits(item)) {
                    Some(bad) if items.len() == 3 => {
                        let expected = format!("a number up to {limit} in size");
                        Err(self.wrong(&items[bad], &format!("{path}[{bad}]"), expected, None))
                    }
                    _ => wrong(self),
                }
            }
            (Kind::Table(keys), Value::Table(entries)) => self.table(entries, keys, path, node),
            (Kind::Named(keys), Value::Table(entries)) => {
                for entry in entries {
                    let own = join(path, &entry.name);
                    let place = self.place(entry.node.span.as_ref());
                    self.places.insert(own.clone(), place);
                    match &entry.node.value {
                        Value::Table(inner) => self.table(inner, keys, &own, &entry.node)?,
                        _ => {
                            let expected = "a table".to_owned();
                            return Err(self.wrong(&entry.node, &own, expected, None));
                        }
                    }
                }
                Ok(())
            }
            (Kind::List(inner), Value::List(items)) => {
                for (index, item) in items.iter().enumerate() {
                    self.node(item, inner, &format!("{path}[{index}]"))?;
                }
                Ok(())
            }
            (Kind::Keys(keys), Value::List(items)) => self.keys(items, keys, path, node, kind),
            (Kind::OverTime(inner), Value::Table(_)) => {
                let keys = [
                    Key::required("time", TIME, "", ""),
                    Key::required("value", **inner, "", ""),
                ];
                self.keyed(node, &keys, path)
            }
            (Kind::OverTime(inner), _) => self.node(node, inner, path).map_err(|error| {
                match error {
                    // Not even the right kind: say both ways.
                    SceneError::Value {
                        key,
                        hint,
                        place,
                        found,
                        ..
                    } if *key == *path => SceneError::Value {
                        expected: kind.in_words().into(),
                        key,
                        hint,
                        place,
                        found,
                    },
                    other => other,
                }
            }),
            (Kind::Head(_), Value::Flag(_)) => Ok(()),
            (Kind::Head(keys), Value::Table(_)) => self.keyed(node, keys, path),
            (Kind::Tagged(variants), Value::Table(entries)) => {
                self.tagged(entries, variants, path, node, kind)
            }
            _ => wrong(self),
        }
    }

    /// `{ join = "...", keys = [...] }`.
    fn keyed(&mut self, node: &Node, keys: &[Key], path: &str) -> Result<(), SceneError> {
        let Value::Table(entries) = &node.value else {
            return Ok(());
        };
        for entry in entries {
            let own = join(path, &entry.name);
            match (entry.name.as_str(), &entry.node.value) {
                ("join", _) => self.node(&entry.node, &JOIN, &own)?,
                ("keys", Value::List(items)) => {
                    self.keys(items, keys, &own, &entry.node, &Kind::Keys(&[]))?;
                }
                ("keys", _) => {
                    let expected = Kind::Keys(&[]).in_words();
                    return Err(self.wrong(&entry.node, &own, expected, None));
                }
                _ => return Err(self.unknown(entry, ["join", "keys"].into_iter(), path)),
            }
        }
        if entries.iter().any(|entry| entry.name == "keys") {
            return Ok(());
        }
        Err(self.missing(node, &join(path, "keys"), Kind::Keys(&[]).in_words()))
    }

    /// At least one key, each later than the one before.
    fn keys(
        &mut self,
        items: &[Node],
        keys: &[Key],
        path: &str,
        node: &Node,
        kind: &Kind,
    ) -> Result<(), SceneError> {
        if items.is_empty() {
            return Err(self.wrong(node, path, kind.in_words(), None));
        }
        let mut before: Option<f64> = None;
        for (index, item) in items.iter().enumerate() {
            let own = format!("{path}[{index}]");
            let Value::Table(entries) = &item.value else {
                return Err(self.wrong(item, &own, "a table".to_owned(), None));
            };
            self.table(entries, keys, &own, item)?;
            let time = entries.iter().find(|entry| entry.name == "time");
            let Some((entry, time)) = time.and_then(|e| Some((e, number(&e.node.value)?))) else {
                continue;
            };
            if let Some(before) = before.filter(|before| time <= *before) {
                let expected = format!("a time after the key before it ({before})");
                return Err(self.wrong(&entry.node, &join(&own, "time"), expected, None));
            }
            before = Some(time);
        }
        Ok(())
    }

    /// A table whose `type` says what other keys it has.
    fn tagged(
        &mut self,
        entries: &[Entry],
        variants: &[(&str, &[Key])],
        path: &str,
        node: &Node,
        kind: &Kind,
    ) -> Result<(), SceneError> {
        let own = join(path, "type");
        let Some(tag) = entries.iter().find(|entry| entry.name == "type") else {
            // A misspelt `type` is nearer to the truth than one that is missing.
            let others = variants.iter().flat_map(|(_, keys)| keys.iter());
            let known: Vec<&str> = ["type"].into_iter().chain(others.map(|k| k.name)).collect();
            if let Some(entry) = entries.iter().find(|e| !known.contains(&e.name.as_str())) {
                return Err(self.unknown(entry, known.into_iter(), path));
            }
            return Err(self.missing(node, &own, kind.in_words()));
        };
        let names = variants.iter().map(|(name, _)| *name);
        let variant = match &tag.node.value {
            Value::Text(text) => variants.iter().find(|(name, _)| name == text),
            _ => None,
        };
        let Some((_, keys)) = variant else {
            let nearest = match &tag.node.value {
                Value::Text(text) => nearest_name(text, names),
                _ => None,
            };
            return Err(self.wrong(&tag.node, &own, kind.in_words(), nearest));
        };
        let known = ["type"].into_iter().chain(keys.iter().map(|key| key.name));
        for entry in entries.iter().filter(|entry| entry.name != "type") {
            if !keys.iter().any(|key| key.name == entry.name) {
                return Err(self.unknown(entry, known, path));
            }
        }
        let rest: Vec<Entry> = entries
            .iter()
            .filter(|e| e.name != "type")
            .cloned()
            .collect();
        self.table(&rest, keys, path, node)
    }
}

/// Times of keys. (s)
const TIME: Kind = Kind::Number {
    low: -1e6,
    high: 1e6,
};

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(x) => Some(*x as f64),
        Value::Number(x) => Some(*x),
        _ => None,
    }
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() {
        name.to_owned()
    } else {
        format!("{path}.{name}")
    }
}
