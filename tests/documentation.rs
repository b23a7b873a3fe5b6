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

/// `tests/examples.rs` runs it.
#[test]
fn the_program_for_another_process_is_an_example() {
    let page = fs::read_to_string(root().join("docs/another-process.md")).unwrap();
    let example = fs::read_to_string(root().join("examples/remote.rs")).unwrap();
    let (_, program) = example.split_once("\n\n").unwrap();
    assert!(page.contains(&format!("```rust,no_run\n{program}```")), "the page does not show\n{program}");
}
