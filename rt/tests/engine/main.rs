//! The engine in virtual time, beside drives of the simplest kind: one subject a file.

#[path = "../fixture/mod.rs"]
mod fixture;
#[path = "../fixture/plain_host.rs"]
mod plain_host;
#[path = "../fixture/thinking.rs"]
mod thinking;

mod bit_field_axes;
mod bring_up_again;
mod bus_cycles;
mod bus_kinds;
mod callbacks;
mod cycle;
mod detection;
mod false_feedback;
mod groups;
mod guarding;
mod late_feedback;
mod measured_limits;
mod measured_work;
mod mode_changes;
mod motion_reports;
mod node_axes;
mod off_cycle_axes;
mod one_group;
mod overload;
mod position_counter;
mod power;
mod profile_modes;
mod reported_process_data;
mod shared_commands;
mod stops;
mod streams;
mod torque_streams;
mod trajectories;
