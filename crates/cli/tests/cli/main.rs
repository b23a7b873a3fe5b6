//! The program `takt`, as a user runs it.

mod announced;
mod command_line;
mod config_check;
mod config_dcf;
mod controller_survives;
mod doctor;
mod drive_command;
mod drive_command_bit_fields;
mod drive_command_erob_can;
mod drive_command_yz_aim;
mod eds_command;
mod erob_modbus_line;
#[path = "../../../../tests/library/erob_module.rs"]
mod erob_module;
mod faults_command;
mod hollow_line_commands;
mod jitter;
mod lss_command;
mod monitor;
#[path = "../../../panel/tests/panel/open_page.rs"]
#[expect(dead_code, reason = "the panel of a controller is tested in `crates/panel/tests`")]
mod open_page;
mod panel_access;
mod panel_bench;
mod plan_command;
mod play_command;
mod printed;
mod replay_command;
mod report_command;
mod rs485_converter;
mod scan_command;
mod send;
mod serial_devices;
mod serial_line_config;
mod served_run;
mod service;
mod simulated;
mod slcan;
mod socketcan;
