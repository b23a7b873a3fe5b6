//! ZeroErr eRob with CANopen firmware, commissioned by SDO (eRunner manual 1.7, chapter 5, and field experience).

mod homing;
mod info;
mod objects;
mod turns;

pub use objects::{OBJECTS, process_data_words};

use crate::family::commission::failure::Failure;
use crate::family::commission::profile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::commission::task::Task;

/// Carries out a task, other than reading and writing objects.
pub async fn carry_out(c: &SdoSession, s: &TargetDrive, task: Task) -> Result<Report, Failure> {
    match task {
        Task::Info => info::info(c, s).await,
        Task::Watch { every_ns, duration_ns } => info::watch(c, s, every_ns, duration_ns).await,
        Task::Home { method, within_ns, .. } => homing::home(c, s, method, within_ns).await,
        Task::Zero { is_confirmed } => turns::zero(c, s, is_confirmed).await,
        Task::ClearFault { is_confirmed } => {
            profile::fault::clear(c, s, async |code| turns::before_fault_reset(c, code, is_confirmed).await)
                .await
        }
        Task::Restore { .. } => Err(unsupported(&task)),
        task => profile::carry_out(c, s, &task).await.unwrap_or_else(|| Err(unsupported(&task))),
    }
}

fn unsupported(task: &Task) -> Failure {
    let (what, instead) = match task {
        Task::SetId { .. } => (
            "the CANopen firmware of an eRob has no object for its node ID",
            "set it with the vendor's custom CAN protocol (object 0043: `640+n: 00 43 00 00 00 id`, then save with \
             `640+n: 00 E8` and power-cycle) or with the vendor's tool",
        ),
        Task::SetBitRate { .. } => {
            ("the bit rate of an eRob is fixed at 1 Mbit/s", "set the bus to 1 Mbit/s instead")
        }
        Task::Mode(_) => ("the mode is an object", "`write 6060 …`; each motion sets its own"),
        Task::Gains { .. } | Task::GainFactors(_) => (
            "the gains of an eRob are set with the vendor's tool and suit most applications",
            "they can be read and written as the objects 2380, 2381 and 2382",
        ),
        Task::Gear { .. } => (
            "an eRob has no electronic gear",
            "it counts turns of its output; `gear_ratio` in the configuration is for a transmission behind it",
        ),
        Task::Restore { .. } => (
            "the firmware of an eRob has no object that restores its parameters (1011)",
            "restore them with the vendor's tool",
        ),
        Task::EmergencyStop => {
            ("the drive has no command of its own for an emergency stop", "`disable` takes its torque")
        }
        Task::CommunicationTimeout { .. } => (
            "a communication time-out is a register of an eRob with Modbus-RTU",
            "the watchdog of a CANopen drive is its consumer heartbeat (1016): `heartbeat` in the configuration sets it",
        ),
        Task::ReleaseBrake { .. } => (
            "the CANopen firmware of an eRob has no object that releases its brake",
            "`enable` releases it, with torque",
        ),
        Task::AutoHome { .. } => ("an eRob does not move by itself at power-up", "move it with `move`"),
        _ => (
            "an eRob needs no set-up for interpolation",
            "its cyclic modes interpolate between set-points by themselves",
        ),
    };
    Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() }
}
