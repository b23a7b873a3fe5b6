//! What a command has printed, and how it ended.

use std::process::Output;

/// On standard output.
pub fn said(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// On standard error.
pub fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[track_caller]
pub fn ends_with(code: i32, output: &Output) {
    assert_eq!(output.status.code(), Some(code), "{}{}", said(output), errors(output));
}
