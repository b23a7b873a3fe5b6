//! Which buses are serial lines, and the period of those that give none.

use toml::de::{DeTable, DeValue};

use takt_rt::EngineParameters;

use crate::config::configured_family::ConfiguredFamily;

/// The names of the buses that have an axis whose drive is on a serial line. Whether a simulated bus is one must be known before
/// its keys are read, and what is wrong with the axes is none of this.
pub fn names<'a>(document: &'a DeTable<'a>, families: &[&'static dyn ConfiguredFamily]) -> Vec<&'a str> {
    let is_on_line =
        |word: &str| families.iter().any(|family| family.word() == word && family.is_on_serial_line());
    let table = |value: &'a DeValue<'a>| if let DeValue::Table(table) = value { Some(table) } else { None };
    let defaults = document
        .get("defaults")
        .and_then(|value| table(value.get_ref())?.get("axis"))
        .and_then(|value| table(value.get_ref()));
    let Some(DeValue::Array(axes)) = document.get("axis").map(|value| value.get_ref()) else { return vec![] };
    let text = |axis: &'a DeTable<'a>, key: &str| {
        let value = axis.get(key).or_else(|| defaults?.get(key))?;
        if let DeValue::String(text) = value.get_ref() { Some(text.as_ref()) } else { None }
    };
    let axes = axes.iter().filter_map(|axis| table(axis.get_ref()));
    axes.filter(|axis| text(axis, "drive").is_some_and(is_on_line))
        .filter_map(|axis| text(axis, "bus"))
        .collect()
}

/// The period of a line that gives none. A longer one would delay the axes of other buses that move with those of the line.
const PERIOD_NS: u64 = 10_000_000;

/// Cycles of the controller in the period of a line that gives none.
pub fn divider(cycle_ns: u64) -> u32 {
    u32::try_from(PERIOD_NS / cycle_ns.max(1)).unwrap_or(1).clamp(1, <EngineParameters>::LARGEST_DIVIDER)
}
