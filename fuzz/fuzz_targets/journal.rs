//! The journal of a recording, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

#[path = "../subjects/mod.rs"]
#[allow(dead_code, reason = "each target takes its own")]
mod subjects;

fuzz_target!(|bytes: &[u8]| subjects::journal::run(bytes));
