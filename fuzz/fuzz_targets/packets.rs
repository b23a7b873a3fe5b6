//! Packets between a controller and clients in other processes, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    subjects::packets::run(bytes);
});
