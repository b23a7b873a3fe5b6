//! The functions that are fuzzed. They take arbitrary bytes and panic if a property does not hold. The fuzz targets call them.
//! A test (`tests/repository/fuzz_corpus.rs`) also calls them, with the files of `fuzz/seeds` and with random bytes.

pub mod bus_logs;
pub mod configuration;
pub mod device_description;
pub mod engine;
pub mod erob_can;
pub mod field_description;
mod input;
pub mod journal;
pub mod lines;
pub mod modbus;
pub mod packets;
pub mod problem_lines;
mod procedures;
pub mod recording;
pub mod scenario;
pub mod wire;
