//! A module with its own CAN protocol, as motions and tasks see it: the sequences of the eRunner manual (7.4 and chapter 4).

use takt_rt::Nanoseconds;
use takt_wire::erob_can::client::{RequestClient, RequestError, RequestFailure};
use takt_wire::erob_can::entries::{self, Entry};

use super::session::ErobCanSession;
use crate::family::commission::{AnsweredProtocol, Failure, TargetDrive};
use crate::family::erob::module::{CommandedModule, Status};
use crate::family::erob::motion::{Motion, OperatingMode, Stop};
use crate::procedure::ProcedureSession;

/// How long to wait for an answer of CANopen firmware.
const OTHER_PROTOCOL_NS: Nanoseconds = 50_000_000;

impl ErobCanSession {
    /// Writes a setting if it is another one: some are locked at times, and a write may wear out a memory.
    async fn set(&self, entry: &Entry, value: i64) -> Result<(), RequestError> {
        if CommandedModule::read(self, entry).await? != value {
            CommandedModule::write(self, entry, value).await?;
        }
        Ok(())
    }
}

impl CommandedModule for ErobCanSession {
    type Client = RequestClient;
    type Parameter = Entry;
    type Error = RequestError;

    const FAULT_CODE: Entry = entries::ERROR_CODE;
    const OPERATING_MODE: Entry = entries::OPERATING_MODE;
    const RELATIVE_POSITION: Entry = entries::RELATIVE_POSITION;
    const PROFILE_VELOCITY: Entry = entries::PROFILE_VELOCITY;
    const PROFILE_ACCELERATION: Entry = entries::PROFILE_ACCELERATION;
    const PROFILE_DECELERATION: Entry = entries::PROFILE_DECELERATION;
    const CONTINUOUS_CURRENT: Entry = entries::CONTINUOUS_CURRENT;
    const PEAK_CURRENT: Entry = entries::PEAK_CURRENT;

    const EMERGENCY: &'static str = "use the emergency stop: the protocol has no command for it";

    fn session(&self) -> &ProcedureSession<RequestClient> {
        self
    }

    async fn connect(&self, target: &TargetDrive) -> Result<(), Failure> {
        self.step("contact");
        let end_ns = self.now_ns().saturating_add(target.patience_ns);
        loop {
            match self.read(&entries::ACTUAL_POSITION).await {
                Ok(_) | Err(RequestError { failure: RequestFailure::Refused(_), .. }) => return Ok(()),
                Err(RequestError { failure: RequestFailure::NoReply, .. }) => {}
                Err(error) => return Err(error.into()),
            }
            if self.is_interrupted() {
                return Err(Failure::Interrupted);
            }
            if self.now_ns() >= end_ns {
                break;
            }
        }
        let mut other_protocol = None;
        if let Some(other) = target.family().other_protocol(&target.drive, target.node)
            && self.answers(other.request, other.answer, OTHER_PROTOCOL_NS).await
        {
            other_protocol = Some(AnsweredProtocol { name: other.name, cure: other.cure });
        }
        Err(Failure::Silent { node: target.node, reported: None, other_protocol })
    }

    async fn read(&self, entry: &Entry) -> Result<i64, RequestError> {
        Ok(ErobCanSession::read(self, entry).await?.into())
    }

    async fn write(&self, entry: &Entry, value: i64) -> Result<(), RequestError> {
        // Who writes has seen that the entry takes the value.
        ErobCanSession::write(self, entry, value as i32).await
    }

    async fn status(&self) -> Result<Status, RequestError> {
        // A number that is none of those that are explained stays one.
        let number = async |entry| Ok(u16::try_from(self.read(entry).await?).unwrap_or(u16::MAX));
        Ok(Status {
            position: self.read(&entries::ACTUAL_POSITION).await?,
            velocity: self.read(&entries::ACTUAL_VELOCITY).await?,
            current_ma: self.read(&entries::MOTOR_CURRENT).await?,
            fault: self.read(&entries::ERROR_CODE).await? as u16,
            motion: number(&entries::RUNNING_STATE).await?.into(),
            reached: number(&entries::TARGET_REACHED_STATE).await?.into(),
            temperature_c: self.read(&entries::TEMPERATURE).await?,
        })
    }

    async fn prepare(&self, motion: Motion) -> Result<(), RequestError> {
        let write = async |entry, value| CommandedModule::write(self, entry, value).await;
        self.set(&entries::OPERATING_MODE, motion.mode() as i64).await?;
        if motion.mode() != OperatingMode::Position {
            write(&entries::CONTROL_SOURCE, 0).await?;
            write(&entries::ANALOGUE_TYPE, 0).await?;
        }
        if let Some(motion_mode) = motion.motion_mode() {
            write(&entries::MOTION_MODE, motion_mode).await?;
        }
        if let Some(profile) = motion.profile() {
            write(&entries::PROFILE_ACCELERATION, profile.acceleration.into()).await?;
            write(&entries::PROFILE_DECELERATION, profile.deceleration.into()).await?;
        }
        if let Some(velocity) = motion.profile_velocity() {
            write(&entries::PROFILE_VELOCITY, velocity).await?;
        }
        match motion {
            Motion::Velocity(..) => write(&entries::SET_POINT, 0).await,
            Motion::Torque { velocity_limit, .. } => {
                write(&entries::SET_POINT, 0).await?;
                // It is locked while the motor is enabled.
                self.set(&entries::TORQUE_VELOCITY_LIMIT, velocity_limit.get().into()).await
            }
            Motion::ReciprocatingTo { dwell_ns, .. } => {
                let dwell_ms = i32::try_from(dwell_ns / 1_000_000).unwrap_or(i32::MAX);
                write(&entries::DWELL_TIME, dwell_ms.into()).await
            }
            _ => Ok(()),
        }
    }

    async fn set_enabled(&self, is_enabled: bool) -> Result<(), RequestError> {
        self.write(&entries::MOTOR_ENABLE, is_enabled.into()).await
    }

    fn is_starting(error: &RequestError) -> bool {
        matches!(error.failure, RequestFailure::Refused(Some(code)) if code.is_of_power_up())
    }

    async fn remark(&self) -> Result<Option<&'static str>, RequestError> {
        Ok(Some(
            "this protocol has no watchdog: if this program ends unexpectedly, the drive goes on with what it does",
        ))
    }

    async fn start(&self, motion: Motion) -> Result<(), RequestError> {
        match motion {
            Motion::Hold => return Ok(()),
            Motion::Velocity(set_point, _) | Motion::Torque { current: set_point, .. } => {
                return self.write(&entries::SET_POINT, set_point).await;
            }
            Motion::Continuous(..) => {}
            Motion::By(distance, _) => self.write(&entries::RELATIVE_POSITION, distance).await?,
            Motion::To(to, _) | Motion::BackAndForth { to, .. } | Motion::ReciprocatingTo { to, .. } => {
                // 0 makes the move an absolute one.
                self.write(&entries::RELATIVE_POSITION, 0).await?;
                self.write(&entries::TARGET_POSITION, to).await?;
            }
        }
        self.command(&entries::START_MOTION).await
    }

    async fn stop(&self, stop: Stop) -> Result<(), RequestError> {
        match stop {
            Stop::Move | Stop::Reciprocation => self.command(&entries::STOP_MOTION).await,
            Stop::Velocity | Stop::Torque => self.write(&entries::SET_POINT, 0).await,
        }
    }
}
