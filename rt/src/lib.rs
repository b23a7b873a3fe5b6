//! The real-time half of takt: everything that runs inside the real-time thread, and nothing else.
//!
//! This crate is `no_std` and does not link an allocator, so that the loop cannot allocate. It formats nothing, takes no lock,
//! and never panics on data from outside. It is sans-I/O: time and frames are handed in, frames are handed out. The only place
//! that touches an operating system is `linux`, behind a feature. Another feature, `checkpoint`, makes bytes of the state of an engine, for
//! replays: with an allocator, and never in the real-time thread.
//!
//! # The tour
//! Read the files in this order:
//!
//! 1. `cycle`: [`Cycle::run`] is one whole cycle on one screen: SYNC, feedback, compute, encode, send.
//! 2. `engine`: [`Engine`] has the axes and the groups that they move in. Its documentation has the order of calls and a program
//!    of its own; `engine/state` has the table of phases.
//! 3. `source`: what is wanted of the axes in a slot: streams ([`LookAhead`]), trajectories ([`TrajectoryView`]), callbacks
//!    ([`CallbackRun`]), and [`follow`], which keeps the limits.
//! 4. `axis`: [`Axis`] is one joint: its set-points, where the joint is, the power of its drive.
//! 5. `guard`: the last check of every set-point; [`AxisLimits`] is what it checks against.
//! 6. [`plan`]: the trajectory planner, of use by itself; `group_trajectory` is what the engine makes of it.
//! 7. `cia402`, `cia402_codec`, `profile`, `control`, `units`, `pdo`: how a drive is spoken to: its state machine ([`DriveState`]),
//!    deviations of a drive ([`Cia402Codec`]), the handshake of profile position, the loops closed here ([`ControlLaw`]), SI to
//!    drive units ([`Scale`]), and PDO mappings compiled to shifts and masks ([`Mapping`]).
//! 8. `bit_fields`: the same for drives without an object dictionary, which are spoken to by frames of fixed bit fields
//!    ([`FieldDrive`], [`FrameLayout`]). [`Exchange`] is where an axis has the one or the other.
//! 9. [`slcan`]: CAN frames as text, for an adapter on a serial line; [`transparent`]: CAN FD frames as blocks of bytes, for a converter.
//!
//! What crosses the border of the real-time thread:
//!
//! - [`HostInterface`]: requests in ([`Request`]), state and records out ([`Snapshot`], [`CycleRecord`], [`Event`]);
//! - [`BusPort`] and [`Clock`]: what the cycle needs of a bus and of time; `dispatch` finds the axis of an identifier;
//! - [`Fault`] and [`StopReason`]: what can go wrong, and how a group stops for it; [`RejectReason`]: why a request is rejected;
//! - [`TimingLadder`], `watch`: what is watched over time: missed slots, silent nodes, duplicate node IDs.
#![no_std]
#![deny(unsafe_code)]

mod answers;
mod axis;
mod bit_fields;
mod bit_set;
mod capacity;
#[cfg(feature = "checkpoint")]
mod checkpoint;
mod cia402;
mod cia402_codec;
mod control;
mod cycle;
mod dispatch;
mod engine;
mod fault;
mod frame;
pub mod function_code;
mod group_trajectory;
mod guard;
mod host;
#[cfg(feature = "linux")]
pub mod linux;
mod motion_reports;
mod pdo;
mod phase;
mod places;
pub mod plan;
mod port;
mod profile;
mod record;
mod recorded_numbers;
mod rejection;
mod request;
mod sender_byte;
pub mod slcan;
mod source;
mod stop;
mod stop_category;
mod time;
mod time_of_day;
pub mod transparent;
mod units;
mod watch;
mod wire;

pub use answers::{Answer, Answers};
pub use axis::{
    Axis, AxisParameters, AxisParametersError, CommandPdo, Exchange, FeedForward, FeedbackSince, Jump,
    ModeChanges, ModeCondition, NoFeedback, OffCycleReport, Pdo, Pdos, PositionCounter, Supervision,
    TorqueLimits,
};
pub use bit_fields::{
    BesideTarget, BitField, BitRange, ByteOrder, CodeRange, CommandTargets, CommandValue, CommandValues,
    FieldBits, FieldDrive, FieldDriveParameters, FieldFrame, FieldGains, FieldMode, FieldTargets, FieldValue,
    FrameLayout, LayoutError, Life, LifeCycle, LifeState, LifeStep, LifeWish, LinearScale, MAX_FIELD_BYTES,
    MAX_FIELDS, MAX_SETUP_FRAMES, ModeCodes, Number, OwnFrame, OwnFrames, PositionReference, ReplyError,
    ReplyValue, ReplyValues, RunningMode, SetUpAgain, Setting, StateCodes,
};
pub use bit_set::BitSet;
pub use capacity::{MAX_AXES, MAX_BUSES, MAX_GROUPS};
#[cfg(feature = "checkpoint")]
pub use checkpoint::CheckpointError;
pub use cia402::{Command, DriveState, Goal, OperationMode, controlword, statusword};
pub use cia402_codec::{
    Cia402Codec, ProfileRamps, SetPointTransfer, ShownStates, StopCommand, StoppedHeartbeat,
};
pub use control::{ControlLaw, Gain, GainError, LoopInput, TorqueDemand, TrackingError};
pub use cycle::{Cycle, Flow, SlotPlan};
pub use engine::{
    BusParameters, CanopenNetwork, CycleCount, CycleInput, Deadline, Engine, EngineParameters,
    GroupParameters, Heartbeat, Receiver, SEND_BATCH, SendBatch, SetUpError,
};
pub use fault::{Fault, Rule};
pub use frame::{Frame, FrameError, FrameFormat, FrameKind, Id};
pub use guard::{AxisLimits, LimitError, braking_distance};
pub use host::{AxisSnapshot, GroupSnapshot, HostInterface, Snapshot};
pub use motion_reports::{MotionReport, MotionReports, MotionState};
pub use pdo::{
    CommandSlot, FeedbackSlot, MAX_NODE_AXES, MAX_OBJECTS, MAX_PDOS, MappedObject, Mapping, MappingError,
    ProcessImage, TooShort, TransmissionType,
};
pub use phase::Phase;
pub use port::{BusHealth, BusPort, BusState, Clock, Outgoing, RECEIVE_BATCH, ReceiveBatch, Received, Wake};
pub use profile::ProfileTarget;
pub use record::{AxisRecord, CycleRecord, CycleTiming, Event, EventKind, GroupRecord, RecordedStop};
pub use rejection::{RejectReason, RequestError};
pub use request::{
    AxisProcessData, ExecutionStart, MappedPdo, ModeChange, Move, ProfileMove, Request, RequestEnvelope,
    RequestId, RequestKind, RequestTarget, TrajectoryId,
};
pub use sender_byte::SenderByte;
pub use source::{
    AxisPoint, AxisTarget, CallbackCycle, CallbackId, CallbackOutcome, CallbackReturn, CallbackRun, Follow,
    LookAhead, LookAheadParameters, POINTS_AT_MOST, PathTime, PointError, PointRole, Polynomial,
    PositionPoint, PositionSequence, StreamCounts, StreamDelay, StreamPoint, StreamReport, StreamSample,
    StreamState, StreamWish, TimeLawPhase, TrajectorySample, TrajectoryView, follow, follow_velocity,
};
pub use stop::{Origin, StopCategories, StopCause, StopReason};
pub use stop_category::StopCategory;
pub use time::{Grid, NANOSECONDS_PER_SECOND, Nanoseconds};
pub use time_of_day::{TIME_ID, TimeOfDay};
pub use units::{Scale, ScaleError, ScaleParameters};
pub use watch::{TimingLadder, TimingLevel, nmt_command, node_state};
pub use wire::UnstuffedLength;
