//! A module on a Modbus line, as motions and tasks see it: the sequences of the eRob Modbus-RTU manual (chapter 5).

use takt_rt::Nanoseconds;
use takt_wire::modbus::exception::ExceptionCode;

use super::drive::{AccessError, ErobDrive};
use super::register::Register;
use super::registers;
use crate::family::commission::{Failure, TargetDrive};
use crate::family::erob::module::{CommandedModule, Status};
use crate::family::erob::motion::{Motion, Stop};
use crate::procedure::{ModbusClient, ModbusSession};

/// 1 ms in the unit of the dwell time is 20.
const DWELL_UNIT_NS: Nanoseconds = 50_000;

impl CommandedModule for ErobDrive {
    type Client = ModbusClient;
    type Parameter = Register;
    type Error = AccessError;

    const FAULT_CODE: Register = registers::FAULT_CODE;
    const OPERATING_MODE: Register = registers::OPERATION_MODE;
    const RELATIVE_POSITION: Register = registers::RELATIVE_POSITION;
    const PROFILE_VELOCITY: Register = registers::PROFILE_VELOCITY;
    const PROFILE_ACCELERATION: Register = registers::PROFILE_ACCELERATION;
    const PROFILE_DECELERATION: Register = registers::PROFILE_DECELERATION;
    const CONTINUOUS_CURRENT: Register = registers::CONTINUOUS_CURRENT;
    const PEAK_CURRENT: Register = registers::PEAK_CURRENT;

    const EMERGENCY: &'static str = "`takt drive … emergency-stop` stops it in less than 50 ms";

    fn session(&self) -> &ModbusSession {
        ErobDrive::session(self)
    }

    async fn connect(&self, _: &TargetDrive) -> Result<(), Failure> {
        self.session().step("contact");
        self.read(&registers::FAULT_CODE).await?;
        Ok(())
    }

    async fn read(&self, register: &Register) -> Result<i64, AccessError> {
        ErobDrive::read(self, register).await
    }

    async fn write(&self, register: &Register, value: i64) -> Result<(), AccessError> {
        ErobDrive::write(self, register, value).await
    }

    async fn status(&self) -> Result<Status, AccessError> {
        ErobDrive::status(self).await
    }

    async fn prepare(&self, motion: Motion) -> Result<(), AccessError> {
        self.write(&registers::OPERATION_MODE, motion.mode() as i64).await?;
        self.write(&registers::CONTROL_SOURCE, 0).await?;
        if let Some(motion_mode) = motion.motion_mode() {
            self.write(&registers::MOTION_MODE, motion_mode).await?;
        }
        if let Some(profile) = motion.profile() {
            self.write(&registers::PROFILE_ACCELERATION, profile.acceleration.into()).await?;
            self.write(&registers::PROFILE_DECELERATION, profile.deceleration.into()).await?;
        }
        if let Some(velocity) = motion.profile_velocity() {
            self.write(&registers::PROFILE_VELOCITY, velocity).await?;
        }
        match motion {
            // A relative target that is not 0 makes the move a relative one.
            Motion::To(..) | Motion::BackAndForth { .. } => {
                self.write(&registers::RELATIVE_POSITION, 0).await
            }
            Motion::ReciprocatingTo { dwell_ns, .. } => {
                self.write(&registers::RELATIVE_POSITION, 0).await?;
                let dwell = u32::try_from(dwell_ns / DWELL_UNIT_NS).unwrap_or(u32::MAX);
                self.write(&registers::DWELL_TIME, dwell.into()).await
            }
            Motion::Velocity(..) => self.write(&registers::TARGET_VELOCITY, 0).await,
            Motion::Torque { velocity_limit, .. } => {
                self.write(&registers::TORQUE_VELOCITY_LIMIT, velocity_limit.get().into()).await?;
                self.write(&registers::TARGET_CURRENT, 0).await
            }
            _ => Ok(()),
        }
    }

    async fn set_enabled(&self, is_enabled: bool) -> Result<(), AccessError> {
        self.write(&registers::MOTOR_ENABLE, is_enabled.into()).await
    }

    fn is_starting(error: &AccessError) -> bool {
        error.is_refusal(ExceptionCode::BUSY)
    }

    async fn remark(&self) -> Result<Option<&'static str>, AccessError> {
        let is_watched = match self.read(&registers::COMMUNICATION_TIMEOUT).await {
            Ok(milliseconds) => milliseconds > 0,
            Err(error) if error.is_refusal(ExceptionCode::ILLEGAL_ADDRESS) => false,
            Err(error) => return Err(error),
        };
        Ok((!is_watched).then_some(
            "the communication time-out is off: if this program ends unexpectedly, the drive goes on with what it does; \
             `communication-timeout` sets it",
        ))
    }

    async fn start(&self, motion: Motion) -> Result<(), AccessError> {
        let target = match motion {
            Motion::Hold => return Ok(()),
            Motion::Velocity(velocity, _) => {
                return self.write(&registers::TARGET_VELOCITY, velocity.into()).await;
            }
            Motion::Torque { current, .. } => {
                return self.write(&registers::TARGET_CURRENT, current.into()).await;
            }
            Motion::Continuous(..) => None,
            Motion::By(distance, _) => Some((registers::RELATIVE_POSITION, distance)),
            Motion::To(to, _) | Motion::BackAndForth { to, .. } | Motion::ReciprocatingTo { to, .. } => {
                Some((registers::TARGET_POSITION, to))
            }
        };
        if let Some((register, counts)) = target {
            self.write(&register, counts.into()).await?;
        }
        self.write(&registers::START_MOTION, 1).await
    }

    async fn stop(&self, stop: Stop) -> Result<(), AccessError> {
        let register = match stop {
            Stop::Move => registers::STOP_MOTION,
            Stop::Reciprocation => registers::STOP_RECIPROCATION,
            Stop::Velocity => registers::TARGET_VELOCITY,
            Stop::Torque => registers::TARGET_CURRENT,
        };
        self.write(&register, 0).await
    }
}
