//! The reader of fault scenarios, given any text, and the ports that play what it takes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::scenario::run(bytes));
