//! What one cycle leaves behind: a record of fixed size, copied to the logger through a lock-free ring.

use crate::capacity::{MAX_AXES, MAX_GROUPS};
use crate::cia402::{self, OperationMode};
use crate::fault::Rule;
use crate::phase::Phase;
use crate::rejection::RequestError;
use crate::request::RequestId;
use crate::source::StreamState;
use crate::stop::StopReason;
use crate::stop_category::StopCategory;
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

/// The times of one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CycleTiming {
    /// The number of the slot on the grid.
    pub slot: u64,
    /// Its start on the grid.
    pub slot_start_ns: Nanoseconds,
    /// How late the timer woke the thread for the slot, against the instant that it was set to. When that was too
    /// late to use a slot, the latest of the wake-ups since the cycle before.
    pub wake_ns: u64,
    /// How late SYNC was handed to the first interface, against the start of the slot.
    pub sync_ns: u64,
    /// What the computation from feedback to set-points took, without any I/O.
    pub compute_ns: u64,
    /// When the last set-point had been handed over, after the start of the slot.
    pub sent_ns: u64,
    /// Slots that had passed unused when this one began (0 in an undisturbed run).
    pub missed_slots: u64,
}

/// One axis in one cycle. SI units: rad (m), rad/s, rad/s², N·m (N).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct AxisRecord {
    /// The set-point of this cycle.
    pub position_set: f64,
    /// What the drive reported for this cycle's SYNC.
    pub position: f64,
    /// Set-point of the velocity.
    pub velocity_set: f32,
    /// Set-point of the acceleration.
    pub acceleration_set: f32,
    /// Change of the acceleration set-point from the last cycle to this one, per second.
    pub jerk_set: f32,
    /// Actual velocity: reported, or else derived from the positions.
    pub velocity: f32,
    /// Torque sent: the command in CST, else the feed-forward; 0 when none is sent.
    pub torque_set: f32,
    /// Torque that the drive reported; 0 when it does not.
    pub torque: f32,
    /// Distance between the set-point that was in force at this cycle's SYNC and the position reported for it.
    pub following_error: f32,
    /// What the statusword says of the drive.
    pub drive_state: cia402::DriveState,
    /// Object 6040 as sent.
    pub controlword: u16,
    /// Object 6041 as received.
    pub statusword: u16,
    /// Object 603F if it is mapped or was announced by an emergency message; else 0.
    pub error_code: u16,
    /// Cycles of its bus since the drive last reported in time, with those in which it was not asked.
    pub feedback_age: u16,
    /// The command on the wire in drive units: counts, counts/s or per mille, by mode.
    pub command_raw: i32,
    /// The position on the wire in counts.
    pub position_raw: i32,
}

/// One group in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct GroupRecord {
    /// What it was doing.
    pub phase: Phase,
    /// Why it was stopping or had stopped.
    pub stop: Option<RecordedStop>,
    /// How long the call of the callback that leads it took; `None` if none was called.
    pub callback_ns: Option<Nanoseconds>,
}

/// What a cycle says of a stop. The event of its beginning says the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct RecordedStop {
    /// How hard it is by now.
    pub category: StopCategory,
    /// The rule that was broken.
    pub rule: Rule,
}

impl RecordedStop {
    /// What a cycle says of this stop.
    pub const fn of(stop: &StopReason) -> Self {
        Self { category: stop.category, rule: stop.rule() }
    }
}

/// One cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct CycleRecord<const AXES: usize = MAX_AXES> {
    /// When.
    pub timing: CycleTiming,
    /// How many of `groups` count: at least one.
    pub group_count: u8,
    /// Every group, in the order of the configuration.
    pub groups: [GroupRecord; MAX_GROUPS],
    /// True if set-points were sent in this cycle; if not, the drives hold the last ones.
    pub is_commanded: bool,
    /// How many of `axes` count.
    pub axis_count: u8,
    /// The axes in the order of the configuration.
    pub axes: [AxisRecord; AXES],
}

impl<const AXES: usize> Default for CycleRecord<AXES> {
    fn default() -> Self {
        Self {
            timing: CycleTiming::default(),
            group_count: 1,
            groups: [GroupRecord::default(); MAX_GROUPS],
            is_commanded: false,
            axis_count: 0,
            axes: [AxisRecord::default(); AXES],
        }
    }
}

impl<const AXES: usize> CycleRecord<AXES> {
    /// The groups that count.
    pub fn groups(&self) -> &[GroupRecord] {
        self.groups.get(..self.group_count.into()).unwrap_or(&self.groups)
    }

    /// The axes that count.
    pub fn axes(&self) -> &[AxisRecord] {
        self.axes.get(..self.axis_count.into()).unwrap_or(&self.axes)
    }
}

/// Something that happened, for the logger and for people.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub struct Event {
    /// The slot in which it was seen.
    pub slot: u64,
    /// The time at which it was seen.
    pub at_ns: Nanoseconds,
    /// The group that it concerns, by its number; `None` when it concerns the controller as a whole.
    pub group: Option<u8>,
    /// What it was.
    pub kind: EventKind,
}

/// The kinds of events.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub enum EventKind {
    /// The group went from one phase to another.
    PhaseChanged {
        /// The phase that ended.
        from: Phase,
        /// The phase that began.
        to: Phase,
    },
    /// A stop began; one for each stop, and a second one when a fault comes up on the way of a stop that was asked for.
    Stop(StopReason),
    /// A stream has begun, has run dry, or goes on again.
    Stream {
        /// What it is doing from now on.
        state: StreamState,
    },
    /// A motion has reached its target.
    MotionFinished {
        /// The request that began it.
        request: RequestId,
    },
    /// A drive's state changed.
    DriveState {
        /// The axis.
        axis: u8,
        /// The new one.
        state: cia402::DriveState,
        /// The statusword that showed it.
        statusword: u16,
    },
    /// A drive shows the mode of operation that it was changed to.
    Mode {
        /// The axis.
        axis: u8,
        /// The new mode, object 6061.
        mode: OperationMode,
    },
    /// A drive sent an emergency message (CiA 301, 7.2.7).
    Emergency {
        /// The axis.
        axis: u8,
        /// The error code; 0 = all errors gone.
        code: u16,
        /// The error register, object 1001.
        register: u8,
        /// The manufacturer's five bytes.
        manufacturer: [u8; 5],
    },
    /// Slots passed unused because the thread was late.
    MissedSlots {
        /// How many.
        count: u64,
    },
    /// Slots have been missed more often, or less often, than before.
    Timing {
        /// The level from now on.
        level: TimingLevel,
    },
    /// A request was rejected and changed nothing.
    Rejected(RequestError),
}
