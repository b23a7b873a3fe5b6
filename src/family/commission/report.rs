//! The result of a procedure: an ordered list of named values, for people and for programs.

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

use crate::words::Words;

/// One named value.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportItem {
    /// The key for programs, with the unit.
    pub key: &'static str,
    /// The label for people.
    pub label: String,
    /// The value for programs.
    pub value: Value,
    /// The value for people.
    pub text: Words,
}

/// Named values in reading order. It serialises as one map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    items: Vec<ReportItem>,
    /// Replaces the items when the report is serialised.
    value: Option<(&'static str, Value)>,
}

impl Report {
    /// An empty report.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a value.
    pub fn add(&mut self, key: &'static str, label: &str, value: impl Into<Value>, text: impl Into<Words>) {
        let item = ReportItem { key, label: label.to_owned(), value: value.into(), text: text.into() };
        self.items.push(item);
    }

    /// Serialises as one key and value instead of the items; people still see the items.
    #[must_use]
    pub fn under(mut self, key: &'static str, value: Value) -> Self {
        self.value = Some((key, value));
        self
    }

    /// The values in order.
    pub fn items(&self) -> &[ReportItem] {
        &self.items
    }

    /// The value with this key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.items.iter().find(|item| item.key == key).map(|item| &item.value)
    }

    /// Adds the values of another report.
    pub fn append(&mut self, other: Self) {
        self.items.extend(other.items);
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some((key, value)) = &self.value {
            map.serialize_entry(key, value)?;
            return map.end();
        }
        for item in &self.items {
            map.serialize_entry(item.key, &item.value)?;
        }
        map.end()
    }
}
