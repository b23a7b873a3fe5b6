//! Commissioning of a drive by Modbus-RTU: the tasks of `takt drive`.

use takt_wire::modbus::exception::ExceptionCode;
use takt_wire::modbus::frame::{ReceivedRequest, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{MasterTiming, RequestFailure};

use super::commands::{self, CommandFailure};
use super::drive::{AccessError, AccessFailure, ErobDrive};
use super::register::Register;
use super::registers;
use crate::family::commission::{DriveTask, Failure, Report, TargetDrive, Task};
use crate::family::erob::module::CommandedModule as _;
use crate::family::erob::{selection, tasks};
use crate::procedure::{ModbusClient, ModbusSession, Procedure};
use crate::words::Words;

/// A task with a drive on a line of this bit rate.
///
/// # Errors
/// Such a drive cannot do it, or a name or a value is wrong.
pub fn begin(target: TargetDrive, task: Task, bit_rate: u32) -> Result<DriveTask<Vec<u8>>, Failure> {
    let Some(slave) = SlaveAddress::new(target.node) else {
        return Err(Failure::Unsuitable(format!(
            "a slave has an address from 1 to 247, not {}",
            target.node
        )));
    };
    let work = Work::of(&target, task)?;
    let timing = MasterTiming::new(LineTiming::new(bit_rate));
    let session = ModbusSession::new(ModbusClient::new(slave, timing));
    let drive = ErobDrive::new(session.clone());
    let procedure = Procedure::new(session, async move { carry_out(&drive, &target, work).await });
    Ok(DriveTask::new(procedure, |bytes: &Vec<u8>| words(bytes)))
}

/// Bytes of the line in words, as far as they are a request.
fn words(bytes: &[u8]) -> String {
    match ReceivedRequest::decode(bytes) {
        Some(ReceivedRequest { address, request: Ok(request) }) => format!("slave {address}: {request}"),
        _ => String::new(),
    }
}

/// A task whose registers have been found.
enum Work {
    Read(Vec<Register>),
    Write(Register, i64),
    Task(Task),
}

impl Work {
    fn of(target: &TargetDrive, task: Task) -> Result<Self, Failure> {
        Ok(match task {
            Task::Read { names, .. } => Self::Read(selection::to_read(&names)?),
            Task::Write { name, value, .. } => {
                let (register, value) = selection::to_write(target, &name, &value)?;
                Self::Write(register, value)
            }
            task => match unsupported(&task) {
                Some(failure) => return Err(failure),
                None => Self::Task(task),
            },
        })
    }
}

async fn carry_out(drive: &ErobDrive, s: &TargetDrive, work: Work) -> Result<Report, Failure> {
    let task = match work {
        Work::Read(registers) => {
            drive.connect(s).await?;
            return selection::read(drive, s, &registers).await;
        }
        Work::Write(register, value) => {
            drive.connect(s).await?;
            return selection::write(drive, s, &register, value).await;
        }
        Work::Task(task) => task,
    };
    match task {
        Task::Watch { every_ns, duration_ns } => tasks::watch(drive, s, every_ns, duration_ns).await,
        Task::Enable { hold_ns, keeps_enabled } => tasks::enable(drive, s, hold_ns, keeps_enabled).await,
        Task::Disable => tasks::disable(drive, s).await,
        Task::Move { kind, profile, keeps_enabled } => {
            tasks::run_move(drive, s, kind, profile, keeps_enabled).await
        }
        Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
            tasks::velocity(drive, s, velocity, profile, duration_ns, keeps_enabled).await
        }
        Task::Torque { torque, velocity_limit, duration_ns } => {
            tasks::torque(drive, s, torque, velocity_limit, duration_ns).await
        }
        // It does not wait for an answer before it stops the joint.
        Task::EmergencyStop => {
            commands::stop_in_an_emergency(drive).await?;
            tasks::summary(drive, s).await
        }
        task => {
            drive.connect(s).await?;
            maintain(drive, s, task).await
        }
    }
}

/// The tasks that move nothing.
async fn maintain(drive: &ErobDrive, s: &TargetDrive, task: Task) -> Result<Report, Failure> {
    match task {
        Task::Info => info(drive, s).await,
        Task::Save => {
            commands::save(drive).await?;
            let mut report = Report::new();
            report.add("saved", "saved", true, "the parameters are kept without power");
            Ok(report)
        }
        Task::SetId { node } => set_address(drive, node).await,
        Task::Zero { is_confirmed } => clear_turns(drive, s, is_confirmed).await,
        Task::CommunicationTimeout { milliseconds } => {
            commands::set_communication_timeout(drive, milliseconds).await.map_err(of_command)?;
            drive.session().note(
                "`save` keeps it without power; an axis of a configuration sets its own before it is enabled",
            );
            let mut report = Report::new();
            let shown = if milliseconds == 0 { "none".to_owned() } else { format!("{milliseconds} ms") };
            report.add("communication_timeout_ms", "communication time-out", milliseconds, shown);
            Ok(report)
        }
        Task::ClearFault { .. } => {
            let before = commands::clear_fault(drive).await.map_err(of_command)?;
            let code = before.map_or(0, |code| code.0);
            let mut report = Report::new();
            report.add("cleared", "cleared", code, s.error_words(code));
            Ok(report)
        }
        task => Err(unsupported(&task).unwrap_or(Failure::Interrupted)),
    }
}

/// `info`
async fn info(drive: &ErobDrive, s: &TargetDrive) -> Result<Report, Failure> {
    let mut report = Report::new();
    let status = drive.status().await?;
    let reading = status.reading(drive.session().now_ns(), s);
    report.add("state", "state", reading.state, reading.state);
    let (position, counts, velocity) = (reading.position, reading.position_counts, reading.velocity);
    let shown = format!("{} ({counts} counts)", s.position_quantity().show(position));
    report.add("position", "position", position, shown);
    report.add("position_counts", "position counts", counts, counts.to_string());
    report.add("velocity", "velocity", velocity, s.velocity_quantity().show(velocity));
    for (register, value) in commands::read_all(drive).await? {
        if let Some(value) = value {
            report.add("", register.name, value, selection::words::<ErobDrive>(s, register, value));
        }
    }
    let code = status.fault;
    report.add("error_code", "error", code, s.error_words(code));
    if code != 0 {
        drive.session().note(s.error_cure(code));
    }
    Ok(report)
}

/// `set-id`
async fn set_address(drive: &ErobDrive, address: u8) -> Result<Report, Failure> {
    tasks::check_standstill(drive).await?;
    drive.session().step("set the slave address");
    drive.write(&registers::SLAVE_ADDRESS, address.into()).await?;
    commands::save(drive).await?;
    drive.session().note("switch the drive off and on: it has the new address then");
    let mut report = Report::new();
    report.add("node", "slave address", address, format!("{address}, after the next power-on"));
    Ok(report)
}

/// `zero`: resets the encoder on the load's side, which wipes the count of turns. The position within one turn remains.
async fn clear_turns(drive: &ErobDrive, s: &TargetDrive, is_confirmed: bool) -> Result<Report, Failure> {
    if !is_confirmed {
        return Err(Failure::NeedsConsent {
            consequence: "this WIPES THE COUNT OF TURNS (register 0x00F9): the position becomes the one within a turn, and \
                          the joint's zero must be set again; it is meant for multi-turn models after a battery alarm",
            option: "--yes",
        });
    }
    tasks::check_standstill(drive).await?;
    let before = drive.read(&registers::ACTUAL_POSITION).await?;
    commands::reset_encoder(drive).await?;
    let after = drive.read(&registers::ACTUAL_POSITION).await?;
    let mut report = Report::new();
    report.add("before_counts", "before", before, format!("{before} counts"));
    report.add("after_counts", "after", after, format!("{after} counts"));
    let position = s.position(after);
    report.add("position", "position", position, s.position_quantity().show(position));
    Ok(report)
}

/// Why a drive with this protocol cannot do a task; `None` where it can.
fn unsupported(task: &Task) -> Option<Failure> {
    let (what, instead) = match task {
        Task::Scan => (
            "a scan of a Modbus line would take half a minute, and disturb what else is on it",
            "`info --node N` asks one address",
        ),
        Task::Home { .. } => ("an eRob with Modbus-RTU has no homing", "its encoder is absolute"),
        Task::Restore { .. } => (
            "an eRob with Modbus-RTU has no command that restores its parameters",
            "restore them with the vendor's tool",
        ),
        Task::SetBitRate { .. } => (
            "its bit rates are those of a serial line",
            "`write \"bit rate\" \"115200 bit/s\"`, then `save`, then switch it off and on",
        ),
        Task::Mode(_) => {
            ("the mode is an entry of an eRob", "`write \"operating mode\" …`; each motion sets its own")
        }
        Task::Gains { .. } | Task::GainFactors(_) => (
            "the gains of an eRob suit most applications, and have no ranges in the manual",
            "`read` and `write` them: \"position loop gain\", \"velocity loop gain\", \"velocity loop integral\"",
        ),
        Task::Gear { .. } => ("an eRob has no electronic gear", "it counts turns of its output"),
        Task::ReleaseBrake { .. } => {
            ("no register of an eRob releases its brake", "`enable` releases it, with torque")
        }
        Task::AutoHome { .. } => ("an eRob does not move by itself at power-up", "move it with `move`"),
        Task::Interpolation => ("Modbus-RTU has no interpolation", "CANopen firmware has cyclic modes"),
        _ => return None,
    };
    Some(Failure::Unsupported { what: what.to_owned(), instead: instead.to_owned() })
}

impl From<AccessError> for Failure {
    fn from(error: AccessError) -> Self {
        let cure = match &error.failure {
            AccessFailure::Request(request) => match request.failure {
                RequestFailure::Refused(ExceptionCode::BUSY) => {
                    Some("try again: it is busy for some seconds after power-on")
                }
                RequestFailure::Refused(_) => Some("see the state of the drive with `info`"),
                _ => None,
            },
            _ => None,
        };
        Self::Request { what: error.to_string(), cure }
    }
}

fn of_command(failure: CommandFailure) -> Failure {
    match failure {
        CommandFailure::Access(error) => error.into(),
        CommandFailure::FaultStays(code) => {
            Failure::FaultPersists { what: Words::bilingual(code.bilingual()), advice: Some(code.cure()) }
        }
        CommandFailure::ReadBack { .. } => Failure::Request { what: failure.to_string(), cure: None },
    }
}
