//! takt: a hard-real-time joint-motion controller for CAN drives.
#![deny(unsafe_code)]

pub mod bus;
pub mod canopen;
pub mod config;
pub mod controller;
pub mod doctor;
pub mod drive;
pub mod jitter;
pub mod sim;
pub mod telemetry;
