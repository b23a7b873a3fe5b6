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

mod answers;
mod axis;
mod bus_set;
mod cia402;
mod control;
mod cycle;
mod dialect;
mod dispatch;
mod engine;
mod fault;
mod frame;
mod group_trajectory;
mod guard;
mod host;
#[cfg(feature = "linux")]
pub mod linux;
mod motion_reports;
mod pdo;
mod phase;
pub mod plan;
mod port;
mod profile;
mod record;
mod request;
mod stop;
mod stop_category;
mod time;
mod time_of_day;
mod units;
mod watch;
mod wire;

pub use answers::{Answer, Answers};
pub use axis::{
    Axis, AxisParameters, AxisParametersError, CommandPdo, FeedbackSince, Jump, MAX_PDOS, Pdo,
    TransmissionType,
};
pub use bus_set::BusSet;
pub use cia402::{Command, DriveState, Goal, OperationMode, controlword, statusword};
pub use control::{ControlLaw, Gain, GainError, LoopInput};
pub use cycle::{Cycle, Flow, SlotPlan};
pub use dialect::Dialect;
pub use engine::{
    BusParameters, CycleCount, CycleInput, Deadline, Engine, EngineParameters, Heartbeat, Receiver,
    SEND_BATCH, SendBatch, SetUpError,
};
pub use fault::{Fault, Rule};
pub use frame::{Frame, FrameError, FrameKind, Id};
pub use guard::{AxisLimits, LimitError, OnViolation, Violation, braking_distance};
pub use host::{AxisSnapshot, HostInterface, Snapshot, StreamCommand};
pub use motion_reports::{MotionReport, MotionReports, MotionState};
pub use pdo::{
    CommandSlot, FeedbackSlot, MAX_OBJECTS, MappedObject, Mapping, MappingError, ProcessImage, TooShort,
};
pub use phase::Phase;
pub use port::{BusHealth, BusPort, BusState, Clock, Outgoing, RECEIVE_BATCH, ReceiveBatch, Received, Wake};
pub use profile::ProfileTarget;
pub use record::{AxisRecord, CycleRecord, CycleTiming, Event, EventKind, MAX_AXES, MAX_BUSES};
pub use request::{
    AxisProcessData, MappedPdo, Move, ProfileMove, RejectReason, Request, RequestEnvelope, RequestError,
    RequestId, RequestKind,
};
pub use stop::{Origin, StopCategories, StopCause, StopReason};
pub use stop_category::StopCategory;
pub use time::{Grid, NANOSECONDS_PER_SECOND, Nanoseconds};
pub use time_of_day::{TIME_ID, TimeOfDay};
pub use units::{Scale, ScaleError, ScaleParameters};
pub use watch::{TimingLadder, TimingLevel, nmt_command, node_state};
pub use wire::UnstuffedLength;
