//! The reader of configurations, given any text.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::configuration::run(bytes));
