//! The host interface: what the real-time thread shares with the rest of the program, as one trait. Behind it stand a few
//! bounded, lock-free channels. No call waits; a full channel drops, and says so.

use crate::answers::Answers;
use crate::axis::OffCycleReport;
use crate::capacity::{MAX_AXES, MAX_BUSES, MAX_GROUPS};
use crate::cia402;
use crate::frame::Frame;
use crate::motion_reports::MotionReports;
use crate::phase::Phase;
use crate::port::{BusHealth, Received};
use crate::record::{CycleRecord, Event};
use crate::request::{RequestEnvelope, TrajectoryId};
use crate::source::{
    AxisTarget, CallbackCycle, CallbackId, CallbackReturn, StreamReport, StreamSample, TrajectorySample,
};
use crate::stop::StopReason;
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

/// What the real-time thread takes from the host and gives to it. Each method has a default that takes or gives nothing, so
/// that an embedder writes only what it uses.
pub trait HostInterface<const AXES: usize = MAX_AXES, const BUSES: usize = MAX_BUSES> {
    /// The oldest request that waits.
    fn request(&mut self) -> Option<RequestEnvelope<AXES>> {
        None
    }

    /// The oldest report that waits of a drive that is spoken to outside of the cycle ([`Exchange::OffCycle`](crate::Exchange)), with
    /// the number of its axis. Asked for only where there are such axes.
    fn off_cycle_report(&mut self) -> Option<(u8, OffCycleReport)> {
        None
    }

    /// A stream of a group was asked for, and begins: it takes points from now on, and begins without any.
    fn begin_stream(&mut self, _group: u8) {}

    /// Writes what the stream of a group wants in the slot that begins at this time. Asked for once in each slot in which the group
    /// streams, and in no other. [`crate::LookAhead`] makes it of points. `sample` is what was written in the slot before.
    fn stream(&mut self, _group: u8, _slot_start_ns: Nanoseconds, _sample: &mut StreamSample<AXES>) {}

    /// Called at the end of each cycle for each group that does not stream: takes no points for its stream from now on, and discards
    /// those that wait. Returns how many these were.
    fn discard_points(&mut self, _group: u8) -> u64 {
        0
    }

    /// What a trajectory wants of a group so many seconds after its beginning. Asked for once in each cycle in which the group is
    /// on it, and when a [`Request::Execute`](crate::Request::Execute) is handled. `None` if there is no such trajectory, or it is
    /// one for another group.
    fn trajectory(
        &mut self,
        _group: u8,
        _trajectory: TrajectoryId,
        _at_s: f64,
    ) -> Option<TrajectorySample<AXES>> {
        None
    }

    /// Called once in each cycle for each group: of the trajectories that the group has asked for, only these are still needed.
    fn keep_trajectories(&mut self, _group: u8, _needed: [Option<TrajectoryId>; 2]) {}

    /// A [`Request::RunCallback`](crate::Request::RunCallback) for a group is handled: whether there is such a callback for it.
    fn take_callback(&mut self, _group: u8, _callback: CallbackId) -> bool {
        false
    }

    /// Calls the callback that leads a group: once in each cycle in which its set-points go on. `axes` shows those of the group as they
    /// have just reported. `targets` is empty, and takes what is wanted of each of them at the end of the slot; an axis without a target
    /// comes to rest and holds. A call that takes longer than its budget is a stop.
    fn callback(
        &mut self,
        _group: u8,
        _callback: CallbackId,
        _cycle: &CallbackCycle,
        _axes: &[AxisSnapshot; AXES],
        _targets: &mut [Option<AxisTarget>; AXES],
    ) -> CallbackReturn {
        CallbackReturn::default()
    }

    /// Called once in each cycle for each group: of the callbacks that the group has taken, only this one is still needed.
    fn keep_callback(&mut self, _group: u8, _needed: Option<CallbackId>) {}

    /// The oldest service frame (NMT, SDO …) that waits to be sent on this bus. Not asked for while the bus cannot take it.
    fn service_frame(&mut self, _bus: usize) -> Option<Frame> {
        None
    }

    /// Hands over a frame that is not process data. Returns whether there was room.
    fn received(&mut self, _bus: usize, _frame: &Received) -> bool {
        true
    }

    /// Hands over the record of a cycle. Returns whether there was room.
    fn record(&mut self, _record: &CycleRecord<AXES>) -> bool {
        true
    }

    /// Hands over an event. Returns whether there was room.
    fn event(&mut self, _event: &Event) -> bool {
        true
    }

    /// Shows the present state to every observer.
    fn publish(&mut self, _snapshot: &Snapshot<AXES, BUSES>) {}
}

/// The state of the controller after a cycle, for any number of observers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Snapshot<const AXES: usize = MAX_AXES, const BUSES: usize = MAX_BUSES> {
    /// The slot that it describes.
    pub slot: u64,
    /// The time at which it was made.
    pub at_ns: Nanoseconds,
    /// Slots that passed unused since the start.
    pub missed_slots: u64,
    /// How late the controller has been of late.
    pub timing: TimingLevel,
    /// Events and records that found no room, since the start.
    pub dropped: u64,
    /// Requests that were rejected, since the start.
    pub rejected: u64,
    /// What became of the last requests.
    pub answers: Answers,
    /// What became of the last motions.
    pub motions: MotionReports,
    /// How many of `groups` count: at least one.
    pub group_count: u8,
    /// Every group, in the order of the configuration.
    pub groups: [GroupSnapshot; MAX_GROUPS],
    /// How many of `axes` count.
    pub axis_count: u8,
    /// The axes in the order of the configuration.
    pub axes: [AxisSnapshot; AXES],
    /// How many of `buses` count.
    pub bus_count: u8,
    /// The buses in the order of the configuration.
    pub buses: [BusHealth; BUSES],
}

impl<const AXES: usize, const BUSES: usize> Snapshot<AXES, BUSES> {
    /// The axes that count.
    pub fn axes(&self) -> &[AxisSnapshot] {
        self.axes.get(..self.axis_count.into()).unwrap_or(&self.axes)
    }

    /// The buses that count.
    pub fn buses(&self) -> &[BusHealth] {
        self.buses.get(..self.bus_count.into()).unwrap_or(&self.buses)
    }
}

impl<const AXES: usize, const BUSES: usize> Default for Snapshot<AXES, BUSES> {
    fn default() -> Self {
        Self {
            slot: 0,
            at_ns: 0,
            missed_slots: 0,
            timing: TimingLevel::Normal,
            dropped: 0,
            rejected: 0,
            answers: Answers::default(),
            motions: MotionReports::default(),
            group_count: 1,
            groups: [GroupSnapshot::default(); MAX_GROUPS],
            axis_count: 0,
            axes: [AxisSnapshot::default(); AXES],
            bus_count: 0,
            buses: [BusHealth::default(); BUSES],
        }
    }
}

impl<const AXES: usize, const BUSES: usize> Snapshot<AXES, BUSES> {
    /// The groups that count.
    pub fn groups(&self) -> &[GroupSnapshot] {
        self.groups.get(..self.group_count.into()).unwrap_or(&self.groups)
    }

    /// The stop that began first, of any group.
    pub fn first_stop(&self) -> Option<StopReason> {
        self.groups().iter().filter_map(|group| group.stop).min_by_key(|stop| stop.slot)
    }
}

/// One group after a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct GroupSnapshot {
    /// What it is doing.
    pub phase: Phase,
    /// Planned time left of its present move or stop, in seconds.
    pub remaining_s: f64,
    /// Why it stopped or is stopping; `None` again after it has been re-enabled.
    pub stop: Option<StopReason>,
    /// True if enabling is refused until a bring-up has succeeded: from [`Request::BringUp`](crate::Request::BringUp) on until
    /// [`Request::ConfirmBringUp`](crate::Request::ConfirmBringUp). It stays true after a bring-up that has failed.
    pub needs_bring_up: bool,
    /// Its stream, or the last one.
    pub stream: StreamReport,
    /// Cycles in which its set-points went on, since the start. In the others the last ones had still to leave, or none can.
    pub steps: u64,
}

/// One axis after a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct AxisSnapshot {
    /// Set-point (rad or m).
    pub position_set: f64,
    /// Set-point of the velocity (rad/s or m/s).
    pub velocity_set: f64,
    /// Torque that is sent (N·m or N): the command in CST, else the feed-forward; 0 when none is sent.
    pub torque_set: f64,
    /// Actual position (rad or m).
    pub position: f64,
    /// Actual velocity (rad/s or m/s): reported, or else derived from the positions.
    pub velocity: f64,
    /// Distance between the set-point that was in force at the SYNC of the last feedback and the position reported for it
    /// (rad or m).
    pub following_error: f64,
    /// Object 6077 (N·m or N); `None` if the drive does not report it.
    pub torque: Option<f64>,
    /// Object 6078, in thousandths of the rated current; `None` if the drive does not report it.
    pub current_per_mille: Option<i16>,
    /// Object 6061, the mode of operation that the drive shows; `None` if the drive does not report it.
    pub mode: Option<i8>,
    /// Object 6060, the mode of operation that is commanded; 0 before the first cycle. While it is being changed this is the new
    /// mode already, and `mode` the old one until the drive shows the new one.
    pub mode_set: i8,
    /// The temperature that the drive reports: °C; `None` if it reports none.
    pub temperature: Option<f32>,
    /// Object 6040 as it is commanded; 0 before the first cycle. It says what is wanted of a drive without such an object, too.
    pub controlword: u16,
    /// Object 6041; of a drive without such an object, one that shows the same state.
    pub statusword: u16,
    /// What it says of the drive.
    pub drive_state: cia402::DriveState,
    /// Object 603F or the code of the last emergency message.
    pub error_code: u16,
    /// True if the drive has reported since the controller became active.
    pub is_heard: bool,
    /// True if the drive has confirmed that it has no torque since it was told to have none: by a report that is not old, or by SDO.
    pub is_confirmed_off: bool,
    /// SYNCs, or set-points where it answers these, that the drive has left without an answer, or has not answered yet. One that stays so may have been lost, or
    /// every answer since then comes so many cycles late: that is looked into whenever the group is enabled.
    pub unanswered: u16,
    /// Cycles of its bus since its last feedback, with those in which it was not asked for any.
    pub feedback_age: u16,
    /// The slot of the last feedback; everything that the drive reports is from then, or older. 0 before the first one.
    pub feedback_slot: u64,
    /// The time at which the last feedback was taken; 0 before the first one.
    pub feedback_ns: Nanoseconds,
}

impl AxisSnapshot {
    /// Returns `true` if what the drive reports is not from its last cycle: it has not reported yet, or has left out a cycle.
    pub const fn is_stale(&self) -> bool {
        !self.is_heard || self.feedback_age > 0
    }

    /// How old what the drive reports is at a time; `None` if it has not reported yet.
    pub fn feedback_age_ns(&self, now_ns: Nanoseconds) -> Option<Nanoseconds> {
        self.is_heard.then(|| now_ns.saturating_sub(self.feedback_ns))
    }
}
