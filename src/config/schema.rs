//! A JSON Schema of configurations, written from the rows of `keys`: editors complete and check the keys by it.

use serde_json::{Map, Value, json};

use super::bounds::Bounds;
use super::key::{Key, Shown, Table, Values};
use super::keys::{self, TABLES};
use super::quantities::Quantities;
use super::quantity::Quantity;
use super::reference::{settings, stops};

/// A number with a unit, as in `"137 deg/s"`.
const WITH_UNIT: &str = "^ *[-+−]?[0-9.][0-9._]*([eE][-+]?[0-9]+)? *(1/)?[^0-9 ].*$";

/// Returns a JSON Schema (draft 7) of configurations, by which editors complete and check the keys.
pub fn schema() -> String {
    let mut root = table(&keys::root::TABLE);
    for table in TABLES.iter().filter(|table| !table.header.is_empty()) {
        insert(&mut root, table);
    }
    let mut stop_keys = object("categories of IEC 60204-1, by rule");
    add_keys(&mut stop_keys, &stops());
    set(&mut root, "stops", stop_keys);
    // The keys of families may stand at an axis, too.
    let of_axis = "/properties/axis/items";
    if let Some(axis) = root.pointer_mut(of_axis) {
        add_keys(axis, keys::family::TABLE.keys);
        add_keys(axis, &settings());
    }
    root["properties"]["defaults"]["properties"]["axis"] = json!({ "$ref": format!("#{of_axis}") });
    root["$schema"] = "http://json-schema.org/draft-07/schema#".into();
    root["title"] = "takt configuration".into();
    format!("{root:#}\n")
}

/// Puts a table where its header says: `[cycle.missed_slots]`, `[[bus]]`, `[axis.limits]`.
fn insert(root: &mut Value, described: &Table) {
    let is_list = described.header.starts_with("[[");
    let path: Vec<&str> = described.header.trim_matches(['[', ']']).split('.').collect();
    let Some((name, parents)) = path.split_last() else { return };
    let mut parent = root;
    for name in parents {
        if parent["properties"].get(name).is_none() {
            set(parent, name, object(""));
        }
        parent = &mut parent["properties"][*name];
        if parent.get("items").is_some() {
            parent = &mut parent["items"];
        }
    }
    let table = table(described);
    let value = if is_list { json!({ "type": "array", "items": table }) } else { table };
    set(parent, name, value);
}

fn object(description: &str) -> Value {
    let mut object = json!({ "type": "object", "additionalProperties": false, "properties": {} });
    if !description.is_empty() {
        object["description"] = description.into();
    }
    object
}

fn table(table: &Table) -> Value {
    let mut value = object(table.sentence);
    add_keys(&mut value, table.keys);
    value
}

fn add_keys(table: &mut Value, keys: &[Key]) {
    for key in keys {
        set(table, key.name, described(key));
    }
}

fn set(table: &mut Value, name: &str, value: Value) {
    if let Some(properties) = table.get_mut("properties").and_then(Value::as_object_mut) {
        properties.insert(name.to_owned(), value);
    }
}

fn described(key: &Key) -> Value {
    let mut value = match (values(key.values), key.word) {
        (value, Some(word)) => json!({ "anyOf": [value, { "const": word }] }),
        (value, None) => value,
    };
    let default = match key.shown {
        Shown::Default(literal) => format!("\nDefault: {}", key.literal(literal)),
        Shown::Computed(_) | Shown::Example(_) | Shown::Comment(_) => String::new(),
    };
    value["description"] = format!("{}{default}", key.sentence).into();
    value
}

fn values(values: Values) -> Value {
    match values {
        Values::Boolean => json!({ "type": "boolean" }),
        Values::Text => json!({ "type": "string" }),
        Values::Integer(low, high) => json!({ "type": "integer", "minimum": low, "maximum": high }),
        Values::Category => json!({ "enum": [0, 1, 2] }),
        Values::Number(bounds) => number(&[bounds]),
        Values::AnyNumber => either(json!({ "type": "number" }), &[]),
        Values::Quantity(quantity, bounds) => either(number(&[bounds]), &[quantity]),
        Values::OfAxis(of) => {
            let [(rotary, of_rotary), (linear, of_linear)] = [Quantities::ROTARY, Quantities::LINEAR].map(of);
            either(number(&[of_rotary, of_linear]), &[rotary, linear])
        }
        Values::Words(words) => json!({ "enum": words }),
        Values::List(of) => json!({ "type": "array", "items": self::values(*of) }),
        Values::OneOrList(of) => {
            let one = self::values(*of);
            json!({ "anyOf": [one, { "type": "array", "items": one }] })
        }
    }
}

/// A number in SI units, or a text with its unit.
fn either(number: Value, quantities: &[Quantity]) -> Value {
    let examples: Vec<&str> = quantities.iter().map(|quantity| quantity.example).collect();
    json!({ "anyOf": [number, { "type": "string", "pattern": WITH_UNIT, "examples": examples }] })
}

/// A number in one of these bounds. Infinity is no number of JSON: what may be infinite has no upper bound.
fn number(bounds: &[Bounds]) -> Value {
    let ranges = bounds.iter().map(|bounds| match *bounds {
        Bounds::Between(low, high) | Bounds::Plausible { low, high, .. } => (low, high),
        Bounds::PlausibleOrZero { high, .. } => (0.0, high),
        Bounds::PlausibleOrInfinite { low, .. } => (low, f64::INFINITY),
        Bounds::Share => (0.0, 1.0),
        Bounds::Finite => (f64::NEG_INFINITY, f64::INFINITY),
    });
    let (low, high) = ranges
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), range| (range.0.min(low), range.1.max(high)));
    let mut value = Map::from_iter([("type".to_owned(), json!("number"))]);
    for (name, bound) in [("minimum", low), ("maximum", high)] {
        if bound.is_finite() {
            value.insert(name.to_owned(), json!(bound));
        }
    }
    value.into()
}
