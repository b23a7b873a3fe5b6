//! The reader of EDS, DCF and concise DCF, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::device_description::run(bytes));
