//! Names that stand in some files alone: families of drives, hidden modules of takt, the crate `tracing`.

use std::fs;
use std::path::{Path, PathBuf};

use crate::rust_files::{rust_files, shown};

/// The crates that stand on takt, and have no order of their own.
const FRONTS: [&str; 2] = ["crates/panel/src", "crates/cli/src"];

/// The modules of takt that only the other crates of this project may use.
const HIDDEN: [&str; 5] = ["channels", "command", "controller", "journal", "procedure"];

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
    let beside =
        FRONTS.into_iter().chain(["crates/remote/src", "crates/tools/src", "src"]).flat_map(rust_files);
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
const MAY_NAME: [(&str, &str); 5] = [
    ("crates/wire/src/lib.rs", "it declares the folders of makers' own protocols"),
    ("src/family/registry.rs", "it is the list of the families"),
    ("src/family/mod.rs", "it declares their folders, and their names for configurations in code"),
    ("src/config/keys.rs", "it says which keys are for the drives of one family, and what is so with some"),
    ("src/config/in_code.rs", "its documentation has an example, which needs some drive"),
];

#[test]
fn only_its_own_folder_and_the_simulation_name_a_family() {
    let crates = ["src", "rt/src", "crates/wire/src", "crates/remote/src", "crates/tools/src"];
    let files = crates.into_iter().chain(FRONTS).flat_map(rust_files);
    let is_of_family = |name: &str| {
        let folders = ["erob", "erob_can", "erob_modbus", "yz_aim", "cia402", "hollow"]
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
