//! The state of a controller after a cycle.

use std::ffi::c_char;

use takt::rt::{BusState, GroupSnapshot, MAX_AXES, MAX_BUSES, MAX_GROUPS, RequestTarget};
use takt::{AxisSnapshot, BusHealth, Snapshot, StopReason, TimingLevel};

use crate::border::{self, Growing, put_text};
use crate::errors::{Failure, takt_result};
use crate::handles::takt_handle;
use crate::scope::Scope;

/// The most axes of a controller.
pub const TAKT_MAX_AXES: usize = 32;
/// The most groups of a controller.
pub const TAKT_MAX_GROUPS: usize = 8;
/// The most buses of a controller.
pub const TAKT_MAX_BUSES: usize = 16;
/// Room for a reason, with the zero at its end.
pub const TAKT_RULE_LENGTH: usize = 32;

const _: () =
    assert!(TAKT_MAX_AXES == MAX_AXES && TAKT_MAX_GROUPS == MAX_GROUPS && TAKT_MAX_BUSES == MAX_BUSES);

/// What a group is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_phase {
    /// The drives are being brought up or shut down.
    TAKT_PHASE_PASSIVE = 0,
    /// No torque.
    TAKT_PHASE_DISABLED = 1,
    /// The drives are being enabled.
    TAKT_PHASE_ENABLING = 2,
    /// Enabled and standing still.
    TAKT_PHASE_HOLDING = 3,
    /// Enabled and on a motion of its own.
    TAKT_PHASE_MOVING = 4,
    /// Enabled and following a stream or a callback.
    TAKT_PHASE_STREAMING = 5,
    /// Decelerating.
    TAKT_PHASE_STOPPING = 6,
    /// The drives are being disabled.
    TAKT_PHASE_DISABLING = 7,
}

/// What a stream is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum takt_stream_state {
    /// The group does not stream.
    TAKT_STREAM_IDLE = 0,
    /// It does, and no point has come yet: the axes hold.
    TAKT_STREAM_AWAITED = 1,
    /// The axes follow the points.
    TAKT_STREAM_FOLLOWING = 2,
    /// The points have run out: the axes come to rest, and go on when points come again.
    TAKT_STREAM_DRY = 3,
    /// A callback leads the axes.
    TAKT_STREAM_CALLBACK = 4,
}

/// One axis after a cycle. A value that the drive does not report is NAN.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_axis_state {
    /// Actual position: rad (m).
    pub position: f64,
    /// Actual velocity: rad/s (m/s).
    pub velocity: f64,
    /// Actual torque: N·m (N); NAN if the drive does not report it.
    pub torque: f64,
    /// Distance of the actual position from its set-point: rad (m).
    pub following_error: f64,
    /// Set-point of the position: rad (m).
    pub position_set: f64,
    /// Set-point of the velocity: rad/s (m/s).
    pub velocity_set: f64,
    /// Torque that is sent, commanded or fed forward: N·m (N); 0 when none is.
    pub torque_set: f64,
    /// In thousandths of the rated current; NAN if the drive does not report it.
    pub current_per_mille: f64,
    /// °C; NAN if the drive does not report it.
    pub temperature: f64,
    /// The slot of the last feedback: everything that the drive reports is from then. 0 before the first one.
    pub feedback_slot: u64,
    /// The time of the last feedback on the clock of takt_now_ns(); 0 before the first one.
    pub feedback_ns: u64,
    /// Cycles since the last feedback: 0 when it is from the last cycle.
    pub feedback_age_cycles: u32,
    /// Object 6041.
    pub statusword: u16,
    /// Object 6040, as commanded.
    pub controlword: u16,
    /// Object 603F, or the code of the last emergency message; 0 for none.
    pub error_code: u16,
    /// Object 6061, the mode of operation that the drive shows; 0 if it does not report it.
    pub mode: i8,
    /// Object 6060, the mode of operation that is commanded; 0 before the first cycle.
    pub mode_set: i8,
    /// The state of CiA 402: 0 not ready to switch on, 1 switch on disabled, 2 ready to switch on, 3 switched on, 4 operation enabled,
    /// 5 quick stop active, 6 fault reaction active, 7 fault, 8 undefined.
    pub drive_state: u8,
    /// True if the drive has reported since the controller became active. If not, nothing that it reports is known.
    pub is_heard: bool,
    /// True if what the drive reports is not from the last cycle: position, velocity, torque and the rest are old.
    pub is_stale: bool,
    /// 0; for later.
    pub reserved: [u8; 17],
}

/// One group after a cycle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_group_state {
    /// What it is doing: a takt_phase.
    pub phase: i32,
    /// Its stream: a takt_stream_state.
    pub stream_state: i32,
    /// Time left of its present move or stop as it is planned: s.
    pub remaining_s: f64,
    /// How far the set-points of its stream are behind the stamps: ns.
    pub stream_lag_ns: u64,
    /// Points that have come to its stream.
    pub stream_points: u64,
    /// Points that have come too late for their time.
    pub stream_late_points: u64,
    /// Points that found no room, or could not be used.
    pub stream_lost_points: u64,
    /// True if it is stopping or has stopped. It is false again once the group has been enabled again, or has moved on.
    pub is_stopped: bool,
    /// True if that stop was for a fault, which takt_clear_faults() must clear.
    pub is_faulted: bool,
    /// The category of that stop, 0 to 2: a takt_stop_category.
    pub stop_category: u8,
    /// 0; for later.
    pub reserved: [u8; 1],
    /// The axis that the stop was for, among those of the controller; -1 where it is not one axis.
    pub stop_axis: i32,
    /// The slot in which the reason of the stop was seen.
    pub stop_slot: u64,
    /// The rule of that stop as configurations name it: "requested", "following_error", "drive_fault" …; empty without a stop.
    pub stop_rule: [c_char; TAKT_RULE_LENGTH],
    /// 0; for later.
    pub reserved_too: [u64; 2],
}

/// One bus after a cycle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_bus_state {
    /// 0 works normally, 1 error-passive, 2 bus-off, 3 down.
    pub state: i32,
    /// 0; for later.
    pub reserved: u32,
    /// Frames sent.
    pub tx_frames: u64,
    /// Frames received.
    pub rx_frames: u64,
    /// Frames that the interface had no room for.
    pub tx_overruns: u64,
    /// Frames that were lost before they could be read.
    pub rx_overruns: u64,
    /// Error frames and bus errors.
    pub errors: u64,
    /// How long the wire was occupied: ns.
    pub busy_ns: u64,
    /// 0; for later.
    pub reserved_too: [u64; 2],
}

/// The state after a cycle. Set `size` to `sizeof(takt_state)` and the rest to 0: `takt_state state = {.size = sizeof state};`.
///
/// It may grow at its end. A library that knows less of it than the caller leaves the rest as it is, and sets `size` to what it knows.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct takt_state {
    /// `sizeof(takt_state)`
    pub size: u32,
    /// How often slots are missed of late: 0 hardly ever, 1 often enough for a warning, 2 no stream may begin, 3 unfit.
    pub timing: u32,
    /// The slot that it describes. takt_wait_cycle() waits for a later one.
    pub slot: u64,
    /// The time at which it was made, on the clock of takt_now_ns().
    pub at_ns: u64,
    /// Slots that passed unused since the start.
    pub missed_slots: u64,
    /// Events and records that found no room, since the start.
    pub dropped: u64,
    /// Requests that were rejected, since the start.
    pub rejected: u64,
    /// How many of `axes` count: those of the handle, in its order.
    pub axis_count: u32,
    /// How many of `groups` count: all of the controller, or the one of the handle.
    pub group_count: u32,
    /// How many of `buses` count.
    pub bus_count: u32,
    /// True if the drive of any of these axes is stale.
    pub is_any_stale: bool,
    /// 0; for later.
    pub reserved: [u8; 3],
    /// The groups. Beyond `group_count` they are 0.
    pub groups: [takt_group_state; TAKT_MAX_GROUPS],
    /// The axes. Beyond `axis_count` they are 0.
    pub axes: [takt_axis_state; TAKT_MAX_AXES],
    /// The buses. Beyond `bus_count` they are 0.
    pub buses: [takt_bus_state; TAKT_MAX_BUSES],
}

// SAFETY: it begins with its size; it is only written for the caller, so no pattern of bits is ever taken for a value.
unsafe impl Growing for takt_state {
    const FIRST_SIZE: usize = size_of::<Self>();
}

/// Reads the state after the newest complete cycle. Before the first one, no drive is heard. After the end, it is the last one.
///
/// Any thread; does not block.
///
/// Errors: TAKT_ERROR_ARGUMENT, TAKT_ERROR_HANDLE.
///
/// # Safety
/// `state` is null, or points to a structure of the size that it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn takt_read_state(handle: takt_handle, state: *mut takt_state) -> takt_result {
    border::carry_out(|| {
        let scope = handle.scope()?;
        let mut put = Ok(());
        scope.controller.look_at_state(|shown| {
            // SAFETY: the caller promises it.
            put = unsafe { put_state(&scope, shown, state) };
        });
        put
    })
}

/// Puts a state where the caller wants it.
///
/// # Safety
/// As [`border::put_growing`].
pub(crate) unsafe fn put_state(
    scope: &Scope,
    shown: &Snapshot,
    state: *mut takt_state,
) -> Result<(), Failure> {
    // SAFETY: the caller promises it.
    unsafe { border::put_growing(state, &takt_state::of(scope, shown), "state") }
}

impl takt_state {
    fn of(scope: &Scope, shown: &Snapshot) -> Self {
        let mut state = Self {
            size: size_of::<Self>() as u32,
            timing: match shown.timing {
                TimingLevel::Normal => 0,
                TimingLevel::Warning => 1,
                TimingLevel::Degraded => 2,
                TimingLevel::Unfit => 3,
            },
            slot: shown.slot,
            at_ns: shown.at_ns,
            missed_slots: shown.missed_slots,
            dropped: shown.dropped,
            rejected: shown.rejected,
            axis_count: 0,
            group_count: 0,
            bus_count: 0,
            is_any_stale: false,
            reserved: [0; 3],
            groups: [takt_group_state::NONE; TAKT_MAX_GROUPS],
            axes: [takt_axis_state::NONE; TAKT_MAX_AXES],
            buses: [takt_bus_state::NONE; TAKT_MAX_BUSES],
        };
        let axes = scope.axes.iter().filter_map(|axis| shown.axes().get(*axis));
        for (to, from) in state.axes.iter_mut().zip(axes) {
            *to = takt_axis_state::of(from);
            state.axis_count += 1;
            state.is_any_stale |= to.is_stale;
        }
        let groups = match scope.target {
            RequestTarget::Group(group) => {
                shown.groups().get(usize::from(group)..).and_then(|of| of.get(..1))
            }
            RequestTarget::All => Some(shown.groups()),
        };
        for (to, from) in state.groups.iter_mut().zip(groups.unwrap_or_default()) {
            *to = takt_group_state::of(from);
            state.group_count += 1;
        }
        for (to, from) in state.buses.iter_mut().zip(shown.buses()) {
            *to = takt_bus_state::of(from);
            state.bus_count += 1;
        }
        state
    }
}

impl takt_axis_state {
    pub(crate) const NONE: Self = Self {
        position: 0.0,
        velocity: 0.0,
        torque: 0.0,
        following_error: 0.0,
        position_set: 0.0,
        velocity_set: 0.0,
        torque_set: 0.0,
        current_per_mille: 0.0,
        temperature: 0.0,
        feedback_slot: 0,
        feedback_ns: 0,
        feedback_age_cycles: 0,
        statusword: 0,
        controlword: 0,
        error_code: 0,
        mode: 0,
        mode_set: 0,
        drive_state: 0,
        is_heard: false,
        is_stale: false,
        reserved: [0; 17],
    };

    pub(crate) fn of(axis: &AxisSnapshot) -> Self {
        Self {
            position: axis.position,
            velocity: axis.velocity,
            torque: axis.torque.unwrap_or(f64::NAN),
            following_error: axis.following_error,
            position_set: axis.position_set,
            velocity_set: axis.velocity_set,
            torque_set: axis.torque_set,
            current_per_mille: axis.current_per_mille.map_or(f64::NAN, f64::from),
            temperature: axis.temperature.map_or(f64::NAN, f64::from),
            feedback_slot: axis.feedback_slot,
            feedback_ns: axis.feedback_ns,
            feedback_age_cycles: axis.feedback_age.into(),
            statusword: axis.statusword,
            controlword: axis.controlword,
            error_code: axis.error_code,
            mode: axis.mode.unwrap_or_default(),
            mode_set: axis.mode_set,
            drive_state: axis.drive_state as u8,
            is_heard: axis.is_heard,
            is_stale: axis.is_stale(),
            reserved: [0; 17],
        }
    }
}

impl takt_group_state {
    const NONE: Self = Self {
        phase: 0,
        stream_state: 0,
        remaining_s: 0.0,
        stream_lag_ns: 0,
        stream_points: 0,
        stream_late_points: 0,
        stream_lost_points: 0,
        is_stopped: false,
        is_faulted: false,
        stop_category: 0,
        reserved: [0],
        stop_axis: -1,
        stop_slot: 0,
        stop_rule: [0; TAKT_RULE_LENGTH],
        reserved_too: [0; 2],
    };

    fn of(group: &GroupSnapshot) -> Self {
        let counts = group.stream.counts;
        let shown = Self {
            phase: group.phase as i32,
            stream_state: group.stream.state as i32,
            remaining_s: group.remaining_s,
            stream_lag_ns: counts.lag_ns,
            stream_points: counts.points,
            stream_late_points: counts.late_points,
            stream_lost_points: counts.lost_points,
            ..Self::NONE
        };
        let stopped = |stop: StopReason| Self {
            is_stopped: true,
            is_faulted: !stop.is_requested(),
            stop_category: stop.category as u8,
            stop_axis: stop.axis().map_or(-1, i32::from),
            stop_slot: stop.slot,
            stop_rule: put_text(stop.rule().key()),
            ..shown
        };
        group.stop.map_or(shown, stopped)
    }
}

impl takt_bus_state {
    const NONE: Self = Self {
        state: 0,
        reserved: 0,
        tx_frames: 0,
        rx_frames: 0,
        tx_overruns: 0,
        rx_overruns: 0,
        errors: 0,
        busy_ns: 0,
        reserved_too: [0; 2],
    };

    fn of(bus: &BusHealth) -> Self {
        Self {
            state: match bus.state {
                BusState::ErrorActive => 0,
                BusState::ErrorPassive => 1,
                BusState::BusOff => 2,
                BusState::Down => 3,
            },
            tx_frames: bus.tx_frames,
            rx_frames: bus.rx_frames,
            tx_overruns: bus.tx_overruns,
            rx_overruns: bus.rx_overruns,
            errors: bus.errors,
            busy_ns: bus.busy_ns,
            ..Self::NONE
        }
    }
}
