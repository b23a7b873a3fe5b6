//! YZ-AIM integrated servos, CANopen edition (manual 1.62), commissioned by SDO with one task at a time. The drive
//! does not answer requests for unknown objects: neither a reply nor an abort comes.

mod clearing;
mod enabling;
mod homing;
mod info;
mod motion;
mod objects;
mod process_data;
mod reading;
mod settings;
mod storing;
mod words;

pub use objects::meaning;
pub use process_data::words as process_data_words;

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
            motion::position(c, s, kind, profile, keeps_enabled).await
        }
        Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
            motion::velocity(c, s, velocity, profile, duration_ns, keeps_enabled).await
        }
        Task::Torque { .. } => Err(Failure::Unsupported {
            what: "a YZ-AIM has no torque mode".to_owned(),
            instead: "its current is limited by 261D (maximum allowed current)".to_owned(),
        }),
        Task::Home { method, within_ns, is_forced } => homing::home(c, s, method, within_ns, is_forced).await,
        Task::Zero { is_confirmed } => storing::zero(c, s, is_confirmed).await,
        Task::Save => storing::save(c, s).await,
        Task::Restore { .. } => Err(Failure::Unsupported {
            what: "a YZ-AIM has no object that restores its parameters (1011)".to_owned(),
            instead: "restore them with the vendor's tool".to_owned(),
        }),
        Task::SetId { node } => storing::set_id(c, s, node).await,
        Task::SetBitRate { bit_rate } => storing::set_bit_rate(c, s, bit_rate).await,
        Task::ClearFault { is_confirmed } => clearing::clear(c, s, is_confirmed).await,
        Task::Gains { position_proportional, velocity_proportional, velocity_integration } => {
            settings::gains(c, s, position_proportional, velocity_proportional, velocity_integration).await
        }
        Task::GainFactors(_) => Err(Failure::Unsupported {
            what: "a YZ-AIM takes its gains, and no factors for them".to_owned(),
            instead: "give them by --position-proportional, --velocity-proportional, --velocity-integration"
                .to_owned(),
        }),
        Task::Mode(_) => Err(Failure::Unsupported {
            what: "the mode of a YZ-AIM is an object".to_owned(),
            instead: "`write 6060 …`; each motion sets its own".to_owned(),
        }),
        Task::Gear { ratio } => settings::gear(c, s, ratio).await,
        Task::AutoHome { is_on, is_confirmed } => settings::auto_home(c, s, is_on, is_confirmed).await,
        Task::Interpolation => settings::interpolation(c, s).await,
        Task::EmergencyStop => Err(Failure::Unsupported {
            what: "the drive has no command of its own for an emergency stop".to_owned(),
            instead: "`disable` takes its torque".to_owned(),
        }),
        Task::CommunicationTimeout { .. } => Err(Failure::Unsupported {
            what: "a communication time-out is a register of an eRob with Modbus-RTU".to_owned(),
            instead: "the watchdog of a CANopen drive is its consumer heartbeat (1016): `heartbeat` in the configuration sets it"
                .to_owned(),
        }),
        Task::ReleaseBrake { .. } => Err(Failure::Unsupported {
            what: "a YZ-AIM has no object that releases its brake".to_owned(),
            instead: "`enable` releases it, with torque".to_owned(),
        }),
        Task::Scan | Task::Read { .. } | Task::Write { .. } => {
            Err(Failure::Unsuitable("scanning, reading and writing are done without the family".to_owned()))
        }
    }
}
