//! The procedures and the SDO server of each family of drives.

use super::axis_session::{AxisSession, StepResult};
use super::{erob_canopen, yz_aim};
use crate::config::DriveFamily;
use crate::procedure::SdoQuirks;

/// A part of a drive's life that has a procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// From any state to pre-operational, configured, without torque.
    Configure,
    /// From there to operational.
    Start,
    /// From any state to pre-operational, without torque, heartbeat watchdog off.
    ShutDown,
}

/// Carries out a part with the drive of an axis.
pub(super) async fn carry_out(part: Part, c: &AxisSession<'_>) -> StepResult {
    match (c.axis.drive, part) {
        (DriveFamily::ErobCanopen, Part::Configure) => erob_canopen::bring_up::configure(c).await,
        (DriveFamily::ErobCanopen, Part::Start) => erob_canopen::bring_up::start(c).await,
        (DriveFamily::ErobCanopen, Part::ShutDown) => erob_canopen::bring_up::shut_down(c).await,
        (DriveFamily::YzAim, Part::Configure) => yz_aim::bring_up::configure(c).await,
        (DriveFamily::YzAim, Part::Start) => yz_aim::bring_up::start(c).await,
        (DriveFamily::YzAim, Part::ShutDown) => yz_aim::bring_up::shut_down(c).await,
    }
}

impl DriveFamily {
    /// Timing and deviations of the SDO server.
    pub const fn sdo_quirks(self) -> SdoQuirks {
        match self {
            Self::ErobCanopen => erob_canopen::SDO_QUIRKS,
            Self::YzAim => yz_aim::SDO_QUIRKS,
        }
    }
}
