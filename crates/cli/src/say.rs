//! Messages beside the result, on standard error. If its reader has gone (`2>&1 | head`), the message is lost and the
//! command goes on; `eprintln!` would panic. Messages may contain names of files and arguments: what a terminal would
//! obey in them is replaced.

use std::fmt;
use std::io::{Write, stderr};

use takt_wire::printable::printable;

/// Writes a line, as `eprintln!` does.
macro_rules! say {
    ($($words:tt)*) => { $crate::say::line(format_args!($($words)*)) };
}

/// What comes from outside (arguments, names of files, other processes) moves no cursor and colours nothing.
pub fn line(words: fmt::Arguments<'_>) {
    let _ = writeln!(stderr(), "{}", printable(&words.to_string()));
}

/// Writes a text that has colours of our own, and nothing else that a terminal obeys.
pub fn styled(text: &str) {
    let _ = writeln!(stderr(), "{text}");
}
