//! What takt says, in the two languages of the pages.
//!
//! takt makes its sentences in English, each where it belongs. The tables here have the Chinese ones; what a family alone says stands in its folder
//! ([`Family::chinese_phrases`](takt::family::Family::chinese_phrases)). A sentence without a phrase stays English, as those of
//! drives' own files do.

mod bench;
mod book;
mod commands;
mod cures;
mod drive_errors;
mod events;
#[cfg(feature = "server")]
mod frame_terms;
#[cfg(feature = "server")]
mod glossary;
mod procedures;
mod refusals;
mod rejections;
mod scans;
mod stops;

use serde::Serialize;

#[cfg(feature = "server")]
use takt_tools::monitor::Decoded;

/// A sentence in both languages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Words {
    en: String,
    zh: String,
}

impl Words {
    /// An English sentence of takt.
    pub fn of(english: impl Into<String>) -> Self {
        let en = english.into();
        let zh = book::book().chinese(&en).unwrap_or_else(|| en.clone());
        Self { en, zh }
    }

    /// What a frame means.
    #[cfg(feature = "server")]
    pub fn of_meaning(decoded: &Decoded) -> Self {
        // Names of axes stay. Others who are concerned are `node 3` or the controller.
        let names = decoded.who.split(", ").filter(|_| !decoded.axes.is_empty());
        let zh = decoded.line_in("：", |part| glossary::glossary().chinese(part, names.clone()));
        Self { en: decoded.line(), zh }
    }

    /// What stands for itself in both languages.
    #[cfg(feature = "server")]
    pub fn none() -> Self {
        Self { en: String::new(), zh: String::new() }
    }

    /// Returns `true` if either of the languages has this part, which is in small letters.
    #[cfg(feature = "server")]
    pub fn contain(&self, before: &str, part: &str) -> bool {
        [&self.en, &self.zh]
            .into_iter()
            .any(|words| format!("{before} {words}").to_lowercase().contains(part))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use takt::telemetry::{AxisDescription, BusDescription, Machine, SetPointMagnitudes, Unit};

    /// Names, units and signs that a Chinese sentence has as well.
    const KEPT: &str = "shoulder slide left right rad rad/s rad/s² rad/s³ m/s m/s² m/s³ ms deg bit/s takt CANopen Modbus eRob operational \
                        pre-operational stopped boot-up bus-off panic mode pv pt cst Homing master localhost x-takt-panel application/json";

    /// A machine with the names of [`KEPT`].
    pub(super) fn machine() -> Machine {
        let axis = |name: &str, unit| AxisDescription {
            name: name.to_owned(),
            bus: None,
            group: 0,
            family: None,
            own_errors: vec![],
            unit,
            plans_own_profile: false,
            counts_per_unit: 1.0,
            limits: SetPointMagnitudes::default(),
        };
        let bus = BusDescription {
            name: "left".to_owned(),
            interface: "can0".to_owned(),
            bit_rate: None,
            data_bit_rate: None,
        };
        Machine {
            name: "arm".to_owned(),
            cycle_ns: 1_000_000,
            axes: vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)],
            buses: vec![bus],
            groups: ["left", "right", "slide"].map(str::to_owned).to_vec(),
        }
    }

    /// All that takt may say: the source without the tables of Chinese, each space of any length one.
    pub(super) fn source() -> String {
        fn add(folder: &Path, to: &mut String) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                match path.is_dir() {
                    _ if name.contains("chinese") => {}
                    true => add(&path, to),
                    false => to.push_str(&fs::read_to_string(&path).unwrap_or_default()),
                }
            }
        }
        let mut source = String::new();
        for folder in ["src", "crates", "rt/src"] {
            add(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(folder), &mut source);
        }
        let source = source.replace("\\\"", "\"").replace("\\\n", "\n");
        source.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Fails unless a sentence of takt is Chinese, but for names, units, and what stands in backticks.
    #[track_caller]
    pub(super) fn is_chinese(english: &str) {
        let Words { zh, .. } = Words::of(english);
        let has_han = zh.chars().any(|letter| ('\u{4e00}'..='\u{9fff}').contains(&letter));
        let outside: String = zh.split('`').step_by(2).collect::<Vec<_>>().join(" ");
        let is_of_word = |letter: char| letter.is_ascii_alphabetic() || "/-²³_".contains(letter);
        let is_english = |word: &&str| {
            let small = word.chars().filter(char::is_ascii_lowercase).count();
            small > 1 && !KEPT.split(' ').any(|kept| kept == *word) && !word.starts_with("--")
        };
        let left: Vec<&str> = outside.split(|letter| !is_of_word(letter)).filter(is_english).collect();
        assert!(has_han && left.is_empty(), "{left:?} of {english:?} are left in {zh:?}");
    }
}
