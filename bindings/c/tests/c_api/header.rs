//! The header is what the crate is.

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_up_to_date() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let sources = fs::read_to_string(folder.join("src/lib.rs")).unwrap();
    let modules = sources.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    let files = modules.map(|module| folder.join(format!("src/{module}.rs")));
    let builder = files.fold(cbindgen::Builder::new(), |builder, file| builder.with_src(file));
    let mut made = Vec::new();
    builder.with_config(config).generate().unwrap().write(&mut made);
    // What Rust calls safety is what the pointers must be.
    let made = String::from_utf8(made).unwrap().replace("// # Safety\n// ", "// Pointers: ");
    let header = folder.join("include/takt.h");
    if std::env::var_os("TAKT_WRITE_HEADER").is_some() {
        fs::write(&header, &made).unwrap();
    }
    let kept = fs::read_to_string(&header).unwrap_or_default();
    assert!(made == kept, "run: TAKT_WRITE_HEADER=1 cargo nextest run -p takt-c header");
}

#[test]
fn every_function_of_the_header_has_its_symbol_in_the_version_script_and_says_from_which_thread_it_may_be_called()
 {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let header = fs::read_to_string(folder.join("include/takt.h")).unwrap();
    let script = fs::read_to_string(folder.join("takt.map")).unwrap();
    let versioned: Vec<&str> = script
        .lines()
        .filter_map(|line| line.trim().strip_suffix(';')?.strip_prefix("takt_").map(|_| line.trim()))
        .collect();
    let mut functions = Vec::new();
    let mut words = String::new();
    for line in header.lines() {
        if let Some(comment) = line.strip_prefix("//") {
            words.push_str(comment);
            continue;
        }
        let name = line.split('(').next().and_then(|before| before.split_whitespace().last());
        let name = name.map(|name| name.trim_start_matches('*'));
        let is_function = line.contains('(') && !line.starts_with(' ') && !line.starts_with("typedef");
        if let Some(name) = name.filter(|name| name.starts_with("takt_") && is_function) {
            functions.push(format!("{name};"));
            let is_said = words.contains("ny thread") || words.contains("As takt_");
            assert!(is_said, "{name} does not say from which thread it may be called:{words}");
        }
        words.clear();
    }
    assert!(functions.len() > 40, "{functions:?}");
    functions.sort();
    assert_eq!(versioned, functions);
}
