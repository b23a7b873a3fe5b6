//! The modules of a crate, and the names that each defines, imports and uses. Tests are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::rust_files::words;

pub type Names = Vec<String>;

/// The files of a crate, each by the names of its module below the crate.
#[derive(Default)]
pub struct Crate(pub BTreeMap<Names, Source>);

#[derive(Default)]
pub struct Source {
    pub file: PathBuf,
    /// The modules in files of their own that it declares.
    children: Vec<Names>,
    defined: BTreeSet<String>,
    imports: Vec<Import>,
    /// The paths in its code with their lines. They begin with `crate`, or with a name that its module knows.
    paths: Vec<(Names, usize)>,
}

struct Import {
    name: String,
    path: Names,
    is_public: bool,
    line: usize,
}

/// The use of a file by another one.
pub struct Arrow {
    pub from: Names,
    pub to: Names,
    pub line: usize,
}

impl Crate {
    pub fn read(root: &Path) -> Self {
        let (mut modules, mut open) = (BTreeMap::new(), vec![vec![]]);
        while let Some(names) = open.pop() {
            let path = root.parent().unwrap().join(names.iter().collect::<PathBuf>());
            let candidates = [path.with_extension("rs"), path.join("mod.rs")];
            let own = || candidates.into_iter().find(|file| file.exists()).unwrap();
            let file = if names.is_empty() { root.to_owned() } else { own() };
            let text = fs::read_to_string(&file).unwrap();
            let source = Source { file, ..Source::read(&text, &names) };
            open.extend(source.children.iter().cloned());
            modules.insert(names, source);
        }
        Self(modules)
    }

    /// Every file that a file uses, once, with the first line. A re-export of what is below a module is not a use.
    pub fn arrows(&self) -> Vec<Arrow> {
        let mut all = vec![];
        for (from, source) in &self.0 {
            let used = source.paths.iter().map(|(path, line)| (path, *line, false));
            let imported = source.imports.iter().map(|import| (&import.path, import.line, import.is_public));
            let mut seen = BTreeSet::from([from]);
            for (path, line, is_public) in used.chain(imported) {
                let Some(to) = self.definer(from, path, 8) else { continue };
                let is_reexport = is_public && to.starts_with(from);
                if !is_reexport && seen.insert(to) {
                    all.push(Arrow { from: from.clone(), to: to.clone(), line });
                }
            }
        }
        all
    }

    /// The module that defines what a path in a module means, through fewer than `steps` imports.
    fn definer(&self, from: &Names, path: &[String], steps: usize) -> Option<&Names> {
        let steps = steps.checked_sub(1)?;
        let names = match path {
            [first, rest @ ..] if first == "crate" => rest.to_vec(),
            _ => [from, path].concat(),
        };
        let (module, rest) = (0..names.len())
            .rev()
            .map(|length| names.split_at(length + 1))
            .find(|(module, _)| self.0.contains_key(*module))
            .unwrap_or((&[], &names));
        let (module, source) = self.0.get_key_value(module)?;
        let name = rest.first()?;
        if source.defined.contains(name) {
            return Some(module);
        }
        let imported = source.imports.iter().filter_map(|import| {
            let rest = if import.name == "*" { rest } else { &rest[1..] };
            let is_it = import.name == *name || import.name == "*";
            is_it.then(|| self.definer(module, &[&import.path, rest].concat(), steps))?
        });
        imported.into_iter().next()
    }
}

fn in_crate(module: &[String]) -> Names {
    [&["crate".to_owned()], module].concat()
}

impl Source {
    pub fn read(text: &str, module: &[String]) -> Self {
        let words = without_tests(&words(text));
        let word = |at: usize| words.get(at).map_or("", |(word, _)| word.as_str());
        let (mut source, mut at) = (Self::default(), 0);
        // The present module, and for each open brace how many names it had before.
        let (mut here, mut outer) = (module.to_vec(), vec![]);
        while at < words.len() {
            let line = words[at].1;
            let before = if at == 0 { "" } else { word(at - 1) };
            match word(at) {
                "{" => outer.push(here.len()),
                "}" => here.truncate(outer.pop().unwrap()),
                "mod" if word(at + 2) == ";" => {
                    source.children.push([&here, &[word(at + 1).to_owned()][..]].concat())
                }
                "mod" => {
                    source.defined.insert(word(at + 1).to_owned());
                    outer.push(here.len());
                    here.push(word(at + 1).to_owned());
                    at += 2;
                }
                "use" if word(at + 1) != "<" => {
                    let is_public = matches!(before, "pub" | ")");
                    let mut add = |name: &str, path: &[String]| {
                        let path = from_crate(&here, path);
                        source.imports.push(Import { name: name.to_owned(), path, is_public, line });
                    };
                    at = read_import(&words, at + 1, vec![], &mut add);
                }
                "struct" | "enum" | "union" | "trait" | "type" | "fn" | "const" | "static" => {
                    source.defined.insert(word(at + 1).to_owned());
                }
                name if is_name(name) && !matches!(before, "::" | ".") => {
                    let mut path = vec![name.to_owned()];
                    while word(at + 1) == "::" && is_name(word(at + 2)) {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    source.paths.push((from_crate(&here, &path), line));
                }
                _ => {}
            }
            at += 1;
        }
        source
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|letter: char| letter.is_alphabetic() || letter == '_')
}

/// A path without `self` and `super`.
fn from_crate(here: &[String], path: &[String]) -> Names {
    let up = path.iter().take_while(|name| *name == "super").count();
    match path[0].as_str() {
        "self" => [&in_crate(here), &path[1..]].concat(),
        "super" => [&in_crate(&here[..here.len() - up]), &path[up..]].concat(),
        _ => path.to_vec(),
    }
}

/// Adds the names of the tree of a `use` behind a path, and returns the place behind it.
fn read_import(
    words: &[(String, usize)],
    mut at: usize,
    mut path: Names,
    add: &mut dyn FnMut(&str, &[String]),
) -> usize {
    let word = |at: usize| words.get(at).map_or("", |(word, _)| word.as_str());
    while word(at + 1) == "::" {
        path.push(word(at).to_owned());
        at += 2;
    }
    match word(at) {
        "{" => {
            while word(at) != "}" {
                // Behind `{` or `,`, which may be the last one.
                at = if word(at + 1) == "}" { at + 1 } else { read_import(words, at + 1, path.clone(), add) };
            }
            return at + 1;
        }
        "self" | "*" => {}
        name => path.push(name.to_owned()),
    }
    let (name, end) = match (word(at), word(at + 1)) {
        (_, "as") => (word(at + 2), at + 3),
        ("self", _) => (path.last().unwrap().as_str(), at + 1),
        (name, _) => (name, at + 1),
    };
    add(name, &path);
    end
}

/// Leaves out each item behind `#[cfg(test)]`.
fn without_tests(words: &[(String, usize)]) -> Vec<(String, usize)> {
    let word = |at: usize| words.get(at).map_or("", |(word, _)| word.as_str());
    let (mut kept, mut at) = (vec![], 0);
    while at < words.len() {
        if !(0..6).map(|step| word(at + step)).eq(["#", "[", "cfg", "(", "test", ")"]) {
            kept.push(words[at].clone());
            at += 1;
            continue;
        }
        let mut depth = 0;
        loop {
            match word(at) {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => depth -= 1,
                _ => {}
            }
            at += 1;
            // `use … {…};` ends behind its brace.
            let is_end = matches!(word(at - 1), "}" | ";") && word(at) != ";";
            if at >= words.len() || depth == 0 && is_end {
                break;
            }
        }
    }
    kept
}
