//! takt as `bindings/c/install` installs it, and what compiles programs against it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;
use std::{env, fs};

use tempfile::TempDir;

const WARNINGS: [&str; 6] = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow", "-Wconversion"];
pub const MEMORY: [&str; 2] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
pub const THREADS: [&str; 1] = ["-fsanitize=thread"];
/// The library is compiled without the sanitizer, which knows nothing of the atomics in it: it looks at what the program does, and not at
/// the memcpy, malloc and free of the library.
const OF_THE_PROGRAM_ALONE: &str = "called_from_lib:libtakt.so\n";
/// The sanitizer takes a part of every stack for itself, and the session thread of a debug build fills most of its two megabytes.
const STACK_BYTES: &str = "16777216";

/// takt as `bindings/c/install` installs it, and a folder for the programs of a test.
pub struct Installed {
    pub prefix: PathBuf,
    pub programs: TempDir,
}

/// Against which of the two libraries a program is linked.
#[derive(Clone, Copy, PartialEq)]
pub enum Library {
    Shared,
    Static,
}

pub fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn repository() -> PathBuf {
    crate_folder().join("../..").canonicalize().unwrap()
}

/// The static library that cargo has made of the crate for these tests: the newest, if features have made several.
fn static_library() -> PathBuf {
    let deps = env::current_exe().unwrap().parent().unwrap().to_owned();
    let is_ours = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        name.starts_with("libtakt_c") && name.ends_with(".a")
    };
    let files = fs::read_dir(&deps).unwrap().map(|entry| entry.unwrap().path()).filter(is_ours);
    files.max_by_key(|path| modified(path)).unwrap()
}

fn modified(path: &Path) -> SystemTime {
    fs::metadata(path).unwrap().modified().unwrap()
}

pub fn succeeds(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let (stdout, stderr) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    assert!(status.success(), "{command:?}: {status}\n{stdout}\n{stderr}");
    stdout.into_owned()
}

impl Installed {
    /// Each state of the library and of its files is installed once, whichever test comes first.
    pub fn new() -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("takt-c");
        fs::create_dir_all(&folder).unwrap();
        let lock = fs::File::create(folder.join("lock")).unwrap();
        lock.lock().unwrap();
        let library = static_library();
        let own = ["install", "takt.map", "include/takt.h", "include/takt.hpp"];
        let newest = own
            .map(|name| modified(&crate_folder().join(name)))
            .into_iter()
            .max()
            .unwrap()
            .max(modified(&library));
        let prefix = folder.join("installed");
        let is_installed = prefix.join("done").exists() && modified(&prefix.join("done")) >= newest;
        if !is_installed {
            let _ = fs::remove_dir_all(&prefix);
            let mut install = Command::new(crate_folder().join("install"));
            succeeds(install.arg("--prefix").arg(&prefix).arg("--static").arg(&library));
            fs::write(prefix.join("done"), "").unwrap();
        }
        Self { prefix, programs: tempfile::tempdir().unwrap() }
    }

    /// What pkg-config says. The file is simple enough to be read here where there is no pkg-config.
    fn flags(&self, library: Library) -> Vec<String> {
        let text = fs::read_to_string(self.prefix.join("lib/pkgconfig/takt.pc")).unwrap();
        let field = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)).unwrap().to_owned();
        let prefix = self.prefix.to_str().unwrap();
        let expanded = |value: String| {
            let value =
                value.replace("${libdir}", "${prefix}/lib").replace("${includedir}", "${prefix}/include");
            value.replace("${prefix}", prefix)
        };
        let libraries = match library {
            Library::Static => format!("{prefix}/lib/libtakt.a {}", field("Libs.private:")),
            Library::Shared => format!("{} -Wl,-rpath,{prefix}/lib", expanded(field("Libs:"))),
        };
        let flags = [expanded(field("Cflags:")), libraries];
        flags.iter().flat_map(|flags| flags.split_whitespace()).map(str::to_owned).collect()
    }

    /// Compiles a program with every warning as an error.
    pub fn compile(&self, source: &Path, more: &[&str], library: Library) -> PathBuf {
        self.compile_all(&[source], more, library)
    }

    /// The same of several files, named for the first.
    pub fn compile_all(&self, sources: &[&Path], more: &[&str], library: Library) -> PathBuf {
        let source = sources[0];
        let is_cpp = source.extension().is_some_and(|extension| extension == "cpp");
        let (compiler, standard) = if is_cpp { ("c++", "-std=c++17") } else { ("cc", "-std=c11") };
        let program = self.programs.path().join(source.file_name().unwrap()).with_extension(if is_cpp {
            "of-cpp"
        } else {
            "of-c"
        });
        let mut command = Command::new(compiler);
        command.args([standard, "-D_DEFAULT_SOURCE", "-g", "-O1"]).args(WARNINGS).args(more).args(sources);
        succeeds(command.args(self.flags(library)).args(["-lm", "-lpthread", "-o"]).arg(&program));
        program
    }

    /// Commands of a page, in the folder of the programs, that find takt as on a system that has it.
    pub fn shell(&self, commands: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.args(["-e", "-c", commands]).current_dir(self.programs.path());
        shell.env("PKG_CONFIG_PATH", self.prefix.join("lib/pkgconfig"));
        shell.env("LD_LIBRARY_PATH", self.prefix.join("lib")).env("CMAKE_PREFIX_PATH", &self.prefix);
        shell
    }

    /// A program, in a folder where its recordings may go.
    pub fn run(&self, runner: &[&str], program: &Path, config: &str) -> String {
        succeeds(&mut self.command(runner, program, repository().join(config).to_str().unwrap()))
    }

    /// The same, with another argument.
    pub fn command(&self, runner: &[&str], program: &Path, argument: &str) -> Command {
        let suppressions = self.programs.path().join("suppressions");
        fs::write(&suppressions, OF_THE_PROGRAM_ALONE).unwrap();
        let mut words = runner.iter().map(PathBuf::from).chain([program.to_owned(), PathBuf::from(argument)]);
        let mut command = Command::new(words.next().unwrap());
        command.args(words).current_dir(self.programs.path()).env("RUST_MIN_STACK", STACK_BYTES);
        let options = format!("suppressions={} halt_on_error=1", suppressions.display());
        command.env("TSAN_OPTIONS", options);
        command
    }
}

pub fn program(name: &str) -> PathBuf {
    crate_folder().join("tests/programs").join(name)
}

/// Returns `true` if a tool is installed.
pub fn is_here(command: &str) -> bool {
    Command::new(command).arg("--version").output().is_ok_and(|output| output.status.success())
}
