//! A table of the file, with the table of its defaults.

use std::borrow::Cow;
use std::ops::Range;

use takt_wire::printable::excerpt;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::entry::{Entry, KeyedEntry};
use crate::config::key::Key;
use crate::config::problem_kind::ProblemKind;
use crate::config::quantities::Quantities;
use crate::config::spelling;
use crate::config::spot::{Problems, Spot};

/// Keys of earlier versions, with the table that they were in where the same key has another place now, and what to write
/// instead.
const REPLACED: [(Option<&str>, &str, &str); 5] = [
    (
        None,
        "on_violation",
        "follow = \"smooth\", as closely as the limits allow, or follow = \"exact\", a stop for what breaks a limit",
    ),
    (Some("simulated"), "inertia", "it in [axis.joint]: real drives obey it too"),
    (Some("simulated"), "viscous_friction", "it in [axis.joint]: real drives obey it too"),
    (Some("simulated"), "coulomb_friction", "it in [axis.joint]: real drives obey it too"),
    (Some("simulated"), "rated_torque", "it in [axis.joint]: real drives obey it too"),
];

/// Words that other programs have for a key, and the key that was probably meant.
const SYNONYMS: [(&str, &str); 8] = [
    ("home_offset", "position_at_zero_counts"),
    ("homing_offset", "position_at_zero_counts"),
    ("zero_offset", "position_at_zero_counts"),
    ("offset", "position_at_zero_counts"),
    ("direction", "reversed"),
    ("inverted", "reversed"),
    ("speed", "velocity"),
    ("effort", "torque"),
];

/// The most unknown keys of a table for which the key that was meant is looked for. No more problems are shown anyway.
const SUGGESTED_AT_MOST: usize = 20;

/// A table that is being read. It remembers which keys were looked up: the others are unknown, and required ones that were not
/// found are missing.
pub struct Section<'a> {
    path: String,
    header: Range<usize>,
    /// The table itself, then the one with its defaults, as far as they are there.
    own: Option<&'a DeTable<'a>>,
    defaults: Option<&'a DeTable<'a>>,
    known: Vec<&'static str>,
    known_in_defaults: Vec<&'static str>,
    missing: Vec<(&'static str, Cow<'static, str>)>,
    /// True if the file has something other than a table here. Its missing keys are not reported then.
    is_no_table: bool,
    problems: &'a Problems,
}

impl<'a> Section<'a> {
    pub fn new(path: &str, header: Range<usize>, own: &'a DeTable<'a>, problems: &'a Problems) -> Self {
        Self {
            path: path.to_owned(),
            header,
            own: Some(own),
            defaults: None,
            known: vec![],
            known_in_defaults: vec![],
            missing: vec![],
            is_no_table: false,
            problems,
        }
    }

    /// The same section with a table of defaults behind it.
    pub fn with_defaults(self, defaults: Option<&'a DeTable<'a>>) -> Self {
        Self { defaults, ..self }
    }

    /// Where the section begins, for problems that concern all of it.
    pub fn header(&self) -> Range<usize> {
        self.header.clone()
    }

    /// Where the section begins, as a spot to report what concerns all of it.
    pub fn header_spot(&self) -> Spot<'a> {
        Spot::in_text(self.path.clone(), self.header(), self.problems)
    }

    /// Where a key of this section is, or else where it would be.
    pub fn spot(&self, key: &str) -> Spot<'a> {
        match find(self.own, key).or_else(|| find(self.defaults, key)) {
            Some(found) => self.entry(key, found).spot,
            None => Spot::in_text(self.path_of(key), self.header(), self.problems),
        }
    }

    /// What a key says, here or else in the defaults.
    pub fn get(&mut self, key: &'static str) -> Option<Entry<'a>> {
        self.know(key, true);
        let found = find(self.own, key).or_else(|| find(self.defaults, key))?;
        Some(self.entry(key, found))
    }

    /// As [`Self::get`], for what has a row.
    pub fn keyed(&mut self, key: &'static Key) -> Option<KeyedEntry<'a>> {
        Some(KeyedEntry::new(self.get(key.name)?, key))
    }

    /// The value of a key, or its default.
    pub fn boolean(&mut self, key: &'static Key) -> bool {
        let value = self.get(key.name).and_then(|entry| entry.boolean());
        value.unwrap_or(key.default_boolean())
    }

    /// The value of a key that is a whole number.
    pub fn integer<T: TryFrom<i64>>(&mut self, key: &'static Key) -> Option<T> {
        self.keyed(key)?.integer()
    }

    /// The value of a key that is a duration, in nanoseconds.
    pub fn nanoseconds(&mut self, key: &'static Key) -> Option<u64> {
        self.keyed(key)?.nanoseconds()
    }

    /// The value of a key that is a quantity, in SI units.
    pub fn quantity(&mut self, key: &'static Key, quantities: Quantities) -> Option<f64> {
        self.keyed(key)?.quantity(quantities)
    }

    /// What a key says here, whatever the defaults are; it is not allowed in them.
    pub fn own(&mut self, key: &'static str) -> Option<Entry<'a>> {
        self.know(key, false);
        Some(self.entry(key, find(self.own, key)?))
    }

    /// As [`Self::get`]; an absent key is a problem, explained by what the key `says`.
    pub fn require(&mut self, key: &'static str, says: impl Into<Cow<'static, str>>) -> Option<Entry<'a>> {
        self.get(key).or_else(|| {
            self.missing.push((key, says.into()));
            None
        })
    }

    /// As [`Self::own`]; an absent key is a problem.
    pub fn require_own(&mut self, key: &'static str, says: &'static str) -> Option<Entry<'a>> {
        self.own(key).or_else(|| {
            self.missing.push((key, says.into()));
            None
        })
    }

    /// A table within this one, with the defaults of that name behind it. It may be absent.
    pub fn section(&mut self, key: &'static str) -> Section<'a> {
        self.know(key, true);
        let own = find(self.own, key).map(|found| self.entry(key, found));
        let defaults = find(self.defaults, key).map(|found| self.entry(key, found));
        let span = own.as_ref().and_then(|entry| entry.spot.span());
        let header = span.unwrap_or_else(|| self.header());
        let own_table = own.as_ref().and_then(|entry| entry.table());
        let default_table = defaults.as_ref().and_then(|entry| entry.table());
        Section {
            path: self.path_of(key),
            header,
            own: own_table,
            defaults: default_table,
            is_no_table: own.is_some() != own_table.is_some()
                || defaults.is_some() != default_table.is_some(),
            known: vec![],
            known_in_defaults: vec![],
            missing: vec![],
            problems: self.problems,
        }
    }

    /// The tables of a list of tables (`[[bus]]`), in the order of the file; none when the key is absent.
    pub fn sections(&mut self, key: &'static str) -> Vec<Section<'a>> {
        let Some(list) = self.get(key).and_then(|entry| entry.tables()) else { return vec![] };
        list.into_iter()
            .filter_map(|entry| {
                let table = entry.table()?;
                Some(Section::new(&entry.spot.key, entry.spot.span()?, table, self.problems))
            })
            .collect()
    }

    /// Reports what is unknown and what is missing. A missing key that an unknown one was probably meant to be is
    /// not reported beside it.
    pub fn finish(self) {
        let mut meant = vec![];
        for (table, known) in [(self.own, &self.known), (self.defaults, &self.known_in_defaults)] {
            let keys = table.into_iter().flat_map(DeTable::iter).map(|(key, _)| key);
            let is_unknown = |key: &&Spanned<DeString<'_>>| !known.iter().any(|known| known == key.get_ref());
            let mut unknown: Vec<_> = keys.filter(is_unknown).collect();
            unknown.sort_by_key(|key| key.span().start);
            for (index, key) in unknown.into_iter().enumerate() {
                let name = self.path.rsplit('.').next();
                let replaced = REPLACED.iter().find(|(place, old, _)| {
                    old == key.get_ref() && place.is_none_or(|place| name == Some(place))
                });
                if let Some((_, _, by)) = replaced {
                    let key_path = self.path_of(key.get_ref());
                    self.problems.report(ProblemKind::Replaced { key: key_path, by }, key.span());
                    continue;
                }
                // Looking for the key that was meant takes long, and only the first problems are shown.
                let nearest = (index < SUGGESTED_AT_MOST).then(|| {
                    let absent = known.iter().copied().filter(|known| find(table, known).is_none());
                    let synonym =
                        SYNONYMS.iter().find(|(word, _)| word == key.get_ref()).map(|(_, meant)| *meant);
                    absent
                        .clone()
                        .find(|key| Some(*key) == synonym)
                        .or_else(|| spelling::nearest(key.get_ref(), absent))
                });
                meant.extend(nearest.flatten());
                let kind = ProblemKind::UnknownKey {
                    key: self.path_of(&excerpt(key.get_ref())),
                    nearest: nearest.flatten(),
                    known: known.clone(),
                };
                self.problems.report(kind, key.span());
            }
        }
        for (key, says) in &self.missing {
            if !meant.contains(key) && !self.is_no_table {
                let kind = ProblemKind::MissingKey { key: self.path_of(key), says: says.clone() };
                self.problems.report(kind, self.header());
            }
        }
    }

    fn know(&mut self, key: &'static str, is_known_in_defaults: bool) {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        if is_known_in_defaults && !self.known_in_defaults.contains(&key) {
            self.known_in_defaults.push(key);
        }
    }

    fn entry(&self, key: &str, value: &'a Spanned<DeValue<'a>>) -> Entry<'a> {
        Entry::new(self.path_of(key), value, self.problems)
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
}

fn find<'a>(table: Option<&'a DeTable<'a>>, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
    table?.get(key)
}
