//! Why a command was refused before it did anything, as text or, with `--json`, as one object.

use std::env;
use std::ffi::OsStr;

use serde::Serialize;
use takt::config::ConfigError;
use takt_wire::printable::printable;

use super::exit::Exit;
use super::print;
use super::say;

/// Why a command was refused.
pub enum UsageError {
    /// As text.
    Words(String),
    /// A file with problems.
    File(ConfigError),
}

/// The error as a JSON object.
#[derive(Serialize)]
struct Printed {
    error: String,
    problems: Vec<Problem>,
    /// Number of problems besides these.
    omitted: usize,
}

#[derive(Serialize)]
struct Problem {
    line: Option<usize>,
    message: String,
    help: String,
}

impl UsageError {
    /// Prints it, as an object on standard output or in words on standard error.
    pub fn print(self, is_json: bool) -> Exit {
        match self {
            error if is_json => print::indented_json(&error.printed(), Exit::Usage),
            Self::Words(words) => {
                say!("takt: {words}");
                Exit::Usage
            }
            Self::File(error) => {
                say::styled(&format!("{:?}", miette::Report::new(error)));
                Exit::Usage
            }
        }
    }

    fn printed(self) -> Printed {
        match self {
            Self::Words(error) => Printed { error, problems: vec![], omitted: 0 },
            Self::File(error) => Printed {
                error: error.to_string(),
                omitted: error.omitted(),
                problems: error
                    .problems()
                    .iter()
                    .map(|problem| Problem {
                        line: error.line(problem),
                        message: problem.to_string(),
                        help: problem.kind.help(),
                    })
                    .collect(),
            },
        }
    }
}

impl From<ConfigError> for UsageError {
    fn from(error: ConfigError) -> Self {
        Self::File(error)
    }
}

impl From<String> for UsageError {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

impl From<&str> for UsageError {
    fn from(words: &str) -> Self {
        Self::Words(words.to_owned())
    }
}

/// Prints what is wrong with the command line, or the help that it has asked for.
pub fn of_command_line(error: &clap::Error) -> Exit {
    let is_json = env::args_os().any(|argument| argument == OsStr::new("--json"));
    if error.use_stderr() && is_json {
        let words = error.render().to_string();
        return UsageError::from(words.trim_start_matches("error: ").trim_end()).print(true);
    }
    // clap prints arguments unchanged on a terminal.
    let is_printable =
        |argument: &OsStr| printable(&argument.to_string_lossy()) == argument.to_string_lossy();
    if error.use_stderr() && !env::args_os().all(|argument| is_printable(&argument)) {
        say!("{}", error.render().to_string().trim_end());
    } else {
        // The reader may have ended.
        let _ = error.print();
    }
    if error.use_stderr() { Exit::Usage } else { Exit::Done }
}
