//! What is fuzzed: functions that take any bytes, and panic when something does not hold that should. The fuzz targets
//! call them, and so does a test (`tests/fuzz_corpus.rs`), with what is kept in `fuzz/seeds` and with random bytes.

pub mod configuration;
pub mod device_description;
pub mod engine;
mod input;
pub mod problem_lines;
mod procedures;
pub mod recording;
pub mod scenario;
pub mod wire;
