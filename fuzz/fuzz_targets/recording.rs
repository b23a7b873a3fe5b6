//! The reader of recordings and black boxes, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::recording::run(bytes));
