//! The examples and the programs of `tests/programs`, compiled as a user compiles them, against what `bindings/c/install` installs, and run:
//! as they are, and under the sanitizers of gcc and valgrind.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::library::{
    Installed, Library, MEMORY, THREADS, crate_folder, is_here, program, repository, succeeds,
};

/// Each program with its configuration, and what it says in the end.
const EXAMPLES: [(&str, &str, &str); 6] = [
    ("first.c", "configs/first.toml", "the joint is there"),
    ("stream.c", "configs/arm6-erob.toml", "at rest after"),
    ("callback.c", "configs/arm6-erob-cst.toml", "swayed for 2 s in"),
    ("trajectory.c", "configs/arm6-erob.toml", "refused at point 0, axis 0"),
    ("first.cpp", "configs/first.toml", "the joint is there"),
    ("every_way.cpp", "configs/arm6-erob.toml", "refused at point 0, axis 0"),
];

fn example(name: &str) -> PathBuf {
    crate_folder().join("examples").join(name)
}

#[test]
fn the_examples_are_compiled_as_they_are_installed_without_a_warning_and_run() {
    let takt = Installed::new();
    for (name, config, words) in EXAMPLES {
        let compiled = takt.compile(&example(name), &[], Library::Shared);
        let said = takt.run(&[], &compiled, config);
        assert!(said.contains(words), "{name} has said: {said}");
    }
}

#[test]
#[ignore = "the part memory runs it"]
fn the_examples_run_under_the_address_sanitizer() {
    let takt = Installed::new();
    for (name, config, words) in EXAMPLES {
        let compiled = takt.compile(&example(name), &MEMORY, Library::Shared);
        assert!(takt.run(&[], &compiled, config).contains(words), "{name}");
    }
}

#[test]
#[ignore = "the part memory runs it"]
fn the_examples_run_under_the_thread_sanitizer() {
    let takt = Installed::new();
    for (name, config, words) in EXAMPLES {
        let compiled = takt.compile(&example(name), &THREADS, Library::Shared);
        assert!(takt.run(&[], &compiled, config).contains(words), "{name}");
    }
}

#[test]
fn nothing_that_a_program_does_wrong_crashes_it_or_touches_foreign_memory() {
    let takt = Installed::new();
    let misuse = takt.compile(&program("misuse.c"), &MEMORY, Library::Static);
    assert!(takt.run(&[], &misuse, "configs/arm6-erob.toml").contains("nothing crashed"));
}

/// The sanitizer sees what the program does; valgrind sees the library as well.
#[test]
#[ignore = "the part memory runs it"]
fn nothing_leaks_and_nothing_is_read_before_it_is_written() {
    let takt = Installed::new();
    let valgrind = [
        "valgrind",
        "--quiet",
        "--error-exitcode=99",
        "--leak-check=full",
        "--errors-for-leak-kinds=definite",
    ];
    let misuse = takt.compile(&program("misuse.c"), &[], Library::Shared);
    assert!(takt.run(&valgrind, &misuse, "configs/arm6-erob.toml").contains("nothing crashed"));
    let every_way = takt.compile(&example("every_way.cpp"), &[], Library::Shared);
    assert!(takt.run(&valgrind, &every_way, "configs/arm6-erob.toml").contains("calls"));
}

#[test]
fn many_threads_and_signals_command_one_controller() {
    let takt = Installed::new();
    for sanitizer in [&MEMORY[..], &THREADS[..]] {
        let threads = takt.compile(&program("threads.c"), sanitizer, Library::Shared);
        assert!(takt.run(&[], &threads, "configs/arm6-erob.toml").contains("all threads have ended"));
    }
}

#[test]
fn a_fork_is_refused_and_neither_a_cancelled_thread_nor_one_that_lets_time_pass_keeps_a_controller_from_its_end()
 {
    let takt = Installed::new();
    let processes = takt.compile(&program("processes.c"), &[], Library::Shared);
    assert!(takt.run(&[], &processes, "configs/first.toml").contains("ended as it should"));
}

#[test]
fn what_a_callback_in_cpp_throws_is_a_stop() {
    let takt = Installed::new();
    let throws = takt.compile(&program("throws.cpp"), &[], Library::Shared);
    assert!(takt.run(&[], &throws, "configs/first.toml").contains("the exception was a stop"));
}

#[test]
fn the_shared_library_has_the_functions_of_the_header_with_their_version_and_nothing_else() {
    let takt = Installed::new();
    let library = takt.prefix.join("lib/libtakt.so");
    let symbols = succeeds(Command::new("nm").args(["-D", "--defined-only"]).arg(&library));
    let mut exported: Vec<&str> = symbols.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    exported.retain(|name| *name != "TAKT_0");
    exported.sort_unstable();
    let script = fs::read_to_string(crate_folder().join("takt.map")).unwrap();
    let named = script.lines().filter_map(|line| line.trim().strip_suffix(';'));
    let named: Vec<String> =
        named.filter(|name| name.starts_with("takt_")).map(|name| format!("{name}@@TAKT_0")).collect();
    assert_eq!(exported, named);
    let dynamic = succeeds(Command::new("readelf").arg("-d").arg(&library));
    assert!(dynamic.contains("Library soname: [libtakt.so.0]"), "{dynamic}");
}

#[test]
fn pkg_config_finds_the_library() {
    if !is_here("pkg-config") {
        eprintln!("pkg-config is not here; tests/run installs it");
        return;
    }
    let takt = Installed::new();
    let ask = |what: &str| {
        let mut command = Command::new("pkg-config");
        succeeds(command.env("PKG_CONFIG_PATH", takt.prefix.join("lib/pkgconfig")).args([what, "takt"]))
    };
    assert_eq!(ask("--modversion").trim(), env!("CARGO_PKG_VERSION"));
    assert!(ask("--libs").contains("-ltakt"));
}

/// The blocks of a language in a page.
pub fn blocks_of(page: &str, language: &str) -> Vec<String> {
    let text = fs::read_to_string(repository().join(page)).unwrap();
    let begin = format!("```{language}\n");
    text.split(&begin).skip(1).map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

fn blocks(language: &str) -> Vec<String> {
    blocks_of("docs/c.md", language)
}

#[test]
fn every_example_of_the_guide_is_compiled_and_every_program_of_it_runs() {
    let takt = Installed::new();
    let (mut programs, mut fragments) = (0, String::from("#include <stdio.h>\n#include <takt.h>\n"));
    for (language, blocks) in [("c", blocks("c")), ("cpp", blocks("cpp"))] {
        for block in blocks {
            if !block.contains("int main") {
                fragments += &format!("void fragment_{}(takt_handle arm);\n", fragments.len());
                let name = fragments.lines().last().unwrap().trim_end_matches(';').to_owned();
                fragments += &format!("{name} {{\n    (void)arm;\n{block}}}\n");
                continue;
            }
            let source = takt.programs.path().join(format!("program.{language}"));
            fs::write(&source, block).unwrap();
            let compiled = takt.compile(&source, &[], Library::Shared);
            assert!(takt.run(&[], &compiled, "configs/first.toml").contains("the joint is there"));
            programs += 1;
        }
    }
    assert_eq!(programs, 2, "the page has the programs of ten lines in both languages");
    assert!(fragments.matches("(void)arm").count() >= 4);
    let source = takt.programs.path().join("fragments.c");
    fs::write(&source, fragments + "int main(void) { return 0; }\n").unwrap();
    takt.compile(&source, &[], Library::Shared);
}

/// From a folder that has nothing but the checkout, as the page begins; what `bindings/c/install` installs is where a system has it.
#[test]
fn the_commands_of_the_guide_make_the_arm_move_from_an_empty_folder() {
    if !is_here("pkg-config") {
        eprintln!("pkg-config is not here; tests/run installs it");
        return;
    }
    let takt = Installed::new();
    let folder = takt.programs.path();
    std::os::unix::fs::symlink(repository(), folder.join("takt")).unwrap();
    for (language, name) in [("c", "first.c"), ("cpp", "first.cpp")] {
        fs::write(folder.join(name), &blocks(language)[0]).unwrap();
    }
    fs::write(folder.join("CMakeLists.txt"), &blocks("cmake")[0]).unwrap();
    // The first of them installs.
    let mut commands = blocks("sh")[1..].to_vec();
    assert_eq!(commands.len(), 3, "{commands:?}");
    if !is_here("cmake") {
        eprintln!("cmake is not here; tests/run installs it");
        commands.pop();
    }
    for commands in commands {
        let mut shell = takt.shell(&commands);
        assert!(succeeds(&mut shell).ends_with("the joint is there\n"));
    }
}
