//! Commissioning of a drive that keeps to the drive profile CiA 402, by SDO. What the drive lacks is left out.

pub(crate) mod access;
pub(crate) mod enabling;
pub(crate) mod fault;
pub(crate) mod homing;
pub(crate) mod info;
pub(crate) mod motion;
pub(crate) mod objects;
pub(crate) mod reading;
pub(crate) mod upkeep;
pub(crate) mod words;

use super::failure::Failure;
use super::report::Report;
use super::sdo_session::SdoSession;
use super::target::TargetDrive;
use super::task::{MoveKind, Task};

/// Carries out a task that every drive of the profile has. `None`: the task is the family's own.
pub async fn carry_out(c: &SdoSession, s: &TargetDrive, task: &Task) -> Option<Result<Report, Failure>> {
    Some(match *task {
        Task::Info => info::info(c, s).await,
        Task::Watch { every_ns, duration_ns } => reading::watch(c, s, every_ns, duration_ns).await,
        Task::Enable { hold_ns, keeps_enabled } => motion::enable(c, s, hold_ns, keeps_enabled).await,
        Task::Disable => enabling::disable(c, s).await,
        Task::Move { kind: MoveKind::Continuous { is_forward, duration_ns }, profile, keeps_enabled } => {
            motion::continuous(c, s, is_forward, profile, duration_ns, keeps_enabled).await
        }
        Task::Move { kind, profile, keeps_enabled } => {
            motion::position::run(c, s, kind, profile, keeps_enabled).await
        }
        Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
            motion::velocity(c, s, velocity, profile, duration_ns, keeps_enabled).await
        }
        Task::Torque { torque, velocity_limit, duration_ns } => {
            motion::torque::run(c, s, torque, velocity_limit, duration_ns).await
        }
        Task::Save => upkeep::save(c, s).await,
        Task::Restore { is_confirmed } => upkeep::restore(c, s, is_confirmed).await,
        _ => return None,
    })
}
