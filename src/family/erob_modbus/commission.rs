//! Commissioning of a drive by Modbus-RTU: the tasks of `takt drive`.

use std::num::NonZeroU32;

use takt_rt::Nanoseconds;

use super::commands::{self, CommandFailure};
use super::drive::{AccessError, AccessFailure, ErobDrive, MotionStatus, ReachedStatus, Status};
use super::motion::{self, Direction, End, Motion, MotionFailure, Profile, Run};
use super::registers::{self, Register};
use super::selection;
use crate::family::commission::polling;
use crate::family::commission::{
    CommandValue, DriveTask, Failure, MotionProfile, MoveKind, Report, TargetDrive, Task,
};
use crate::modbus::exception::ExceptionCode;
use crate::modbus::frame::{ReceivedRequest, SlaveAddress};
use crate::modbus::line_timing::LineTiming;
use crate::modbus::master::{MasterTiming, RequestFailure};
use crate::procedure::{AxisReading, ModbusClient, ModbusSession, Procedure};

/// A joint slower than this stands: counts/s.
const STANDING: i32 = 300;
/// 1 ms in the unit of the dwell time.
const DWELL_UNIT_NS: Nanoseconds = 50_000;

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
    if !matches!(work, Work::Task(Task::EmergencyStop)) {
        connect(drive).await?;
    }
    let task = match work {
        Work::Read(registers) => return selection::read(drive, s, &registers).await,
        Work::Write(register, value) => return selection::write(drive, s, &register, value).await,
        Work::Task(task) => task,
    };
    match task {
        Task::Info => info(drive, s).await,
        Task::Watch { every_ns, duration_ns } => watch(drive, s, every_ns, duration_ns).await,
        Task::Enable { hold_ns, keeps_enabled } => {
            let duration_ns = if keeps_enabled { Some(0) } else { hold_ns };
            run(drive, s, Run { motion: Motion::Hold, duration_ns, keeps_enabled }).await?;
            summary(drive, s).await
        }
        Task::Disable => {
            drive.session().step("disable");
            drive.write(&registers::STOP_MOTION, 0).await?;
            drive.write(&registers::MOTOR_ENABLE, 0).await?;
            summary(drive, s).await
        }
        Task::Move { kind, profile, keeps_enabled } => run_move(drive, s, kind, profile, keeps_enabled).await,
        Task::Velocity { velocity, profile, duration_ns, keeps_enabled } => {
            let raw = s.velocity_raw(velocity);
            s.check_velocity(raw)?;
            let profile = MotionProfile { velocity: Some(CommandValue::Drive(raw.abs().max(1))), ..profile };
            let motion = Motion::Velocity(whole(raw)?, complete(drive, s, &profile).await?);
            run(drive, s, Run { motion, duration_ns, keeps_enabled }).await?;
            summary(drive, s).await
        }
        Task::Torque { torque, velocity_limit, duration_ns } => {
            let motion = torque_of(s, torque, velocity_limit)?;
            run(drive, s, Run { motion, duration_ns, keeps_enabled: false }).await?;
            summary(drive, s).await
        }
        Task::Save => {
            commands::save(drive).await?;
            let mut report = Report::new();
            report.add("saved", "saved", true, "the parameters are kept without power");
            Ok(report)
        }
        Task::SetId { node } => set_address(drive, node).await,
        Task::Zero { is_confirmed } => clear_turns(drive, s, is_confirmed).await,
        Task::EmergencyStop => {
            commands::stop_in_an_emergency(drive).await?;
            summary(drive, s).await
        }
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

/// Sees that the drive answers. It reads the fault code, which changes nothing.
async fn connect(drive: &ErobDrive) -> Result<(), Failure> {
    drive.session().step("contact");
    drive.fault().await?;
    Ok(())
}

/// `info`
async fn info(drive: &ErobDrive, s: &TargetDrive) -> Result<Report, Failure> {
    let mut report = Report::new();
    let status = drive.status().await?;
    let state = state_of(&status);
    report.add("state", "state", state, state);
    let (position, velocity) = (s.position(status.position.into()), s.velocity(status.velocity.into()));
    let shown = format!("{} ({} counts)", s.position_quantity().show(position), status.position);
    report.add("position", "position", position, shown);
    report.add("position_counts", "position counts", status.position, status.position.to_string());
    report.add("velocity", "velocity", velocity, s.velocity_quantity().show(velocity));
    for (register, value) in commands::read_all(drive).await? {
        if let Some(value) = value {
            report.add("", register.name, value, selection::words(s, register, value));
        }
    }
    let code = status.fault.map_or(0, |code| code.0);
    report.add("error_code", "error", code, s.error_words(code));
    if code != 0 {
        drive.session().note(s.error_cure(code));
    }
    Ok(report)
}

/// `watch`
async fn watch(
    drive: &ErobDrive,
    s: &TargetDrive,
    every_ns: Nanoseconds,
    duration_ns: Option<Nanoseconds>,
) -> Result<Report, Failure> {
    let session = drive.session();
    let read = async || Ok(reading(session.now_ns(), s, &drive.status().await?));
    polling::watch(session, every_ns, duration_ns, read).await
}

/// `move`
async fn run_move(
    drive: &ErobDrive,
    s: &TargetDrive,
    kind: MoveKind,
    profile: MotionProfile,
    keeps_enabled: bool,
) -> Result<Report, Failure> {
    let profile = complete(drive, s, &profile).await?;
    let from = drive.read(&registers::ACTUAL_POSITION).await?;
    let mut duration_ns = None;
    let (motion, target) = match kind {
        MoveKind::Absolute { to, .. } => {
            let to = position(s, s.position_counts(to))?;
            (Motion::To(to, profile), Some(i64::from(to)))
        }
        MoveKind::Relative(by) => {
            let to = position(s, from.saturating_add(s.distance_counts(by)))?;
            (Motion::By(whole(i64::from(to) - from)?, profile), Some(to.into()))
        }
        MoveKind::Reciprocate { times: Some(times), .. } if times > 1 => {
            return Err(Failure::Unsupported {
                what: "the drive does not count how often it has gone to and fro".to_owned(),
                instead: "use `--endless` and Ctrl-C, or `move absolute` in a loop".to_owned(),
            });
        }
        MoveKind::Reciprocate { to, dwell_ns, .. } => {
            let target = position(s, s.position_counts(to))?;
            let dwell = u32::try_from(dwell_ns / DWELL_UNIT_NS).unwrap_or(u32::MAX);
            (Motion::Reciprocating { target, dwell, profile }, None)
        }
        MoveKind::Continuous { is_forward, duration_ns: lasts_ns } => {
            duration_ns = lasts_ns;
            let goes_up = is_forward == (s.scale.resolution() > 0.0);
            let direction = if goes_up { Direction::Forward } else { Direction::Backward };
            (Motion::Continuous(direction, profile), None)
        }
    };
    let at = run(drive, s, Run { motion, duration_ns, keeps_enabled }).await?;
    let mut report = match target {
        Some(target) => polling::move_report(s, from, target, 1, i64::from(at) - target),
        None => Report::new(),
    };
    report.append(summary(drive, s).await?);
    Ok(report)
}

/// Carries out a motion. Returns where the joint is: counts.
async fn run(drive: &ErobDrive, s: &TargetDrive, run: Run) -> Result<i32, Failure> {
    match motion::carry_out(drive, run).await {
        Ok(ended) if ended.end == End::Interrupted => {
            let at = s.position_quantity().show(s.position(ended.position.into()));
            drive.session().note(format!("the axis is at {at}"));
            Err(Failure::Interrupted)
        }
        Ok(ended) => Ok(ended.position),
        Err(failure) => Err(of_motion(s, failure)),
    }
}

/// `torque`: a current, because the drive takes no other measure.
fn torque_of(
    s: &TargetDrive,
    torque: CommandValue,
    velocity_limit: Option<CommandValue>,
) -> Result<Motion, Failure> {
    let CommandValue::Drive(current) = torque else {
        return Err(Failure::Unsuitable(
            "the drive takes a current, and does not tell its torque: with `--raw` the value is a current in mA".to_owned(),
        ));
    };
    let limit = velocity_limit
        .map(|limit| s.velocity_raw(limit))
        .and_then(|limit| NonZeroU32::new(u32::try_from(limit.unsigned_abs()).unwrap_or(u32::MAX)));
    let velocity_limit = limit.ok_or(Failure::Missing {
        what: "--max-velocity",
        why: "without a limit the joint turns as fast as the current makes it",
    })?;
    Ok(Motion::Torque { current: whole(current)?, velocity_limit })
}

/// `set-id`
async fn set_address(drive: &ErobDrive, address: u8) -> Result<Report, Failure> {
    check_standstill(drive).await?;
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
    check_standstill(drive).await?;
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

/// Such settings are made at standstill without torque.
async fn check_standstill(drive: &ErobDrive) -> Result<(), Failure> {
    let status = drive.status().await?;
    let is_off = status.reached == ReachedStatus::MotorOff && status.velocity.saturating_abs() <= STANDING;
    if is_off { Ok(()) } else { Err(Failure::Enabled) }
}

async fn summary(drive: &ErobDrive, s: &TargetDrive) -> Result<Report, Failure> {
    let status = drive.status().await?;
    Ok(polling::summary(s, &reading(drive.session().now_ns(), s, &status)))
}

fn reading(at_ns: Nanoseconds, s: &TargetDrive, status: &Status) -> AxisReading {
    AxisReading {
        at_ns,
        position: s.position(status.position.into()),
        position_counts: status.position.into(),
        velocity: s.velocity(status.velocity.into()),
        torque: None,
        current_a: Some(f64::from(status.current_ma) / 1000.0),
        temperature_c: Some(status.temperature_c.into()),
        statusword: None,
        state: state_of(status),
    }
}

fn state_of(status: &Status) -> &'static str {
    match (status.fault, status.reached, status.motion) {
        (Some(_), ..) => "fault",
        (None, ReachedStatus::MotorOff, _) => "motor off",
        (None, ReachedStatus::Reached, _) => "target reached",
        (None, ReachedStatus::Settling, _) => "settling",
        (None, _, MotionStatus::Moving) => "moving",
        (None, ..) => "motor on",
    }
}

/// The profile in the units of the drive. What neither the user nor the limits say is that of the drive.
async fn complete(drive: &ErobDrive, s: &TargetDrive, profile: &MotionProfile) -> Result<Profile, Failure> {
    let given = s.drive_profile(profile)?;
    drive.session().step("profile");
    let of_drive = async |given: Option<i64>, register: &Register| match given {
        Some(value) => Ok::<_, Failure>(value),
        None => Ok(drive.read(register).await?.abs()),
    };
    let velocity = of_drive(given.velocity, &registers::PROFILE_VELOCITY).await?;
    let acceleration = of_drive(given.acceleration, &registers::PROFILE_ACCELERATION).await?;
    let deceleration = of_drive(given.deceleration, &registers::PROFILE_DECELERATION).await?;
    if velocity == 0 {
        return Err(Failure::Missing {
            what: "--velocity",
            why: "the drive's profile velocity (0x0047) is 0",
        });
    }
    if acceleration == 0 || deceleration == 0 {
        return Err(Failure::Missing {
            what: "--acceleration and --deceleration",
            why: "those of the drive (0x0049 and 0x004B) are 0",
        });
    }
    let rate = |value: i64| u32::try_from(value).unwrap_or(u32::MAX);
    Ok(Profile {
        velocity: whole(velocity)?,
        acceleration: rate(acceleration),
        deceleration: rate(deceleration),
    })
}

/// A position within the limits of the axis.
fn position(s: &TargetDrive, counts: i64) -> Result<i32, Failure> {
    s.check_position(counts)?;
    whole(counts)
}

fn whole(value: i64) -> Result<i32, Failure> {
    i32::try_from(value).map_err(|_| Failure::Unsuitable(format!("{value} does not fit the drive's 32 bits")))
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
            Failure::FaultPersists { what: code.words().to_owned(), advice: Some(code.cure()) }
        }
        CommandFailure::ReadBack { .. } => Failure::Request { what: failure.to_string(), cure: None },
    }
}

fn of_motion(s: &TargetDrive, failure: MotionFailure) -> Failure {
    let what = failure.to_string();
    match failure {
        MotionFailure::Access(error) => error.into(),
        MotionFailure::Drive(code) => {
            Failure::Faulted { what: s.error_words(code.0), advice: Some(code.cure()) }
        }
        MotionFailure::NotEnabled => Failure::Request { what, cure: None },
        MotionFailure::TooLong { .. } => Failure::Request {
            what,
            cure: Some("check whether something blocks the joint, and the profile in the drive"),
        },
        MotionFailure::NotStopped { .. } => Failure::Request {
            what,
            cure: Some("`takt drive … emergency-stop` stops it in less than 50 ms"),
        },
    }
}
