//! The result of a subcommand, on standard output.

use std::env;
use std::io::{self, ErrorKind, IsTerminal, Write, stdout};

use serde::Serialize;
use takt::telemetry::Emphasis;

use super::exit::Exit;

/// How the result is emphasised: with colours on a terminal, unless `NO_COLOR` is set (<https://no-color.org>).
pub fn emphasis() -> Emphasis {
    let is_plain = env::var_os("NO_COLOR").is_some_and(|set| !set.is_empty());
    if stdout().is_terminal() && !is_plain { Emphasis::Ansi } else { Emphasis::None }
}

/// Prints a text. How the subcommand ends: as it would, unless the text cannot be written.
pub fn text(text: &str, exit: Exit) -> Exit {
    match write(text) {
        Ok(_) => exit,
        Err(error) => unwritten(&error, exit),
    }
}

/// Prints one object in a line, for machines.
pub fn json(value: &impl Serialize, exit: Exit) -> Exit {
    object(serde_json::to_string(value), exit)
}

/// Prints one object over many lines, for machines and people.
pub fn indented_json(value: &impl Serialize, exit: Exit) -> Exit {
    object(serde_json::to_string_pretty(value), exit)
}

fn object(json: serde_json::Result<String>, exit: Exit) -> Exit {
    match json {
        Ok(json) => text(&format!("{json}\n"), exit),
        Err(error) => unwritten(&error.into(), exit),
    }
}

/// Writes a text at once, and tells whether there is still a reader: one that has seen enough (`| head`) is no failure.
///
/// # Errors
/// What is lost otherwise, as on a full disk.
pub fn write(text: &str) -> io::Result<bool> {
    let mut stdout = stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}

/// Says that the result is lost. Nobody may take that for success.
pub fn unwritten(error: &io::Error, exit: Exit) -> Exit {
    say!("takt: the result cannot be written to standard output: {error}");
    exit.and_failed()
}
