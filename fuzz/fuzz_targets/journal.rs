//! The journal of a recording, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    subjects::journal::run(bytes);
});
