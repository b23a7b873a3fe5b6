//! Drives of bit fields: hollow-shaft motors and the makes that a file describes, from the configuration to the simulated drive.

mod damiao;
mod machine;
mod odrive;
mod refusals;
mod running;
mod schedule;
mod simulated;
mod vectors;
