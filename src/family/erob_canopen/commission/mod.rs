//! ZeroErr eRob with CANopen firmware, commissioned by SDO (eRunner manual 1.7, chapter 5, and field experience).

mod enabling;
mod fault;
mod homing;
mod info;
mod motion;
mod objects;
mod reading;
mod state;
mod upkeep;

pub use objects::{OBJECTS, meaning, process_data_words};

use crate::family::commission::failure::Failure;
use crate::family::commission::report::Report;
use crate::family::commission::sdo_session::SdoSession;
use crate::family::commission::target::TargetDrive;
use crate::family::commission::task::{MoveKind, Task};

/// Carries out a task. AxisReading and writing objects is the same for every family and is done elsewhere.
pub async fn carry_out(c: &SdoSession, s: &TargetDrive, task: Task) -> Result<Report, Failure> {
    match task {
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
        Task::Home { method, within_ns, .. } => homing::home(c, s, method, within_ns).await,
        Task::Zero { is_confirmed } => upkeep::zero(c, s, is_confirmed).await,
        Task::Save => upkeep::save(c, s).await,
        Task::ClearFault { is_confirmed } => fault::clear(c, s, is_confirmed).await,
        task => Err(unsupported(&task)),
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
        Task::Gains { .. } => (
            "the gains of an eRob are set with the vendor's tool and suit most applications",
            "they can be read and written as the objects 2380, 2381 and 2382",
        ),
        Task::Gear { .. } => (
            "an eRob has no electronic gear",
            "it counts turns of its output; `gear_ratio` in the configuration is for a transmission behind it",
        ),
        Task::AutoHome { .. } => ("an eRob does not move by itself at power-up", "move it with `move`"),
        _ => (
            "an eRob needs no set-up for interpolation",
            "its cyclic modes interpolate between set-points by themselves",
        ),
    };
    Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() }
}
