//! Commissioning of a drive by its data sheet: the tasks of the drive profile. What only a vendor's own objects can do is
//! refused with what to do instead.

use super::device::Device;
use super::turns;
use crate::family::commission::failure::Failure;
use crate::family::commission::profile;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::commission::task::Task;
use takt_wire::quirks::Refusal;

/// Carries out a task, other than reading and writing objects.
pub async fn carry_out(c: &SdoSession, s: &TargetDrive, task: Task) -> Result<Report, Failure> {
    let quirks = s.drive.description().map(|device: &Device| &device.quirks);
    let refusals = quirks.map_or(&[][..], |quirks| &quirks.refusals);
    if let Some(Refusal { reason, instead, .. }) =
        refusals.iter().find(|refusal| refusal.task == command(&task))
    {
        let (what, instead) = ((*reason).to_owned(), (*instead).to_owned());
        return Err(Failure::Unsupported { what, instead });
    }
    if let Some(done) = profile::carry_out(c, s, &task).await {
        return done;
    }
    match (task, quirks.and_then(|quirks| quirks.turn_count)) {
        (Task::Zero { is_confirmed }, Some(turns)) => turns::zero(c, s, turns, is_confirmed).await,
        (Task::ClearFault { is_confirmed }, Some(turns)) => {
            let before = async |code| turns::before_fault_reset(c, s, turns, code, is_confirmed).await;
            profile::fault::clear(c, s, before).await
        }
        (Task::Home { method, within_ns, is_forced }, _) => {
            profile::homing::home(c, s, method, within_ns, is_forced).await
        }
        (Task::ClearFault { .. }, None) => profile::fault::clear(c, s, async |_| Ok(())).await,
        (task, _) => Err(unsupported(&task)),
    }
}

/// The command of `takt drive` by which a quirk file refuses a task; empty for one that it cannot refuse.
fn command(task: &Task) -> &'static str {
    match task {
        Task::Zero { .. } => "zero",
        Task::Restore { .. } => "restore",
        Task::SetId { .. } => "set-id",
        Task::SetBitRate { .. } => "set-bit-rate",
        Task::ReleaseBrake { .. } => "release-brake",
        Task::Gains { .. } | Task::GainFactors(_) => "gains",
        Task::Gear { .. } => "gear",
        Task::AutoHome { .. } => "auto-home",
        Task::Interpolation => "interpolation",
        _ => "",
    }
}

fn unsupported(task: &Task) -> Failure {
    let (what, instead) = match task {
        Task::Zero { .. } => (
            "how an encoder is zeroed is not part of the drive profile",
            "`home --method 37` (or 35) makes the present position the zero; or set `zero_counts` in the configuration",
        ),
        Task::SetId { .. } => (
            "the node ID is not part of the drive profile",
            "`takt lss` sets it where the drive has layer setting services; otherwise switches or the vendor's tool",
        ),
        Task::SetBitRate { .. } => (
            "the bit rate is not part of the drive profile",
            "`takt lss` sets it where the drive has layer setting services; otherwise switches or the vendor's tool",
        ),
        Task::Mode(_) => ("the mode is an object", "`write 6060 …`; each motion sets its own"),
        Task::Gains { .. } | Task::GainFactors(_) => {
            ("the gains are the vendor's own objects", "`read` and `write` them by index:subindex")
        }
        Task::EmergencyStop => {
            ("the drive has no command of its own for an emergency stop", "`disable` takes its torque")
        }
        Task::CommunicationTimeout { .. } => (
            "a communication time-out is a register of an eRob with Modbus-RTU",
            "the watchdog of a CANopen drive is its consumer heartbeat (1016): `heartbeat` in the configuration sets it",
        ),
        Task::ReleaseBrake { .. } => {
            ("how a brake is released is not part of the drive profile", "`enable` releases it, with torque")
        }
        _ => (
            "this is done with a YZ-AIM only",
            "`read` and `write` the objects of this drive by index:subindex",
        ),
    };
    Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() }
}
