//! takt: a hard-real-time joint-motion controller for CAN drives.
//!
//! A configuration, here of one joint on a simulated bus:
//!
#![doc = concat!("```toml\n", include_str!("../configs/first.toml"), "```")]
//!
//! and a program that carries it out, here in virtual time, without hardware and without waiting:
//!
//! ```
//! fn main() -> takt::Result {
//!     let config = takt::Config::load("configs/first.toml".as_ref())?;
//!     let (mut run, _log) = takt::VirtualRun::simulated(&config)?;
//!     let outcome = run.run(100_000, |_run| {});
//!     let joint = run.snapshot().axes[0];
//!     println!("{outcome:?}: the joint is at {:.4} rad", joint.position);
//!     assert!((joint.position - std::f64::consts::FRAC_PI_2).abs() < 0.01);
//!     Ok(())
//! }
//! ```
//!
//! [`Controller`] does the same in real time, on the buses that the configuration names, and takes commands from any thread.
//!
//! This crate is the half that is not real-time: set-up, configuration, files, people, simulation. What runs inside the
//! real-time thread is the crate [`takt_rt`], which is `no_std` and links no allocator. Between the two is a door of
//! bounded, lock-free channels ([`channels`]), and nothing else.
//!
//! Each folder uses only what stands below it in this picture (`tests/arrows.rs` proves it):
//!
//! ```text
//! cli                                 the program `takt`
//! doctor jitter commission play       is the machine fit; one drive apart from any run; motion from a file
//! error                               one error for a program that embeds takt
//! controller                          the engine of a configuration, its life, its ports, the handles
//! telemetry schedule                  what a run leaves behind; whether everything fits on the buses
//! faults                              faults on purpose
//! family                              one folder a family of drives: everything that takt knows of it outside the cycle
//! link sim                            sockets; simulated buses and drives
//! config                              TOML to checked plain data in SI units
//! procedure                           the engine of bring-up, shutdown and commissioning, without I/O
//! canopen erob_can                    CiA 301, 305 and 306; eRob's own protocol; both without I/O
//! channels                            the lock-free door to the real-time thread
//! trajectory frame_time sleep_alignment source_text printable text_file
//! ```
//!
//! A tour, in the order in which a run meets the parts:
//!
//! - [`config`]: TOML to checked plain data in SI units; what is wrong is shown at its line.
//! - [`link`]: what a bus is connected to, and who commands it.
//! - [`schedule`]: whether everything fits on the buses in the worst case.
//! - [`family`], [`procedure`] and [`canopen`]: what takt knows of each family of drives, and how it sets one up, without I/O.
//! - [`procedure`]: the engine of procedures on drives, for bring-up, shutdown and [`commission`]ing.
//! - [`controller`]: assembles the engine, paces it in the real-time thread or in virtual time, and leads it through its
//!   life: bring-up, enable, program, stop, disable, leave.
//! - [`commission`]: what a single drive is set up, moved and looked at with, apart from any run.
//! - [`sim`]: buses and drives that behave like the manuals and the field notes say, quirks included.
//! - [`faults`]: what can go wrong on a bus or in a drive, on purpose, from a scenario file.
//! - [`telemetry`]: the logger that empties the rings: statistics, recordings, the report.
//! - [`doctor`] and [`jitter`]: whether a machine is fit for it, and how evenly it paces the loop.
//!
//! # To embed takt
//! A program depends on this crate alone: what it needs of `takt_rt` is re-exported. It makes or reads a [`Config`], starts a
//! [`Controller`], and commands and observes it through [`Handle`]s, from any thread. `examples/` has a short program for
//! each way to move. Every error is readable when `main` returns it: see [`Error`].
#![deny(unsafe_code)]

pub mod canopen;
pub mod channels;
pub mod commission;
pub mod config;
pub mod controller;
pub mod doctor;
pub mod erob_can;
mod error;
pub mod family;
pub mod faults;
mod frame_time;
pub mod jitter;
pub mod link;
pub mod play;
#[doc(hidden)]
pub mod printable;
pub mod procedure;
pub mod schedule;
pub mod sim;
mod sleep_alignment;
mod source_text;
pub mod telemetry;
mod text_file;
pub mod trajectory;

pub use config::{Config, ConfigError};
pub use controller::session::{Session, SessionError, SessionOptions};
pub use controller::{
    CallbackCommand, CallbackHandle, CallbackOptions, CallbackState, CallbackTimes, CommandError, Controller,
    Events, GroupHandle, Handle, MotionError, MotionId, MoveOptions, Outcome, PointRefusal, Refused,
    StartFailure, Stopped, StreamError, StreamHandle, TrajectoryProgress, VirtualRun, WaitError,
};
pub use error::{Error, Result};
pub use faults::{FaultInjector, Scenario};
pub use link::ownership::IfOwned;
pub use telemetry::{Notice, RecordingDestination};
pub use trajectory::{Trajectory, TrajectoryError, TrajectoryPoint};

/// What runs inside the real-time thread: its types as they come out of a [`Handle`], and the planner.
pub use takt_rt as rt;
pub use takt_rt::{
    AxisPoint, AxisSnapshot, AxisTarget, BusHealth, CallbackCycle, DriveState, Event, EventKind, Follow,
    OperationMode, Origin, Phase, RejectReason, RequestError, RequestId, Rule, Snapshot, StopCategory,
    StopCause, StopReason, StreamCounts, StreamReport, StreamState, TimingLevel, linux::ThreadReport, plan,
};
