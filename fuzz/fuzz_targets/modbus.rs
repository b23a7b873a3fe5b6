//! Both sides of a Modbus line, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::modbus::run(bytes));
