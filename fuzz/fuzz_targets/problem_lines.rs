//! The reader of trajectory problems in JSON lines, given any text.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::problem_lines::run(bytes));
