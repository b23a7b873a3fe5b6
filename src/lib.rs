//! takt: a hard-real-time joint-motion controller for CAN drives.
//!
//! This is the half that is not real-time: set-up, configuration, files, people, simulation. What runs inside the
//! real-time thread is the crate [`takt_rt`], which is `no_std` and links no allocator. Between the two is a door of
//! bounded, lock-free channels ([`controller::channels`]), and nothing else.
//!
//! A tour, in the order in which a run meets the parts:
//!
//! - [`config`]: TOML to checked plain data in SI units; what is wrong is shown at its line.
//! - [`bus`]: what a bus is connected to, how long frames take, and whether everything fits in the worst case.
//! - [`drive`] and [`canopen`]: bring-up of each family of drives over the services of CiA 301, without I/O.
//! - [`controller`]: assembles the engine, paces it in the real-time thread or in virtual time, and leads it through its
//!   life: bring-up, enable, program, stop, disable, leave.
//! - [`commission`]: what a single drive is set up, moved and looked at with, apart from any run.
//! - [`sim`]: buses and drives that behave like the manuals and the field notes say, quirks included.
//! - [`faults`]: what can go wrong on a bus or in a drive, on purpose, from a scenario file.
//! - [`telemetry`]: the logger that empties the rings: statistics, recordings, the report.
//! - [`doctor`] and [`jitter`]: whether a machine is fit for it, and how evenly it paces the loop.
//!
//! To embed takt, see `examples/` and [`controller::Controller`].
#![deny(unsafe_code)]

pub mod bus;
pub mod canopen;
pub mod commission;
pub mod config;
pub mod controller;
pub mod doctor;
pub mod drive;
pub mod faults;
pub mod jitter;
pub mod play;
pub mod printable;
pub mod sim;
pub mod telemetry;
mod text_file;
pub mod trajectory;
