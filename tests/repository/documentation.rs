//! The pages that people read: the README and `docs/`.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README and every page in `docs/`.
fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let pages: Vec<PathBuf> = docs.filter(|path| path.is_file()).chain([root().join("README.md")]).collect();
    assert!(pages.len() > 10, "{pages:?}");
    pages
}

/// The files to which the links of a page lead; links to other sites are left out.
fn linked(page: &Path) -> Vec<PathBuf> {
    let text = fs::read_to_string(page).unwrap();
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
    let here = targets.filter(|target| !target.contains("://")).map(|target| {
        let (path, _heading) = target.split_once('#').unwrap_or((target, ""));
        page.parent().unwrap().join(path)
    });
    here.collect()
}

#[test]
fn every_link_leads_to_a_file_or_a_folder() {
    let mut links = 0;
    for page in pages() {
        for target in linked(&page) {
            assert!(target.exists(), "{} links to {}", page.display(), target.display());
            links += 1;
        }
    }
    assert!(links > 20, "{links}");
}

#[test]
fn every_page_of_docs_can_be_reached_from_the_readme_in_one_step() {
    let linked: Vec<PathBuf> =
        linked(&root().join("README.md")).iter().filter_map(|path| path.canonicalize().ok()).collect();
    let missing: Vec<PathBuf> = pages()
        .into_iter()
        .filter(|page| page.starts_with(root().join("docs")) && !linked.contains(page))
        .collect();
    assert!(missing.is_empty(), "the README does not link to {missing:?}");
}

#[test]
fn the_readme_stays_short() {
    let words = fs::read_to_string(root().join("README.md")).unwrap().split_whitespace().count();
    assert!(words < 1_200, "{words} words: details belong into docs/");
}

/// `tests/library/examples.rs` runs it.
#[test]
fn the_program_for_another_process_is_an_example() {
    let page = fs::read_to_string(root().join("docs/another-process.md")).unwrap();
    let example = fs::read_to_string(root().join("examples/remote.rs")).unwrap();
    let (_, program) = example.split_once("\n\n").unwrap();
    assert!(page.contains(&format!("```rust,no_run\n{program}```")), "the page does not show\n{program}");
}

/// The rows of the tables of a page whose heading begins with a word: their cells, without the heading itself.
fn rows(page: &str, heading: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    let begin = format!("| {heading} |");
    let tables = text.split("\n\n").filter(|part| part.starts_with(&begin));
    tables.flat_map(|table| table.lines().skip(2).map(cells).collect::<Vec<_>>()).collect()
}

/// The names that a cell writes as code: of a call without its arguments, of a path all parts.
fn names(cell: &str) -> Vec<String> {
    let codes = cell.split('`').skip(1).step_by(2).map(|code| code.split(['(', '[', ' ']).next().unwrap());
    codes.flat_map(|code| code.split([':', '.']).filter(|name| !name.is_empty())).map(str::to_owned).collect()
}

fn words_of(text: &str) -> std::collections::HashSet<&str> {
    text.split(|letter: char| !letter.is_alphanumeric() && letter != '_').collect()
}

/// The text of every file in Rust of a folder.
fn sources(folder: &Path, text: &mut String) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, text);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            *text += &fs::read_to_string(path).unwrap();
        }
    }
}

#[test]
fn every_word_that_is_said_to_be_ours_is_a_name_of_its_language() {
    let mut rust = String::new();
    sources(&root().join("src"), &mut rust);
    sources(&root().join("crates/remote/src"), &mut rust);
    sources(&root().join("crates/wire/src"), &mut rust);
    sources(&root().join("crates/sim/src"), &mut rust);
    sources(&root().join("rt/src"), &mut rust);
    let read = |file: &str| fs::read_to_string(root().join(file)).unwrap();
    let (c, cpp) = (read("bindings/c/include/takt.h"), read("bindings/c/include/takt.hpp"));
    let (cpp, python) = (cpp + &c, read("bindings/python/python/takt/_takt.pyi"));
    let languages = [words_of(&rust), words_of(&c), words_of(&cpp), words_of(&python)];
    let in_each = rows("docs/words.md", "Rust");
    assert!(in_each.len() > 20, "{in_each:?}");
    for row in in_each {
        for (cell, known) in row.iter().zip(&languages) {
            for name in names(cell) {
                assert!(known.contains(name.as_str()), "there is no {name}, of {row:?}");
            }
        }
    }
    let (ours, theirs) = (rows("docs/words.md", "takt"), rows("docs/words.md", "`RTDEControlInterface`"));
    let cells = ours.iter().map(|row| &row[0]).chain(theirs.iter().map(|row| &row[1]));
    let all: Vec<String> = cells.flat_map(|cell| names(cell)).collect();
    assert!(all.len() > 60, "{all:?}");
    let settings = words_of(&python);
    for name in all {
        assert!(
            languages[0].contains(name.as_str()) || settings.contains(name.as_str()),
            "there is no {name}"
        );
    }
}

#[test]
fn the_table_of_faults_has_every_rule_with_its_category() {
    let text = fs::read_to_string(root().join("docs/faults.md")).unwrap();
    let (_, after) = text.split_once("## What is noticed, and what follows").unwrap();
    let rows =
        after.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let mut documented = Vec::new();
    for row in rows.skip(2) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        // All code in these cells is keys.
        for key in cells[1].split('`').skip(1).step_by(2) {
            documented.push((key.to_owned(), cells[3].parse::<u8>().unwrap()));
        }
    }
    documented.sort();
    documented.dedup();
    let rules = takt::Rule::ALL.into_iter().filter(|rule| *rule != takt::Rule::Requested);
    let mut rules: Vec<_> =
        rules.map(|rule| (rule.key().to_owned(), rule.default_category() as u8)).collect();
    rules.sort();
    assert_eq!(documented, rules);
}
