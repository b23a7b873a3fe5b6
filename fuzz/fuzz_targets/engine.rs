//! The engine, given any frames, requests, streams, faults and delays.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    subjects::engine::run(bytes);
});
