//! The form of the file: sections, keys and values, each with its place. Names are found whatever their case.

use std::collections::HashMap;
use std::ops::Range;

use super::findings::Reporter;
use super::problem::ProblemKind;

/// The sections of a file in its order; those of the same name are one.
#[derive(Debug, Default)]
pub(super) struct Document<'t> {
    sections: Vec<Section<'t>>,
    by_name: HashMap<String, usize>,
}

/// A section.
#[derive(Debug)]
pub(super) struct Section<'t> {
    /// Its name as written.
    pub name: &'t str,
    /// Where its header is.
    pub header: Range<usize>,
    pairs: Vec<Pair<'t>>,
    by_key: HashMap<String, usize>,
}

/// A key with its value.
#[derive(Clone, Debug)]
pub(super) struct Pair<'t> {
    /// The key as written.
    pub key: &'t str,
    /// Where the key is.
    pub key_span: Range<usize>,
    /// The value; never empty where it was found by [`Section::get`].
    pub value: &'t str,
    /// Where the value is.
    pub span: Range<usize>,
}

/// Keys whose value is written to a device, or chooses which: two that differ are no matter of taste.
const BEYOND_DOUBT: [&str; 2] = ["parametervalue", "nodeid"];

impl<'t> Document<'t> {
    /// Reads every line. What is no line of an EDS is passed over with a warning.
    pub fn parse(text: &'t str, reporter: &mut Reporter) -> Self {
        let mut document = Self::default();
        let mut current = None;
        let mut start = 0;
        for line in text.split_inclusive('\n') {
            let trimmed = trimmed(line);
            let at = start + offset(line, trimmed);
            let span = at..at + trimmed.len();
            start += line.len();
            if trimmed.is_empty() || trimmed.starts_with([';', '#']) || trimmed.starts_with("//") {
                continue;
            }
            if let Some(inner) = trimmed.strip_prefix('[') {
                current = document.open(inner, span, reporter);
            } else if let Some((key, value)) = trimmed.split_once('=') {
                let Some(section) = current.and_then(|section| document.sections.get_mut(section)) else {
                    reporter.report(ProblemKind::OutsideSections, span);
                    continue;
                };
                section.add(pair(trimmed, at, key, value), reporter);
            } else {
                reporter.report(ProblemKind::NotALine, span);
            }
        }
        document
    }

    /// A section by its name.
    pub fn section(&self, name: &str) -> Option<&Section<'t>> {
        self.sections.get(*self.by_name.get(&folded(name))?)
    }

    /// Every section.
    pub fn sections(&self) -> impl Iterator<Item = &Section<'t>> {
        self.sections.iter()
    }

    /// Begins a section, or goes on with the earlier one of that name. `None` where the header has no name.
    fn open(&mut self, inner: &'t str, span: Range<usize>, reporter: &mut Reporter) -> Option<usize> {
        let name = match inner.split_once(']') {
            Some((name, _)) => name.trim(),
            None => {
                reporter.report(ProblemKind::UnclosedHeader, span.clone());
                inner.trim()
            }
        };
        if name.is_empty() {
            reporter.report(ProblemKind::NotALine, span);
            return None;
        }
        if let Some(&first) = self.by_name.get(&folded(name)) {
            let first_header = self.sections.get(first)?.header.clone();
            reporter.report_against(
                ProblemKind::RepeatedSection { name: name.to_owned() },
                span,
                first_header.start,
            );
            return Some(first);
        }
        self.by_name.insert(folded(name), self.sections.len());
        self.sections.push(Section { name, header: span, pairs: vec![], by_key: HashMap::new() });
        Some(self.sections.len() - 1)
    }
}

impl<'t> Section<'t> {
    /// A key with its value; `None` when the key is absent or its value empty.
    pub fn get(&self, key: &str) -> Option<&Pair<'t>> {
        self.pairs.get(*self.by_key.get(&folded(key))?).filter(|pair| !pair.value.is_empty())
    }

    /// Every key in the order of the file, those without a value too.
    pub fn pairs(&self) -> &[Pair<'t>] {
        &self.pairs
    }

    fn add(&mut self, pair: Pair<'t>, reporter: &mut Reporter) {
        let key = folded(pair.key);
        let earlier = self.by_key.get(&key).and_then(|first| self.pairs.get(*first));
        let Some(first) = earlier.filter(|first| !first.value.is_empty()) else {
            self.by_key.insert(key, self.pairs.len());
            self.pairs.push(pair);
            return;
        };
        let shown = pair.key.to_owned();
        let kind = if first.value.eq_ignore_ascii_case(pair.value) {
            ProblemKind::RepeatedKey { key: shown }
        } else if BEYOND_DOUBT.contains(&key.as_str()) {
            ProblemKind::Contradiction { key: shown }
        } else {
            ProblemKind::RepeatedKeyDiffers { key: shown, counts: first.value.to_owned() }
        };
        reporter.report_against(kind, pair.key_span, first.key_span.start);
    }
}

fn pair<'t>(line: &'t str, at: usize, key: &'t str, value: &'t str) -> Pair<'t> {
    let place = |part: &'t str| {
        let trimmed = trimmed(part);
        let start = at + offset(line, trimmed);
        (trimmed, start..start + trimmed.len())
    };
    let (key, key_span) = place(key);
    let (value, span) = place(value);
    let span = if value.is_empty() { key_span.clone() } else { span };
    Pair { key, key_span, value, span }
}

fn trimmed(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_whitespace() || c == '\0' || c == '\u{FEFF}')
}

/// Where a part of a text begins in it. Both are slices of the same file.
fn offset(whole: &str, part: &str) -> usize {
    (part.as_ptr() as usize).saturating_sub(whole.as_ptr() as usize).min(whole.len())
}

/// A name as it is looked up: case and blanks do not count.
fn folded(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case_and_values_keep_their_place() {
        let text = "; comment\r\n[ 1018Sub1 ]\r\n  ParameterName = Vendor ID \r\nDEFAULTVALUE=\r\n";
        let mut reporter = Reporter::new(text);
        let document = Document::parse(text, &mut reporter);
        let section = document.section("1018sub1").unwrap();
        let name = section.get("parametername").unwrap();
        assert_eq!((name.value, &text[name.span.clone()]), ("Vendor ID", "Vendor ID"));
        assert!(section.get("DefaultValue").is_none(), "an empty value is none");
        assert_eq!(section.pairs().len(), 2);
        assert!(reporter.into_problems().is_empty());
    }

    #[test]
    fn the_first_of_two_counts() {
        let text = "[a]\nx=1\n[A]\nX=2\ny=3\n";
        let mut reporter = Reporter::new(text);
        let document = Document::parse(text, &mut reporter);
        let section = document.section("a").unwrap();
        assert_eq!((section.get("x").unwrap().value, section.get("y").unwrap().value), ("1", "3"));
        assert_eq!(reporter.into_problems().len(), 2);
    }
}
