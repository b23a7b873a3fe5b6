//! Drives of bit fields: hollow-shaft motors and the makes that a file describes, from the configuration to the simulated drive.

mod machine;
mod refusals;
mod running;
mod schedule;
mod simulated;
mod vectors;
