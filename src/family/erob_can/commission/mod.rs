//! Commissioning of a drive by eRob's own protocol: the tasks of `takt drive`. Motions, and what is read and written by name, are those
//! of every module that commands move: [`erob`](crate::family::erob).
//!
//! - `inspection`: what the drive tells of itself; the other drives on the bus.
//! - `upkeep`: saving, node ID, brake, faults, the count of turns.
//! - `words`: requests and replies in words.

mod inspection;
mod upkeep;
mod words;

use takt_rt::Frame;
use takt_wire::canopen::object::DataType;
use takt_wire::erob_can::client::{RequestClient, RequestTiming};
use takt_wire::erob_can::entries::Entry;
use takt_wire::erob_can::frame::NODES;

use crate::family::FrameWords;
use crate::family::commission::{DriveTask, Failure, Report, TargetDrive, Task};
use crate::family::erob::module::CommandedModule as _;
use crate::family::erob::{selection, tasks};
use crate::family::erob_can::session::ErobCanSession;
use crate::procedure::Procedure;

/// A task with a drive.
///
/// # Errors
/// Such a drive cannot do it, or a name or a value is wrong.
pub fn begin(target: TargetDrive, task: Task) -> Result<DriveTask<Frame>, Failure> {
    if !NODES.contains(&target.node) {
        return Err(Failure::Unsuitable(format!(
            "an eRob with its own protocol has a node ID from 1 to 64, not {}",
            target.node
        )));
    }
    let work = Work::of(&target, task)?;
    let session = ErobCanSession::new(RequestClient::new(target.node, RequestTiming::default()));
    let mut words = frame_words(target.clone());
    let procedure = Procedure::new(session.clone(), async move { carry_out(&session, &target, work).await });
    Ok(DriveTask::new(procedure, move |frame| words(frame)))
}

/// What describes the frames of a drive.
pub fn frame_words(target: TargetDrive) -> FrameWords {
    let mut words = words::Words::new(target);
    Box::new(move |frame| words.of(frame))
}

/// A task whose entries have been found.
enum Work {
    Read(Vec<Entry>),
    Write(Entry, i64),
    Task(Task),
}

impl Work {
    fn of(target: &TargetDrive, task: Task) -> Result<Self, Failure> {
        Ok(match task {
            Task::Read { names, data_type } => {
                check_type(data_type)?;
                Self::Read(selection::to_read(&names)?)
            }
            Task::Write { name, value, data_type } => {
                check_type(data_type)?;
                let (entry, value): (Entry, i64) = selection::to_write(target, &name, &value)?;
                if !entry.is_listed() && data_type.is_none() {
                    return Err(Failure::Unsuitable(format!(
                        "nothing is known of {entry}: say with --type i32 that you mean it"
                    )));
                }
                Self::Write(entry, value)
            }
            task => match unsupported(&task) {
                Some(failure) => return Err(failure),
                None => Self::Task(task),
            },
        })
    }
}

/// On the wire every entry has 32 bits.
fn check_type(data_type: Option<DataType>) -> Result<(), Failure> {
    match data_type {
        None | Some(DataType::I32 | DataType::U32) => Ok(()),
        Some(_) => {
            Err(Failure::Unsuitable("every entry of this protocol has 32 bits: --type i32".to_owned()))
        }
    }
}

async fn carry_out(c: &ErobCanSession, s: &TargetDrive, work: Work) -> Result<Report, Failure> {
    match work {
        Work::Read(entries) => {
            c.connect(s).await?;
            selection::read(c, s, &entries).await
        }
        Work::Write(entry, value) => {
            c.connect(s).await?;
            selection::write(c, s, &entry, value).await
        }
        Work::Task(task) => match task {
            Task::Scan => inspection::scan(c).await,
            Task::Info => inspection::info(c, s).await,
            Task::Watch { every_ns, duration_ns } => tasks::watch(c, s, every_ns, duration_ns).await,
            Task::Enable { hold_ns, keeps_enabled } => tasks::enable(c, s, hold_ns, keeps_enabled).await,
            Task::Disable => tasks::disable(c, s).await,
            Task::Move { kind, profile, keeps_enabled } => {
                tasks::run_move(c, s, kind, profile, keeps_enabled).await
            }
            Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
                tasks::velocity(c, s, velocity, profile, duration_ns, keeps_enabled).await
            }
            Task::Torque { torque, velocity_limit, duration_ns } => {
                tasks::torque(c, s, torque, velocity_limit, duration_ns).await
            }
            Task::Save => upkeep::save(c, s).await,
            Task::SetId { node } => upkeep::set_id(c, s, node).await,
            Task::ReleaseBrake { is_confirmed } => upkeep::release_brake(c, s, is_confirmed).await,
            Task::Zero { is_confirmed } => upkeep::clear_turns(c, s, is_confirmed).await,
            Task::ClearFault { .. } => upkeep::clear_fault(c, s).await,
            task => Err(unsupported(&task).unwrap_or(Failure::Interrupted)),
        },
    }
}

/// Why a drive with this protocol cannot do a task; `None` where it can.
fn unsupported(task: &Task) -> Option<Failure> {
    let (what, instead) = match task {
        Task::Home { .. } => (
            "the own protocol of an eRob has no homing",
            "its encoder is absolute: set `zero_counts` in the configuration",
        ),
        Task::Restore { .. } => (
            "the own protocol of an eRob has no command that restores its parameters",
            "restore them with the vendor's tool",
        ),
        Task::EmergencyStop => {
            ("the drive has no command of its own for an emergency stop", "`disable` takes its torque")
        }
        Task::CommunicationTimeout { .. } => (
            "a communication time-out is a register of an eRob with Modbus-RTU",
            "this protocol has no watchdog: have a relay cut the supply",
        ),
        Task::SetBitRate { .. } => {
            ("the bit rate of an eRob is fixed at 1 Mbit/s", "set the bus to 1 Mbit/s instead")
        }
        Task::Mode(_) => {
            ("the mode is an entry of an eRob", "`write \"operating mode\" …`; each motion sets its own")
        }
        Task::Gains { .. } | Task::GainFactors(_) => (
            "the gains of an eRob suit most applications, and have no ranges in the manual",
            "`read` and `write` them: \"position loop gain\", \"velocity loop gain\", \"velocity loop integral\"",
        ),
        Task::Gear { .. } => (
            "an eRob has no electronic gear",
            "it counts turns of its output; `gear_ratio` in the configuration is for a transmission behind it",
        ),
        Task::AutoHome { .. } => ("an eRob does not move by itself at power-up", "move it with `move`"),
        Task::Interpolation => (
            "the own protocol of an eRob has no interpolation",
            "CANopen firmware has cyclic modes that interpolate by themselves",
        ),
        _ => return None,
    };
    Some(Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() })
}
