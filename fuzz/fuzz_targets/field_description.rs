//! Descriptions of bit fields, and drives that are led by them, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::field_description::run(bytes));
