//! Everything that is decoded from the wire, given any frames: emergency messages, NMT, SDO from both sides, PDO.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| subjects::wire::run(bytes));
