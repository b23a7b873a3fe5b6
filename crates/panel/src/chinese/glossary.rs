//! The meaning of a frame in Chinese.
//!
//! It is made of names, states and numbers, which change from frame to frame, so no phrase is for the whole of it. It is taken term by
//! term: the longest one that is known at each word. What is no term stays as it is, as the names of axes do.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use super::{book, frame_terms};
use takt::family::{self, ChineseTerm};

/// Every term there is: those of frames, then sentences without parts, as the errors of drives are.
fn terms() -> Vec<ChineseTerm> {
    let of_families = family::all().into_iter().flat_map(|family| family.chinese_terms());
    let sentences = book::phrases().into_iter().filter(|(english, _)| !english.contains(['{', '<', '`']));
    let mut seen = BTreeSet::new();
    let all = frame_terms::TERMS.iter().copied().chain(of_families).chain(sentences);
    all.filter(|(english, _)| seen.insert(*english)).collect()
}

/// The glossary of all terms.
pub fn glossary() -> &'static Glossary {
    static GLOSSARY: OnceLock<Glossary> = OnceLock::new();
    GLOSSARY.get_or_init(|| Glossary::of(terms()))
}

/// Terms by their first letter, the longest first.
pub struct Glossary {
    terms: BTreeMap<char, Vec<ChineseTerm>>,
}

impl Glossary {
    fn of(terms: impl IntoIterator<Item = ChineseTerm>) -> Self {
        let mut sorted: BTreeMap<char, Vec<ChineseTerm>> = BTreeMap::new();
        for term in terms {
            if let Some(first) = term.0.chars().next() {
                sorted.entry(first).or_default().push(term);
            }
        }
        for terms in sorted.values_mut() {
            terms.sort_by_key(|(english, _)| std::cmp::Reverse(english.len()));
        }
        Self { terms: sorted }
    }

    /// A meaning in Chinese. `names` stay as they are, except in a longer term, as does what stands in quotation marks.
    pub fn chinese<'n>(&self, meaning: &str, names: impl Iterator<Item = &'n str> + Clone) -> String {
        let mut words = Chinese::default();
        let mut rest = meaning;
        while let Some(letter) = rest.chars().next() {
            let term = self.term(rest);
            let longest = term.map_or(0, |(english, _)| english.len());
            let name = names.clone().find(|name| name.len() >= longest && is_next(rest, name));
            let taken = if let Some(name) = name {
                words.keep(name);
                name.len()
            } else if let Some((english, chinese)) = term {
                words.add(chinese);
                english.len()
            } else if letter == '"' {
                let end = rest.char_indices().skip(1).find(|(_, letter)| *letter == '"');
                let text = end.map_or(rest, |(end, _)| &rest[..=end]);
                words.keep(text);
                text.len()
            } else if letter.is_alphanumeric() {
                let end = rest.find(|letter: char| !is_of_word(letter)).unwrap_or(rest.len());
                words.keep(&rest[..end]);
                end
            } else {
                words.sign(letter);
                letter.len_utf8()
            };
            rest = &rest[taken..];
        }
        words.text
    }

    fn term(&self, rest: &str) -> Option<ChineseTerm> {
        let terms = self.terms.get(&rest.chars().next()?)?;
        terms.iter().find(|(english, _)| is_next(rest, english)).copied()
    }
}

/// Returns `true` if a text begins with these words, and not with a longer one.
fn is_next(text: &str, words: &str) -> bool {
    let Some(rest) = text.strip_prefix(words) else { return false };
    !words.is_empty() && (!words.ends_with(is_of_word) || !rest.starts_with(is_of_word))
}

fn is_of_word(letter: char) -> bool {
    letter.is_alphanumeric() || letter == '_' || letter == '-'
}

fn is_han(letter: char) -> bool {
    ('\u{4e00}'..='\u{9fff}').contains(&letter)
}

/// A Chinese text that is being made.
#[derive(Default)]
struct Chinese {
    text: String,
    /// True if the end is within square brackets, where numbers stand.
    is_in_list: bool,
}

impl Chinese {
    /// No space stands between Chinese words.
    fn add(&mut self, chinese: &str) {
        let mut before = self.text.chars().rev();
        let is_between =
            before.next() == Some(' ') && before.next().is_some_and(is_han) && chinese.starts_with(is_han);
        if is_between {
            self.text.pop();
        }
        self.text.push_str(chinese);
    }

    fn keep(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// The signs of Chinese are as wide as their spaces, but for those between numbers.
    fn sign(&mut self, sign: char) {
        match sign {
            '[' => self.is_in_list = true,
            ']' => self.is_in_list = false,
            _ => {}
        }
        let before = self.text.chars().next_back().filter(|_| sign == ' ' && !self.is_in_list);
        if let Some(wide) = before.and_then(wide) {
            self.text.pop();
            self.text.push(wide);
        } else {
            self.text.push(sign);
        }
    }
}

/// What stands in Chinese for a sign and a space.
const fn wide(sign: char) -> Option<char> {
    match sign {
        ':' => Some('：'),
        ';' => Some('；'),
        ',' => Some('，'),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::chinese::Words;
    use crate::chinese::tests::source;
    use takt::config::Config;
    use takt_tools::monitor::BusDecoder;
    use takt_wire::bus_log::frame_text;
    use takt_wire::canopen::emcy::ErrorCode;
    use takt_wire::canopen::sdo::AbortCode;
    use takt_wire::erob_can::entries::Entry;
    use takt_wire::erob_can::parameter::{Parameter as _, Values};

    /// Names of protocols, units and the like, which are the same in Chinese.
    const KEPT: &str = "rad rad/s rad/s² m m/s mm/s Nm N·m mN·m count/s count/s² kbit/s bit/s ms min r/min save load deg deg/s deg/s² CiA eRob \
                        Modbus CANopen EtherCAT boot-up stopped operational pre-operational";

    /// The English words that are left in a Chinese meaning.
    fn left(chinese: &str, names: &[&str]) -> Vec<String> {
        let outside: String = chinese.split('"').step_by(2).collect();
        let is_of_word = |letter: char| letter.is_alphanumeric() || "/-_²³·".contains(letter);
        let is_english = |word: &&str| {
            let letters = word.chars().filter(|letter| !is_han(*letter)).collect::<String>();
            let is_number = letters.starts_with(|letter: char| letter.is_ascii_digit());
            let small = letters.chars().filter(char::is_ascii_lowercase).count();
            small > 1 && !is_number && !names.contains(word) && !KEPT.split(' ').any(|kept| kept == *word)
        };
        outside.split(|letter| !is_of_word(letter)).filter(is_english).map(str::to_owned).collect()
    }

    /// Fails unless all of them are Chinese.
    #[track_caller]
    fn are_chinese(all: impl IntoIterator<Item = String>) {
        let mut english: Vec<String> = vec![];
        for meaning in all {
            let chinese = glossary().chinese(&meaning, std::iter::empty());
            let left = left(&chinese, &[]);
            if !left.is_empty() || !chinese.contains(is_han) {
                english.push(format!("{left:?} of {meaning:?} are left in {chinese:?}"));
            }
        }
        assert!(english.is_empty(), "{english:#?}");
    }

    #[test]
    fn a_meaning_is_taken_term_by_term_and_names_and_texts_stay() {
        let terms = [
            ("target position", "目标位置"),
            ("target", "目标"),
            ("set", "设置"),
            ("to", "为"),
            ("is", "为"),
            ("reset", "复位"),
        ];
        let glossary = Glossary::of(terms);
        let chinese = |english, names: &[&str]| glossary.chinese(english, names.iter().copied());
        for (english, expected) in [
            ("set 607A:00 (target position) to -5", "设置 607A:00 (目标位置) 为 -5"),
            ("target set, reset; target: 5", "目标设置，复位；目标：5"),
            ("targets are no target-position", "targets are no target-position"),
            ("1008:00 is \"set to\"", "1008:00 为 \"set to\""),
            ("manufacturer [01, 02]", "manufacturer [01, 02]"),
            ("1008:00 is \"set to", "1008:00 为 \"set to"),
            ("", ""),
        ] {
            assert_eq!(chinese(english, &[]), expected, "{english}");
        }
        assert_eq!(chinese("target target position, set", &["target", "set"]), "target 目标位置，set");
    }

    #[test]
    fn each_term_stands_once_in_the_book_and_the_tables_and_is_said_by_the_source() {
        let source = source();
        let mut problems = vec![];
        let mut check = |table: &[ChineseTerm], others: &BTreeSet<&str>| {
            let mut own = BTreeSet::new();
            for (english, chinese) in table {
                if !own.insert(*english) || others.contains(english) {
                    problems.push(format!("{english:?} stands twice"));
                }
                if !source.contains(english) {
                    problems.push(format!("{english:?} is said nowhere"));
                }
                if !chinese.contains(is_han) {
                    problems.push(format!("{english:?}: {chinese:?}"));
                }
            }
            own
        };
        let phrases: BTreeSet<&str> = book::phrases().into_iter().map(|(english, _)| english).collect();
        let mut general = check(frame_terms::TERMS, &phrases);
        general.extend(phrases);
        for family in family::all() {
            check(&family.chinese_terms(), &general);
        }
        assert!(problems.is_empty(), "{problems:#?}");
    }

    #[test]
    fn the_objects_of_every_family_have_chinese_names() {
        let of_families = family::all().into_iter().flat_map(|family| family.objects());
        let objects = of_families.map(|entry| entry.object.name.to_owned());
        let entries = Entry::all().iter().flat_map(|entry| {
            let named: &[(i64, &str)] = match entry.values() {
                Values::Named(named) => named,
                _ => &[],
            };
            let is_word = |name: &&str| *name != "EtherCAT" && !name.ends_with("µs");
            let named = named.iter().map(|(_, name)| *name).filter(is_word);
            std::iter::once(entry.name()).chain(named).map(str::to_owned)
        });
        are_chinese(objects.chain(entries));
    }

    #[test]
    fn the_errors_of_sdo_and_emergency_messages_are_chinese() {
        let emergencies = (0..=0xFF).map(|class: u16| ErrorCode(class << 8).to_string());
        let aborts = AbortCode::LISTED.iter().copied().chain([AbortCode::Other(0x1234_5678)]);
        are_chinese(emergencies.chain(aborts.map(|code| code.to_string())));
    }

    /// Every frame of the logs that the monitor is tested with.
    #[test]
    fn the_frames_of_every_protocol_are_chinese() {
        let folder =
            Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("crates/cli/tests/monitor");
        let mut english = BTreeSet::new();
        for log in ["canopen", "hollow", "own_protocol", "two_buses", "every_service"] {
            let config = (log != "every_service")
                .then(|| Config::load(&folder.join(log).with_extension("toml")).unwrap());
            let mut decoders: BTreeMap<String, BusDecoder> = match &config {
                Some(config) => config
                    .buses
                    .iter()
                    .enumerate()
                    .map(|(bus, named)| (named.name.clone(), BusDecoder::of(config, bus)))
                    .collect(),
                None => BTreeMap::new(),
            };
            let names: Vec<&str> =
                config.iter().flat_map(|config| &config.axes).map(|axis| axis.name.as_str()).collect();
            for line in fs::read_to_string(folder.join(log).with_extension("log")).unwrap().lines() {
                let mut parts = line.split(' ').skip(1);
                let (bus, frame) = (parts.next().unwrap(), frame_text::parse(parts.next().unwrap()).unwrap());
                let decoder = decoders.entry(bus.to_owned()).or_insert_with(|| BusDecoder::with_drives(&[]));
                let decoded = decoder.decode(&frame);
                let Words { en, zh } = Words::of_meaning(&decoded);
                assert_eq!(en, decoded.line());
                let left = left(&zh, &names);
                if !left.is_empty() {
                    english.insert(format!("{left:?} of {en:?} are left in {zh:?} ({log})"));
                }
            }
        }
        assert!(english.is_empty(), "{english:#?}");
    }
}
