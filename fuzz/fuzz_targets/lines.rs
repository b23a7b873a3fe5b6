//! Everything that is decoded from a serial line, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::lines::run(bytes));
