//! The syntax of the file: sections, keys and values with their positions. Names are compared without case.

use std::collections::HashMap;
use std::ops::Range;

use super::findings::Reporter;
use super::problem::EdsProblemKind;

/// The sections of a file in order. Sections with the same name are merged.
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
    /// The position of its header.
    pub header: Range<usize>,
    pairs: Vec<Pair<'t>>,
    by_key: HashMap<String, usize>,
}

/// A key with its value.
#[derive(Clone, Debug)]
pub(super) struct Pair<'t> {
    /// The key as written.
    pub key: &'t str,
    /// The position of the key.
    pub key_span: Range<usize>,
    /// The value; never empty in a result of [`Section::get`].
    pub value: &'t str,
    /// The position of the value.
    pub span: Range<usize>,
}

/// The most lines with a section or a key. They are enough for [`MAX_ENTRIES`](super::objects::MAX_ENTRIES), and bound the memory.
const MAX_LINES: usize = 500_000;

/// Keys whose value is written to a device or selects the device: two different values are an error.
const MUST_NOT_DIFFER: [&str; 2] = ["parametervalue", "nodeid"];

impl<'t> Document<'t> {
    /// Parses every line. Lines that are not valid in an EDS are ignored with a warning.
    pub fn parse(text: &'t str, reporter: &mut Reporter) -> Self {
        let mut document = Self::default();
        let mut current = None;
        let (mut start, mut lines) = (0, 0);
        for line in text.split_inclusive('\n') {
            let trimmed = trimmed(line);
            let at = start + offset(line, trimmed);
            let span = at..at + trimmed.len();
            start += line.len();
            if trimmed.is_empty() || trimmed.starts_with([';', '#']) || trimmed.starts_with("//") {
                continue;
            }
            if lines == MAX_LINES {
                reporter.report(EdsProblemKind::TooMany { items: "lines", most: MAX_LINES }, span);
                break;
            }
            lines += 1;
            if let Some(inner) = trimmed.strip_prefix('[') {
                current = document.open(inner, span, reporter);
            } else if let Some((key, value)) = trimmed.split_once('=') {
                let Some(section) = current.and_then(|section| document.sections.get_mut(section)) else {
                    reporter.report(EdsProblemKind::OutsideSections, span);
                    continue;
                };
                section.add(pair(trimmed, at, key, value), reporter);
            } else {
                reporter.report(EdsProblemKind::NotALine, span);
            }
        }
        document
    }

    /// Finds a section by its name.
    pub fn section(&self, name: &str) -> Option<&Section<'t>> {
        self.sections.get(*self.by_name.get(&folded(name))?)
    }

    /// All sections.
    pub fn sections(&self) -> impl Iterator<Item = &Section<'t>> {
        self.sections.iter()
    }

    /// Begins a section, or continues an earlier one with the same name. `None` if the header has no name.
    fn open(&mut self, inner: &'t str, span: Range<usize>, reporter: &mut Reporter) -> Option<usize> {
        let name = match inner.split_once(']') {
            Some((name, _)) => name.trim(),
            None => {
                reporter.report(EdsProblemKind::UnclosedHeader, span.clone());
                inner.trim()
            }
        };
        if name.is_empty() {
            reporter.report(EdsProblemKind::NotALine, span);
            return None;
        }
        if let Some(&first) = self.by_name.get(&folded(name)) {
            let first_header = self.sections.get(first)?.header.clone();
            reporter.report_against(
                EdsProblemKind::RepeatedSection { name: name.to_owned() },
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
    /// Finds a key with a value; `None` when the key is absent or its value is empty.
    pub fn get(&self, key: &str) -> Option<&Pair<'t>> {
        self.pairs.get(*self.by_key.get(&folded(key))?).filter(|pair| !pair.value.is_empty())
    }

    /// All keys in order, including those without a value.
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
            EdsProblemKind::RepeatedKey { key: shown }
        } else if MUST_NOT_DIFFER.contains(&key.as_str()) {
            EdsProblemKind::Contradiction { key: shown }
        } else {
            EdsProblemKind::RepeatedKeyDiffers { key: shown, counts: first.value.to_owned() }
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

/// The offset of a part in its text. Both are slices of the same file.
fn offset(whole: &str, part: &str) -> usize {
    (part.as_ptr() as usize).saturating_sub(whole.as_ptr() as usize).min(whole.len())
}

/// A name without case and blanks, for comparison.
fn folded(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case_and_values_keep_their_position() {
        let text = "; comment\r\n[ 1018Sub1 ]\r\n  ParameterName = Vendor ID \r\nDEFAULTVALUE=\r\n";
        let mut reporter = Reporter::new(text);
        let document = Document::parse(text, &mut reporter);
        let section = document.section("1018sub1").unwrap();
        let name = section.get("parametername").unwrap();
        assert_eq!((name.value, &text[name.span.clone()]), ("Vendor ID", "Vendor ID"));
        assert!(section.get("DefaultValue").is_none(), "an empty value does not count");
        assert_eq!(section.pairs().len(), 2);
        assert!(reporter.into_problems().is_empty());
    }

    #[test]
    fn the_first_of_two_values_is_used() {
        let text = "[a]\nx=1\n[A]\nX=2\ny=3\n";
        let mut reporter = Reporter::new(text);
        let document = Document::parse(text, &mut reporter);
        let section = document.section("a").unwrap();
        assert_eq!((section.get("x").unwrap().value, section.get("y").unwrap().value), ("1", "3"));
        assert_eq!(reporter.into_problems().len(), 2);
    }

    /// 65,000 lines would be 16 million entries, which need gigabytes, and 64 MiB of keys as much.
    #[test]
    fn a_file_with_more_entries_or_lines_than_one_can_have_is_refused() {
        let refused = |text: &str| {
            let findings = crate::canopen::eds::parse("large.eds", text.as_bytes()).unwrap_err();
            assert!(findings.has_errors());
            let of_kind = |problem: &&crate::canopen::eds::EdsProblem| {
                matches!(problem.kind, EdsProblemKind::TooMany { .. })
            };
            let problem = findings.problems().iter().find(of_kind).unwrap();
            (problem.to_string(), findings.position(problem).line)
        };
        let arrays: String =
            (0x2000..0x5000).map(|index| format!("[{index:X}]\nCompactSubObj=254\n")).collect();
        let (words, line) = refused(&arrays);
        assert_eq!(words, "the file has more than 65536 entries");
        assert_eq!(line, 2 * (65_536 / 255) + 1);
        let keys: String = (0..600_000).map(|number| format!("k{number}=1\n")).collect();
        let (words, line) = refused(&format!("[2000]\n{keys}"));
        assert_eq!((words.as_str(), line), ("the file has more than 500000 lines", 500_001));
    }
}
