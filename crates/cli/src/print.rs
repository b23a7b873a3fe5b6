//! The result of a subcommand, on standard output.

use std::env;
use std::io::{self, ErrorKind, IsTerminal, Write, stdout};

use serde::Serialize;
use takt::telemetry::Emphasis;

use super::exit::Exit;

/// Whether the result has colours: with colours on a terminal, unless `NO_COLOR` is set (<https://no-color.org>).
pub fn emphasis() -> Emphasis {
    let is_plain = env::var_os("NO_COLOR").is_some_and(|set| !set.is_empty());
    if stdout().is_terminal() && !is_plain { Emphasis::Ansi } else { Emphasis::None }
}

/// Prints a text. Returns `exit`, or failure when the text cannot be written.
pub fn text(text: &str, exit: Exit) -> Exit {
    match write(text) {
        Ok(_) => exit,
        Err(error) => unwritten(&error, exit),
    }
}

/// Prints one JSON object in one line.
pub fn json(value: &impl Serialize, exit: Exit) -> Exit {
    object(serde_json::to_string(value), exit)
}

/// Prints one JSON object, indented.
pub fn indented_json(value: &impl Serialize, exit: Exit) -> Exit {
    object(serde_json::to_string_pretty(value), exit)
}

fn object(json: serde_json::Result<String>, exit: Exit) -> Exit {
    match json {
        Ok(json) => text(&format!("{json}\n"), exit),
        Err(error) => unwritten(&error.into(), exit),
    }
}

/// Writes a text and flushes it. Returns whether there is still a reader: one that has ended (`| head`) is no failure.
///
/// # Errors
/// The text could not be written for another reason, for example to a full disk.
pub fn write(text: &str) -> io::Result<bool> {
    let mut stdout = stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(error),
    }
}

/// Text that is collected before it is printed, for results that come bit by bit.
#[derive(Debug, Default)]
pub struct Collected {
    /// What is not printed yet.
    pub text: String,
    has_no_reader: bool,
    failed: Option<Exit>,
}

impl Collected {
    /// Prints what was collected.
    pub fn print(&mut self) {
        let text = std::mem::take(&mut self.text);
        if text.is_empty() || self.has_no_reader {
            return;
        }
        match write(&text) {
            Ok(true) => {}
            Ok(false) => self.has_no_reader = true,
            Err(error) => {
                self.has_no_reader = true;
                self.failed = Some(unwritten(&error, Exit::Done));
            }
        }
    }

    /// Returns `true` if nobody reads it any more.
    pub const fn has_no_reader(&self) -> bool {
        self.has_no_reader
    }

    /// The exit code if it could not be printed.
    pub const fn failed(&self) -> Option<Exit> {
        self.failed
    }
}

/// Reports that the result could not be written. The command must not end with success then.
pub fn unwritten(error: &io::Error, exit: Exit) -> Exit {
    say!("takt: the result cannot be written to standard output: {error}");
    exit.and_failed()
}
