//! The files of a crate use each other in one direction, and its folders only what stands below them in its picture.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::modules::{Arrow, Crate, Names, Source};
use crate::rust_files::shown;

/// The files that use each other all the same: what these use does not count.
const EXCEPTIONS: [&str; 10] = [
    "src/family/adapter_warning.rs",
    "src/family/bit_fields/commission/mod.rs",
    "src/family/bit_fields/scan/mod.rs",
    "src/family/cia402/starting.rs",
    "src/family/hollow/lines/mod.rs",
    "src/family/hollow/scan.rs",
    "src/family/mod.rs",
    "src/family/registry.rs",
    "src/family/scan/canopen.rs",
    "src/family/scan/heard.rs",
];

/// The crates with a picture of the order of their folders in lib.rs. A file at the top level counts as a folder.
const PICTURED: [&str; 4] =
    ["src/lib.rs", "crates/remote/src/lib.rs", "crates/tools/src/lib.rs", "crates/wire/src/lib.rs"];

#[test]
fn no_files_of_a_crate_use_each_other() {
    let (mut found, mut needless) = (vec![], BTreeSet::from(EXCEPTIONS));
    for root in roots() {
        let all = Crate::read(&root);
        let name = |module: &Names| shown(&all.0[module].file);
        let (arrows, mut counted) = (all.arrows(), all.arrows());
        for file in circles(&arrows).iter().flatten() {
            needless.remove(name(file).as_str());
        }
        counted.retain(|arrow| !EXCEPTIONS.contains(&name(&arrow.from).as_str()));
        for circle in circles(&counted) {
            let inner =
                counted.iter().filter(|arrow| circle.contains(&arrow.from) && circle.contains(&arrow.to));
            let lines =
                inner.map(|arrow| format!("{}:{} uses {}\n", name(&arrow.from), arrow.line, name(&arrow.to)));
            found.push(lines.collect::<String>());
        }
    }
    assert!(found.is_empty(), "files that use each other:\n\n{}", found.join("\n"));
    assert!(needless.is_empty(), "they are in no circle, and need no exception: {needless:?}");
}

#[test]
fn no_folder_uses_one_that_stands_above_it_in_the_picture() {
    for root in PICTURED.map(|name| Path::new(env!("CARGO_MANIFEST_DIR")).join(name)) {
        let order = pictured(&fs::read_to_string(&root).unwrap());
        let all = Crate::read(&root);
        let folders: BTreeSet<&String> = all.0.keys().filter_map(|module| module.first()).collect();
        assert_eq!(order.iter().collect::<BTreeSet<_>>(), folders, "{}", root.display());
        // lib.rs stands above all.
        let place = |module: &Names| order.iter().position(|name| module.first() == Some(name));
        let back = all.arrows().into_iter().filter(|arrow| place(&arrow.to) < place(&arrow.from));
        let back: Vec<String> = back
            .map(|arrow| {
                format!("{}:{} uses {}", shown(&all.0[&arrow.from].file), arrow.line, arrow.to.join("::"))
            })
            .collect();
        assert!(back.is_empty(), "they use what is above them:\n{}", back.join("\n"));
    }
}

/// The names in the last picture of lib.rs. Those of a line are before its words, which begin behind two blanks.
fn pictured(text: &str) -> Vec<String> {
    let picture = text.rsplit("//! ```text\n").next().and_then(|rest| rest.split("//! ```").next()).unwrap();
    let names = picture.lines().map(|line| line.trim_start_matches("//! ").split("  ").next().unwrap());
    names.flat_map(|names| names.split(' ').map(str::to_owned)).collect()
}

#[test]
fn a_circle_is_found_through_re_exports_and_inner_modules_and_not_in_tests_or_comments() {
    let crate_of = |texts: &[(&str, &str)]| {
        let names = |module: &str| module.split_terminator("::").map(str::to_owned).collect::<Names>();
        Crate(
            texts.iter().map(|(module, text)| (names(module), Source::read(text, &names(module)))).collect(),
        )
    };
    let found = |texts: &[(&str, &str)]| circles(&crate_of(texts).arrows()).into_iter().collect::<Vec<_>>();
    let root = ("", "mod a; mod b; pub use a::{A as First, inner::Other}; pub struct Own;");
    let a = ("a", "pub use inner::Other; mod inner; use super::b; pub struct A(b::B);");
    let inner = ("a::inner", "pub struct Other;");
    assert_eq!(
        found(&[root, a, inner, ("b", "mod m { fn f() -> crate::First {} } pub struct B;")]),
        [BTreeSet::from(["a", "b"].map(|name| vec![name.to_owned()]))]
    );
    for b in [
        "pub struct B(crate::Other, super::a::Other, crate::Own);",
        "/* crate::First */ pub struct B; #[cfg(test)] mod tests { use crate::First; }",
        "pub struct B; const TEXT: &str = \"crate::First\"; fn f(a: x::A) { a.A(First) }",
        "pub struct B; pub(in crate::a) fn f<'a>(c: char) -> bool { c == '\"' || g::<'a>() }",
    ] {
        assert!(found(&[root, a, inner, ("b", b)]).is_empty(), "{b}");
    }
    let of_parent = ("a", "mod inner; pub struct A; fn f(of: inner::Other) {}");
    assert_eq!(found(&[root, of_parent, ("a::inner", "pub struct Other(super::A);"), ("b", "")]).len(), 1);
}

/// The root files of all crates.
fn roots() -> Vec<PathBuf> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let members =
        ["crates", "bindings", "extras"].map(|folder| fs::read_dir(repository.join(folder)).unwrap());
    let members = members.into_iter().flatten().map(|entry| entry.unwrap().path());
    let folders = members.chain([repository.to_owned(), repository.join("rt")]);
    let candidates = folders.map(|folder| ["lib.rs", "main.rs"].map(|name| folder.join("src").join(name)));
    let roots: Vec<_> = candidates.filter_map(|files| files.into_iter().find(|file| file.exists())).collect();
    assert!(roots.len() > 10, "{roots:?}");
    roots
}

/// The groups of files that use each other.
fn circles(arrows: &[Arrow]) -> BTreeSet<BTreeSet<Names>> {
    let mut used: BTreeMap<&Names, Vec<&Names>> = BTreeMap::new();
    for arrow in arrows {
        used.entry(&arrow.from).or_default().push(&arrow.to);
    }
    let mut reached: BTreeMap<&Names, BTreeSet<&Names>> = BTreeMap::new();
    for start in used.keys() {
        let (reached, mut open) = (reached.entry(start).or_default(), vec![*start]);
        while let Some(from) = open.pop() {
            open.extend(used.get(from).into_iter().flatten().filter(|to| reached.insert(to)));
        }
    }
    let reaches = |from: &Names, to: &Names| reached.get(from).is_some_and(|reached| reached.contains(to));
    let circle = |file: &Names| {
        reached[file].iter().filter(|other| reaches(other, file)).map(|other| other.to_vec()).collect()
    };
    reached.keys().map(|file| circle(file)).filter(|circle: &BTreeSet<Names>| !circle.is_empty()).collect()
}
