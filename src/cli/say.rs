//! What people are told beside the result, on standard error. Whoever reads it may have gone (`2>&1 | head`): nothing can be
//! done about that, and no run may end of it, as `eprintln!` would have it.

use std::fmt;
use std::io::{Write, stderr};

use takt::printable::printable;

/// Says a line, as `eprintln!` does, to whoever is still there.
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::say::line(format_args!($($words)*)) };
}

/// What comes from outside (arguments, names of files, other processes) moves no cursor and colours nothing.
pub fn line(words: fmt::Arguments<'_>) {
    let _ = writeln!(stderr(), "{}", printable(&words.to_string()));
}

/// A report of the problems of a file, with the colours of `miette`. The text of the file in it is printable already.
pub fn report(report: &miette::Report) {
    let _ = writeln!(stderr(), "{report:?}");
}
