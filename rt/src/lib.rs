//! The real-time half of takt: everything that runs inside the real-time thread, and nothing else.
//!
//! This crate is `no_std` and does not link an allocator, so the loop cannot allocate. It formats nothing, takes
//! no lock, and never panics on data from outside. It is sans-I/O: time and frames are handed in, frames are
//! handed out; the only place that touches an operating system is `linux`, behind a feature.
//!
//! From the wire inwards:
//!
//! - [`time`], [`time_of_day`], [`frame`]: integer nanoseconds and the grid; what the drives are told the time is; CAN
//!   frames that can only be valid.
//! - [`port`], [`door`]: what the cycle needs from the world, and what it shares with the rest of the program, as
//!   small traits.
//! - [`pdo`], [`units`], [`cia402`], [`dialect`], [`profile`]: process data compiled to shifts and masks; SI to drive
//!   units; the state machine of drives, those that speak otherwise, and those that make their own way to a target.
//! - [`plan`], [`guard`], [`control`], [`stop`]: trajectories, the last look at every set-point, the loops closed here,
//!   and the reasons to stop.
//! - [`axis`], [`engine`]: one joint, and the group that moves together; [`engine::Engine::compute`] is a cycle's thinking.
//! - [`watch`]: what is watched over time: missed slots, nodes that fall silent, two nodes with one number.
//! - [`cycle`]: the paced loop around it: SYNC, feedback, set-points, skip and never burst.
//! - [`record`], [`refusal`]: what each cycle leaves behind; why a request was refused.
#![no_std]
#![deny(unsafe_code)]

mod axis;
mod cia402;
mod control;
mod cycle;
mod dialect;
mod dispatch;
mod engine;
mod frame;
mod guard;
mod host;
#[cfg(feature = "linux")]
pub mod linux;
mod motion;
mod motion_reports;
mod pdo;
pub mod plan;
mod port;
mod profile;
mod record;
mod refusal;
mod stop;
mod time;
mod time_of_day;
mod units;
mod watch;
mod wire;

pub use axis::{Axis, AxisParameters, CommandPdo, FeedbackSince, Jump, MAX_PDOS, Pdo, TransmissionType};
pub use cia402::{Command, DriveState, Goal, OperationMode, controlword, statusword};
pub use control::{ControlLaw, LoopInput};
pub use cycle::{Cycle, Flow, SlotPlan};
pub use dialect::Dialect;
pub use engine::{
    BusParameters, BusSet, Engine, EngineParameters, Heartbeat, SEND_BATCH, SendBatch, SetUpError,
    Transmission,
};
pub use frame::{Frame, FrameError, FrameKind, Id};
pub use guard::{AxisLimits, OnViolation, Violation, braking_distance};
pub use host::{
    AxisProcessData, AxisSnapshot, HostInterface, MappedPdo, Move, ProfileMove, Request, RequestEnvelope,
    RequestId, Snapshot, StreamCommand,
};
pub use motion_reports::{MotionReport, MotionReports, MotionState};
pub use pdo::{
    CommandSlot, FeedbackSlot, MAX_OBJECTS, MappedObject, Mapping, MappingError, ProcessImage, TooShort,
};
pub use port::{BusHealth, BusPort, BusState, Clock, Outgoing, RECEIVE_BATCH, ReceiveBatch, Received, Wake};
pub use profile::ProfileTarget;
pub use record::{AxisRecord, CycleRecord, CycleTiming, Event, EventKind, MAX_AXES, MAX_BUSES};
pub use refusal::{Answer, Answers, Refusal, RejectReason, RequestKind};
pub use stop::{Origin, Phase, Rule, StopCategories, StopCategory, StopReason};
pub use time::{Grid, NANOSECONDS_PER_SECOND, Nanoseconds};
pub use time_of_day::{TIME_ID, TimeOfDay};
pub use units::{Scale, ScaleError, ScaleParameters};
pub use watch::{TimingLadder, TimingLevel, nmt_command, node_state};
pub use wire::{INTERMISSION_BITS, WireLength, bits_ns};
