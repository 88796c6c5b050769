//! A text as a tree of values with their places.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::{SceneError, TextPlace, no_toml};

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// Bytes of the text; none where there is no text.
    pub(super) span: Option<Range<usize>>,
    pub(super) value: Value,
}

#[derive(Debug, Clone)]
pub(super) enum Value {
    /// Nothing: as if the key were not there.
    Null,
    Flag(bool),
    Integer(i128),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    /// In the order of the text.
    Table(Vec<Entry>),
    /// What no key takes, in words.
    Other(&'static str),
}

/// A key with its value.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) span: Option<Range<usize>>,
    pub(super) node: Node,
}

impl Node {
    pub(super) fn of_toml(text: &str) -> Result<Self, SceneError> {
        let document = DeTable::parse(text).map_err(|error| no_toml(text, &error))?;
        Ok(Self {
            span: None,
            value: of_table(document.get_ref()),
        })
    }

    pub(super) fn of_json(value: &serde_json::Value) -> Self {
        use serde_json::Value as Json;
        let value = match value {
            Json::Null => Value::Null,
            Json::Bool(flag) => Value::Flag(*flag),
            Json::Number(number) => match (number.as_i64(), number.as_u64()) {
                (Some(integer), _) => Value::Integer(integer.into()),
                (None, Some(integer)) => Value::Integer(integer.into()),
                (None, None) => Value::Number(number.as_f64().unwrap_or(f64::NAN)),
            },
            Json::String(text) => Value::Text(text.clone()),
            Json::Array(items) => Value::List(items.iter().map(Self::of_json).collect()),
            Json::Object(entries) => Value::Table(
                entries
                    .iter()
                    .map(|(name, value)| Entry {
                        name: name.clone(),
                        span: None,
                        node: Self::of_json(value),
                    })
                    .collect(),
            ),
        };
        Self { span: None, value }
    }

    /// What it is, in words.
    pub(super) fn in_words(&self) -> String {
        match &self.value {
            Value::Null => "nothing".to_owned(),
            Value::Flag(flag) => flag.to_string(),
            Value::Integer(number) => number.to_string(),
            Value::Number(number) => number.to_string(),
            Value::Text(text) => format!("'{}'", text.escape_debug()),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Table(_) => "a table".to_owned(),
            Value::Other(what) => (*what).to_owned(),
        }
    }
}

fn of_table(table: &DeTable<'_>) -> Value {
    let mut entries: Vec<Entry> = table
        .iter()
        .map(|(key, value)| Entry {
            name: key.get_ref().to_string(),
            span: Some(key.span()),
            node: Node {
                span: Some(value.span()),
                value: of_value(value.get_ref()),
            },
        })
        .collect();
    entries.sort_by_key(|entry| entry.span.as_ref().map(|span| span.start));
    Value::Table(entries)
}

fn of_value(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix())
            .map_or(Value::Other("a number that is too large"), Value::Integer),
        DeValue::Float(float) => float
            .as_str()
            .parse()
            .map_or(Value::Other("a number that cannot be read"), Value::Number),
        DeValue::Boolean(flag) => Value::Flag(*flag),
        DeValue::Datetime(_) => Value::Other("a date"),
        DeValue::Array(items) => Value::List(
            items
                .iter()
                .map(|item| Node {
                    span: Some(item.span()),
                    value: of_value(item.get_ref()),
                })
                .collect(),
        ),
        DeValue::Table(table) => of_table(table),
    }
}

/// Line and column of a byte of a text, both from 1.
pub(super) fn line_and_column(text: &str, byte: usize) -> TextPlace {
    let mut end = byte.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let before = &text[..end];
    let line = before.rfind('\n').map_or(0, |at| at + 1);
    TextPlace {
        line: 1 + before.matches('\n').count(),
        column: 1 + before[line..].chars().count(),
    }
}
