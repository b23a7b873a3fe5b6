//! What a program embeds: configurations, drives, controllers and their handles.

mod bit_fields;
mod callbacks;
mod canopen_bring_up;
mod cia402_family;
mod cia402_nodes;
mod config;
mod config_groups;
mod config_in_code;
mod config_problems;
mod controller;
mod drive_modes;
mod erob_can_follower;
mod erob_modbus_axis;
mod erob_modbus_follower;
mod erob_modbus_vectors;
mod erob_module;
mod erob_procedures;
mod examples;
mod faults;
mod front_latency;
mod group_handles;
mod handle;
mod handle_trajectory;
mod interface_lock;
mod new_family;
mod real_time;
mod realtime_survives;
#[path = "../vectors/rows.rs"]
mod rows;
mod schedule;
mod schedule_bounds;
mod socketcan;
mod stream_clients;
mod telemetry;
mod urdf;
mod virtual_clients;
