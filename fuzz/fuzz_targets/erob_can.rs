//! An eRob that is spoken to outside of the cycle, on a disturbed bus, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::erob_can::run(bytes));
