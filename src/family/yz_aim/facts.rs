//! What is known of a YZ-AIM.

use std::sync::LazyLock;

use takt_rt::{Cia402Codec, ProfileRamps, SetPointTransfer, ShownStates, StopCommand, StoppedHeartbeat};

use crate::config::{DriveFacts, DriveFamily, ModeChangeRule};
use crate::family::cia402::{self, Device};

/// The only period of interpolated position mode (manual, 5.10.3).
pub const INTERPOLATION_PERIOD_NS: u64 = 2_000_000;
/// The highest value of 6081 and 60FF, in r/min.
pub const HIGHEST_SPEED_RPM: f64 = 3000.0;
/// At this value of 6083 and above the drive uses no ramp (4.3).
pub const NO_RAMP: i64 = 60_000;
/// Below this speed the drive counts as standing: 1 r/min, in the 0.1 r/min of object 606C by SDO (A27).
pub const STANDSTILL: i64 = 10;

/// How it uses controlword and statusword (manual v1.62, 5.04): bits 6, 7, 9, 11, 14 and 15 of the statusword are absent, bits 0, 1,
/// 2, 4 and 5 show that it is enabled, bit 3 alone is an alarm, and nothing shows the states before it is enabled. Set-points are
/// not acknowledged; bit 5 of the controlword makes every target effective at once. It has no quick stop, and its halt keeps the
/// shaft locked. A stopped one says nothing, and one with an alarm says "stopped" (5.11.1).
pub const CODEC: Cia402Codec = Cia402Codec {
    states: ShownStates::EnabledAndFault { enabled: 0x37, fault: 0x08 },
    set_points: SetPointTransfer::Immediate,
    stop: StopCommand::Halt,
    ramps: ProfileRamps::Common,
    stopped_heartbeat: StoppedHeartbeat::Alarm,
};

/// What its data sheet and its quirk file do not say.
const STANDARD: DriveFacts = DriveFacts {
    mode_changes: ModeChangeRule::Never {
        because: "no object 6061 shows its mode, and it interpolates only with 2619h = 7 stored",
    },
    interpolation_period_ns: Some(INTERPOLATION_PERIOD_NS),
    highest_speed_rpm: Some(HIGHEST_SPEED_RPM),
    // Manual, 5.13.
    bit_rates: &[125_000, 250_000, 500_000, 1_000_000],
    may_ignore_sync: true,
    // The manual does not say which NMT state real units have after power-up.
    may_power_up_operational: true,
    codec: CODEC,
    // A drive that has just booted ignores controlwords that follow sooner.
    controlword_spacing_ns: 20_000_000,
    ..DriveFacts::standard("yz-aim", "YZ-AIM")
};

/// The drive, by its data sheet and its quirk file.
pub fn drive() -> &'static DriveFamily {
    static DRIVE: LazyLock<DriveFamily> = LazyLock::new(|| {
        cia402::built_in(
            STANDARD,
            include_str!("../../../configs/eds/yz-aim.eds"),
            include_str!("../../../drives/yz-aim.toml"),
        )
    });
    &DRIVE
}

/// Its data sheet and its quirks.
pub fn device() -> &'static Device {
    drive().description().expect("it is made from them")
}

#[cfg(test)]
mod tests {
    use takt_rt::DriveState;

    use super::*;

    #[test]
    fn statuswords_of_the_manual_decode_bit_by_bit() {
        let seen = [
            (0x0037, DriveState::OperationEnabled),
            (0x0437, DriveState::OperationEnabled),
            (0x0404, DriveState::SwitchOnDisabled),
            (0x0014, DriveState::SwitchOnDisabled),
            (0x1414, DriveState::SwitchOnDisabled),
            (0x043F, DriveState::Fault),
            (0x0008, DriveState::Fault),
        ];
        for (word, state) in seen {
            assert_eq!(CODEC.state(word), state, "{word:#06x}");
        }
    }
}
