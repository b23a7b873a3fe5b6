//! What people are told beside the result, on standard error. Whoever reads it may have gone (`2>&1 | head`): nothing can be
//! done about that, and no run may end of it, as `eprintln!` would have it.

use std::fmt;
use std::io::{Write, stderr};

/// Says a line, as `eprintln!` does, to whoever is still there.
macro_rules! say {
    ($($words:tt)*) => { $crate::cli::say::line(format_args!($($words)*)) };
}

pub fn line(words: fmt::Arguments<'_>) {
    let _ = writeln!(stderr(), "{words}");
}
