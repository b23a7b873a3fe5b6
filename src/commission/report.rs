//! What a procedure has found or done: an ordered list of named values, for people and for programs.

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value;

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its name for programs, with the unit.
    pub key: &'static str,
    /// Its name for people.
    pub label: String,
    /// The value for programs.
    pub value: Value,
    /// The value for people.
    pub text: String,
}

/// What was found, in the order in which people want to read it. Serialises as one map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    findings: Vec<Finding>,
    /// What programs get in place of the findings.
    value: Option<(&'static str, Value)>,
}

impl Report {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a finding.
    pub fn add(&mut self, key: &'static str, label: &str, value: impl Into<Value>, text: impl Into<String>) {
        let finding = Finding { key, label: label.to_owned(), value: value.into(), text: text.into() };
        self.findings.push(finding);
    }

    /// The same for people, and one value under this key for programs.
    #[must_use]
    pub fn under(mut self, key: &'static str, value: Value) -> Self {
        self.value = Some((key, value));
        self
    }

    /// The findings.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// The value with this key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.findings.iter().find(|finding| finding.key == key).map(|finding| &finding.value)
    }

    /// Adds the findings of another report.
    pub fn append(&mut self, other: Self) {
        self.findings.extend(other.findings);
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some((key, value)) = &self.value {
            map.serialize_entry(key, value)?;
            return map.end();
        }
        for finding in &self.findings {
            map.serialize_entry(finding.key, &finding.value)?;
        }
        map.end()
    }
}
