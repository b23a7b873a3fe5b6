//! YZ-AIM integrated servos, CANopen edition (manual v1.62, and field experience): bring-up and shutdown, limits, and the
//! names of the alarms.
//!
//! The PDO mapping is fixed. The drive has no mode display (6061) and no emergency messages, and it does not answer SDO
//! requests for unknown objects.

mod alarm;
pub(super) mod bring_up;

use takt_rt::Nanoseconds;

use crate::canopen::sdo::SdoTiming;
use crate::config::{Axis, Control};
use crate::procedure::SdoQuirks;

pub use alarm::{Alarm, Clearing};

/// Pause between controlwords while enabling; a drive that has just booted ignores controlwords that follow sooner.
pub const CONTROLWORD_SPACING_NS: Nanoseconds = 20_000_000;
/// The only period of interpolated position mode (manual, 5.10.3).
pub const INTERPOLATION_PERIOD_NS: Nanoseconds = 2_000_000;
/// The highest value of 6081 and 60FF, in r/min.
pub const HIGHEST_SPEED_RPM: f64 = 3000.0;
/// At this value of 6083 and above the drive uses no ramp (4.3).
pub const NO_RAMP: i64 = 60_000;
/// Below this speed the drive counts as standing: 1 r/min, in the 0.1 r/min of object 606C by SDO (A27).
pub const STANDSTILL: i64 = 10;
/// Its SDO server drops requests that overlap or follow too soon. The manual gives 606C two lengths (A27), so the length
/// of the reply counts.
pub(super) const SDO_QUIRKS: SdoQuirks = SdoQuirks {
    timing: SdoTiming { reply_timeout_ns: 100_000_000, retries: 2 },
    gap_ns: 2_000_000,
    has_short_replies: true,
    has_other_lengths: true,
    is_silent_if_absent: true,
};

/// Whether the drive sends its feedback in reply to a set-point, and only then. TPDO 1, the reply in profile position,
/// may also be sent by its event timer (manual, 5.08.3).
pub fn answers_set_points(axis: &Axis) -> bool {
    !answers_sync(axis) && axis.control == Control::Interpolated
}

/// Whether the drive sends its feedback at SYNC. In profile velocity it must: its reply to a command has no statusword.
pub fn answers_sync(axis: &Axis) -> bool {
    axis.answers_sync || axis.control == Control::ProfileVelocity
}

/// Whether this drive has the mode.
pub fn has_mode(control: &Control) -> bool {
    matches!(control, Control::Interpolated | Control::ProfilePosition | Control::ProfileVelocity)
}
