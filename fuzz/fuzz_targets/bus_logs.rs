//! Logs of buses and the meaning of their frames, given any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    subjects::bus_logs::run(bytes);
    subjects::bus_logs::decode(bytes);
});
