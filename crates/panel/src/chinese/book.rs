//! How a sentence is found in the phrases, and filled in.
//!
//! A phrase is an English sentence and the Chinese one for it, both with parts: `{0}` is a name or a number, without a colon or semicolon, and
//! stays as it is; `<1>` is made of words, and looked up as well.

use std::cmp::Reverse;
use std::collections::{BTreeSet, HashMap};
use std::sync::OnceLock;

use super::{bench, commands, cures, drive_errors, events, procedures, refusals, rejections, scans, stops};
use takt::family::{self, ChinesePhrase};

/// No sentence of takt is longer, in bytes. What comes from elsewhere may be.
const LONGEST: usize = 800;

/// The phrases, those with the longest texts of their own first, otherwise in the order of the tables.
pub struct Book {
    phrases: Vec<Phrase>,
}

struct Phrase {
    /// What is before, between and after the parts.
    english: Vec<&'static str>,
    /// The parts in their order.
    parts: Vec<Part>,
    chinese: &'static str,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// `{0}`
    Stays,
    /// `<0>`
    Words,
}

impl Part {
    /// Returns `true` if it may stand for a text. A name or a number is no sentence.
    fn may_be(self, text: &str) -> bool {
        !text.is_empty() && (self == Self::Words || !(text.contains(": ") || text.contains("; ")))
    }
}

/// A sentence in Chinese.
#[derive(Clone)]
struct Found {
    words: String,
    /// How much of the sentence stays as it is, in bytes.
    left: usize,
}

/// Sentences that were looked up.
type Known<'s> = HashMap<&'s str, Option<Found>>;

/// What comes next in a sentence of a phrase.
enum Piece {
    Text(&'static str),
    Part(Part, usize),
}

/// Every phrase there is. Families that are made alike have some of them in common.
pub(super) fn phrases() -> Vec<ChinesePhrase> {
    let general = [
        events::PHRASES,
        stops::PHRASES,
        cures::PHRASES,
        rejections::PHRASES,
        drive_errors::PHRASES,
        commands::PHRASES,
        refusals::PHRASES,
        procedures::PHRASES,
        scans::PHRASES,
        bench::PHRASES,
    ];
    let of_families = family::all().into_iter().flat_map(|family| family.chinese_phrases());
    let mut seen = BTreeSet::new();
    let all = general.into_iter().flatten().copied().chain(of_families);
    all.filter(|phrase| seen.insert(*phrase)).collect()
}

/// The book of all phrases.
pub fn book() -> &'static Book {
    static BOOK: OnceLock<Book> = OnceLock::new();
    BOOK.get_or_init(|| Book::of(phrases()))
}

impl Book {
    fn of(phrases: impl IntoIterator<Item = ChinesePhrase>) -> Self {
        let mut phrases: Vec<Phrase> = phrases.into_iter().map(Phrase::new).collect();
        phrases.sort_by_key(|phrase| Reverse(phrase.own_length()));
        Self { phrases }
    }

    /// A sentence in Chinese; `None` where no phrase is for it.
    pub fn chinese(&self, sentence: &str) -> Option<String> {
        Some(self.found(sentence, &mut HashMap::new())?.words)
    }

    /// By the phrase that leaves the least as it is; of two that leave the same, the first one. `known` has what was
    /// looked up before: the phrases divide a sentence in many ways, and most of these have parts in common.
    fn found<'s>(&self, sentence: &'s str, known: &mut Known<'s>) -> Option<Found> {
        if sentence.len() > LONGEST {
            return None;
        }
        if let Some(found) = known.get(sentence) {
            return found.clone();
        }
        let mut best: Option<Found> = None;
        for phrase in &self.phrases {
            let Some(given) = phrase.parts_of(sentence) else { continue };
            let Some(found) = self.filled(phrase, &given, known) else { continue };
            if best.as_ref().is_none_or(|best| found.left < best.left) {
                best = Some(found);
            }
        }
        known.insert(sentence, best.clone());
        best
    }

    /// A phrase with its parts; `None` where it only joins words without a phrase.
    fn filled<'s>(&self, phrase: &Phrase, given: &[&'s str], known: &mut Known<'s>) -> Option<Found> {
        let parts = phrase.parts.iter().zip(given);
        let parts: Vec<Option<Found>> = parts
            .map(|(part, given)| match part {
                Part::Stays => None,
                Part::Words => self.found(given, known),
            })
            .collect();
        if phrase.is_join() && parts.iter().all(Option::is_none) {
            return None;
        }
        let left_of = |(found, given): (&Option<Found>, &&str)| match found {
            Some(found) => found.left,
            None => given.len(),
        };
        let left = parts.iter().zip(given).map(left_of).sum();
        let words = pieces(phrase.chinese).map(|piece| match piece {
            Piece::Text(text) => text,
            Piece::Part(_, place) => match parts.get(place) {
                Some(Some(found)) => found.words.as_str(),
                _ => given.get(place).copied().unwrap_or_default(),
            },
        });
        Some(Found { words: words.collect(), left })
    }
}

impl Phrase {
    fn new((english, chinese): ChinesePhrase) -> Self {
        let (mut texts, mut parts) = (vec![""], vec![]);
        for piece in pieces(english) {
            match piece {
                Piece::Text(text) => {
                    texts.pop();
                    texts.push(text);
                }
                Piece::Part(part, _) => {
                    parts.push(part);
                    texts.push("");
                }
            }
        }
        Self { english: texts, parts, chinese }
    }

    /// Returns `true` if it only joins words, as by a semicolon. It is for words of which some have a phrase.
    fn is_join(&self) -> bool {
        !self.english.iter().any(|text| text.contains(char::is_alphabetic))
    }

    /// How much of a sentence is its own.
    fn own_length(&self) -> usize {
        if self.is_join() { 0 } else { self.english.iter().map(|text| text.len()).sum() }
    }

    /// The parts of a sentence, if it is this one.
    fn parts_of<'t>(&self, sentence: &'t str) -> Option<Vec<&'t str>> {
        let (first, others) = self.english.split_first()?;
        // Most phrases differ at their end already, which is seen without a search.
        let may_be = sentence.ends_with(self.english.last()?);
        split(sentence.strip_prefix(first).filter(|_| may_be)?, others, &self.parts)
    }
}

/// The parts before each of the texts; the last text is the end.
fn split<'t>(sentence: &'t str, texts: &[&str], parts: &[Part]) -> Option<Vec<&'t str>> {
    let Some(((next, later), (part, others))) = texts.split_first().zip(parts.split_first()) else {
        return sentence.is_empty().then(Vec::new);
    };
    if later.is_empty() {
        return sentence.strip_suffix(next).filter(|given| part.may_be(given)).map(|given| vec![given]);
    }
    sentence.match_indices(next).find_map(|(at, _)| {
        let (given, rest) = (sentence.get(..at)?, sentence.get(at + next.len()..)?);
        let mut found = split(rest, later, others).filter(|_| part.may_be(given))?;
        found.insert(0, given);
        Some(found)
    })
}

/// The pieces of a sentence of a phrase.
fn pieces(sentence: &'static str) -> impl Iterator<Item = Piece> {
    let mut rest = sentence;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        if let Some((part, place)) = part_at(rest) {
            rest = &rest[3..];
            return Some(Piece::Part(part, place));
        }
        let end = (1..rest.len()).find(|at| rest.get(*at..).is_some_and(|rest| part_at(rest).is_some()));
        let (text, later) = rest.split_at(end.unwrap_or(rest.len()));
        rest = later;
        Some(Piece::Text(text))
    })
}

/// The part that a text begins with.
fn part_at(text: &str) -> Option<(Part, usize)> {
    match *text.as_bytes() {
        [b'{', digit @ b'0'..=b'9', b'}', ..] => Some((Part::Stays, usize::from(digit - b'0'))),
        [b'<', digit @ b'0'..=b'9', b'>', ..] => Some((Part::Words, usize::from(digit - b'0'))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chinese::tests::source;

    fn parts(sentence: &'static str) -> Vec<(bool, usize)> {
        let part = |piece| match piece {
            Piece::Part(part, place) => Some((part == Part::Words, place)),
            Piece::Text(_) => None,
        };
        pieces(sentence).filter_map(part).collect()
    }

    #[test]
    fn a_sentence_is_found_and_its_parts_are_filled_in_where_the_chinese_one_has_them() {
        const PHRASES: [ChinesePhrase; 5] = [
            ("{0} moves at {1} m/s", "{0} 速度 {1} m/s"),
            ("{0}: <1>", "{0}：<1>"),
            ("<0> while <1>", "<1>时<0>"),
            ("moving", "运动中"),
            ("a stop was requested", "请求了停止"),
        ];
        let book = Book::of(PHRASES);
        for (english, chinese) in [
            ("a stop was requested while moving", "运动中时请求了停止"),
            ("left: a stop was requested while moving", "运动中时left：请求了停止"),
            ("moving moves at 2 m/s", "moving 速度 2 m/s"),
            ("something else while moving", "运动中时something else"),
        ] {
            assert_eq!(book.chinese(english).as_deref(), Some(chinese));
        }
        for english in ["left: something else", "no phrase is for it", " while moving", ""] {
            assert_eq!(book.chinese(english), None, "{english}");
        }
    }

    #[test]
    fn each_phrase_stands_once_in_chinese_with_the_parts_of_the_english_one() {
        let mut seen = BTreeSet::new();
        for (english, chinese) in phrases() {
            assert!(seen.insert(english), "{english:?} stands twice");
            let is_chinese =
                |letter: char| matches!(letter, '\u{4e00}'..='\u{9fff}' | '：' | '；' | '、' | '（');
            assert!(chinese.contains(is_chinese), "{english:?}: {chinese:?}");
            let in_order: Vec<usize> = parts(english).iter().map(|(_, place)| *place).collect();
            assert!(in_order.iter().copied().eq(0..in_order.len()), "{english:?}");
            let of = |sentence| parts(sentence).into_iter().collect::<BTreeSet<_>>();
            assert_eq!(of(english), of(chinese), "{english:?}: {chinese:?}");
            let between = Phrase::new((english, chinese)).english;
            let inner = between.get(1..between.len() - 1).unwrap_or_default();
            assert!(inner.iter().all(|text| !text.is_empty()), "{english:?} has two parts side by side");
        }
    }

    /// A phrase whose English sentence is said nowhere is one that was left behind when the sentence was changed.
    #[test]
    fn each_phrase_is_for_a_sentence_that_the_source_has() {
        let source = source();
        for (english, chinese) in phrases() {
            for text in Phrase::new((english, chinese)).english {
                assert!(source.contains(text.trim()), "{text:?} of {english:?} is said nowhere");
            }
        }
    }
}
