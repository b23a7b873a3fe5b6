//! A sentence as a template and its fields, so that a page can word it in another language.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::{self, Write as _};

use serde::Serialize;
use takt_wire::printable::Shown;

/// A sentence: an English template, which is its key in a table of another language, and the fields that fill it in. It is made by
/// [`words!`](crate::words!) or from a text without fields, and shown in English.
///
/// As JSON: `{"text": "{axis} is in {mode}", "fields": {"axis": "joint1", "mode": {"text": "homing"}}}`. A field that is a text is a name or
/// a number, which is the same in every language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Words {
    text: Cow<'static, str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    zh: Option<&'static str>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    fields: BTreeMap<&'static str, Field>,
}

/// A field of [`Words`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Field {
    /// A name or a number.
    Value(String),
    /// Words, which have a template of their own.
    Words(Words),
}

impl Words {
    /// A template with its fields. [`words!`](crate::words!) compares the two.
    pub fn new(text: &'static str, fields: impl IntoIterator<Item = (&'static str, Field)>) -> Self {
        Self { text: text.into(), zh: None, fields: fields.into_iter().collect() }
    }

    /// A text in English and in Chinese.
    pub const fn bilingual((english, chinese): (&'static str, &'static str)) -> Self {
        Self { text: Cow::Borrowed(english), zh: Some(chinese), fields: BTreeMap::new() }
    }
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rest = &*self.text;
        while let Some((before, after)) = rest.split_once('{') {
            f.write_str(before)?;
            let field = after.split_once('}').and_then(|(name, after)| Some((self.fields.get(name)?, after)));
            match field {
                Some((Field::Value(value), _)) => f.write_str(value)?,
                Some((Field::Words(words), _)) => words.fmt(f)?,
                None => f.write_char('{')?,
            }
            rest = field.map_or(after, |(_, after)| after);
        }
        f.write_str(rest)
    }
}

impl From<&'static str> for Words {
    fn from(text: &'static str) -> Self {
        Self::new(text, [])
    }
}

impl From<String> for Words {
    fn from(text: String) -> Self {
        Self { text: text.into(), zh: None, fields: BTreeMap::new() }
    }
}

impl From<Words> for Field {
    fn from(words: Words) -> Self {
        Self::Words(words)
    }
}

impl From<&str> for Field {
    fn from(value: &str) -> Self {
        Self::Value(value.to_owned())
    }
}

macro_rules! values {
    ($($value:ty),*) => {$(
        impl From<$value> for Field {
            fn from(value: $value) -> Self {
                Self::Value(value.to_string())
            }
        }

        impl From<&$value> for Field {
            fn from(value: &$value) -> Self {
                Self::Value(value.to_string())
            }
        }
    )*};
}

values!(String, u8, u16, u32, u64, usize, i8, i64, f64, Shown);

/// [`Words`] of a template and of its fields: `words!("{axis} is in {mode}", axis, mode = Words::from(mode.name()))`. A field that
/// the template lacks does not compile, and neither does a template that lacks a field.
#[macro_export]
macro_rules! words {
    ($template:literal $(, $name:ident $(= $value:expr)?)* $(,)?) => {{
        const _: fn() = || {
            let _ = ::core::format_args!($template $(, $name = "")*);
        };
        $crate::words::Words::new($template, [$((
            stringify!($name),
            $crate::words::Field::from($crate::words!(@ $name $(= $value)?)),
        )),*])
    }};
    (@ $name:ident) => { $name };
    (@ $name:ident = $value:expr) => { $value };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_shown_in_english_and_sent_as_their_template_and_fields() {
        let axis = "joint{mode}";
        let words = crate::words!("{axis} is in {mode}", axis, mode = Words::from("homing"));
        assert_eq!(words.to_string(), "joint{mode} is in homing");
        let sent = serde_json::json!({
            "text": "{axis} is in {mode}", "fields": { "axis": axis, "mode": { "text": "homing" } }
        });
        assert_eq!(serde_json::to_value(words).unwrap(), sent);
    }

    #[test]
    fn a_text_of_others_is_no_template() {
        for text in ["expected `{`", "{unknown} {", "a {} b", ""] {
            assert_eq!(Words::from(text.to_owned()).to_string(), text);
        }
    }
}
