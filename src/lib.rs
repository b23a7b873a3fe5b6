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
//! real-time thread is the crate [`takt_rt`], which is `no_std` and links no allocator. Between the two are bounded, lock-free
//! channels, and nothing else.
//!
//! # What is here
//! The root has what most programs need: [`Config`], [`Controller`] and its [`Handle`]s, [`VirtualController`], [`VirtualRun`], [`Trajectory`], the
//! [`Snapshot`] and the [`Event`]s that they give, and their errors. The rest is in modules, one for each subject:
//!
//! - [`config`]: TOML to checked plain data in SI units; what is wrong is shown at its line.
//! - [`trajectory`]: points with times, checked as a whole before they are carried out.
//! - [`words`](mod@words): a sentence as a template and its fields, for pages in other languages.
//! - [`schedule`]: whether everything fits on the buses in the worst case.
//! - [`telemetry`]: the logger that empties the rings: statistics, recordings, the report.
//! - [`sim`]: buses and drives that behave like the manuals and the field notes say, quirks included.
//! - [`faults`]: what can go wrong on a bus or in a drive, on purpose, from a scenario file.
//! - [`family`]: what takt knows of each family of drives, and how to add one of your own; [`canopen`] has the protocols
//!   (CiA 301 and 306) that it needs.
//! - [`link`]: what a bus is connected to, and who commands it.
//! - [`error`]: one error for a program that embeds takt.
//! - [`rt`]: what runs inside the real-time thread.
//!
//! # To embed takt
//! A program depends on this crate alone: what it needs of `takt_rt` is re-exported. It makes or reads a [`Config`], starts a
//! [`Controller`], and commands and observes it through [`Handle`]s, from any thread. `examples/` has a short program for
//! each way to move. Every error is readable when `main` returns it: see [`Error`].
//!
//! # What happens
//! takt tells what happens through the crate `tracing`, from the threads beside the real-time thread. Each thing has its words and its
//! fields:
//!
//! | target | what | fields |
//! | --- | --- | --- |
//! | `takt::bring_up` | each step, the end and the failure of bring-up and shutdown | `axis`, `bus`, `node`, `stage`, `step`, `reason`, `cure` |
//! | `takt::run` | stages and phases, stops, states and emergencies of drives, missed slots, rejected requests | `slot`, `group`, `axis`, `rule`, `category`, `reason`, … |
//! | `takt::bus` | a bus is opened; its state changes | `bus`, `interface`, `state` |
//! | `takt::recording` | files are opened and closed, or cannot be written | `kind`, `file`, `reason` |
//! | `takt::realtime` | what the operating system has refused to the real-time thread | `step` |
//!
//! # To read takt
//! Each folder uses only what stands below it in this picture (`tests/repository/arrows.rs` proves it):
//!
//! ```text
//! error                               one error for a program that embeds takt
//! controller                          the engine of a configuration, its life, its ports, the handles
//! command                             one handle: what may be asked of a running controller, and how it is refused
//! telemetry schedule                  what a run leaves behind; whether everything fits on the buses
//! faults                              faults on purpose
//! family                              one folder a family of drives: everything that takt knows of it outside the cycle
//! journal                             what a run was told from outside, so that it can be replayed
//! link                                sockets and serial lines
//! config                              TOML to checked plain data in SI units
//! procedure                           the engine of bring-up, shutdown and commissioning, without I/O
//! channels                            the lock-free channels to the real-time thread
//! trajectory sleep_alignment monotonic_clock words
//! ```
//!
//! A controller of another process (`takt-remote`), the tools, the panel and the program `takt` stand on this crate, as crates of their
//! own. It stands on [`takt_sim`] (simulated buses and drives), [`takt_wire`] (protocols without I/O, times of frames on the wire, logs of
//! frames) and [`takt_rt`].
//!
//! A run meets the parts in this order: `config` reads the file, `link` opens the buses, `schedule` says whether everything fits,
//! `controller` assembles the engine, paces it in the real-time thread or in virtual time, and leads it through its life (bring-up by
//! `family`, `procedure` and `canopen`; enable, program, stop, disable, leave), and `telemetry` writes down what happened.
#![deny(unsafe_code)]
#![cfg_attr(
    not(target_os = "linux"),
    allow(dead_code, unnameable_types, unused_imports, reason = "only Linux has buses and other processes")
)]

pub mod config;
pub mod error;
pub mod family;
pub mod faults;
pub mod link;
pub mod schedule;
pub mod telemetry;
pub mod trajectory;
pub mod words;

// What the other crates of this project stand on. It may change in any release.
#[doc(hidden)]
#[allow(unnameable_types, reason = "the other crates of this project are handed them")]
pub mod channels;
#[doc(hidden)]
pub mod command;
#[doc(hidden)]
#[allow(unnameable_types, reason = "the other crates of this project are handed them")]
pub mod controller;
#[doc(hidden)]
pub mod journal;
#[doc(hidden)]
pub mod procedure;

mod monotonic_clock;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod sleep_alignment;

pub use channels::{Consumer, Producer, ring};
pub use command::{
    AnyHandle, AxisProperties, Backend, Command, CommandError, EventSource, Events, LeaseError, LeaseHolder,
    MotionError, MotionId, MoveOptions, PointRefusal, QuestionError, RecoveryError, Refused, Reply, Stopped,
    StreamError, StreamHandle, TrajectoryProgress, WaitError,
};
pub use config::{Config, ConfigError};
#[cfg(target_os = "linux")]
pub use controller::Controller;
pub use controller::port::Port;
#[cfg(target_os = "linux")]
pub use controller::realtime_thread::{Begun, Ended};
#[cfg(target_os = "linux")]
pub use controller::session::{Session, SessionError, SessionOptions};
pub use controller::{
    CallbackCommand, CallbackHandle, CallbackOptions, CallbackState, CallbackTimes, Handle, Interrupt,
    LinePort, Outcome, OwnProcess, SharedLine, StartFailure, VirtualClock, VirtualController, VirtualRun,
};
pub use error::{Error, Result};
pub use family::simulated_bus;
pub use faults::{FaultInjector, Scenario};
#[cfg(target_os = "linux")]
pub use link::IfOwned;
pub use telemetry::{Notice, RecordingDestination};
pub use trajectory::{Interpolation, Trajectory, TrajectoryError, TrajectoryPoint};

/// The CANopen services, device descriptions and configuration files that configurations and families name.
pub use takt_wire::canopen;

/// Simulated buses and drives that behave as their manuals and the field notes say.
pub use takt_sim as sim;

/// What runs inside the real-time thread: its types as they come out of a [`Handle`], and the planner.
pub use takt_rt as rt;
#[cfg(target_os = "linux")]
pub use takt_rt::linux::ThreadReport;
pub use takt_rt::{
    AxisPoint, AxisSnapshot, AxisTarget, BusHealth, CallbackCycle, DriveState, Event, EventKind, Follow,
    OperationMode, Origin, Phase, RejectReason, RequestError, RequestId, Rule, Snapshot, StopCategory,
    StopCause, StopReason, StreamCounts, StreamReport, StreamState, TimingLevel, plan,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
