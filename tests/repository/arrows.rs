//! The folders of a crate stand in one order, and use only what is below them.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The sources of a crate, and the order of its folders from top to bottom. A file at the top level counts as a folder. The picture in
/// lib.rs is the same.
struct Tree {
    root: &'static str,
    order: &'static [&'static str],
}

const TREES: [Tree; 3] = [
    Tree { root: "src", order: &TAKT },
    Tree { root: "crates/tools/src", order: &TOOLS },
    Tree { root: "crates/wire/src", order: &WIRE },
];

const TAKT: [&str; 18] = [
    "error",
    "serve",
    "controller",
    "remote",
    "command",
    "telemetry",
    "schedule",
    "faults",
    "family",
    "journal",
    "link",
    "config",
    "procedure",
    "channels",
    "trajectory",
    "packet",
    "sleep_alignment",
    "monotonic_clock",
];

const TOOLS: [&str; 6] = ["doctor", "commission", "play", "replay", "jitter", "monitor"];

const WIRE: [&str; 13] = [
    "quirks",
    "bit_fields",
    "canopen",
    "erob_can",
    "modbus",
    "hollow_lines",
    "bus_log",
    "wire_length",
    "frame_time",
    "described_drive",
    "source_text",
    "printable",
    "text_file",
];

/// The crates that stand on takt, and have no order of their own.
const FRONTS: [&str; 2] = ["crates/panel/src", "crates/cli/src"];

/// The modules of takt that only the other crates of this project may use.
const HIDDEN: [&str; 7] = ["channels", "command", "controller", "journal", "procedure", "remote", "serve"];

/// One use of a folder by another.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Arrow {
    from: String,
    to: String,
    place: String,
}

#[test]
fn no_folder_uses_one_that_stands_above_it() {
    let back: Vec<String> = TREES
        .iter()
        .flat_map(|tree| tree.arrows().into_iter().filter(|arrow| tree.points_back(arrow)))
        .map(|Arrow { from, to, place }| format!("{place}: {from} uses {to}, which is above it"))
        .collect();
    assert!(back.is_empty(), "arrows that point back:\n{}", back.join("\n"));
}

#[test]
fn the_examples_and_the_documentation_use_the_public_face_alone() {
    let shown =
        ["examples", "docs", "README.md"].map(|name| Path::new(env!("CARGO_MANIFEST_DIR")).join(name));
    let mut files = vec![];
    for path in shown {
        match fs::read_dir(&path) {
            Ok(entries) => {
                files.extend(entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()));
            }
            Err(_) => files.push(path),
        }
    }
    // It counts the instructions of a ring for `benches/instructions`.
    files.retain(|path| !path.ends_with("ring_instructions.rs"));
    assert!(files.len() > 10, "{files:?}");
    // In C++, `takt::controller` is the class of the header.
    let of_rust =
        |text: &str| text.replace("takt::controller::connect(\"", "").replace("takt::controller::open(", "");
    let uses_hidden =
        |text: &str| HIDDEN.iter().any(|name| of_rust(text).contains(&format!("takt::{name}::")));
    files.retain(|path| uses_hidden(&fs::read_to_string(path).unwrap()));
    assert!(files.is_empty(), "they use a hidden module of takt: {files:?}");
}

/// The files that use the crate `tracing`: none of them is called in the real-time thread.
const TELL: [&str; 10] = [
    "crates/cli/src/log.rs",
    "src/controller/interfaces.rs",
    "src/controller/lines/thread.rs",
    "src/controller/session.rs",
    "src/controller/supervisor/bring_up_again.rs",
    "src/controller/supervisor/mod.rs",
    "src/controller/watchdog.rs",
    "src/family/bring_up/stages.rs",
    "src/link/ownership/mod.rs",
    "src/telemetry/announce.rs",
];

#[test]
fn only_what_runs_beside_the_real_time_thread_tells_tracing() {
    for name in ["rt/Cargo.toml", "crates/wire/Cargo.toml", "crates/sim/Cargo.toml"] {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        assert!(!fs::read_to_string(manifest).unwrap().contains("tracing"), "{name}");
    }
    let uses_it = |path: &PathBuf| fs::read_to_string(path).unwrap().contains("tracing::");
    let beside = FRONTS.into_iter().chain(["crates/tools/src", "src"]).flat_map(rust_files);
    let found: Vec<String> = beside.filter(uses_it).map(|path| shown(&path)).collect();
    assert_eq!(found, TELL);
}

/// How families and makers are called, in small letters.
const NAMES: [&str; 22] = [
    "hollow",
    "erob",
    "zeroerr",
    "yz_aim",
    "yz-aim",
    "yzaim",
    "maxon",
    "epos",
    "nanotec",
    "elmo",
    "technosoft",
    "copley",
    "schneider",
    "lexium",
    "delta asda",
    "leadshine",
    "eyou",
    "schunk",
    "faulhaber",
    "trinamic",
    "kollmorgen",
    "beckhoff",
];

/// The files that may name a family, and why.
const MAY_NAME: [(&str, &str); 4] = [
    ("crates/wire/src/lib.rs", "it declares the folders of makers' own protocols"),
    ("src/family/registry.rs", "it is the list of the families"),
    ("src/family/mod.rs", "it declares their folders, and their names for configurations in code"),
    ("src/config/in_code.rs", "its documentation has an example, which needs some drive"),
];

#[test]
fn only_its_own_folder_and_the_simulation_name_a_family() {
    let crates = ["src", "rt/src", "crates/wire/src", "crates/tools/src"];
    let files = crates.into_iter().chain(FRONTS).flat_map(rust_files);
    let is_of_family = |name: &str| {
        let folders = ["erob", "erob_can", "erob_canopen", "erob_modbus", "yz_aim", "cia402", "hollow"]
            .map(|family| format!("src/family/{family}/"));
        name.starts_with("crates/wire/src/erob_can/")
            || name.starts_with("crates/wire/src/hollow_lines/")
            || folders.iter().any(|folder| name.starts_with(folder))
    };
    let (mut found, mut needless) = (vec![], vec![]);
    for path in files {
        let name = shown(&path);
        let text = fs::read_to_string(&path).unwrap();
        let named: Vec<String> = lines_without_tests(&path, &text)
            .filter(|(_, line)| NAMES.iter().any(|family| names(line, family)))
            .map(|(number, line)| format!("{name}:{number}: {}", line.trim()))
            .collect();
        match MAY_NAME.iter().find(|(file, _)| *file == name) {
            Some(_) if named.is_empty() => needless.push(name),
            Some(_) => {}
            None if is_of_family(&name) => {}
            None => found.extend(named),
        }
    }
    assert!(found.is_empty(), "families are named outside of their folders:\n{}", found.join("\n"));
    assert!(needless.is_empty(), "they name no family, and need no exception: {needless:?}");
}

#[test]
fn a_name_of_a_family_is_found_in_any_case_and_as_a_part_of_a_name_and_not_within_another_word() {
    for line in [
        "an eRob has it",
        "drive = \"erob-canopen\"",
        "family::EROB_CANOPEN",
        "use sim::ErobJoint;",
        "YzAimJoint",
    ] {
        assert!(NAMES.iter().any(|family| names(line, family)), "{line}");
    }
    for line in ["ControlLaw::ProfilePosition", "SourcePosition", "let other_objects = 1;", "probe"] {
        assert!(!NAMES.iter().any(|family| names(line, family)), "{line}");
    }
}

/// Returns `true` if a line has this name, not as a part of a longer word: it begins a word, or a part of a name in capitals.
fn names(line: &str, family: &str) -> bool {
    let lower = line.to_lowercase();
    lower.match_indices(family).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let first = line[at..].chars().next();
        let begins_word = before.is_none_or(|letter| !letter.is_alphanumeric());
        begins_word || (first.is_some_and(char::is_uppercase) && before.is_some_and(char::is_lowercase))
    })
}

/// The lines of a file with their numbers, without the module of its unit tests, which is its end.
fn lines_without_tests<'a>(path: &Path, text: &'a str) -> impl Iterator<Item = (usize, &'a str)> {
    let is_of_tests = path.file_name().is_some_and(|name| name == "tests.rs");
    let end = if is_of_tests { Some(0) } else { text.find("#[cfg(test)]\nmod tests") };
    text[..end.unwrap_or(text.len())].lines().enumerate().map(|(index, line)| (index + 1, line))
}

#[test]
fn the_folders_of_a_crate_are_those_of_its_order() {
    for tree in &TREES {
        let there: BTreeSet<String> = tree
            .files()
            .iter()
            .map(|path| tree.module_path(path)[0].clone())
            .filter(|name| !["lib", "main"].contains(&name.as_str()))
            .collect();
        let ordered: BTreeSet<String> = tree.order.iter().map(|name| name.to_string()).collect();
        assert_eq!(there, ordered, "{}", tree.root);
    }
}

#[test]
fn the_picture_in_the_tour_shows_the_order() {
    for tree in &TREES {
        let tour = fs::read_to_string(tree.folder().join("lib.rs")).unwrap();
        let picture =
            tour.split("//! ```text\n").nth(1).and_then(|rest| rest.split("//! ```").next()).unwrap();
        // The names of a line are before its words, which begin behind two blanks.
        let line = |line: &str| line.trim_start_matches("//! ").split("  ").next().unwrap().to_owned();
        let shown: Vec<String> = picture
            .lines()
            .flat_map(|text| line(text).split(' ').map(str::to_owned).collect::<Vec<_>>())
            .collect();
        assert_eq!(shown, tree.order, "{}", tree.root);
    }
}

#[test]
fn uses_are_found_wherever_they_stand_in_a_file_and_not_in_comments_or_texts() {
    let text = r##"
        //! [`crate::cli`]
        use crate::{config::{self, Bus}, sim};
        use super::super::controller::Handle;
        /* crate::doctor */
        const TEXT: &str = "crate::jitter \" crate::jitter"; const RAW: &str = r#"crate::jitter"#;
        fn f<'a>(c: char) -> bool { c == '"' || crate::link::is_up::<'a>() }
        mod tests {
            use super::super::super::play;
            use super::super::inner;
            mod deeper { use super::super::super::super::schedule::Slot; }
        }
        use super::beside;
        use crate::faults;
    "##;
    let found = arrows_in(text, &["here", "inner"].map(str::to_owned), "x.rs");
    let seen: Vec<_> = found.iter().map(|arrow| (arrow.to.as_str(), arrow.place.as_str())).collect();
    let expected = [
        ("config", "x.rs:3"),
        ("sim", "x.rs:3"),
        ("controller", "x.rs:4"),
        ("link", "x.rs:7"),
        ("play", "x.rs:9"),
        ("schedule", "x.rs:11"),
        ("faults", "x.rs:14"),
    ];
    assert_eq!(seen, expected);
    assert!(found.iter().all(|arrow| arrow.from == "here"));
}

impl Tree {
    fn folder(&self) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join(self.root)
    }

    fn files(&self) -> Vec<PathBuf> {
        rust_files(self.root)
    }

    /// The names of the module of a file, as in `["link", "ownership"]`.
    fn module_path(&self, path: &Path) -> Vec<String> {
        let relative = path.strip_prefix(self.folder()).unwrap().with_extension("");
        let mut names: Vec<String> =
            relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if names.last().is_some_and(|name| name == "mod") {
            names.pop();
        }
        names
    }

    fn arrows(&self) -> Vec<Arrow> {
        let mut all = vec![];
        for path in self.files() {
            let text = fs::read_to_string(&path).unwrap();
            all.extend(arrows_in(&text, &self.module_path(&path), &shown(&path)));
        }
        all
    }

    /// An arrow to something that is no folder, such as a name that lib.rs re-exports, hides where it leads: it points back too.
    fn points_back(&self, arrow: &Arrow) -> bool {
        let place = |name: &str| self.order.iter().position(|folder| *folder == name);
        match (place(&arrow.from), place(&arrow.to)) {
            (Some(from), Some(to)) => to < from,
            // lib.rs and main.rs stand above all.
            (None, _) => false,
            (Some(_), None) => true,
        }
    }
}

/// A file of the repository as messages name it.
fn shown(path: &Path) -> String {
    path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display().to_string()
}

/// The Rust files below a folder of the repository.
fn rust_files(folder: &str) -> Vec<PathBuf> {
    fn add(directory: &Path, to: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(&path, to);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                to.push(path);
            }
        }
    }
    let mut all = vec![];
    add(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut all);
    all.sort();
    assert!(all.len() > 30, "{folder}/ was not found");
    all
}

/// Every path of a file that leads to another top-level module of its crate.
fn arrows_in(text: &str, module: &[String], shown: &str) -> Vec<Arrow> {
    let words = words(text);
    let word = |at: usize| words.get(at).map_or("", |(word, _)| word.as_str());
    let is_path_end = |at: usize| word(at) != "::";
    // Open braces, and whether each is that of a module.
    let mut braces: Vec<bool> = vec![];
    let mut found = vec![];
    let mut at = 0;
    while at < words.len() {
        let line = words[at].1;
        let is_begin = at == 0 || is_path_end(at - 1);
        let depth = module.len() + braces.iter().filter(|is_module| **is_module).count();
        let mut to_root = None;
        match word(at) {
            "{" => braces.push(at >= 2 && word(at - 2) == "mod"),
            "}" => {
                braces.pop();
            }
            "crate" if is_begin => to_root = Some(at + 1),
            "super" if is_begin => {
                let mut end = at;
                while word(end) == "super" && word(end + 1) == "::" {
                    end += 2;
                }
                // `super::name`: as many steps up as there are `super`.
                if (end - at) / 2 == depth {
                    to_root = Some(end - 1);
                }
            }
            _ => {}
        }
        if let Some(separator) = to_root.filter(|separator| word(*separator) == "::") {
            for to in first_names(&words, separator + 1) {
                if to != module[0] {
                    let place = format!("{shown}:{line}");
                    found.push(Arrow { from: module[0].clone(), to, place });
                }
            }
        }
        at += 1;
    }
    found
}

/// The name at a place of a path, or those at the beginning of each path in `{…}`.
fn first_names(words: &[(String, usize)], at: usize) -> Vec<String> {
    let word = |at: usize| words.get(at).map_or("", |(word, _)| word.as_str());
    if word(at) != "{" {
        return vec![word(at).to_owned()].into_iter().filter(|name| name != "*").collect();
    }
    let (mut names, mut depth, mut end) = (vec![], 1, at + 1);
    while depth > 0 && end < words.len() {
        let is_first = depth == 1 && matches!(word(end - 1), "{" | ",");
        match word(end) {
            "{" => depth += 1,
            "}" => depth -= 1,
            name if is_first => names.push(name.to_owned()),
            _ => {}
        }
        end += 1;
    }
    names
}

/// The names and signs of a Rust text with their lines, without comments, texts and characters.
fn words(text: &str) -> Vec<(String, usize)> {
    let letters: Vec<char> = text.chars().collect();
    let letter = |at: usize| letters.get(at).copied().unwrap_or('\0');
    let is_of_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    let (mut words, mut at, mut line) = (vec![], 0, 1);
    while at < letters.len() {
        let begin = at;
        match (letter(at), letter(at + 1)) {
            ('/', '/') => {
                while at < letters.len() && letter(at) != '\n' {
                    at += 1;
                }
            }
            ('/', '*') => {
                let mut depth = 1;
                at += 2;
                while depth > 0 && at < letters.len() {
                    match (letter(at), letter(at + 1)) {
                        ('/', '*') => (depth, at) = (depth + 1, at + 2),
                        ('*', '/') => (depth, at) = (depth - 1, at + 2),
                        _ => at += 1,
                    }
                }
            }
            ('r', '"' | '#') if letter(at + 1) == '"' || matches!(letter(at + 2), '"' | '#') => {
                let hashes = (at + 1..).take_while(|place| letter(*place) == '#').count();
                let end: String = std::iter::once('"').chain("#".repeat(hashes).chars()).collect();
                at += hashes + 2;
                while at < letters.len()
                    && !end.chars().zip(at..).all(|(of_end, place)| of_end == letter(place))
                {
                    at += 1;
                }
                at += end.len();
            }
            ('"', _) => {
                at += 1;
                while at < letters.len() && letter(at) != '"' {
                    at += if letter(at) == '\\' { 2 } else { 1 };
                }
                at += 1;
            }
            ('\'', '\\') => {
                at += 3;
                while at < letters.len() && letter(at) != '\'' {
                    at += 1;
                }
                at += 1;
            }
            ('\'', _) if letter(at + 2) == '\'' => at += 3,
            (':', ':') => {
                words.push(("::".to_owned(), line));
                at += 2;
            }
            (first, _) if is_of_name(first) => {
                while is_of_name(letter(at)) {
                    at += 1;
                }
                words.push((letters[begin..at].iter().collect(), line));
            }
            (sign, _) => {
                if !sign.is_whitespace() {
                    words.push((sign.to_string(), line));
                }
                at += 1;
            }
        }
        line += letters[begin..at.min(letters.len())].iter().filter(|letter| **letter == '\n').count();
    }
    words
}
