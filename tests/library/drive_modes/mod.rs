//! Whole controllers in virtual time against simulated drives: interpolated position on YZ-AIMs, every mode of operation
//! of an eRob, what comes on the wire, and what happens when the controller falls silent.

mod one_yz_aim;
mod targets;
mod wire;
pub mod world;

mod arrival;
mod bus_budget;
mod closed_loops;
mod configuration_file;
mod interpolation;
mod mode_changes;
mod offsets;
mod profile_position;
mod profile_torque;
mod profile_velocity;
mod quirks;
mod reported_mapping;
mod silence;
mod statuswords;
mod stream;
mod time_of_day;
mod torque_streams;
mod trajectory_time;
mod unattended;
